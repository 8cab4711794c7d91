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
from functools import cache

import numpy as np
from scipy.linalg import solve_triangular
from scipy.special import fdtrc, gammaln, softmax, stdtrit

from riemhuman.arrays import Array, JSONRecord
from riemhuman.checks import SUSPECTED_UNITS, metric_weight, one_of, real_number
from riemhuman.errors import ArgumentError
from riemhuman.measurements.measurement_set import load_json, open_measurements
from riemhuman.measurements.measuring import as_mapping

SEXES = ("woman", "man")
# Degrees of freedom with which the expected share of ANSUR II is flagged, and that share.
_DEGREES, _SHARE = 12.0, 0.005
# Standard deviation with which a value is measured, relative to it.
_ERROR = 0.005
# Default standard deviations of values: metres, and shares of areas, volumes and masses.
_LENGTH_TOLERANCE, _SHARE_TOLERANCE = 1e-4, 5e-4
# Smallest and largest values of people, as shares of the mean woman's: from the shortest adults,
# 0.55 m tall, to the tallest, and to the heaviest; other values are in other units.
_SHARES = {"m": (0.33, 2.0), "m²": (0.1, 4.0), "m³": (0.03, 10.0), "kg": (0.03, 10.0)}
_SHARES_AROUND = (0.25, 3.0)  # of girths, breadths and depths, which grow with weight
# The tallest person was 2.72 m tall, and no arm span was longer than 2.9 m.
_LARGEST_LENGTH = 2.9
# Body mass over the square of stature, kg/m²: the heaviest people known had 204, and nobody
# survived below 6. Kilograms by the unit of what stands for mass.
_MASS_INDICES = (6.0, 205.0)
_DENSITIES = {"body mass": 1.0, "volume": 1000.0}


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

    Examples
    --------
    See `predict_measurements`.
    """

    values: dict[str, float]
    std: dict[str, float]
    sexes: dict[str, float]
    z_scores: dict[str, float]
    contradictory: tuple[str, ...]


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
        nobody has raise an error that suggests another unit.
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
    one_of(sex, "sex", ("adult", *SEXES))
    given, errors = checked_values(values, tolerances, sex)
    prediction = predict(given, sex, errors)
    return PredictedMeasurements(
        prediction.mean,
        prediction.std,
        prediction.sexes,
        prediction.scores,
        prediction.contradictory,
    )


def checked_values(
    values: Mapping[str, float], tolerances: Mapping[str, float] | None, sex: str
) -> tuple[dict[str, float], dict[str, float]]:
    """Return given values and their standard deviations by name."""
    given = as_mapping(values, list(dict.fromkeys((*_units(), *adults()["names"]))))
    check_values(given, sex)
    errors = {}
    for name, value in given.items():
        is_length = _units().get(name, "m") == "m"
        errors[name] = _LENGTH_TOLERANCE if is_length else _SHARE_TOLERANCE * value
    for name, error in _given_tolerances(tolerances, given).items():
        errors[name] = metric_weight(error, f"tolerance of {name}", strict=True)
    return given, errors


def _given_tolerances(
    tolerances: Mapping[str, float] | None, given: Mapping[str, float]
) -> dict[str, float]:
    if tolerances is None or (isinstance(tolerances, Mapping) and not tolerances):
        return {}
    return as_mapping(tolerances, list(given))


def check_values(values: Mapping[str, float], sex: str = "adult") -> None:
    """Raise an error for values that no person has, alone or together; NaN is no value.

    Parameters
    ----------
    values : mapping of str to float
        Measurements by name, in SI units; names that are not the open body's are not checked.
    sex : {"adult", "woman", "man"}
        Whose means messages name.
    """
    people = "man" if sex == "man" else "woman"
    typical = dict(zip(adults()["names"], adults()[people]["mean"].tolist(), strict=True))
    given = {name: value for name, value in values.items() if not np.isnan(value)}
    for name, value in given.items():
        real_number(value, name, minimum=0.0, strict=True)
        if name in typical:
            unit = _units().get(name, "m")
            _check_value(name, value, typical[name], unit, "men" if sex == "man" else "women")
    stature = given.get("stature")
    if stature is None:
        return
    for name, value in given.items():
        if "height" in name and name in typical and value >= stature:
            raise ArgumentError(
                f"{name} must be smaller than the stature; found {value:g} m, and a stature of "
                f"{stature:g} m"
            )
        if name in _DENSITIES:
            lowest, highest = (index * stature**2 / _DENSITIES[name] for index in _MASS_INDICES)
            if not lowest < value < highest:
                raise ArgumentError(
                    f"{name} must lie between {lowest:.3g} and {highest:.3g} {_units()[name]} with "
                    f"a stature of {stature:g} m; found {value:g}, which nobody has"
                )


@cache
def _units() -> dict[str, str]:
    """Return the unit of each standing measurement; all seated ones are lengths."""
    standing = open_measurements("coarse")
    assert standing is not None, "the open model has measurements"
    return {measurement.name: measurement.units for measurement in standing.measurements}


def _check_value(name: str, value: float, usual: float, unit: str, people: str) -> None:
    """Raise an error that suspects the unit if no person has a value, given the usual one."""
    if _is_human(name, value, usual, unit):
        return
    units = []
    if unit == "m":
        for suspected, size in SUSPECTED_UNITS.items():
            if _is_human(name, value / size, usual, unit):
                units.append(suspected)
    question = f": is it in {' or '.join(units)}?" if units else ""
    raise ArgumentError(
        f"{name} must be in {unit}, in which the mean of {people} is {usual:.3g}; found {value:g}, "
        f"which nobody has{question}"
    )


def _is_human(name: str, value: float, usual: float, unit: str) -> bool:
    """Return whether a person can have a value, given the usual one."""
    is_around = any(word in name for word in ("girth", "breadth", "depth", "clearance"))
    low, high = _SHARES_AROUND if unit == "m" and is_around else _SHARES[unit]
    return low * usual < value < high * usual and not (unit == "m" and value >= _LARGEST_LENGTH)


@dataclass(frozen=True)
class Prediction:
    """What given values say: the others, the sex, and values that contradict each other."""

    mean: dict[str, float]
    std: dict[str, float]
    sexes: dict[str, float]
    scores: dict[str, float]  # t-values of the given values
    contradictory: tuple[str, ...]
    # The two values that fit each other least, and a value of the first that would fit.
    pair: tuple[str, str, float] | None
    rarity: float  # share of adults as far from the mean


@cache
def adults() -> JSONRecord:
    """Return names, and by sex means, covariances and offsets: those of the model less ANSUR's."""
    record: JSONRecord = load_json("measurements_of_adults.json")
    size = len(record["names"])
    for sex in SEXES:
        entry, correlations = record[sex], np.eye(size)
        correlations[np.tril_indices(size, -1)] = entry["correlations"]
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
    return Prediction(
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
