"""Train the networks that ship, on random people in random poses of the open body model.

    python -m riemhuman.learned.build_weights [folder] [--only shape-pose]

writes their weights, by default over those that ship. It needs PyTorch. Training runs on one
thread, so the same versions of the packages write the same files. An interrupted training continues
from its last checkpoint beside the file. `python -m riemhuman.learned.evaluate` prints how accurate
the networks are.
"""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import Any

from riemhuman.bodies import BodyModel
from riemhuman.datasets import load_open_model
from riemhuman.errors import FileError
from riemhuman.geometry import AlignedSurfaces, ElasticMetric
from riemhuman.learned.codes import FOLDER, Codes
from riemhuman.learned.intrinsic_extrinsic_codes import IntrinsicExtrinsicCodes
from riemhuman.learned.metric_codes import MetricCodes
from riemhuman.learned.shape_pose_codes import ShapePoseCodes
from riemhuman.learned.training_bodies import random_bodies

WEIGHTS = {"shape": (1.0, 1e-4, 0.0), "pose": (0.0, 0.0, 1.0)}
"""Weights (a, λ, c) of the metrics that `MetricCodes` ships for."""
N_CODES = {"shape": 64, "pose": 32}
"""Lengths of their codes. The shape metric needs more: all people are far from each other."""


def _shape_pose(model: BodyModel, **options: Any) -> Codes:
    bodies = random_bodies(model, 2000, 4, rng=0)
    return ShapePoseCodes(model.template).fit(bodies.points, bodies.subject, **options)


def _intrinsic_extrinsic(model: BodyModel, **options: Any) -> Codes:
    bodies = random_bodies(model, 1000, 3, rng=1)
    return IntrinsicExtrinsicCodes(model.template).fit(bodies.points, **options)


def _metric(model: BodyModel, which: str, **options: Any) -> Codes:
    a, lam, c = WEIGHTS[which]
    # A block of distances has sixteen people in three poses.
    bodies = random_bodies(model, 1600, 3, rng=2)
    metric = ElasticMetric(AlignedSurfaces(model.template, equip=False), a=a, lam=lam, c=c)
    return MetricCodes(metric, N_CODES[which]).fit(bodies.points, **options)


RECIPES: dict[str, tuple[str, Callable[..., Codes]]] = {
    "shape-pose": ("shape_pose_codes", _shape_pose),
    "intrinsic-extrinsic": ("intrinsic_extrinsic_codes", _intrinsic_extrinsic),
    "metric-shape": ("metric_codes_shape", partial(_metric, which="shape")),
    "metric-pose": ("metric_codes_pose", partial(_metric, which="pose")),
}
"""The networks that ship: the name of the file, and the function that trains them."""


def main(arguments: Sequence[str] | None = None) -> None:
    """Train the networks and write their files.

    Parameters
    ----------
    arguments : sequence of str, optional
        Command line; by default that of the process.

    Raises
    ------
    MissingDependencyError
        If PyTorch is not installed.
    FileError
        If the folder does not exist or cannot be written to.
    """
    parser = argparse.ArgumentParser(description="Train the networks that ship.")
    parser.add_argument("folder", nargs="?", type=Path, default=FOLDER)
    parser.add_argument("--only", choices=tuple(RECIPES), action="append")
    options = parser.parse_args(arguments)
    if not options.folder.is_dir():
        raise FileError(f"{options.folder} is not a folder; it must exist to receive the weights")
    for name in options.only or RECIPES:
        title, train = RECIPES[name]
        file = options.folder / f"{title}.npz"
        checkpoint = options.folder / f"{title}.checkpoint.npz"
        clock, work = time.perf_counter(), time.process_time()
        train(load_open_model("coarse"), checkpoint=checkpoint, progress=True).save(file)
        checkpoint.unlink(missing_ok=True)
        sys.stdout.write(
            f"{file}: {file.stat().st_size / 1e6:.2f} MB, {time.process_time() - work:.0f} s of "
            f"one core, {time.perf_counter() - clock:.0f} s on the clock\n"
        )
        sys.stdout.flush()


if __name__ == "__main__":
    main()
