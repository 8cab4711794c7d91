"""Adults of a stature: percentiles hold for people who were not used, and averages are average."""

import json

import numpy as np
import pytest
from build_percentiles import drawn_betas
from scipy.stats import norm

from riemhuman.datasets import load_open_model
from riemhuman.errors import ArgumentError, RiemhumanError
from riemhuman.measurements import (
    Measurements,
    average_adult,
    noise_of_measurements,
    percentiles,
)
from riemhuman.measurements.measurement_set import DATA

NAMES = ["stature", "waist girth", "hip girth", "thigh girth", "body mass", "inside leg height"]


@pytest.fixture(scope="module")
def measurements():
    return Measurements(load_open_model("coarse"))


@pytest.mark.parametrize("sex", ["woman", "man"])
def test_percentiles_are_even_among_other_people(sex):
    betas = drawn_betas(sex, 120, np.random.default_rng(7), "coarse")
    some = Measurements(load_open_model("coarse"), NAMES)
    points = load_open_model("coarse")(betas, some.definitions.standard_pose_vector)
    values = some.measure(points, axes="space").values
    found = np.array(
        [[*percentiles(dict(zip(NAMES, row, strict=True)), sex).values()] for row in values]
    )
    # Of 120 people, a quarter within four standard deviations of a count; coarse bodies measure
    # millimetres otherwise than full ones.
    for level in (25.0, 50.0, 75.0):
        expected = level / 100.0
        tolerance = 4.0 * np.sqrt(expected * (1.0 - expected) / len(values))
        assert np.abs((found < level).mean(axis=0) - expected).max() < tolerance


@pytest.mark.parametrize(
    ("sex", "published"), [("woman", (19.7, 28.3, 44.9)), ("man", (20.9, 28.2, 42.1))]
)
def test_body_mass_is_spread_as_in_the_public(sex, published):
    # NHANES, August 2021 to August 2023: Vital Health Stat. 3(50), table 10.
    record = json.loads((DATA / "percentiles_of_adults.json").read_text(encoding="utf-8"))[sex]
    mean, std = record["log_stature"]
    statures = np.exp(mean + std * norm.ppf((np.arange(20) + 0.5) / 20))
    for index, expected, tolerance in zip(published, (5, 50, 95), (1.0, 2.0, 1.0), strict=True):
        found = [
            percentiles({"body mass": index * stature**2}, sex, stature=stature)["body mass"]
            for stature in statures
        ]
        assert abs(np.mean(found) - expected) < tolerance


def test_the_average_body_is_average(measurements):
    for sex, stature in (("woman", 1.60), ("man", 1.85), ("adult", 1.70)):
        body = average_adult(stature, sex, "coarse")
        measured = measurements.measure(body, axes="space")
        assert measured["stature"] == pytest.approx(stature, abs=1e-4)
        found = np.array([*percentiles(measured.to_dict(), sex, stature=stature).values()])
        assert 35.0 < np.median(found[1:]) < 65.0


def test_percentiles_grow_with_the_value_also_beyond_the_quantiles():
    girths = np.linspace(0.4, 1.6, 60)
    found = [percentiles({"waist girth": g}, "man", stature=1.75)["waist girth"] for g in girths]
    assert np.all(np.diff(found) >= 0.0)
    assert found[0] < 0.01
    assert found[-1] > 99.9
    # Twice the width in small steps has no jump where the extrapolation begins.
    assert np.diff(found).max() < 12.0


def test_women_and_men_count_by_their_number_at_a_stature():
    value = {"hip girth": 1.0}
    by_sex = {
        sex: percentiles(value, sex, stature=1.55)["hip girth"] for sex in ("woman", "man", "adult")
    }
    assert by_sex["woman"] < by_sex["adult"] < by_sex["man"]
    # Hardly a man is so small.
    assert by_sex["adult"] - by_sex["woman"] < by_sex["man"] - by_sex["adult"]


def test_nobody_has_such_a_stature():
    found = percentiles({"stature": 1.0, "waist girth": 0.6})
    assert np.isnan([*found.values()]).all()
    with pytest.raises(ArgumentError, match="stature must be that of an adult"):
        average_adult(1.0)
    with pytest.raises(ArgumentError, match="stature must be given"):
        percentiles({"waist girth": 0.6})
    with pytest.raises(ArgumentError, match="sex must be one of"):
        percentiles({"stature": 1.7}, "female")
    unmeasured = percentiles({"stature": 1.7, "waist girth": float("nan")}, "woman")
    assert np.isnan(unmeasured["waist girth"])
    assert np.isfinite(unmeasured["stature"])
    # So it is if nothing was measured, and names are checked all the same.
    alone = percentiles({"waist girth": float("nan")}, "woman", stature=1.7)
    assert list(alone) == ["waist girth"]
    assert np.isnan(alone["waist girth"])
    with pytest.raises(ArgumentError, match="did you mean 'waist girth'"):
        percentiles({"wasit girth": float("nan")}, "woman", stature=1.7)
    with pytest.raises(ArgumentError, match="stature must be given"):
        percentiles({"stature": float("nan"), "waist girth": 0.8}, "woman")


def test_noise_has_the_order_of_the_names():
    noise = noise_of_measurements(["waist girth", "no such girth", "stature"])
    assert np.isnan(noise).tolist() == [False, True, False]
    assert (noise[[0, 2]] > 0.001).all()
    assert (noise[[0, 2]] < 0.02).all()


@pytest.mark.parametrize(
    "values", [None, "stature", [1.7], {"stature": "1.7"}, {"stature": None}, {"stature": [1.7]}]
)
def test_percentiles_of_what_is_no_measurement(values):
    with pytest.raises(RiemhumanError, match="must map names|must be a real number"):
        percentiles(values, "woman")
