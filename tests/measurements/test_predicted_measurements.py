"""Measurements that are predicted from others: calibrated, with a sex that is inferred."""

import numpy as np
import pytest

from riemhuman.measurements.adults import adults
from riemhuman.measurements.predicted_measurements import predict

FOUR = {"stature": 1.63, "chest girth": 0.95, "waist girth (omphalion)": 0.87, "hip girth": 1.02}


@pytest.mark.parametrize("sex", ["woman", "man"])
def test_predictions_are_calibrated(sex):
    """Of people drawn from the statistics, 90 per cent lie within the stated 90 per cent."""
    names, entry = adults()["names"], adults()[sex]
    rng = np.random.default_rng(0)
    people = rng.multivariate_normal(entry["mean"], entry["covariance"], 400)
    rows = [names.index(name) for name in FOUR]
    found = [predict(dict(zip(FOUR, person[rows], strict=True)), sex) for person in people]
    rest = [name for name in names if name not in FOUR]
    mean, std = (
        np.array([[getattr(one, kind)[name] for name in rest] for one in found])
        for kind in ("values", "std")
    )
    errors = people[:, [names.index(name) for name in rest]] - mean
    within = (np.abs(errors) < 1.6449 * std).mean(axis=0)
    assert abs(within.mean() - 0.9) < 0.01
    assert within.min() > 0.83
    assert np.mean([bool(one.contradictory) for one in found]) <= 0.01
    assert np.mean([one.rarity < 0.001 for one in found]) <= 0.001
    # No linear function of the given values explains more.
    inputs = np.column_stack([np.ones(len(people)), people[:, rows]])
    residuals = errors - inputs @ np.linalg.lstsq(inputs, errors, rcond=None)[0]
    assert (errors.std(axis=0) < 1.05 * residuals.std(axis=0)).all()


def test_the_sex_is_inferred():
    woman = predict(FOUR, "adult")
    assert woman.sexes["woman"] > 0.9
    same = predict(FOUR, "woman")
    assert (
        abs(woman.values["neck girth"] - same.values["neck girth"]) < 0.1 * same.std["neck girth"]
    )
    unknown = predict({"stature": 1.69}, "adult")
    assert unknown.std["neck girth"] > 1.2 * predict({"stature": 1.69}, "man").std["neck girth"]
