"""Distances from fields that come from no surface: the definition's values and slopes."""

import numpy as np
import pytest
from autograd import value_and_grad
from cases import sphere_template, surfaces

from riemhuman.geometry.aligned_surfaces import AlignedSurfaces
from riemhuman.geometry.elastic_metric import ElasticMetric
from riemhuman.geometry.srnf import SRNFMetric
from riemhuman.statistics.image_distances import image_distances

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


@pytest.mark.parametrize("abc", [(1.0, 1.0, 0.0), None])
def test_no_guess_where_a_field_is_missing(abc):
    metric = SRNFMetric(SPACE) if abc is None else ElasticMetric(SPACE, *abc)
    distances = image_distances(metric, metric.map(POINTS[1:2]), np.ones(1))
    np.testing.assert_array_equal(distances.nearby(POINTS[0]), POINTS[0])
