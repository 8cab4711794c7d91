"""Rebuild or check the percentiles of adults from ANSUR II.

    python tutorials/remake/build_percentiles.py ANSUR [folder]
    python tutorials/remake/build_percentiles.py ANSUR --check

ANSUR is a folder with men.csv and women.csv, as for build_statistics.py. The first command writes
percentiles_of_adults.json. For each sex, log m = a + b log s + c i + d i² + e, with the measurement
m, the stature s, the logarithm i of the body mass index (from its mean), and what is left, e. The
index is spread as among the US public (NHANES, 2021 to 2023), as far as ANSUR has people, and e
spreads more at larger indices, as among the people of ANSUR; the quantiles of c i + d i² + e are
kept. To what tapes and callipers measure, the offset of our
definition is added: what the mean body of the open model measures more, the mean of both sexes. A
measurement gets no percentiles if ANSUR lacks it, or if its offset is large or differs between
women and men, because then the definitions do not agree. One sex has none of a measurement that
fails the check below: as built from one half of the people, fewer than 3 or more than 7 per cent of
the other half lie below the 5th or above the 95th percentile.

The shape coefficients are regressed on stature as well, for the average body of a stature.

With --check, nothing is drawn from a model: percentiles built from one half of the people are tried
on the other half, weighted to the public's body mass index, sixteen times.
"""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from adult_people import public_body_mass_index
from build_statistics import read_people
from numpy import ndarray
from scipy.special import ndtri
from scipy.stats import norm, rankdata

from riemhuman.measurements import Measurements, open_measurements
from riemhuman.measurements.adults import SEXES
from riemhuman.measurements.measurement_set import DATA
from riemhuman.measurements.populations import scores_of_quantiles

_SOURCE = (
    "Derived from every second person of ANSUR II: 2012 Anthropometric Survey of U.S. Army "
    "Personnel (Natick/TR-15/007), weighted to the body mass index of the US public (NHANES, "
    "August 2021 to August 2023, Vital Health Stat. 3(50), 2025, table 10). Work of the US "
    "government, in the public domain."
)
_STATISTICS = "measurements_of_adults.json"
_LEVELS = (1.0, 2.5, 5.0, 10.0, 25.0, 50.0, 75.0, 90.0, 95.0, 97.5, 99.0)
# Definitions agree if the mean of the offsets of women and men is at most this, and if these differ
# by at most that: standard deviations among people of one sex and stature. With half a deviation,
# either sex is off by a quarter, which moves a median by ten points.
_LARGEST_OFFSET, _LARGEST_GAP = 1.0, 0.5
# Heavy people are rare among soldiers, so few would carry everything if people counted by their
# weights. With this power of these, tails hold better for people who were not used than with the
# powers 0.5 and 1; medians hold as well.
_POWER = 0.75
# Width of the kernel that smooths the logarithm of body mass indices. Among 0.02 to 0.07, it comes
# closest to the public's quartiles and tails. Without it, the one heaviest of 993 women would carry
# a tenth of all weight, and decide who is above the 95th percentile.
_WIDTH = 0.04
# Percentages of people who may lie in each tail, where there should be 5, in halves of the people.
_LEAST_TAIL, _LARGEST_TAIL, _N_SPLITS = 3.0, 7.0, 16
_N_INDICES = 400  # quantiles of the public's body mass index
_N_PEOPLE, _BATCH, _SEED = 1500, 50, 51
# Steps after which a body has the wanted body mass index to within a thousandth.
_INDEX_STEPS = 4


