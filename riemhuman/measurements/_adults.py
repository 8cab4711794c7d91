r"""What adults measure, and what measurements say about each other.

The measurements of one sex are normal, y ~ N(μ, C), with statistics of ANSUR II. Given some of
them, the others are normal with mean :math:`\mu_o + C_{og} C_{gg}^{-1} (y_g - \mu_g)` and
covariance :math:`C_{oo} - C_{og} C_{gg}^{-1} C_{go}`: the best linear regression. If the sex is not
given, both count by their probability.

Whether values contradict each other is judged with heavier tails: y has a t-distribution with ν
degrees of freedom, so that :math:`y_k` given p − 1 others has one with ν + p − 1, about the same
mean, and a scale that grows with the distance of the others from their means.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from itertools import permutations
from typing import Any

import numpy as np
from numpy import ndarray
from scipy import stats

from riemhuman.measurements.measurement_set import DATA

SEXES = ("woman", "man")
# Degrees of freedom, which flag the expected share of the people of ANSUR II, and that share.
_DEGREES, _SHARE = 12.0, 0.005
# Standard deviation with which a value is measured, relative to it.
_ERROR = 0.005


@dataclass(frozen=True)
class Prediction:
    """What given values say: the others, the sex, and values that contradict each other.

    `mean` and `std` are by name; `scores` are t-values of the given values in standard deviations,
    `pair` the two values that fit each other least, with the first one's value that would fit.
    """

    mean: dict[str, float]
    std: dict[str, float]
    sexes: dict[str, float]
    scores: dict[str, float]
    contradictory: tuple[str, ...]
    pair: tuple[str, str, float] | None


@lru_cache(maxsize=1)
def adults() -> dict[str, Any]:
    """Return names, and by sex means, standard deviations, correlations and offsets of the model.

    The offset of a measurement is that of the model's mean adult less the mean of ANSUR II.
    """
    record = json.loads((DATA / "measurements_of_adults.json").read_text(encoding="utf-8"))
    size = len(record["names"])
    for sex in SEXES:
        entry, correlations = record[sex], np.eye(size)
        correlations[np.tril_indices(size, -1)] = entry.pop("correlations")
        correlations += np.tril(correlations, -1).T
        std = np.array(entry["std"])
        entry["mean"] = np.array(entry["mean"])
        entry["covariance"] = correlations * np.outer(std, std)
    return record


def predict(
    given: Mapping[str, float], sex: str, errors: Mapping[str, float] | None = None
) -> Prediction:
    """Predict all measurements of adults that are not given, from values with errors."""
    names = adults()["names"]
    known = [name for name in given if name in names]
    rows = np.array([names.index(name) for name in known], dtype=int)
    rest = np.setdiff1d(np.arange(len(names)), rows)
    values = np.array([given[name] for name in known])
    noise = np.array([(errors or {}).get(name, 0.0) for name in known])
    sexes = [sex] if sex in SEXES else list(SEXES)
    parts, likelihoods = [], []
    for one in sexes:
        mean, covariance = adults()[one]["mean"], adults()[one]["covariance"]
        inner = covariance[np.ix_(rows, rows)] + np.diag(noise**2)
        slopes = np.linalg.solve(inner, covariance[np.ix_(rows, rest)])
        variances = np.diag(covariance)[rest]
        variances = variances - np.sum(covariance[np.ix_(rows, rest)] * slopes, axis=0)
        parts.append((mean[rest] + (values - mean[rows]) @ slopes, variances))
        tails = stats.multivariate_t(mean[rows], inner, df=_DEGREES) if known else None
        likelihoods.append(tails.logpdf(values) if tails else 0.0)
    shares = np.exp(np.array(likelihoods) - max(likelihoods))
    shares = shares / shares.sum()
    expected = sum(share * mean for share, (mean, _) in zip(shares, parts, strict=True))
    variance = sum(
        share * (variances + (mean - expected) ** 2)
        for share, (mean, variances) in zip(shares, parts, strict=True)
    )
    scores, contradictory, pair = _contradictions(known, values, noise, sexes[int(shares.argmax())])
    return Prediction(
        {names[k]: float(value) for k, value in zip(rest, expected, strict=True)},
        {names[k]: float(value) for k, value in zip(rest, np.sqrt(variance), strict=True)},
        dict(zip(sexes, shares.tolist(), strict=True)),
        scores,
        contradictory,
        pair,
    )


def _contradictions(
    known: Sequence[str], values: ndarray, noise: ndarray, sex: str
) -> tuple[dict[str, float], tuple[str, ...], tuple[str, str, float] | None]:
    if not known:
        return {}, (), None
    names = adults()["names"]
    rows = [names.index(name) for name in known]
    deviations = values - adults()[sex]["mean"][rows]
    covariance = adults()[sex]["covariance"][np.ix_(rows, rows)]
    covariance = covariance + np.diag(np.maximum(_ERROR * values, noise) ** 2)
    scores, _ = _t_values(deviations, covariance)
    limit = stats.t.ppf(1.0 - _SHARE / (2 * len(known)), _DEGREES + len(known) - 1)
    order = np.argsort(-np.abs(scores))
    contradictory = tuple(known[k] for k in order if abs(scores[k]) > limit)
    pair = None
    if contradictory:
        # Of all pairs with the worst value, the one whose values fit each other least.
        worst, least = int(order[0]), -1.0
        for k, j in permutations(range(len(known)), 2):
            if worst not in (k, j):
                continue
            both, gaps = _t_values(deviations[[k, j]], covariance[np.ix_([k, j], [k, j])])
            if k == worst and abs(both[0]) > least:
                least, pair = abs(both[0]), (known[k], known[j], float(values[k] - gaps[0]))
    return dict(zip(known, scores.tolist(), strict=True)), contradictory, pair


def _t_values(deviations: ndarray, covariance: ndarray) -> tuple[ndarray, ndarray]:
    """Compare each value with its mean given the others: in t-values, and in its unit."""
    precision = np.linalg.inv(covariance)
    pull = precision @ deviations
    squares = pull**2 / np.diag(precision)
    others = deviations @ pull - squares
    degrees = _DEGREES + len(deviations) - 1
    scores = np.sign(pull) * np.sqrt(squares * degrees / (_DEGREES + others))
    return scores, pull / np.diag(precision)
