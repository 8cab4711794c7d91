r"""Measurements predicted from others, by the statistics of ANSUR II; values that contradict.

The measurements of one sex are normal, y ~ N(μ, C), with statistics of ANSUR II. Given some of
them, the others are normal with mean :math:`\mu_o + C_{og} C_{gg}^{-1} (y_g - \mu_g)` and
covariance :math:`C_{oo} - C_{og} C_{gg}^{-1} C_{go}`: the best linear regression. If the sex is not
given, both count by their probability. Whether values contradict each other is judged with heavier
tails: y has a t-distribution with ν degrees of freedom, and :math:`y_k` given p − 1 others one with
ν + p − 1, the same mean, and a scale that grows with the distance of the others from their means.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.linalg import solve_triangular
from scipy.special import fdtrc, gammaln, softmax, stdtrit

from riemhuman.arrays import Array
from riemhuman.checks import checked, choice, metric_weight
from riemhuman.measurements.adults import SEXES, adults, given_values, units_of_measurements
from riemhuman.measurements.measuring import as_mapping

# Degrees of freedom with which the expected share of ANSUR II is flagged, and that share.
_DEGREES, _SHARE = 12.0, 0.005
# Standard deviation with which a value is measured, relative to it.
_ERROR = 0.005
# Default standard deviations of values: metres, and shares of areas, volumes and masses.
_LENGTH_TOLERANCE, _SHARE_TOLERANCE = 1e-4, 5e-4


@dataclass(frozen=True, eq=False)
class PredictedMeasurements:
    """Measurements of adults, predicted from others.

    Attributes
    ----------
    values, std : dict of str to float
        The measurements that were not given, standing and seated, in metres, square metres, cubic
        metres or kilograms, and the standard deviations of their errors.
    sexes : dict of str to float
        Probabilities of "woman" and "man" given the values.
    z_scores : dict of str to float
        Each given value minus its prediction from the others, as a t-value.
    contradictory : tuple of str
        Names of values that do not fit the others in at most 1 of 100 people, the worst first.
    pair : tuple of (str, str, float), or None
        Of contradictory values, the two that fit each other least, and a value of the first that
        would fit.
    rarity : float
        Share of adults who are as far from the mean.

    Examples
    --------
    See `predict_measurements`.
    """

    values: dict[str, float]
    std: dict[str, float]
    sexes: dict[str, float]
    z_scores: dict[str, float]
    contradictory: tuple[str, ...]
    pair: tuple[str, str, float] | None
    rarity: float


@checked(sex=choice("adult", *SEXES))
def predict_measurements(
    values: Mapping[str, float],
    sex: str = "adult",
    *,
    tolerances: Mapping[str, float] | None = None,
) -> PredictedMeasurements:
    """Predict all other measurements of adults from given ones, without making a body.

    They are predicted by linear regression on ANSUR II, as measured with tapes and callipers;
    `model_from_measurements` gives a body that comes close to them.

    Parameters
    ----------
    values : mapping of str to float
        Measurements by name, in metres, square metres, cubic metres or kilograms. Values that
        nobody has, alone or together, raise an error that suggests another unit.
    sex : {"adult", "woman", "man"}
        Population; for "adult", both sexes count by their probability given the values.
    tolerances : mapping of str to float, optional
        Standard deviations of errors of the values, in their units; by default 0.1 mm for lengths,
        and a two-thousandth of the value for areas, volumes and masses.

    Examples
    --------
    >>> predicted = rh.measurements.predict_measurements({"stature": 1.70}, "woman")
    >>> round(predicted.values["sitting height"], 2), round(predicted.std["sitting height"], 3)
    (0.88, 0.022)
    """
    given = given_values(values, sex)
    return predict(given, sex, errors_of_values(given, tolerances))


def errors_of_values(
    given: Mapping[str, float], tolerances: Mapping[str, float] | None
) -> dict[str, float]:
    """Return the standard deviations of errors of given values, in their units."""
    units = units_of_measurements()
    errors = {
        name: _LENGTH_TOLERANCE if units[name] == "m" else _SHARE_TOLERANCE * value
        for name, value in given.items()
    }
    for name, error in as_mapping(tolerances, list(given)).items() if tolerances else ():
        errors[name] = metric_weight(error, f"tolerance of {name}", strict=True)
    return errors


def predict(
    given: Mapping[str, float], sex: str, errors: Mapping[str, float] | None = None
) -> PredictedMeasurements:
    """Predict all measurements of adults that are not given, from values with errors."""
    names = adults()["names"]
    known = [name for name in given if name in names]
    rows = np.array([names.index(name) for name in known], dtype=int)
    rest = np.setdiff1d(np.arange(len(names)), rows)
    values = np.array([given[name] for name in known])
    noise = np.array([(errors or {}).get(name, 0.0) for name in known])
    sexes = [sex] if sex in SEXES else list(SEXES)
    means, variances = np.empty((2, len(sexes), len(rest)))
    likelihoods = np.zeros(len(sexes))
    for k, population in enumerate(sexes):
        mean, covariance = adults()[population]["mean"], adults()[population]["covariance"]
        inner = covariance[np.ix_(rows, rows)] + np.diag(noise**2)
        slopes = np.linalg.solve(inner, covariance[np.ix_(rows, rest)])
        means[k] = mean[rest] + (values - mean[rows]) @ slopes
        explained = np.sum(covariance[np.ix_(rows, rest)] * slopes, axis=0)
        variances[k] = np.diag(covariance)[rest] - explained
        if known:
            likelihoods[k] = _log_density(values - mean[rows], inner)
    shares = softmax(likelihoods)
    expected = shares @ means
    variance = shares @ (variances + (means - expected) ** 2)
    others = [names[k] for k in rest]
    return PredictedMeasurements(
        dict(zip(others, expected.tolist(), strict=True)),
        dict(zip(others, np.sqrt(variance).tolist(), strict=True)),
        dict(zip(sexes, shares.tolist(), strict=True)),
        *_contradictions(known, values, noise, sexes[int(shares.argmax())]),
    )


def _log_density(deviations: Array, scale: Array) -> float:
    """Return the logarithm of the density of Student's distribution in several dimensions."""
    # Like `scipy.stats.multivariate_t`, whose package takes half a second to import.
    n, root = len(deviations), np.linalg.cholesky(scale)
    within = float(np.sum(solve_triangular(root, deviations, lower=True) ** 2))
    constant = gammaln(0.5 * (_DEGREES + n)) - gammaln(0.5 * _DEGREES)
    constant -= 0.5 * n * np.log(np.pi * _DEGREES) + np.sum(np.log(np.diag(root)))
    return float(constant - 0.5 * (_DEGREES + n) * np.log1p(within / _DEGREES))


