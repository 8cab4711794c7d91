"""Surfaces carried between templates in correspondence."""

import numpy as np
import pytest
from evaluate_codes import mean_error
from training_bodies import random_bodies

from riemhuman.datasets import load_open_model
from riemhuman.errors import ArgumentError
from riemhuman.learned._correspondence import Correspondence
from riemhuman.surfaces.template import Template


@pytest.fixture(scope="module")
def coarse():
    return load_open_model("coarse")


@pytest.fixture(scope="module")
def bodies(coarse):
    return random_bodies(coarse, 2, 1, rng=5)


def test_full_bodies_come_back_from_coarse_ones(coarse, bodies):
    full = load_open_model("full")
    carried = Correspondence(coarse.template, full.template)
    wanted = full(bodies.betas, bodies.poses)
    small = carried.forth(wanted)
    assert small.shape == bodies.points.shape
    found = carried.back(small)
    # What a coarse mesh cannot know of a finer one.
    assert mean_error(found, wanted) < 2.0
    np.testing.assert_allclose(carried.forth(found), small, atol=1e-3)


def test_what_is_not_in_correspondence_is_refused(coarse, bodies):
    other = Template(bodies.points[0], coarse.faces)
    with pytest.raises(ArgumentError, match="correspondence is missing"):
        Correspondence(coarse.template, other)
    with pytest.raises(ArgumentError, match="a row for each of the 1202 vertices"):
        Correspondence(coarse.template, other, np.arange(1000))
    with pytest.raises(ArgumentError, match="must keep most triangles.*0% of the body"):
        Correspondence(coarse.template, other, np.zeros(coarse.n_vertices, dtype=int))
    with pytest.raises(ArgumentError, match="must hold whole numbers from 0"):
        Correspondence(coarse.template, other, np.arange(1, coarse.n_vertices + 1))
