"""Distances from fields that come from no surface: the definition's values and slopes."""

import numpy as np
import pytest
from autograd import value_and_grad
from cases import sphere_template, surfaces

from riemhuman.datasets import load_open_bodies
from riemhuman.geometry import AlignedSurfaces, ElasticMetric, SRNFMetric
from riemhuman.solvers.nearest_surface import image_distances

SPACE = AlignedSurfaces(sphere_template(), equip=False)
POINTS = surfaces(sphere_template(), 4, rng=3)
WEIGHTS = np.array([0.5, 0.0, 0.5])


@pytest.mark.parametrize("abc", [(1.0, 0.5, 0.3), (2.0, 1.0, 0.0), (0.0, 0.0, 1.0), None])
def test_values_and_slopes_are_those_of_the_definition(abc):
    metric = SRNFMetric(SPACE) if abc is None else ElasticMetric(SPACE, *abc)
    target = metric.target_metric
    images = target.space.projection(1.1 * metric.map(POINTS[1:]))

    def mean(surface):
        return np.dot(WEIGHTS, target.squared_dist(metric.map(surface), images))

    value, slope = image_distances(metric, images, WEIGHTS).value_and_gradient(POINTS[0])
    expected, expected_slope = value_and_grad(mean)(POINTS[0])
    assert value == pytest.approx(expected, rel=1e-11)
    np.testing.assert_allclose(slope, expected_slope, atol=1e-10 * np.abs(expected_slope).max())


def test_fields_of_a_surface_lead_near_it():
    metric = ElasticMetric(SPACE, 1.0, 1.0, 1.0)
    distances = image_distances(metric, metric.map(POINTS[1:2]), np.ones(1))
    before = distances.value_and_gradient(POINTS[0])[0]
    assert distances.value_and_gradient(distances.nearby(POINTS[0]))[0] < 0.1 * before


def test_fields_between_poses_lead_near_their_surface():
    """To 0.3 to 0.7 % of the value; to 1.0 to 2.3 % where errors of large triangles counted more
    and no round was extrapolated."""
    bodies = load_open_bodies("coarse")
    metric = ElasticMetric(AlignedSurfaces(bodies.template, equip=False), 1.0, 1.0, 1.0)
    target, standing = metric.target_metric, metric.map(bodies.points[0])
    for pose in (1, 2, 6):
        way = target.log(metric.map(bodies.points[pose]), standing)
        image = target.exp(0.8 * way, standing)[None]
        distances = image_distances(metric, image, np.ones(1))
        before = distances.value_and_gradient(bodies.points[0])[0]
        near = distances.nearby(bodies.points[0])
        assert distances.value_and_gradient(near)[0] < 0.008 * before


@pytest.mark.parametrize("abc", [(1.0, 1.0, 0.0), None])
def test_no_guess_where_a_field_is_missing(abc):
    metric = SRNFMetric(SPACE) if abc is None else ElasticMetric(SPACE, *abc)
    distances = image_distances(metric, metric.map(POINTS[1:2]), np.ones(1))
    np.testing.assert_array_equal(distances.nearby(POINTS[0]), POINTS[0])
