"""Products, weighted sums of their factors (Theorem 2), and pull-backs of any metric by any map."""

import numpy as np
import pytest
from autograd import grad
from cases import (
    CASES,
    SURFACES,
    HalfPlane,
    HyperbolicDistance,
    HyperbolicInnerProduct,
    name_of,
    triangle_template,
)

from riemhuman.errors import ArgumentError, ArgumentTypeError
from riemhuman.geometry import (
    MetricFields,
    NormalFields,
    ProductManifold,
    ProductMetric,
    PullbackMetric,
    VectorSpace,
)

CASE = CASES["product"]
SPACE, METRIC = CASE.space, CASE.metric
EBIN, NORMALS = SPACE.factors


def parts(points):
    return SPACE.project_from_product(points)


def test_points_are_joined_and_split():
    g, n = EBIN.random_point(3, rng=1), NORMALS.random_point(3, rng=2)
    joined = SPACE.embed_to_product([g, n])
    assert joined.shape == (3, 80 * 4 + 80 * 3)
    for part, expected in zip(parts(joined), (g, n), strict=True):
        np.testing.assert_array_equal(part, expected)
    np.testing.assert_array_equal(SPACE.component(joined[0], 1), n[0])
    broadcast = SPACE.embed_to_product([g, n[0]])
    np.testing.assert_array_equal(SPACE.component(broadcast, 1), np.stack([n[0]] * 3))
    slope = grad(lambda x: np.sum(SPACE.embed_to_product([g, x]) * np.arange(560)))(n[0])
    np.testing.assert_allclose(slope.ravel(), 3 * np.arange(320.0, 560.0))


def test_a_product_of_flat_spaces_needs_no_base_point():
    space = ProductManifold([VectorSpace((2,)), VectorSpace((1,))])
    metric, a, b = ProductMetric(space, [1.0, 4.0]), np.ones(3), np.arange(3.0)
    assert metric.inner_product(a, b) == metric.inner_product(a, b, a)
    assert metric.norm(b) == metric.norm(b, a)
    with pytest.raises(ArgumentTypeError, match="base_point must be"):
        METRIC.inner_product(CASE.tangent_vecs[0], CASE.tangent_vecs[0])


def test_sums_of_the_factors():
    (a, b), (v, w) = CASE.points[:2], CASE.tangent_vecs[:2]
    w = SPACE.to_tangent(w, a)
    (ga, na), (gb, nb), (gv, nv), (gw, nw) = parts(a), parts(b), parts(v), parts(w)
    expected = 2.0 * EBIN.metric.squared_dist(ga, gb) + 0.3 * NORMALS.metric.squared_dist(na, nb)
    np.testing.assert_allclose(METRIC.squared_dist(a, b), expected, rtol=1e-14)
    expected = 2.0 * EBIN.metric.inner_product(gv, gw, ga)
    expected += 0.3 * NORMALS.metric.inner_product(nv, nw, na)
    np.testing.assert_allclose(METRIC.inner_product(v, w, a), expected, rtol=1e-12)
    np.testing.assert_array_equal(parts(METRIC.log(b, a))[0], EBIN.metric.log(gb, ga))
    np.testing.assert_array_equal(
        parts(METRIC.exp(0.1 * v, a))[1], NORMALS.metric.exp(0.1 * nv, na)
    )
    path = METRIC.geodesic(a, b)([0.3, 0.4])
    np.testing.assert_array_equal(parts(path)[0], EBIN.metric.geodesic(ga, gb)([0.3, 0.4]))
    equal = ProductMetric(SPACE)
    assert equal.weights == (1.0, 1.0)
    expected = EBIN.metric.squared_dist(ga, gb) + NORMALS.metric.squared_dist(na, nb)
    np.testing.assert_allclose(equal.squared_dist(a, b), expected, rtol=1e-14)