def _contradictions(
    known: Sequence[str], values: Array, noise: Array, sex: str
) -> tuple[dict[str, float], tuple[str, ...], tuple[str, str, float] | None, float]:
    if not known:
        return {}, (), None, 1.0
    names = adults()["names"]
    rows = [names.index(name) for name in known]
    deviations = values - adults()[sex]["mean"][rows]
    covariance = adults()[sex]["covariance"][np.ix_(rows, rows)]
    covariance = covariance + np.diag(np.maximum(_ERROR * values, noise) ** 2)
    scores, _ = _t_values(deviations, covariance)
    limit = stdtrit(_DEGREES + len(known) - 1, 1.0 - _SHARE / (2 * len(known)))
    order = np.argsort(-np.abs(scores))
    contradictory = tuple(known[k] for k in order if abs(scores[k]) > limit)
    pair = None
    if contradictory:
        # Of all pairs with the worst value, the one whose values fit each other least.
        worst, least = order[0], -1.0
        for j in order[1:]:
            both = [worst, j]
            pair_scores, gaps = _t_values(deviations[both], covariance[np.ix_(both, both)])
            if abs(pair_scores[0]) > least:
                least, pair = (
                    abs(pair_scores[0]),
                    (known[worst], known[j], float(values[worst] - gaps[0])),
                )
    squared = deviations @ np.linalg.solve(covariance, deviations) / len(known)
    rarity = float(fdtrc(len(known), _DEGREES, squared))
    return dict(zip(known, scores.tolist(), strict=True)), contradictory, pair, rarity


def _t_values(deviations: Array, covariance: Array) -> tuple[Array, Array]:
    """Compare each value with its mean given the others: in t-values, and in its unit."""
    precision = np.linalg.inv(covariance)
    pull = precision @ deviations
    squares = pull**2 / np.diag(precision)
    others = deviations @ pull - squares
    degrees = _DEGREES + len(deviations) - 1
    scores = np.sign(pull) * np.sqrt(squares * degrees / (_DEGREES + others))
    return scores, pull / np.diag(precision)
