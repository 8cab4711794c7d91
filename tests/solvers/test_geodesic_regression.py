"""Regression finds the geodesic the points were taken from, and the least sum of squares."""

import numpy as np
import pytest
from cases import sphere_template, triangle_template

from riemhuman.errors import ArgumentError, ConvergenceWarning
from riemhuman.geometry import (
    AlignedSurfaces,
    EbinMetric,
    GeneralElasticMetric,
    MetricFields,
    NormalFields,
    ProductManifold,
    ProductMetric,
    VectorSpace,
)
from riemhuman.solvers import GeodesicRegression


def product():
    """Return a product of two fields with weights."""
    space = ProductManifold(
        [
            MetricFields(sphere_template()).equip_with_metric(EbinMetric, lam=2.0),
            NormalFields(sphere_template()),
        ],
        equip=False,
    )
    return space.equip_with_metric(ProductMetric, weights=[2.0, 0.3])


def general_elastic_fields():
    """Return the fields of the general elastic metric with normals."""
    surfaces = AlignedSurfaces(sphere_template(), equip=False)
    return GeneralElasticMetric(surfaces, 1.0, 1.0, 1.0).target_metric.space


FIELDS = {
    "normals": NormalFields(sphere_template()),
    "one sphere": NormalFields(triangle_template()),
    "metrics": MetricFields(triangle_template()).equip_with_metric(EbinMetric, lam=2.0),
    "product": product(),
    "metrics with normals": general_elastic_fields(),
    "vectors": VectorSpace((4, 2)),
}
each_space = pytest.mark.parametrize("space", FIELDS.values(), ids=FIELDS)
TIMES = np.array([160.0, 163.0, 171.0, 174.0, 180.0, 191.0])


def on_a_geodesic(space):
    """Return points at the times, and the point and velocity at their mean."""
    point = space.random_point(rng=1)
    velocity = space.random_tangent_vec(point, rng=2)
    velocity *= 0.04 / np.abs(velocity).max()
    times = (TIMES - TIMES.mean()).reshape(-1, *(1,) * point.ndim)
    return space.metric.exp(times * velocity, point), point, velocity


def scattered(space, size=0.2):
    """Return points around a geodesic."""
    points, _, _ = on_a_geodesic(space)
    noise = space.random_tangent_vec(points, rng=4)
    return space.projection(space.metric.exp(size * noise, points))


def misfit(space, point, velocity, points):
    times = (TIMES - TIMES.mean()).reshape(-1, *(1,) * point.ndim)
    return float(
        np.sum(space.metric.squared_dist(space.metric.exp(times * velocity, point), points))
    )


@each_space
def test_a_geodesic_is_recovered(space):
    points, point, velocity = on_a_geodesic(space)
    found = GeodesicRegression(space).fit(TIMES[:, None], points)
    assert found.center_ == TIMES.mean()
    np.testing.assert_allclose(found.intercept_, point, atol=1e-6)
    np.testing.assert_allclose(found.velocity_, velocity, atol=1e-7)
    np.testing.assert_allclose(found.predict(TIMES), points, atol=1e-6)
    assert found.score(TIMES, points) == pytest.approx(1.0, abs=1e-9)


@pytest.mark.everyday("normals", "metrics")
@each_space
def test_sum_of_squares_is_below_that_in_the_tangent_space_and_all_near(space):
    points = scattered(space)
    found = GeodesicRegression(space).fit(TIMES, points)
    line = GeodesicRegression(space, max_iter=0).fit(TIMES, points)
    assert line.n_iter_ == 0
    best = misfit(space, found.intercept_, found.velocity_, points)
    assert best <= misfit(space, line.intercept_, line.velocity_, points) * (1 + 1e-12)
    for seed in range(4):
        step = 1e-3 * space.random_tangent_vec(found.intercept_, rng=seed)
        moved = space.metric.exp(step, found.intercept_)
        turned = space.to_tangent(found.velocity_, moved)
        assert misfit(space, moved, turned, points) > best
        faster = found.velocity_ + 0.1 * step
        assert misfit(space, found.intercept_, faster, points) > best


def test_refusals():
    space = FIELDS["vectors"]
    points = space.random_point(6, rng=0)
    regression = GeodesicRegression(space)
    fitted = GeodesicRegression(space, max_iter=0).fit(TIMES, points)
    assert fitted.predict([]).shape == (0, *space.shape)
    assert fitted.gram_matrix(points[:0]).shape == (0, 0)
    with pytest.raises(ArgumentError, match="y must hold a point other than the mean"):
        fitted.score(TIMES[:0], points[:0])
    with pytest.raises(ArgumentError, match="5 numbers and y 6 points"):
        regression.fit(TIMES[:5], points)
    with pytest.raises(ArgumentError, match="two different numbers"):
        regression.fit(np.ones(6), points)
    with pytest.raises(ArgumentError, match=r"\(n,\) or \(n, 1\)"):
        regression.fit(np.ones((6, 2)), points)
    surface_space = AlignedSurfaces(sphere_template())
    with pytest.raises(ArgumentError, match="max_iter must be 0 because ElasticMetric"):
        GeodesicRegression(surface_space, image="points").fit(
            TIMES, np.repeat(sphere_template().vertices[None], 6, axis=0)
        )
    sphere = FIELDS["one sphere"]
    with pytest.warns(ConvergenceWarning, match="GeodesicRegression"):
        GeodesicRegression(sphere, max_iter=1, tolerance=1e-14).fit(TIMES, scattered(sphere, 0.6))
    same = np.repeat(sphere.random_point(rng=1)[None], 6, axis=0)
    still = GeodesicRegression(sphere).fit(TIMES, same)
    np.testing.assert_allclose(still.velocity_, 0.0, atol=1e-12)
