"""Regression of bodies on a measurement, and its permutation test."""

import numpy as np
import pytest

from riemhuman.datasets import load_open_model
from riemhuman.errors import ArgumentError
from riemhuman.geometry import AlignedSurfaces, ElasticMetric
from riemhuman.measurements import Measurements
from riemhuman.statistics import regress_shape


@pytest.fixture(scope="module")
def people():
    model = load_open_model("coarse")
    betas = np.clip(np.random.default_rng(2).normal(size=(12, 32)), -1.0, 1.0)
    space = AlignedSurfaces(model.template)
    space.equip_with_metric(ElasticMetric, a=1.0, lam=1.0, c=0.1)
    return space, model(betas), Measurements(model)


def test_a_measurement_explains_shape_and_random_numbers_do_not(people):
    space, points, values = people
    waists = values.measure(points)["waist girth"]
    result = regress_shape(space, waists, points, n_permutations=99, rng=0, max_iter=0)
    assert result.p_value == pytest.approx(0.01)
    assert 0.1 < result.explained < 1
    thin, wide = values.measure(result.regression.predict([0.7, 0.95]))["waist girth"]
    assert wide - thin > 0.1
    numbers = np.random.default_rng(1).normal(size=12)
    result = regress_shape(space, numbers, points, n_permutations=49, rng=0, max_iter=0)
    assert result.p_value > 0.1


def test_people_are_permuted_as_a_whole(people):
    space, points, values = people
    waists = values.measure(points[::2])["waist girth"]
    who = np.repeat(np.arange(6), 2)
    result = regress_shape(
        space, np.repeat(waists, 2), points, people=who, n_permutations=9, rng=0, max_iter=0
    )
    assert result.n_permutations == 9
    with pytest.raises(ArgumentError, match="same for all bodies of a person"):
        regress_shape(space, np.arange(12.0), points, people=who, max_iter=0)
    with pytest.raises(ArgumentError, match="people must hold a label"):
        regress_shape(space, np.arange(12.0), points, people=who[1:], max_iter=0)
    with pytest.raises(ArgumentError, match="same for all bodies of a person"):
        regress_shape(space, np.arange(12.0), points, people=["a", ("b",)] * 6, max_iter=0)
