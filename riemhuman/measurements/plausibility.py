r"""Groups of measurements that no adult combines: signs of hair, closed hands and shoes in a scan.

The logarithms of a group's measurements are compared with those of adults of the same stature and
body mass (ANSUR II). The covariance S holds the spread of the adults, the variance of the
measurements of one scan, and how uncertain the offset of our definition is. With the residual r,
and with d, what hair, closed hands or shoes typically add,
:math:`d^T S^{-1} r / \sqrt{d^T S^{-1} d}` is standard normal among adults without these. Other
contradictions show in the Mahalanobis distance :math:`r^T S^{-1} r`.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from scipy.special import chdtrc, ndtr

from riemhuman.arrays import Array
from riemhuman.measurements.adults import SEXES, adults

# Shares of adults beyond whom a group counts as implausible: in the direction of what is suspected,
# and in any. Of ANSUR II's people, 0.1 to 0.5 per cent are beyond the first.
_RARE_DIRECTION, _RARE = 0.005, 0.001
_GIVEN = ("stature", "body mass")
# Deviation of what a definition measures more than ANSUR's, beside half of how much its offsets
# differ between women and men: shares of a value.
_OFFSET = 0.01


@dataclass(frozen=True)
class Group:
    """Measurements of one part of the body, with what hair, closed hands or shoes add to them."""

    name: str
    effects: Mapping[str, float]  # on the logarithms of measurements
    reason: str
    advice: str
    others: tuple[str, ...] = ()  # measurements that are spoilt as well

    @property
    def measurements(self) -> tuple[str, ...]:
        return (*self.effects, *self.others)


GROUPS = (
    Group(
        "head",
        {
            "head girth": 0.05,
            "head length": 0.06,
            "head breadth": 0.06,
            "tragion to crown": 0.05,
        },
        "hair or a cap seems to cover the head",
        "cover the hair with a tight cap",
    ),
    Group(
        "hands",
        {"hand length": -0.15, "palm length": 0.0, "hand breadth": 0.0, "hand girth": 0.12},
        "the hands seem to be closed, or to hold something",
        "open the hands, away from the body",
        ("arm span",),
    ),
    Group(
        "feet",
        {
            "foot length": 0.06,
            "ball of foot length": 0.03,
            "foot breadth": 0.05,
            "heel breadth": 0.05,
            "ankle breadth": 0.0,
            "heel and ankle girth": 0.06,
            "foot girth": 0.06,
            "ankle girth": 0.0,
        },
        "the person seems to wear shoes, or the floor is part of the scan",
        "take off the shoes",
        ("ankle height",),
    ),
)


def implausible_groups(
    values: Mapping[str, float], deviations: Mapping[str, float], sex: str
) -> list[Group]:
    """Return the groups whose measurements hardly any adult combines, and why, in words.

    Parameters
    ----------
    values, deviations : mapping of str to float
        Measurements of a scan of an adult, and their standard deviations, in SI units.
    sex : {"adult", "woman", "man"}
    """
    found = []
    for group in GROUPS:
        shares = [
            shares_of_adults(group, values, deviations, population)
            for population in ([sex] if sex in SEXES else SEXES)
        ]
        if max(in_direction for in_direction, _ in shares) < _RARE_DIRECTION:
            found.append(group)
        elif max(in_any for _, in_any in shares) < _RARE:
            found.append(replace(group, reason=f"almost no adult has such {group.name}"))
    return found


def shares_of_adults(
    group: Group, values: Mapping[str, float], deviations: Mapping[str, float], sex: str
) -> tuple[float, float]:
    """Return shares of adults, given stature and mass: with more of the effect, and as unusual."""

    def is_known(name: str) -> bool:
        return bool(np.isfinite(values.get(name, np.nan) * deviations.get(name, np.nan)))

    names = [name for name in group.effects if is_known(name)]
    given = [name for name in _GIVEN if is_known(name)]
    effects = np.array([group.effects[name] for name in names])
    if len(names) < 2 or not effects.any():
        return 1.0, 1.0
    logs = np.log([values[name] for name in (*given, *names)])
    away = logs - _means([*given, *names], sex)
    covariance = _covariance([*given, *names], sex)
    women, men = _relative_offsets([*given, *names])
    of_scan = np.array([deviations[name] / values[name] for name in (*given, *names)])
    covariance += np.diag(of_scan**2 + _OFFSET**2 + ((women - men) / 2.0) ** 2)
    n = len(given)
    slopes = np.linalg.solve(covariance[:n, :n], covariance[:n, n:])
    left = away[n:] - away[:n] @ slopes
    inner = covariance[n:, n:] - covariance[n:, :n] @ slopes
    scaled = np.linalg.solve(inner, effects)
    score = scaled @ left / np.sqrt(scaled @ effects)
    squared = left @ np.linalg.solve(inner, left)
    return float(ndtr(-score)), float(chdtrc(len(names), squared))


def _means(names: list[str], sex: str) -> Array:
    """Return the logarithms of what our definitions measure of mean adults."""
    statistics = adults()
    rows = [statistics["names"].index(name) for name in names]
    means: Array = np.log(statistics[sex]["mean"][rows]) + _relative_offsets(names).mean(axis=0)
    return means


def _covariance(names: list[str], sex: str) -> Array:
    rows = [adults()["names"].index(name) for name in names]
    mean = adults()[sex]["mean"][rows]
    covariance: Array = adults()[sex]["covariance"][np.ix_(rows, rows)] / np.outer(mean, mean)
    return covariance


def _relative_offsets(names: list[str]) -> Array:
    """Return by how much our definitions measure more of mean women and men, logarithms (2, n)."""
    statistics = adults()
    rows = [statistics["names"].index(name) for name in names]
    shares = [
        [statistics[s]["offsets"].get(name, 0.0) for name in names] / statistics[s]["mean"][rows]
        for s in SEXES
    ]
    offsets: Array = np.log1p(np.array(shares))
    return offsets
