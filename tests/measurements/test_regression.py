"""Regression of shape on a measurement: what is there is found, and chance is told from it."""

import numpy as np
import pytest

from riemhuman.datasets import load_open_model
from riemhuman.errors import ArgumentError
from riemhuman.geometry import AlignedSurfaces, ElasticMetric
from riemhuman.measurements import Measurements, regress_shape


@pytest.fixture(scope="module")
def people():
    model = load_open_model("coarse")
    betas = np.random.default_rng(2).normal(size=(12, 16))
    space = AlignedSurfaces(model.template)
    space.equip_with_metric(ElasticMetric, a=1.0, lam=1.0, c=0.1)
    return space, model(betas), Measurements(model)


def test_a_measurement_explains_shape(people):
    space, points, own = people
    waists = own.measure(points)["waist girth"]
    found = regress_shape(space, waists, points, n_permutations=99, rng=0, max_iter=0)
    assert found.p_value == pytest.approx(0.01)
    assert 0.1 < found.explained < 1
    thin, wide = own.measure(found.regression.predict([0.7, 0.95]))["waist girth"]
    assert wide - thin > 0.1


def test_random_numbers_do_not(people):
    space, points, _ = people
    rng = np.random.default_rng(1)
    values = [
        regress_shape(
            space, rng.normal(size=12), points, n_permutations=49, rng=k, max_iter=0
        ).p_value
        for k in range(3)
    ]
    assert np.median(values) > 0.1


def test_people_keep_their_value(people):
    space, points, own = people
    waists = own.measure(points[::2])["waist girth"]
    who = np.repeat(np.arange(6), 2)
    found = regress_shape(
        space, np.repeat(waists, 2), points, people=who, n_permutations=9, rng=0, max_iter=0
    )
    assert found.n_permutations == 9
    with pytest.raises(ArgumentError, match="same for all bodies of a person"):
        regress_shape(space, np.arange(12.0), points, people=who, max_iter=0)
    with pytest.raises(ArgumentError, match="people must have shape"):
        regress_shape(space, np.arange(12.0), points, people=who[1:], max_iter=0)
