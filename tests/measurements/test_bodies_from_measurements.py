"""Bodies from measurements: they have them, and are the most probable."""

import numpy as np
import pytest

from riemhuman.errors import ArgumentError, ArgumentTypeError
from riemhuman.measurements import (
    model_from_measurements,
    predict_measurements,
)
from riemhuman.measurements.adults import adults
from riemhuman.measurements.bodies_from_measurements import _mixture_of_adults
from riemhuman.measurements.predicted_measurements import predict


def test_adults_of_both_sexes_are_spread_as_their_mixture():
    """Their second moments are those of the sexes, weighted by their shares."""
    shares = {"woman": 0.3, "man": 0.7}
    mean, covariance = _mixture_of_adults(shares)
    moments = np.zeros_like(covariance)
    for sex, share in shares.items():
        alone, within = _mixture_of_adults({sex: 1.0})
        moments += share * (within + np.outer(alone, alone))
    np.testing.assert_allclose(covariance + np.outer(mean, mean), moments, atol=1e-12)
    assert np.trace(covariance) > np.trace(within)


def test_the_rest_is_the_most_probable(measurements, woman_of_four):
    man = model_from_measurements({"stature": 1.65}, "man", resolution="coarse")
    assert man.contradictory == ()
    assert man.message == ""
    loose, woman = (
        model_from_measurements({"stature": 1.95}, "woman", tolerances=t, resolution="coarse")
        for t in ({"stature": 0.2}, None)
    )
    assert abs(woman.values["stature"] - 1.95) < 5e-4
    measured = measurements.measure(np.stack([woman.points, man.points]))
    breadths = measured["shoulder (biacromial) breadth"] / measured["hip breadth"]
    assert breadths[0] < breadths[1]
    assert loose.values["stature"] < woman.values["stature"] - 0.05
    assert max(woman_of_four.improbability, loose.improbability) < woman.improbability


FOUR = {"stature": 1.63, "chest girth": 0.95, "waist girth (omphalion)": 0.87, "hip girth": 1.02}


@pytest.fixture(scope="module")
def woman_of_four():
    return model_from_measurements(FOUR, "woman", resolution="coarse")


def test_contradictory_values_are_named():
    assert predict(FOUR, "woman").contradictory == ()
    wanted = FOUR | {"inside leg height": 0.95}
    person = model_from_measurements(wanted, "woman", resolution="coarse", max_iter=1)
    assert person.contradictory[0] == "inside leg height"
    assert "inside leg height of 0.95 contradicts stature of 1.63" in person.message
    assert abs(person.z_scores["inside leg height"]) > 4.0
    assert predict(wanted, "woman", {"inside leg height": 0.2}).contradictory == ()


TALL = {"stature": 1.827, "body mass": 93.1, "chest girth": 1.021, "hip girth": 1.136}
TALL["waist girth (omphalion)"] = 1.08


def test_no_gradient_of_a_distant_body_ends_the_search(woman_of_four):
    """With signed errors of linearisations, the searches end 0.01 to 0.4 above these costs."""
    wanted = FOUR | {"inside leg height": 0.95}
    other = model_from_measurements(wanted, "woman", resolution="coarse")
    for person, cost in ((woman_of_four, 107.24), (other, 300.68)):
        assert person.converged
        assert person.cost < cost


def test_a_tall_heavy_woman_is_found():
    """Large steps of the search lead to bodies whose waist is not defined."""
    person = model_from_measurements(TALL, "woman", resolution="coarse")
    assert person.converged
    assert abs(person.misses["body mass"]) < 0.05
    assert person.improbability < 10.0
    assert person.message == "the values agree with each other"


def test_single_values_and_misses_are_named():
    person = model_from_measurements({"stature": 1.0}, resolution="coarse", max_iter=1)
    assert person.contradictory == ("stature",)
    assert "stature of 1: at most 1 in 100 adults has such a value" in person.message
    assert "the body misses stature by" in person.message
    child = {"stature": 1.2, "body mass": 22.0}
    person = model_from_measurements(child, resolution="coarse", max_iter=1)
    assert "agree with each other, but at most 1 in 1000 adults" in person.message


def test_the_message_says_which_waist(woman_of_four):
    wanted = {"stature": 1.63, "waist girth": 1.0, "chest girth": 0.95, "hip girth": 1.02}
    person = model_from_measurements(wanted, "woman", resolution="coarse", max_iter=1)
    assert "waist girth" in person.contradictory
    assert "natural waist; if yours was measured at the navel" in person.message
    assert woman_of_four.message == "the values agree with each other"


def test_predictions_need_no_body(woman_of_four):
    predicted = predict_measurements(FOUR, "woman")
    assert predicted.values == woman_of_four.predicted
    assert predicted.std == woman_of_four.predicted_std
    assert predicted.sexes == {"woman": 1.0}
    assert predicted.z_scores == woman_of_four.z_scores
    loose = predict_measurements(FOUR, "woman", tolerances={"hip girth": 0.1})
    assert loose.std["thigh girth"] > 1.1 * predicted.std["thigh girth"]
    wrong = predict_measurements(FOUR | {"inside leg height": 0.95}, "woman")
    assert wrong.contradictory[0] == "inside leg height"
    with pytest.raises(ArgumentError, match="is it in centimetres"):
        predict_measurements({"stature": 170})
    with pytest.raises(ArgumentError, match="did you mean 'waist girth'"):
        predict_measurements({"waist grith": 0.8})


def test_the_body_is_near_the_prediction(measurements, woman_of_four):
    person = woman_of_four
    measured = measurements.measure(person.points, axes="space").to_dict()
    for name in ("hip height", "thigh girth", "neck girth", "body mass"):
        expected = person.predicted[name] + adults()["woman"]["offsets"][name]
        assert abs(measured[name] - expected) < person.predicted_std[name]
    assert "sitting height" in person.predicted
    seated = {"sitting height": 0.95}
    by_seat = model_from_measurements(seated, "woman", resolution="coarse", max_iter=1)
    assert by_seat.values == {}
    assert by_seat.predicted["stature"] > person.predicted["sitting height"] + 0.8


def test_wrong_values():
    for arguments, message in (
        (({"waist grith": 0.8},), "did you mean 'waist girth'"),
        (({"waist girth": -0.8},), "waist girth must be a finite number above 0"),
        (({},), "must map names"),
        (({"stature": "tall"},), "stature must be a"),
        (({"stature": 170},), "stature must be in m, in which the mean of women is 1.63"),
    ):
        with pytest.raises((ArgumentError, ArgumentTypeError), match=message):
            model_from_measurements(*arguments)
    with pytest.raises(ArgumentError, match="there is no measurement 'stature'"):
        model_from_measurements({"waist girth": 0.8}, tolerances={"stature": 1.0})
