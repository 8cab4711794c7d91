"""Write `percentiles_of_adults.json`: how measurements spread among adults of one stature.

    python tutorials/remake/build_percentiles.py

Bodies of both sexes are drawn from `adults.json`, which holds the mean and covariance of the shape
coefficients of the people of ANSUR II. A normal distribution is symmetric, and the public's body
mass index is not: its upper half is wider. So every drawn body is moved to the body mass index that
has its rank among the public, along the regression of the coefficients on the index at one stature,
and measured in the standard pose. Each measurement is regressed on stature, both as logarithms; the
quantiles of what is left are kept. The shape coefficients are regressed on stature as well, for the
average body of a stature.
With --check it prints instead how often the kept quantiles hold for other draws, and the body mass
index of the draws.
"""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from adult_people import public_body_mass_index
from numpy import ndarray
from scipy.stats import norm, rankdata

from riemhuman.measurements import Measurements, open_measurements, percentiles
from riemhuman.measurements.measurement_set import DATA

_SOURCE = (
    "Simulated adults: bodies of the open body model with the spread of ANSUR II (US Army, 2012), "
    "body mass index moved to that of the US public (NHANES, August 2021 to August 2023); see "
    "datasets/data/README.md."
)
_LEVELS = (1.0, 2.5, 5.0, 10.0, 25.0, 50.0, 75.0, 90.0, 95.0, 97.5, 99.0)
_SEXES = ("woman", "man")
_MASS = ("stature", "body mass")
_N_PEOPLE, _BATCH, _SEED = 1500, 50, 51
# Steps after which a body has the wanted body mass index to within a thousandth.
_INDEX_STEPS = 4


def main(arguments: Sequence[str] | None = None) -> None:
    """Build or check.

    Parameters
    ----------
    arguments : sequence of str, optional
        Command line; by default that of the process.
    """
    parser = argparse.ArgumentParser(description="Percentiles of adults of one stature.")
    parser.add_argument("folder", nargs="?", type=Path, default=DATA)
    parser.add_argument("--people", type=int, default=_N_PEOPLE, help="people of each sex")
    parser.add_argument("--check", action="store_true", help="check other draws, write nothing")
    options = parser.parse_args(arguments)
    if options.check:
        _check(options.people)
        return
    record: dict[str, object] = {"source": _SOURCE, "levels": list(_LEVELS)}
    for sex in _SEXES:
        record[sex] = _statistics(*_drawn(sex, options.people, _SEED))
    path = options.folder / "percentiles_of_adults.json"
    path.write_text(json.dumps(record, indent=0) + "\n", encoding="utf-8")
    sys.stdout.write(f"{path}: {path.stat().st_size:,} bytes\n")


def drawn_betas(
    sex: str, n_people: int, rng: np.random.Generator, resolution: str = "full"
) -> ndarray:
    """Return shape coefficients of people of one sex with the public's body mass index."""
    entry = json.loads((DATA / "adults.json").read_text(encoding="utf-8"))[sex]
    betas = rng.multivariate_normal(entry["mean"], entry["covariance"], n_people)
    measured = _measured(betas, resolution, _MASS)
    index, stature = _log_index(measured), np.log(measured[:, 0])
    normal = norm.ppf((rankdata(index, method="ordinal") - 0.5) / n_people)
    wanted = public_body_mass_index(normal, sex)
    predictors = np.stack([np.ones(n_people), stature, index], axis=1)
    direction = np.linalg.lstsq(predictors, betas, rcond=None)[0][2]
    for _ in range(_INDEX_STEPS):
        betas = betas + (wanted - index)[:, None] * direction
        index = _log_index(_measured(betas, resolution, _MASS))
    return betas


def _drawn(sex: str, n_people: int, seed: int) -> tuple[ndarray, tuple[str, ...], ndarray]:
    """Return shape coefficients of people, and their measurements with names."""
    betas = drawn_betas(sex, n_people, np.random.default_rng([seed, _SEXES.index(sex)]))
    values = _measured(betas, "full")
    known = np.isfinite(values).all(axis=1)
    return betas[known], Measurements(open_measurements("full")).names, values[known]


def _measured(betas: ndarray, resolution: str, names: Sequence[str] | None = None) -> ndarray:
    """Return measurements in the standard pose, of these names or all, (n, M)."""
    definitions = open_measurements(resolution)
    measurements, pose = Measurements(definitions, names), definitions.standard_pose_vector
    rows = []
    for first in range(0, len(betas), _BATCH):
        points = definitions.model(betas[first : first + _BATCH], pose)
        rows.append(measurements.measure(points, axes="space", missing="nan").values)
    return np.concatenate(rows)


def _log_index(stature_and_mass: ndarray) -> ndarray:
    stature, mass = stature_and_mass.T
    return np.log(mass / stature**2)


def _statistics(betas: ndarray, names: tuple[str, ...], values: ndarray) -> dict[str, object]:
    logs = np.log(values)
    stature = logs[:, names.index("stature")]
    mean, std = float(stature.mean()), float(stature.std())
    predictors = np.stack([np.ones(len(stature)), stature - mean], axis=1)
    lines = np.linalg.lstsq(predictors, logs, rcond=None)[0]
    lines[1, names.index("stature")] = 0.0  # is compared with all of the sex
    left = logs - predictors @ lines
    quantiles = np.percentile(left, _LEVELS, axis=0)
    of_betas = np.linalg.lstsq(predictors, betas, rcond=None)[0]
    return {
        "people": len(values),
        "log_stature": [round(mean, 5), round(std, 5)],
        "measurements": {
            name: [round(float(x), 5) for x in (*lines[:, k], *quantiles[:, k])]
            for k, name in enumerate(names)
        },
        "betas": [[round(float(x), 4) for x in row] for row in of_betas],
    }


def _check(n_people: int) -> None:
    for sex in _SEXES:
        _, names, values = _drawn(sex, n_people, _SEED + 1)
        people = [dict(zip(names, row, strict=True)) for row in values]
        levels = np.array([[*percentiles(person, sex).values()] for person in people])
        index = values[:, names.index("body mass")] / values[:, names.index("stature")] ** 2
        shown = ", ".join(f"{x:.1f}" for x in np.percentile(index, [5, 25, 50, 75, 95]))
        sys.stdout.write(f"\n{len(values)} simulated people, {sex}; body mass index {shown}\n")
        sys.stdout.write(f"{'':36}{'below 5':>9}{'below 50':>9}{'below 95':>9}\n")
        for k, name in enumerate(names):
            shares = [100 * np.mean(levels[:, k] < level) for level in (5, 50, 95)]
            sys.stdout.write(f"{name:36}" + "".join(f"{share:9.1f}" for share in shares) + "\n")


if __name__ == "__main__":
    main()
