r"""Adults of a stature: how their measurements spread, and their average body.

The people are those of ANSUR II (US Army, 2012), weighted to the body mass index of the US public
(NHANES, 2021 to 2023) as far as there are such soldiers. For each sex,
log m = a + b log s + e, with the measurement m, the stature s, and a residual e whose quantiles
are stored; for the stature itself, b = 0. What our definition of a measurement measures more than
tapes and callipers is part of a. The numbers come from `tutorials/remake/build_percentiles.py`,
which also checks them on people who were not used.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import cache

import numpy as np
from scipy.special import ndtr, ndtri, softmax

from riemhuman.arrays import Array, JSONRecord
from riemhuman.checks import checked, choice, positive, real
from riemhuman.datasets import load_open_model
from riemhuman.errors import ArgumentError
from riemhuman.measurements.adults import SEXES, check_values, given_values
from riemhuman.measurements.measurement_set import load_json, open_measurements
from riemhuman.measurements.measuring import Measurements

_STATURE = "stature"
a_population = choice("adult", *SEXES)
# Standard deviations of the logarithm of stature beyond which there are hardly any adults.
_FARTHEST = 4.0
# Steps after which the average adult has the stature to within a tenth of a millimetre.
_STATURE_STEPS = 3


@checked(sex=a_population, stature=real())
def percentiles(
    values: Mapping[str, float], sex: str = "adult", *, stature: float | None = None
) -> dict[str, float]:
    """Return the percentage of adults of the same sex and stature whose measurements are smaller.

    The stature itself is compared with all adults of the sex. The adults are the soldiers of
    ANSUR II (US Army, 2012), weighted to the body mass index of the US public (NHANES, 2021 to
    2023) up to 41 kg/m² for women and 43 for men; nobody is heavier among the soldiers. They were
    measured with tapes and callipers, and the mean offset of our definitions is taken into account.

    Parameters
    ----------
    values : mapping of str to float
        Measurements of the open body by name, in metres, square metres, cubic metres or kilograms.
        Values that nobody has, alone or together, raise an error that suggests another unit.
    sex : {"adult", "woman", "man"}
        Population; for "adult", women and men are weighted by how many of them have the stature.
    stature : float, optional
        The stature, metres; by default the one among the values.

    Returns
    -------
    dict of str to float
        Percentages between 0 and 100; those below 1 and above 99 are extrapolated. NaN for values
        that are NaN, for measurements that ANSUR II lacks, defines otherwise or has too few
        people for, and for all measurements if no adult of the sex has such a stature.

    Examples
    --------
    >>> values = {"stature": 1.70, "waist girth (omphalion)": 0.80}
    >>> found = rh.measurements.percentiles(values, "woman")
    >>> 80 < found["stature"] < 95, 5 < found["waist girth (omphalion)"] < 40
    (True, True)
    """
    given = given_values(values, sex, may_miss=True)
    height = given.get(_STATURE, np.nan) if stature is None else stature
    check_values({**given, _STATURE: height}, sex)
    if np.isnan(height):
        raise ArgumentError("stature must be given, as an argument or among the values")
    return percentages(given, sex, height)


def percentages(values: Mapping[str, float], sex: str, stature: float) -> dict[str, float]:
    """Return percentiles of measured values, as `percentiles` does; no values are refused."""
    shares = _shares_of_sexes(stature, sex)
    found = dict.fromkeys(values, float("nan"))
    for name, value in values.items():
        if shares and value > 0.0 and has_percentiles(name, sex):
            found[name] = sum(
                share * _percentage(name, value, stature, group) for group, share in shares.items()
            )
    return found


def has_percentiles(name: str, sex: str = "adult") -> bool:
    """Return whether ANSUR II supports percentiles of a measurement, of both sexes for adults.

    Definitions must agree, and percentiles from one half of the people must hold for the other.
    """
    sexes = [sex] if sex in SEXES else list(SEXES)
    return all(name in _adults()[group]["measurements"] for group in sexes)


def is_of_adults(stature: float, sex: str) -> bool:
    """Return whether there are adults of a sex with this stature."""
    return bool(_shares_of_sexes(stature, sex))


def spread_of_adults(name: str, sex: str) -> float:
    """Return the standard deviation of a measurement among adults of one stature, of its value."""
    levels, middle = _adults()["levels"], [25.0, 75.0]
    between = ndtri(0.75) - ndtri(0.25)
    sexes = [sex] if sex in SEXES else list(SEXES)
    spreads = [
        np.ptp(np.interp(middle, levels, _adults()[group]["measurements"][name][2:])) / between
        for group in sexes
    ]
    return float(np.mean(spreads))


def largest_body_mass_index(sex: str) -> float:
    """Return the body mass index of the heaviest adult of a sex for their height, kg/m²."""
    sexes = [sex] if sex in SEXES else list(SEXES)
    return float(min(_adults()[group]["body mass index"][1] for group in sexes))


@checked(
    stature=positive,
    sex=a_population,
    resolution=choice("full", "coarse"),
)
def average_adult(stature: float, sex: str = "adult", resolution: str = "full") -> Array:
    """Return the average body of a sex and stature, in the standard pose.

    Its shape coefficients are predicted by linear regression of those of simulated adults on the
    logarithm of their stature (see `percentiles`). Its stature is accurate to 0.1 mm.

    Parameters
    ----------
    stature : float
        Stature in metres; one that no adult has raises an error.
    sex : {"adult", "woman", "man"}
        Population; for "adult", women and men are weighted by how many of them have the stature.
    resolution : {"full", "coarse"}
        Resolution of the open body model.

    Returns
    -------
    array, shape (V, 3)
        The body, metres.

    Examples
    --------
    >>> body = rh.measurements.average_adult(1.70, "woman", "coarse")
    >>> measurements = rh.measurements.Measurements(rh.datasets.load_open_model("coarse"))
    >>> measured = measurements.measure(body, axes="space")
    >>> round(float(measured["stature"]), 2)
    1.7
    """
    shares = _shares_of_sexes(stature, sex)
    if not shares:
        raise ArgumentError(f"stature must be that of an adult, in metres; found {stature:g}")
    definitions = open_measurements(resolution)
    assert definitions is not None, "the open model has measurements"
    model = load_open_model(resolution)
    standing = definitions.standard_pose_vector
    measurements = Measurements(model, [_STATURE])
    predictor = stature
    for _ in range(_STATURE_STEPS):  # the regression is off by millimetres for tall people
        body = model(_average_betas(predictor, shares), standing)
        predictor *= stature / float(measurements.measure(body, axes="space")[_STATURE])
    return np.asarray(model(_average_betas(predictor, shares), standing))


def _average_betas(stature: float, shares: Mapping[str, float]) -> Array:
    """Return the shape coefficients that regression on the stature predicts."""
    betas = np.zeros(len(_adults()["woman"]["betas"][0]))
    for sex, share in shares.items():
        entry = _adults()[sex]
        intercept, slope = np.array(entry["betas"])
        betas += share * (intercept + slope * (np.log(stature) - entry["log_stature"][0]))
    return betas


@cache
def _adults() -> JSONRecord:
    record: JSONRecord = load_json("percentiles_of_adults.json")
    return record


def _shares_of_sexes(stature: float, sex: str) -> dict[str, float]:
    """Return the share of each sex among adults of a stature; empty if there are none."""
    sexes = [sex] if sex in SEXES else list(SEXES)
    if not stature > 0.0:
        return {}
    scores = []
    for group in sexes:
        mean, std = _adults()[group]["log_stature"]
        scores.append((np.log(stature) - mean) / std)
    if min(np.abs(scores)) > _FARTHEST:
        return {}
    stds = np.array([_adults()[group]["log_stature"][1] for group in sexes])
    shares = softmax(-np.square(scores) / 2.0 - np.log(stds))
    return dict(zip(sexes, shares.tolist(), strict=True))


def _percentage(name: str, value: float, stature: float, sex: str) -> float:
    """Return the percentage of one sex with this stature below a value."""
    entry = _adults()[sex]
    intercept, slope, *quantiles = entry["measurements"][name]
    mean, _ = entry["log_stature"]
    rest = np.log(value) - intercept - slope * (np.log(stature) - mean)
    score = scores_of_quantiles(np.array([rest]), np.array(quantiles), _adults()["levels"])
    return float(100.0 * ndtr(score[0]))


def scores_of_quantiles(values: Array, quantiles: Array, levels: Sequence[float]) -> Array:
    """Return the quantiles of the standard normal that values have, given quantiles of theirs.

    Beyond the outermost quantile, they follow the line through it and the median.
    """
    normal = ndtri(np.array(levels) / 100.0)
    scores: Array = np.interp(values, quantiles, normal)
    middle = len(quantiles) // 2
    for end, is_beyond in ((0, values < quantiles[0]), (-1, values > quantiles[-1])):
        step = (quantiles[end] - quantiles[middle]) / (normal[end] - normal[middle])
        scores[is_beyond] = normal[end] + (values[is_beyond] - quantiles[end]) / step
    return scores
