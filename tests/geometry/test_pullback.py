"""Pull-backs of any metric by any map: inner products through the differential."""

import numpy as np
import pytest
from cases import CASES, SURFACES, name_of

from riemhuman.geometry import PullbackMetric

every_surface_metric = pytest.mark.parametrize("case", [*SURFACES, CASES["edges"]], ids=name_of)


def generic(metric):
    """Return the same pull-back without the formulas a subclass has of its own."""
    return PullbackMetric(metric.space, metric.target_metric, metric.map)


@every_surface_metric
def test_inner_products_are_those_of_the_differential(case):
    points, (v, w) = case.points, case.tangent_vecs[:2]
    twin = generic(case.metric)
    expected = twin.inner_product(v, w, points)
    found = case.metric.inner_product(v, w, points)
    np.testing.assert_allclose(found, expected, atol=1e-11 * np.abs(expected).max())


def test_differential_of_a_map_that_reshapes():
    """Base points with more leading axes than the tangent vectors, and the reverse."""
    metric, (x, y), v = (
        CASES["edges"].metric,
        CASES["edges"].points[:2],
        CASES["edges"].tangent_vecs,
    )
    batch = metric.differential(v[0], np.stack([x, y]))
    assert batch.shape == (2, 2, 3)
    np.testing.assert_allclose(batch[1], metric.differential(v[0], y))
    assert metric.differential(v, x).shape == (4, 2, 3)


@every_surface_metric
def test_dist_is_that_of_the_images(case):
    a, b = case.points[:2]
    expected = case.metric.target_metric.dist(case.metric.map(a), case.metric.map(b))
    np.testing.assert_allclose(case.metric.dist(a, b), expected, rtol=1e-13)
    of_images = case.metric.target_metric.energy(case.metric.map(case.points))
    assert case.metric.energy(case.points) == pytest.approx(of_images, rel=1e-12)
