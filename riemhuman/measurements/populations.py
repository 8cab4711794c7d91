r"""Adults of a stature: how their measurements spread, and their average body.

The people are simulated: bodies of the open model with the spread of ANSUR II (US Army, 2012),
whose body mass index is moved to that of the US public (NHANES, 2021 to 2023). For each sex,
log m = a + b log s + e, with the measurement m, the stature s, and a residual e whose quantiles
among these people are stored; for the stature itself, b = 0. The numbers come from
`tutorials/remake/build_percentiles.py`.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache

import numpy as np
from scipy.special import ndtr, ndtri, softmax

from riemhuman.arrays import Array, ArrayLike, JSONRecord
from riemhuman.checks import one_of, real_number
from riemhuman.datasets import load_open_model
from riemhuman.errors import ArgumentError
from riemhuman.measurements.measurement_set import load_json, open_measurements
from riemhuman.measurements.measuring import Measurements, as_mapping
from riemhuman.measurements.predicted_measurements import SEXES, check_values

_STATURE = "stature"
# Standard deviations of the logarithm of stature beyond which there are hardly any adults.
_FARTHEST = 4.0
# Steps after which the average adult has the stature to within a tenth of a millimetre.
_STATURE_STEPS = 3


def percentiles(
    values: Mapping[str, float], sex: str = "adult", *, stature: float | None = None
) -> dict[str, float]:
    """Return the percentage of adults of the same sex and stature whose measurements are smaller.

    The stature itself is compared with all adults of the sex. The adults are simulated: they have
    the spread of ANSUR II (US Army, 2012), with the body mass index of the US public (NHANES, 2021
    to 2023), and they are measured like any other body, in the standard pose.

    Parameters
    ----------
    values : mapping of str to float
        Measurements of the open body by name, in metres, square metres, cubic metres or kilograms.
        Values that nobody has raise an error that suggests another unit.
    sex : {"adult", "woman", "man"}
        Population; for "adult", women and men are weighted by how many of them have the stature.
    stature : float, optional
        The stature, metres; by default the one among the values.

    Returns
    -------
    dict of str to float
        Percentages between 0 and 100; those below 1 and above 99 are extrapolated. NaN for values
        that are NaN, and all NaN if no adult of the sex has such a stature.

    Examples
    --------
    >>> found = rh.measurements.percentiles({"stature": 1.70, "waist girth": 0.75}, "woman")
    >>> 80 < found["stature"] < 95, 10 < found["waist girth"] < 50
    (True, True)
    """
    one_of(sex, "sex", ("adult", *SEXES))
    given = as_mapping(values, list(_adults()["woman"]["measurements"]), may_miss=True)
    height = given.get(_STATURE, np.nan) if stature is None else real_number(stature, "stature")
    check_values({**given, _STATURE: height}, sex)
    if np.isnan(height):
        raise ArgumentError("stature must be given, as an argument or among the values")
    shares = _shares_of_sexes(height, sex)
    percentages = dict.fromkeys(given, float("nan"))
    if not shares:
        return percentages
    for name, value in given.items():
        if not np.isnan(value):
            percentages[name] = sum(
                share * _percentile(name, value, height, group) for group, share in shares.items()
            )
    return percentages


def average_adult(
    stature: float, sex: str = "adult", resolution: str = "full", *, pose: ArrayLike | None = None
) -> Array:
    """Return the average body of a sex and stature.

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
    pose : array_like, shape (J, 3), optional
        Axis-angle rotations of the joints; by default those of the standard pose.

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
    one_of(sex, "sex", ("adult", *SEXES))
    one_of(resolution, "resolution", ("full", "coarse"))
    shares = _shares_of_sexes(real_number(stature, "stature", minimum=0.0, strict=True), sex)
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
    return np.asarray(model(_average_betas(predictor, shares), standing if pose is None else pose))


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


def _percentile(name: str, value: float, stature: float, sex: str) -> float:
    """Return the percentage of one sex with this stature below a value."""
    entry = _adults()[sex]
    intercept, slope = entry["measurements"][name][:2]
    quantiles = entry["measurements"][name][2:]
    mean, _ = entry["log_stature"]
    rest = np.log(value) - intercept - slope * (np.log(stature) - mean)
    scores = ndtri(np.array(_adults()["levels"]) / 100.0)
    score = np.interp(rest, quantiles, scores)
    if not quantiles[0] <= rest <= quantiles[-1]:
        # Beyond the outermost quantile, follow the line through it and the median.
        end = 0 if rest < quantiles[0] else -1
        middle = len(quantiles) // 2
        step = (quantiles[end] - quantiles[middle]) / (scores[end] - scores[middle])
        score = scores[end] + (rest - quantiles[end]) / step
    return float(100.0 * ndtr(score))