def main(arguments: Sequence[str] | None = None) -> None:
    """Build or check."""
    parser = argparse.ArgumentParser(description="Percentiles of adults of one stature.")
    parser.add_argument("ansur", type=Path, help="folder with men.csv and women.csv")
    parser.add_argument("folder", nargs="?", type=Path, default=DATA)
    parser.add_argument("--check", action="store_true", help="check, write nothing")
    options = parser.parse_args(arguments)
    names, people = read_people(options.ansur)
    standing = open_measurements("coarse").names
    kept = [k for k, name in enumerate(names) if name in standing]
    names, people = [names[k] for k in kept], {sex: v[:, kept] for sex, v in people.items()}
    statistics = json.loads((options.folder / _STATISTICS).read_text(encoding="utf-8"))
    if options.check:
        check(names, people, statistics)
        return
    record: dict[str, object] = {"source": _SOURCE, "levels": list(_LEVELS)}
    tables = {sex: fitted(names, people[sex], sex) for sex in SEXES}
    offsets = agreeing_offsets(names, tables, statistics)
    for sex, table in tables.items():
        holds = tails_hold(tails_of_halves(names, people[sex], list(offsets), sex))
        mean, std = _log_stature(people[sex])
        index = _index(names, people[sex])
        record[sex] = {
            "people": len(people[sex]),
            "body mass index": [round(float(index.min()), 1), round(float(index.max()), 1)],
            "log_stature": [mean, std],
            "measurements": {
                name: _rounded([table[name][0] + offset, *table[name][1:]])
                for (name, offset), supported in zip(offsets.items(), holds, strict=True)
                if supported
            },
            "betas": _betas_of_stature(sex, mean),
        }
    path = options.folder / "percentiles_of_adults.json"
    path.write_text(json.dumps(record, indent=0) + "\n", encoding="utf-8")
    sys.stdout.write(f"{path}: {len(offsets)} of {len(names)} measurements of ANSUR II\n")


def fitted(names: Sequence[str], people: ndarray, sex: str) -> dict[str, ndarray]:
    """Return intercept (at the mean stature), slope, and quantiles of measurements by name."""
    logs, index = np.log(people), np.log(_index(names, people))
    stature = logs[:, names.index("stature")] - _log_stature(people)[0]
    middle = index.mean()
    ones = np.ones(len(people))
    predictors = np.stack([ones, stature, index - middle, (index - middle) ** 2], axis=1)
    weights = public_weights(np.exp(index), sex) ** _POWER
    public = _public_within(index, sex) - middle
    table = {}
    for k, name in enumerate(names):
        # The stature is compared with all of the sex.
        x = predictors[:, :1] if name == "stature" else predictors
        root = np.sqrt(weights)
        line = np.linalg.lstsq(x * root[:, np.newaxis], logs[:, k] * root, rcond=None)[0]
        left = logs[:, k] - x @ line
        line = np.pad(line, (0, 4 - len(line)))
        growth = 0.0 if name == "stature" else _growth_of_spread(index - middle, left, root)
        mixed = left * np.exp(growth * np.subtract.outer(public, index - middle))
        mixed += (line[2] * public + line[3] * public**2)[:, np.newaxis]
        quantiles = weighted_quantiles(mixed, np.broadcast_to(weights, mixed.shape), _LEVELS)
        table[name] = np.array([line[0], line[1], *quantiles])
    return table


def _growth_of_spread(index: ndarray, left: ndarray, root: ndarray) -> float:
    """Return how fast the spread of what is left grows with the index, as an exponent."""
    sizes = np.abs(left)
    slope, _ = np.polyfit(index, sizes, 1, w=root)
    return float(slope / np.average(sizes, weights=root**2))


def agreeing_offsets(
    names: Sequence[str], tables: dict[str, dict[str, ndarray]], statistics: dict[str, Any]
) -> dict[str, float]:
    """Return offsets of the logarithms, by names of measurements whose definitions agree."""
    offsets = {}
    for name in names:
        row = statistics["names"].index(name)
        of_sexes, in_deviations = [], []
        for sex in SEXES:
            offset = statistics[sex]["offsets"][name] / statistics[sex]["mean"][row]
            quantiles = tables[sex][name][2:]
            deviation = np.polyfit(ndtri(np.array(_LEVELS) / 100.0), quantiles, 1)[0]
            of_sexes.append(np.log1p(offset))
            in_deviations.append(np.log1p(offset) / deviation)
        is_small = abs(np.mean(in_deviations)) <= _LARGEST_OFFSET
        if is_small and np.ptp(in_deviations) <= _LARGEST_GAP:
            offsets[name] = float(np.mean(of_sexes))
    return offsets


