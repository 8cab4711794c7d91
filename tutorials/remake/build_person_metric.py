"""Learn how poses change the areas of simulated people; rebuild person_metric.npz.

    python tutorials/remake/build_person_metric.py [file]

The people are the natural bodies of three seeds, whom no table of this documentation includes. The
variance that counts as little as any, relative to the largest, and the number of directions were
chosen on people whom the model cannot make, with unmodelled changes of shape in every pose.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from riemhuman.datasets import load_open_bodies, load_open_model
from riemhuman.geometry import AlignedSurfaces, AreaMetric
from riemhuman.io.arrays import save_arrays
from riemhuman.statistics.person_metric import WEIGHTS
from riemhuman.surfaces import nearest_points

_SEEDS = (50, 51, 52)
_DIRECTIONS, _FLOOR = 20, 0.003


def main(arguments: Sequence[str] | None = None) -> None:
    """Learn and write."""
    parser = argparse.ArgumentParser(description="Learn the metric of people from simulated ones.")
    parser.add_argument("file", nargs="?", type=Path, default=WEIGHTS)
    options = parser.parse_args(arguments)
    residuals = []
    for seed in _SEEDS:
        bodies = load_open_bodies("coarse", "natural", seed)
        metric = AreaMetric(AlignedSurfaces(bodies.template, equip=False))
        coordinates = metric.lower_bound_coordinates(bodies.points)
        people = coordinates.reshape(10, 10, -1)
        residuals.append((people - people.mean(axis=1, keepdims=True)).reshape(100, -1))
    within = np.concatenate(residuals)
    _, scales, directions = np.linalg.svd(within, full_matrices=False)
    variances = scales[:_DIRECTIONS] ** 2 / len(within)
    floor = _FLOOR * variances[0]
    masses = bodies.template.vertex_heat.masses
    fields = directions[:_DIRECTIONS] / np.sqrt(masses)
    weights = np.sqrt(floor / (variances + floor))
    full, coarse = (load_open_model(name).template for name in ("full", "coarse"))
    places, _ = nearest_points(full.vertices, coarse.vertices, coarse.faces)
    arrays = {"fields": fields.T.astype(np.float32), "weights": weights, **places._asdict()}
    save_arrays(options.file, arrays, compressed=True)
    sys.stdout.write(f"{options.file}: {_DIRECTIONS} directions, weights {weights.round(3)}\n")


if __name__ == "__main__":
    main()