def test_factors_of_weight_zero_are_not_looked_at():
    metric = ProductMetric(SPACE, weights=[0.0, 1.5])
    a, b = CASE.points[:2].copy()
    expected = 1.5 * NORMALS.metric.squared_dist(parts(a)[1], parts(b)[1])
    a[:320] = -1.0
    np.testing.assert_allclose(metric.squared_dist(a, b), expected, rtol=1e-14)
    np.testing.assert_allclose(metric.dist_pairwise(np.stack([a, b]))[0, 1] ** 2, expected)
    plane = HalfPlane().equip_with_metric(HyperbolicInnerProduct)
    mixed = ProductManifold([plane, NORMALS])
    assert not ProductMetric(mixed).has_closed_form_dist
    assert not ProductMetric(mixed).has_closed_form_geodesic
    assert ProductMetric(mixed, weights=[0.0, 1.0]).has_closed_form_dist


def test_tables_of_distances_in_products_of_users_spaces():
    plane = HalfPlane().equip_with_metric(HyperbolicDistance)
    space = ProductManifold([NormalFields(triangle_template()), plane])
    metric, points = ProductMetric(space, [3, 1]), space.random_point(4, rng=8)
    assert metric.has_closed_form_dist
    assert not metric.has_closed_form_geodesic
    tables = [
        factor.metric.dist_pairwise(space.component(points, k))
        for k, factor in enumerate(space.factors)
    ]
    expected = np.sqrt(3.0 * tables[0] ** 2 + tables[1] ** 2)
    np.testing.assert_allclose(metric.dist_pairwise(points), expected, rtol=1e-6)
    np.testing.assert_allclose(metric.cdist(points[:3], points), expected[:3], rtol=1e-6)


def test_refusals():
    with pytest.raises(ArgumentError, match="factors must hold at least one manifold; found none"):
        ProductManifold([])
    with pytest.raises(ValueError, match="shorter"):
        SPACE.embed_to_product([EBIN.random_point(rng=0)])
    with pytest.raises(ArgumentError, match=r"points\[1\] must have shape \(\.\.\., 80, 3\)"):
        SPACE.embed_to_product([EBIN.random_point(rng=0), EBIN.random_point(rng=0)])
    with pytest.raises(ArgumentError, match=r"weights\[1\] must be a finite number of at least 0"):
        ProductMetric(SPACE, weights=[1.0, -1.0])
    with pytest.raises(ArgumentError, match="weights must not all be 0"):
        ProductMetric(SPACE, weights=[0.0, 0.0])
    bare = ProductManifold([NORMALS, MetricFields(triangle_template(), equip=False)], equip=False)
    with pytest.raises(ArgumentError, match=r"factors\[1\] must be equipped.*MetricFields"):
        ProductMetric(bare)


@pytest.mark.parametrize("weights", [(2.0, 0.3), (0.0, 1.5), (0.7, 0.0)])
def test_rounding_adds_up_as_distances_do(weights):
    metric = ProductMetric(SPACE, weights=weights)
    features = metric.features(CASE.points, "single")
    squared = 0.0
    for k, (factor, weight) in enumerate(zip(SPACE.factors, weights, strict=True)):
        part = factor.metric.features(SPACE.component(CASE.points, k), "single")
        rounding = factor.metric.bulk.rounding(part)
        assert np.all(rounding > 0)
        squared = squared + weight * rounding**2
    np.testing.assert_allclose(metric.bulk.rounding(features), np.sqrt(squared), rtol=1e-12)
    assert len(features) == metric.bulk.n_arrays
    np.testing.assert_array_equal(metric.bulk.rounding(metric.features(CASE.points)), 0.0)


# Pull-backs.

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


@every_surface_metric
def test_dist_is_that_of_the_images(case):
    a, b = case.points[:2]
    expected = case.metric.target_metric.dist(case.metric.map(a), case.metric.map(b))
    np.testing.assert_allclose(case.metric.dist(a, b), expected, rtol=1e-13)
    of_images = case.metric.target_metric.energy(case.metric.map(case.points))
    assert case.metric.energy(case.points) == pytest.approx(of_images, rel=1e-12)
