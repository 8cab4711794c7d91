"""Measure how much the measurements of one person vary over poses; rebuild noise_of_poses.json.

    python tutorials/remake/build_noise_of_poses.py [folder] [--resolution full] [--people 5]

prints the standard deviation of every measurement over ten poses, in millimetres: the median and
the worst of the people in the standard pose, and the median as the bodies stand. The plain people
are the ten that ship; the natural ones are others, who played no part in tuning; the registered
ones are some of these again, from scans of 12,000 points with 2 mm of noise and 10 per cent in
holes. It writes the noise of the registered people in the standard pose: of pairs of poses, 4.55
per cent differ by more than 2√2 times the noise, as of normal numbers with this standard deviation.
People differ in how much they vary, so that the median of their deviations would be exceeded by
twice as many. With --people 0 there are none, and it writes nothing.

Real people vary more, in proportion to the distance of their poses: variation_of_people.json holds
slopes of FAUST's people, measured with an earlier standard pose. No command remakes it, because the
bodies may not be stored here.

Last, it prints how many of the measurements of two poses are beyond their thresholds, by chance
3.9 of 85, for all pairs of poses of plain people, and of natural ones that were not registered.

A second table compares girths of the natural people in the standard pose, found from their surfaces
alone, with those of the same surfaces brought there by the rotations that they were made with: what
varies in these, in per cent, is the flesh, which bulges where joints bend; the rest is the
measurement's.
"""

from __future__ import annotations

import argparse
import json
import math
import sys
from collections.abc import Sequence
from dataclasses import replace
from itertools import combinations
from pathlib import Path

import numpy as np
from numpy import ndarray

from riemhuman.bodies import joint_motions, rotation_matrix, skin_surface
from riemhuman.datasets import Bodies, load_open_bodies, load_open_model
from riemhuman.errors import FileError
from riemhuman.measurements import (
    Breadth,
    Girth,
    Height,
    Measurement,
    Measurements,
    in_standard_pose,
)
from riemhuman.measurements.measurement_set import DATA
from riemhuman.registration import ScanRegistration, simulated_scan

_HELD_OUT = 1
_SEED = 33
_SCAN = {"n_points": 12_000, "mesh": True, "noise": 0.002, "missing": 0.1}
_DIGITS = 6
# Changes beyond this many deviations of the noise are significant, and their share by chance.
_LIMIT, _CHANCE = 2.0 * math.sqrt(2.0), math.erfc(math.sqrt(2.0))
# Mean differences in millimetres that ISO 20685-1 permits between scan-derived and manual values.
_LARGE_GIRTH, _SMALL, _BREADTH = 9, 4, 5
_LARGE = ("chest", "bust", "waist", "hip")


def main(arguments: Sequence[str] | None = None) -> None:
    """Measure, print and write."""
    parser = argparse.ArgumentParser(description="Measure people in ten poses.")
    parser.add_argument("folder", nargs="?", type=Path, default=DATA)
    parser.add_argument("--resolution", choices=("coarse", "full"), default="coarse")
    parser.add_argument("--people", type=int, default=5, help="people whose scans are registered")
    options = parser.parse_args(arguments)
    if not options.folder.is_dir():
        raise FileError(f"{options.folder} is not a folder; it must exist to receive the noise")
    measurements = Measurements(load_open_model(options.resolution))
    spreads, values = {}, {}
    natural = load_open_bodies(options.resolution, "natural", _HELD_OUT)
    variants = {"plain": load_open_bodies(options.resolution), "natural": natural}
    if options.people:
        variants["registered"] = _registered(natural, options.people)
    for variant, bodies in variants.items():
        straight = in_standard_pose(measurements.definitions, bodies.points)
        standard = measurements.measure(straight, axes="space", missing="nan")
        as_is = measurements.measure(bodies.points, missing="nan")
        spreads[variant] = _spread(standard.values, bodies), _spread(as_is.values, bodies)
        values[variant] = standard.values
    _print(measurements, spreads)
    _print_girths(measurements, natural, values["natural"])
    if not options.people:
        return
    noise = _noise(_differences(values["registered"], bodies)).round(_DIGITS)
    record = {"measurements": dict(zip(measurements.names, noise.tolist(), strict=True))}
    others = ~np.isin(natural.subject, bodies.subject)
    for name, values_of_group, group in (
        ("plain", values["plain"], variants["plain"]),
        ("other natural", values["natural"][others], natural[others]),
    ):
        if len(values_of_group):
            marked = (_differences(values_of_group, group) > _LIMIT * noise).sum(axis=1)
            sys.stdout.write(f"{name} people, marked of {len(noise)}: {marked.mean():.1f} (mean)\n")
    path = options.folder / "noise_of_poses.json"
    path.write_text(json.dumps(record, indent=1) + "\n", encoding="utf-8")
    sys.stdout.write(f"{path}\n")