def public_weights(index: ndarray, sex: str) -> ndarray:
    """Return weights of people with which their body mass index is spread as in the public.

    They are the density of the public over that of the people, both smoothed by the same kernel.
    """
    logs = np.log(index)
    public = _public_within(logs, sex)
    densities = [
        np.exp(-np.square(np.subtract.outer(logs, known) / _WIDTH) / 2.0).mean(axis=1)
        for known in (public, logs)
    ]
    weights = densities[0] / densities[1]
    return weights / weights.sum()


def _public_within(logs: ndarray, sex: str) -> ndarray:
    """Return logarithms of the public's indices, as far as there are people."""
    public = public_body_mass_index(norm.ppf((np.arange(_N_INDICES) + 0.5) / _N_INDICES), sex)
    return public[(public >= logs.min()) & (public <= logs.max())]


def weighted_quantiles(values: ndarray, weights: ndarray, levels: Sequence[float]) -> ndarray:
    """Return quantiles at levels in per cent."""
    order = np.argsort(values, axis=None)
    weights = weights.ravel()[order]
    places = (np.cumsum(weights) - 0.5 * weights) / weights.sum()
    return np.interp(np.array(levels) / 100.0, places, values.ravel()[order])


def _index(names: Sequence[str], people: ndarray) -> ndarray:
    return people[:, names.index("body mass")] / people[:, names.index("stature")] ** 2


def _log_stature(people: ndarray) -> tuple[float, float]:
    stature = np.log(people[:, 0])
    return round(float(stature.mean()), 5), round(float(stature.std()), 5)


def _rounded(values: Sequence[float]) -> list[float]:
    return [round(float(value), 5) for value in values]


def drawn_betas(
    sex: str, n_people: int, rng: np.random.Generator, resolution: str = "full"
) -> ndarray:
    """Return shape coefficients of people of one sex with the public's body mass index.

    They are drawn from `adults.json`; a normal distribution is symmetric, and the public's body
    mass index is not, so every body is moved to the index that has its rank among the public.
    """
    entry = json.loads((DATA / "adults.json").read_text(encoding="utf-8"))[sex]
    betas = rng.multivariate_normal(entry["mean"], entry["covariance"], n_people)
    index, stature = _index_and_stature(betas, resolution)
    normal = norm.ppf((rankdata(index, method="ordinal") - 0.5) / n_people)
    wanted = public_body_mass_index(normal, sex)
    predictors = np.stack([np.ones(n_people), stature, index], axis=1)
    direction = np.linalg.lstsq(predictors, betas, rcond=None)[0][2]
    for _ in range(_INDEX_STEPS):
        betas = betas + (wanted - index)[:, None] * direction
        index, _ = _index_and_stature(betas, resolution)
    return betas


def _index_and_stature(betas: ndarray, resolution: str) -> tuple[ndarray, ndarray]:
    """Return logarithms of body mass indices and statures of bodies."""
    definitions = open_measurements(resolution)
    measurements = Measurements(definitions, ["stature", "body mass"])
    rows = []
    for first in range(0, len(betas), _BATCH):
        points = definitions.model(betas[first : first + _BATCH], definitions.standard_pose_vector)
        rows.append(measurements.measure(points, axes="space").values)
    stature, mass = np.log(np.concatenate(rows)).T
    return mass - 2.0 * stature, stature


