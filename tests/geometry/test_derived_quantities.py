"""Unit vectors, diameters, curvature and injectivity radii, in geomstats' spelling."""

import numpy as np
import pytest
from cases import CASES, KINDS, name_of, sphere_template

from riemhuman.errors import (
    ArgumentTypeError,
    OutsideManifoldError,
)
from riemhuman.geometry import ElasticMetric, SRNFMetric, VectorSpace

every_case = pytest.mark.parametrize("case", KINDS, ids=name_of)
CURVED = [
    CASES[name]
    for name in ("ebin 0.05 sphere", "ebin 1 sphere", "ebin 10 sphere", "ebin 0.5 triangle")
] + [CASES[name] for name in ("normals sphere", "normals triangle", "flat", "product")]
CURVED += [CASES[name] for name in ("rotations sphere", "rotations triangle")]
curved = pytest.mark.parametrize("case", CURVED, ids=name_of)


def two_vectors(case):
    """Return a point and two tangent vectors there."""
    point = case.points[0]
    return point, *(case.space.to_tangent(vector, point) for vector in case.tangent_vecs[:2])


@every_case
def test_unit_vectors(case):
    metric = case.metric
    units = metric.normalize(case.tangent_vecs, case.points)
    np.testing.assert_allclose(metric.norm(units, case.points), 1.0, rtol=1e-6)
    zero = np.zeros(case.space.shape)
    np.testing.assert_array_equal(metric.normalize(zero, case.points[0]), zero)


@curved
def test_curvature_is_how_geodesics_spread(case):
    """d²(exp(εa), exp(εb)) = ε²‖a − b‖² − ε⁴⟨R(a, b)b, a⟩/3 + O(ε⁵)."""
    metric, (x, a, b) = case.metric, two_vectors(case)
    reach = min(1.0, float(metric.injectivity_radius(x)))
    step = 0.02 * reach / float(max(metric.norm(a, x), metric.norm(b, x)))

    def spread(epsilon):
        squared = metric.squared_dist(metric.exp(epsilon * a, x), metric.exp(epsilon * b, x))
        return -3.0 * (squared - epsilon**2 * metric.squared_norm(a - b, x)) / epsilon**4

    expected = 2.0 * spread(step) - spread(2.0 * step)
    scale = float(metric.squared_norm(a, x) * metric.squared_norm(b, x))
    found = metric.curvature_form(a, b, x)
    assert found == pytest.approx(float(expected), rel=5e-4, abs=1e-6 * scale)


@curved
def test_curvature_of_planes(case):
    metric, (x, a, b) = case.metric, two_vectors(case)
    curvature = metric.sectional_curvature(a, b, x)
    # It is a function of the plane.
    np.testing.assert_allclose(
        metric.sectional_curvature(2 * a - b, a + b, x), curvature, rtol=1e-9
    )
    np.testing.assert_allclose(
        metric.sectional_curvature(1e-5 * a, 1e-5 * b, x), curvature, rtol=1e-9
    )
    assert np.isnan(metric.sectional_curvature(a, -2.0 * a, x))
    several = metric.sectional_curvature(case.tangent_vecs, case.tangent_vecs[::-1], case.points)
    assert several.shape == (4,)
    turned = case.space.to_tangent(case.tangent_vecs[3], case.points[0])
    alone = metric.sectional_curvature(case.tangent_vecs[0], turned, case.points[0])
    both = metric.sectional_curvature(case.tangent_vecs[0], np.stack([turned, b]), case.points[0])
    np.testing.assert_allclose(both, [alone, curvature], rtol=1e-12, atol=1e-15)


@curved
def test_geodesics_are_shortest_within_the_injectivity_radius(case):
    metric, (x, a, _) = case.metric, two_vectors(case)
    radius = metric.injectivity_radius(x)
    assert metric.injectivity_radius(case.points).shape == (4,)
    length = 0.99 * float(radius) if np.isfinite(radius) else 100.0
    direction = length * metric.normalize(a, x)
    assert metric.dist(x, metric.exp(direction, x)) == pytest.approx(length, rel=1e-9)


def test_beyond_the_injectivity_radius():
    """On the smallest triangle, the sphere's great circles close and the cone has its apex."""
    for name in ("normals sphere", "rotations sphere", "ebin 1 sphere"):
        case = CASES[name]
        x, metric = case.points[0], case.metric
        weights = case.space.template.face_areas
        radii = np.sqrt(weights)
        if name.startswith("ebin"):
            radii = radii * 4.0 * np.linalg.det(x) ** 0.25
        t = np.argmin(radii)
        direction = np.zeros_like(x)
        # Towards the apex, or along any great circle.
        direction[t] = -x[t] if name.startswith("ebin") else case.tangent_vecs[0][t]
        beyond = 1.01 * metric.injectivity_radius(x) * metric.normalize(direction, x)
        if name.startswith("ebin"):
            with pytest.raises(OutsideManifoldError):
                metric.exp(beyond, x)
        else:
            assert metric.dist(x, metric.exp(beyond, x)) < 0.999 * metric.norm(beyond, x)


def test_base_points_are_optional_where_they_do_not_matter():
    metric = VectorSpace((3, 2)).metric
    a, b = metric.space.random_point(2, rng=1)
    assert metric.norm(a) == pytest.approx(np.linalg.norm(a))
    assert metric.inner_product(a, b) == pytest.approx(np.sum(a * b))
    assert metric.injectivity_radius() == np.inf
    for name in ("ebin 1 sphere", "normals sphere", "product", "mixed sphere", "edges"):
        case = CASES[name]
        with pytest.raises(ArgumentTypeError, match="point must be an array of real numbers"):
            case.metric.norm(case.tangent_vecs[0])


@pytest.mark.parametrize("metric_class", [ElasticMetric, SRNFMetric])
def test_a_template_is_no_space(metric_class):
    """As users of other libraries write it."""
    message = f"{metric_class.__name__} takes a space of points, such as AlignedSurfaces"
    with pytest.raises(ArgumentTypeError, match=message):
        metric_class(sphere_template())