def _registered(bodies: Bodies, n_people: int) -> Bodies:
    """Return the bodies that scans of some of the people give, if they are trusted."""
    subjects = np.unique(bodies.subject)[:n_people]
    chosen = np.flatnonzero(np.isin(bodies.subject, subjects))
    registration = ScanRegistration(bodies.model)
    points, trusted = np.empty((len(chosen), *bodies.points.shape[1:])), np.ones(len(chosen), bool)
    for k, number in enumerate(chosen):
        rng = np.random.default_rng([_SEED, k])
        scan = simulated_scan(bodies.points[number], bodies.template.faces, rng, **_SCAN)
        result = registration.solve(scan)
        points[k], trusted[k] = result.points, result.trusted
    sys.stdout.write(f"{trusted.sum()} of {len(trusted)} registered bodies are trusted\n")
    return replace(bodies[chosen[trusted]], points=points[trusted])


def _spread(values: ndarray, bodies: Bodies) -> ndarray:
    """Return standard deviations over poses, shape (n_people, M)."""
    people = np.unique(bodies.subject)
    return np.array([np.nanstd(values[bodies.subject == k], axis=0, ddof=1) for k in people])


def _differences(values: ndarray, bodies: Bodies) -> ndarray:
    """Return absolute differences of all pairs of poses of each person, shape (n_pairs, M)."""
    poses = [values[bodies.subject == k] for k in np.unique(bodies.subject)]
    return np.array(
        [np.abs(a - b) for values_of_person in poses for a, b in combinations(values_of_person, 2)]
    )


def _noise(differences: ndarray) -> ndarray:
    return np.nanquantile(differences, 1.0 - _CHANCE, axis=0) / _LIMIT


def _print(measurements: Measurements, spreads: dict[str, tuple[ndarray, ndarray]]) -> None:
    head = "".join(f"{variant + ': median':>18}{'worst':>7}{'as is':>8}" for variant in spreads)
    sys.stdout.write(f"{'':32}{head}{'permitted':>12}\n")
    for k, measurement in enumerate(measurements.definitions.measurements):
        unit = 1000.0 if measurement.units == "m" else 1.0
        row = "".join(
            f"{unit * np.median(standard[:, k]):18.4g}{unit * standard[:, k].max():7.3g}"
            f"{unit * np.median(as_is[:, k]):8.3g}"
            for standard, as_is in spreads.values()
        )
        name = measurement.name + ("" if measurement.units == "m" else f" ({measurement.units})")
        sys.stdout.write(f"{name:32}{row}{_permitted(measurement):>12}\n")


def _print_girths(measurements: Measurements, bodies: Bodies, registered: ndarray) -> None:
    made = measurements.measure(
        _in_standard_pose_as_made(measurements, bodies), axes="space", missing="nan"
    ).values
    means = np.abs(_means(made, bodies))
    columns = [_spread(values, bodies) / means for values in (made, registered, registered - made)]
    head = f"{'flesh':>8}{'found':>8}{'difference':>12}"
    sys.stdout.write(f"\n{'per cent, natural people':32}{head}\n")
    for k, measurement in enumerate(measurements.definitions.measurements):
        if isinstance(measurement, Girth):
            flesh, all_in_all, rest = (100.0 * np.median(column[:, k]) for column in columns)
            sys.stdout.write(f"{measurement.name:32}{flesh:8.2f}{all_in_all:8.2f}{rest:12.2f}\n")


def _means(values: ndarray, bodies: Bodies) -> ndarray:
    people = np.unique(bodies.subject)
    return np.array([np.nanmean(values[bodies.subject == k], axis=0) for k in people])


def _in_standard_pose_as_made(measurements: Measurements, bodies: Bodies) -> ndarray:
    """Return bodies in the standard pose, by the rotations that they were made with."""
    model, pose = bodies.model, measurements.definitions.standard_pose_vector
    straight = np.empty_like(bodies.points)
    for number, point in enumerate(bodies.points - bodies.translations[:, np.newaxis]):
        joints = model.joints(bodies.betas[number])
        rotations, places = joint_motions(
            joints, rotation_matrix(bodies.pose_vectors[number]), model.parents
        )
        shifts = model.weights @ (places - np.einsum("jab,jb->ja", rotations, joints))
        linear = np.einsum("vj,jab->vab", model.weights, rotations)
        rest = np.linalg.solve(linear, (point - shifts)[..., np.newaxis])[..., 0]
        motions = joint_motions(joints, rotation_matrix(pose), model.parents)
        straight[number] = skin_surface(rest, model.weights, joints, *motions)
    return straight


def _permitted(measurement: Measurement) -> str:
    if isinstance(measurement, Girth):
        large = any(word in measurement.name for word in _LARGE)
        return str(_LARGE_GIRTH if large else _SMALL)
    if isinstance(measurement, Height):
        return str(_SMALL)
    return str(_BREADTH) if isinstance(measurement, Breadth) else ""


if __name__ == "__main__":
    main()
