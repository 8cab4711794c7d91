"""Adults of a stature: percentiles hold for people who were not used, and averages are average."""

import numpy as np
import pytest
from build_percentiles import agreeing_offsets, fitted, public_weights, tails_hold
from scipy.special import ndtri

from riemhuman.errors import ArgumentError
from riemhuman.measurements import (
    average_adult,
    noise_of_measurements,
    percentiles,
)
from riemhuman.measurements.adults import adults
from riemhuman.measurements.populations import (
    has_percentiles,
    largest_body_mass_index,
    scores_of_quantiles,
)

LEVELS = (1.0, 2.5, 5.0, 10.0, 25.0, 50.0, 75.0, 90.0, 95.0, 97.5, 99.0)


def some_people(sex, number, rng):
    """People as ANSUR II has them, whose logarithms are normal; real ones cannot be stored."""
    names, mean = adults()["names"], adults()[sex]["mean"]
    chosen = ["stature", "body mass", "chest girth", "head breadth", "inside leg height"]
    rows = [names.index(name) for name in chosen]
    scale = np.outer(mean, mean)[np.ix_(rows, rows)]
    covariance = adults()[sex]["covariance"][np.ix_(rows, rows)] / scale
    logs = rng.multivariate_normal(np.log(mean[rows]), covariance, number)
    return chosen, np.exp(logs)


@pytest.mark.parametrize("sex", ["woman", "man"])
def test_percentiles_built_from_some_people_hold_for_others(sex):
    rng = np.random.default_rng(7)
    names, people = some_people(sex, 3000, rng)
    _, others = some_people(sex, 3000, rng)
    table = fitted(names, people, sex)
    index = others[:, 1] / others[:, 0] ** 2
    known = people[:, 1] / people[:, 0] ** 2
    weights = public_weights(index, sex) * ((index > known.min()) & (index < known.max()))
    stature = np.log(others[:, 0]) - np.log(people[:, 0]).mean()
    for k, name in enumerate(names):
        rest = np.log(others[:, k]) - table[name][0] - table[name][1] * stature
        scores = scores_of_quantiles(rest, table[name][2:], LEVELS)
        shares = [100 * weights @ (scores < ndtri(q)) / weights.sum() for q in (0.05, 0.5, 0.95)]
        assert np.abs(np.array(shares) - [5.0, 50.0, 95.0]).max() < 4.0, name


def test_definitions_that_do_not_agree_have_no_percentiles():
    # The mean women's and men's chest breadths of the model exceed ANSUR's by 4 and 7 cm.
    wide, narrow = (
        {sex: {"chest breadth": np.array([0.0, 0.0, *(spread * ndtri(np.array(LEVELS) / 100))])}
         for sex in ("woman", "man")}
        for spread in (0.5, 0.06)
    )  # fmt: skip
    assert list(agreeing_offsets(["chest breadth"], wide, adults())) == ["chest breadth"]
    assert not agreeing_offsets(["chest breadth"], narrow, adults())
    assert not has_percentiles("chest breadth")
    found = percentiles({"stature": 1.7, "chest breadth": 0.3}, "woman")
    assert np.isfinite(found["stature"])
    assert np.isnan(found["chest breadth"])


def test_tails_that_do_not_hold_for_others_have_no_percentiles():
    """Few soldiers are as heavy as many women are: some of the girths of women have too few."""
    values = {"stature": 1.7, "calf girth": 0.38, "hip girth": 1.0}
    found = {sex: percentiles(values, sex) for sex in ("woman", "man", "adult")}
    assert [np.isfinite(found[sex]["calf girth"]) for sex in found] == [False, True, False]
    assert all(np.isfinite(found[sex]["hip girth"]) for sex in found)


def test_which_tails_hold():
    of_all = np.array([[5.0, 5.0], [2.9, 5.0], [5.0, 7.1], [3.0, 7.0]])
    tails = np.repeat(of_all[:, np.newaxis], 4, axis=1)
    tails[0, 1:] = 50.0  # thirds by stature are shown, and do not count
    assert tails_hold(tails).tolist() == [True, False, False, True]


@pytest.mark.parametrize(
    ("sex", "published"),
    [("woman", {19.7: 5, 24.1: 25, 28.3: 50, 34.4: 75}), ("man", {20.9: 5, 28.2: 50, 37.8: 90})],
)
def test_body_mass_is_spread_as_in_the_public(sex, published):
    """NHANES, August 2021 to August 2023: Vital Health Stat. 3(50), table 10."""
    # Soldiers reach 40.8 and 43.5 kg/m², the public's 90th and 96th percentile.
    share = {"woman": 0.90, "man": 0.96}[sex]
    assert largest_body_mass_index(sex) == {"woman": 40.8, "man": 43.5}[sex]
    statures = {"woman": 1.63, "man": 1.755}[sex] * np.linspace(0.95, 1.05, 11)
    for index, expected in published.items():
        found = [
            percentiles({"body mass": index * stature**2}, sex, stature=stature)["body mass"]
            for stature in statures
        ]
        assert abs(np.mean(found) - expected / share) < 4.0


def test_the_average_body_is_average(measurements):
    for sex, stature in (("woman", 1.60), ("man", 1.85), ("adult", 1.70)):
        body = average_adult(stature, sex, "coarse")
        measured = measurements.measure(body, axes="space")
        assert measured["stature"] == pytest.approx(stature, abs=1e-4)
        found = np.array([*percentiles(measured.to_dict(), sex, stature=stature).values()])
        assert 35.0 < np.nanmedian(found[1:]) < 65.0


def test_percentiles_grow_with_the_value_also_beyond_the_quantiles():
    girths = np.linspace(0.5, 1.6, 60)
    waist = "waist girth (omphalion)"
    found = [percentiles({waist: girth}, "man", stature=1.75)[waist] for girth in girths]
    assert np.all(np.diff(found) >= 0.0)
    assert found[0] < 0.1
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
    unmeasured = percentiles({"stature": 1.7, "hip girth": float("nan")}, "woman")
    assert np.isnan(unmeasured["hip girth"])
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


def test_people_of_records_are_human():
    percentiles({"stature": 2.72, "body mass": 199.0}, "man")
    percentiles({"stature": 0.65, "body mass": 6.0}, "woman")
    percentiles({"stature": 1.65, "body mass": 260.0, "hip girth": 2.2}, "woman")