def _betas_of_stature(sex: str, mean: float) -> list[list[float]]:
    """Return shape coefficients at the mean stature, and their change with its logarithm."""
    betas = drawn_betas(sex, _N_PEOPLE, np.random.default_rng([_SEED, SEXES.index(sex)]))
    _, stature = _index_and_stature(betas, "full")
    predictors = np.stack([np.ones(len(stature)), stature - mean], axis=1)
    lines = np.linalg.lstsq(predictors, betas, rcond=None)[0]
    return [[round(float(x), 4) for x in row] for row in lines]


def check(names: Sequence[str], people: dict[str, ndarray], statistics: dict[str, Any]) -> None:
    """Print how many people lie in the tails of percentiles built from other people."""
    tables = {sex: fitted(names, people[sex], sex) for sex in SEXES}
    offsets = agreeing_offsets(names, tables, statistics)
    for sex in SEXES:
        tails = tails_of_halves(names, people[sex], list(offsets), sex)
        _print_tails(list(offsets), tails, sex, len(people[sex]))


def tails_of_halves(
    names: Sequence[str], people: ndarray, shown: Sequence[str], sex: str
) -> ndarray:
    """Return percentages of the other half below the 5th and above the 95th percentile.

    Their shape is (M, 4, 2): of everybody, and of thirds by stature.
    """
    tails = np.empty((_N_SPLITS, len(shown), 4, 2))
    for split in range(_N_SPLITS):
        order = np.random.default_rng([_SEED, split]).permutation(len(people))
        built, tried = np.array_split(people[order], 2)
        tails[split] = _tails(names, shown, built, tried, sex)
    means: ndarray = tails.mean(axis=0)
    return means


def tails_hold(tails: ndarray) -> ndarray:
    """Return which measurements have about 5 per cent of people in both tails, shape (M,)."""
    of_all = tails[:, 0]
    holds: ndarray = ((of_all >= _LEAST_TAIL) & (of_all <= _LARGEST_TAIL)).all(axis=1)
    return holds


def _tails(
    names: Sequence[str], shown: Sequence[str], built: ndarray, tried: ndarray, sex: str
) -> ndarray:
    """Return percentages of people below the 5th and above the 95th percentile, (M, 4, 2)."""
    table = fitted(names, built, sex)
    weights = public_weights(_index(names, tried), sex)
    stature = np.log(tried[:, names.index("stature")])
    thirds = np.searchsorted(np.quantile(stature, [1 / 3, 2 / 3]), stature)
    groups = [np.ones(len(tried), dtype=bool), *(thirds == k for k in range(3))]
    tails = np.empty((len(shown), 4, 2))
    for k, name in enumerate(shown):
        line = table[name]
        rest = np.log(tried[:, names.index(name)]) - line[0]
        rest -= line[1] * (stature - _log_stature(built)[0])
        scores = scores_of_quantiles(rest, line[2:], _LEVELS)
        scores -= weighted_quantiles(scores, weights, [50.0])
        for number, group in enumerate(groups):
            share = weights[group] / weights[group].sum()
            tails[k, number] = (
                100 * share @ (scores[group] < ndtri(0.05)),
                100 * share @ (scores[group] > ndtri(0.95)),
            )
    return tails


def _print_tails(names: Sequence[str], tails: ndarray, sex: str, n_people: int) -> None:
    holds = tails_hold(tails)
    sys.stdout.write(
        f"\n{n_people} people, {sex}; percentiles from one half, tried on the other, {_N_SPLITS} "
        f"times; medians removed\nmean shares of both tails within 3 to 7 %: {holds.sum()} of "
        f"{len(names)} measurements; the others, marked *, get none\n"
        f"{'':36}{'below 5':>9}{'above 95':>9}   by thirds of stature\n"
    )
    for name, row, supported in zip(names, tails, holds, strict=True):
        thirds = "  ".join(f"{low:4.1f} {high:4.1f}" for low, high in row[1:])
        mark = "" if supported else " *"
        sys.stdout.write(f"{name + mark:36}{row[0, 0]:9.1f}{row[0, 1]:9.1f}   {thirds}\n")


if __name__ == "__main__":
    main()
