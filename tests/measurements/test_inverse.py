"""Bodies from measurements: they have them, and the most probable among those that do."""

import numpy as np
import pytest

from riemhuman.datasets import load_open_bodies, load_open_model
from riemhuman.errors import ArgumentError
from riemhuman.measurements import Measurements, in_standard_pose, model_from_measurements

SIXTEEN = (
    ["stature", "cervical height", "chest girth", "under-bust girth", "waist girth", "hip girth"]
    + ["upper arm girth", "forearm girth", "wrist girth", "thigh girth", "knee girth"]
    + ["calf girth", "neck girth", "arm length", "inside leg height"]
    + ["shoulder (biacromial) breadth"]
)


@pytest.fixture(scope="module")
def own():
    return Measurements(load_open_model("coarse"))


def test_sixteen_of_people_the_model_does_not_hold(own):
    """Natural people have a surface that no shape coefficient describes."""
    bodies = load_open_bodies("coarse", "natural", people=11)
    straight = in_standard_pose(own.definitions, bodies.points[:30:10])
    measured = own.measure(straight, axes="space")
    for row in measured.values:
        wanted = {name: row[own.names.index(name)] for name in SIXTEEN}
        person = model_from_measurements(wanted, resolution="coarse")
        assert person.converged
        assert max(map(abs, person.misses.values())) < 0.002
        assert person.contradictory == ()
        again = Measurements(own.definitions, SIXTEEN).measure(person.points, axes="space")
        np.testing.assert_allclose(again.values, list(person.values.values()), rtol=1e-12)


def test_a_subset_leaves_the_rest_to_probability(own):
    woman = model_from_measurements({"stature": 1.65}, "woman", resolution="coarse")
    man = model_from_measurements({"stature": 1.65}, "man", resolution="coarse")
    assert abs(woman.values["stature"] - 1.65) < 5e-4
    measured = own.measure(np.stack([woman.points, man.points]))
    breadths = measured["shoulder (biacromial) breadth"] / measured["hip breadth"]
    assert breadths[0] < breadths[1]
    # Nobody nearer the mean adult has this stature: moving along any direction of equal stature
    # makes the person less probable.
    short = model_from_measurements({"stature": 1.64}, "woman", resolution="coarse")
    assert short.improbability > woman.improbability


def test_loose_values_give_way_to_probability():
    loose = model_from_measurements(
        {"stature": 1.95}, "woman", tolerances={"stature": 0.2}, resolution="coarse"
    )
    tight = model_from_measurements({"stature": 1.95}, "woman", resolution="coarse")
    assert loose.values["stature"] < tight.values["stature"] - 0.05
    assert loose.improbability < tight.improbability


def test_what_contradicts_is_named(own):
    measured = own.measure(load_open_model("coarse")())
    wanted = {name: float(measured[name]) for name in SIXTEEN}
    person = model_from_measurements(wanted, resolution="coarse")
    assert person.contradictory == ()
    assert "agree" in person.message
    wanted["inside leg height"] += 0.12
    person = model_from_measurements(wanted, resolution="coarse")
    assert person.contradictory[0] == "inside leg height"
    assert "inside leg height of" in person.message


def test_what_is_refused():
    with pytest.raises(ArgumentError, match="did you mean 'waist girth'"):
        model_from_measurements({"waist grith": 0.8})
    with pytest.raises(ArgumentError, match="sex must be one of"):
        model_from_measurements({"waist girth": 0.8}, "w")
    with pytest.raises(ArgumentError, match="waist girth must be a finite number above 0"):
        model_from_measurements({"waist girth": -0.8})
    with pytest.raises(ArgumentError, match="there is no measurement 'stature'"):
        model_from_measurements({"waist girth": 0.8}, tolerances={"stature": 1.0})
    with pytest.raises(ArgumentError, match="must map names"):
        model_from_measurements({})
