"""Statistics of adults' measurements, and the one check of values that people give.

Functions that take measurements of a person (`percentiles`, `predict_measurements`,
`model_from_measurements`) ask `check_values` first: a value that nobody has is in another unit,
and two values that nobody has together hold a mistake.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import cache

import numpy as np

from riemhuman.arrays import Array, JSONRecord
from riemhuman.checks import SUSPECTED_UNITS, real_number
from riemhuman.errors import ArgumentError
from riemhuman.measurements.measurement_set import load_json, open_measurements
from riemhuman.measurements.measuring import as_mapping

SEXES = ("woman", "man")
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
# One value given another lies within so many standard deviations among soldiers; weight, and what
# grows with it, varies more among others.
_MOST_DEVIATIONS = 10.0
_MORE_WEIGHT = 1.5
# The least of these deviations, as a share of the value: people hold themselves differently.
_LEAST_SPREAD = 0.04


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


def given_values(
    values: Mapping[str, float], sex: str = "adult", *, may_miss: bool = False
) -> dict[str, float]:
    """Return measurements of the open body by name, standing and seated, after `check_values`."""
    given = as_mapping(values, list(units_of_measurements()), may_miss=may_miss)
    check_values(given, sex)
    return given


def check_values(values: Mapping[str, float], sex: str = "adult") -> None:
    """Raise an error for values that no person has, alone or together; NaN is no value.

    Parameters
    ----------
    values : mapping of str to float
        Measurements by name, in SI units; of names that are not the open body's, values must be
        above zero.
    sex : {"adult", "woman", "man"}
    """
    given = {name: value for name, value in values.items() if not np.isnan(value)}
    names = units_of_measurements().keys() & {*adults()["names"]}
    known = {name: value for name, value in given.items() if name in names}
    for name, value in given.items():
        real_number(value, name, minimum=0.0, strict=True)
        if name in known:
            _check_value(name, value, sex)
    if "stature" in known:
        _check_with_stature(known)
    _check_together(known, sex)


@cache
def units_of_measurements() -> dict[str, str]:
    """Return the units of all measurements of the open body, standing and seated, by name."""
    units: dict[str, str] = {}
    for pose in ("standing", "seated"):
        definitions = open_measurements("coarse", pose)
        assert definitions is not None, "the open model has measurements"
        units |= {measurement.name: measurement.units for measurement in definitions.measurements}
    return units


def _check_value(name: str, value: float, sex: str) -> None:
    """Raise an error that suspects the unit if no person has a value."""
    unit, people = units_of_measurements()[name], "men" if sex == "man" else "women"
    mean = adults()["man" if sex == "man" else "woman"]["mean"]
    usual = float(mean[adults()["names"].index(name)])
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
    """Return whether a person can have a value, given the mean woman's."""
    low, high = _SHARES_AROUND if unit == "m" and _is_around(name) else _SHARES[unit]
    return low * usual < value < high * usual and not (unit == "m" and value >= _LARGEST_LENGTH)


def _check_with_stature(given: Mapping[str, float]) -> None:
    stature = given["stature"]
    for name, value in given.items():
        if "height" in name and value >= stature:
            raise ArgumentError(
                f"{name} must be smaller than the stature; found {value:g} m, and a stature of "
                f"{stature:g} m"
            )
        if name in _DENSITIES:
            lowest, highest = (index * stature**2 / _DENSITIES[name] for index in _MASS_INDICES)
            if not lowest < value < highest:
                unit = units_of_measurements()[name]
                raise ArgumentError(
                    f"{name} must lie between {lowest:.3g} and {highest:.3g} {unit} with a "
                    f"stature of {stature:g} m; found {value:g}, which nobody has"
                )


def _is_around(name: str) -> bool:
    return any(word in name for word in ("girth", "breadth", "depth", "clearance"))


def _check_together(given: Mapping[str, float], sex: str) -> None:
    """Raise an error if hardly anybody of the sex has two of the values together."""
    if len(given) < 2:
        return
    names, values = list(given), np.array(list(given.values()))
    sexes = [sex] if sex in SEXES else list(SEXES)
    gaps = np.array([_gaps(names, np.log(values), group) for group in sexes])
    best = gaps[np.argmin(gaps.max(axis=(1, 2)))]
    if best.max() < _MOST_DEVIATIONS:
        return
    j, k = np.unravel_index(best.argmax(), best.shape)
    units = units_of_measurements()
    raise ArgumentError(
        f"almost nobody has both: {names[j]} of {values[j]:g} {units[names[j]]}, and {names[k]} "
        f"of {values[k]:g} {units[names[k]]}; check the values and their units"
    )


def _gaps(names: Sequence[str], logs: Array, sex: str) -> Array:
    """Return how far each value (rows) is from its mean given each other one, in deviations.

    Logarithms of measurements are taken as normal, with the correlations of ANSUR II. Given are
    those that vary less, such as stature: a stature that a mass of 150 kg makes likely is none.
    """
    rows = [adults()["names"].index(name) for name in names]
    mean = adults()[sex]["mean"][rows]
    covariance = adults()[sex]["covariance"][np.ix_(rows, rows)] / np.outer(mean, mean)
    away, spread = logs - np.log(mean), np.sqrt(np.diag(covariance))
    expected = covariance / spread**2 * away  # of the rows, given the columns
    left = spread[:, np.newaxis] ** 2 - covariance**2 / spread**2
    grows = [units_of_measurements()[name] != "m" or _is_around(name) for name in names]
    deviations = np.sqrt(np.maximum(left, _LEAST_SPREAD**2))
    deviations *= np.where(grows, _MORE_WEIGHT, 1.0)[:, np.newaxis]
    gaps: Array = np.abs(away[:, np.newaxis] - expected) / deviations
    gaps[spread[:, np.newaxis] < spread] = 0.0
    np.fill_diagonal(gaps, 0.0)
    return gaps
