"""What every metric of the registry measures: inner products, distances, energies.

A property is a function that asserts; broken twins of a metric must not pass it.
"""

import autograd.numpy as anp
import numpy as np
import pytest
from autograd import grad
from cases import (
    CASES,
    KINDS,
    HalfPlane,
    HyperbolicDistance,
    HyperbolicInnerProduct,
    cases_that,
    name_of,
    triangle_template,
)
from oracles import taylor_slope

from riemhuman.errors import ArgumentError, ArgumentTypeError
from riemhuman.geometry import AlignedSurfaces, NormalFields, RiemannianMetric, VectorSpace

pytestmark = pytest.mark.usefixtures("strict_floats")

every_kind = pytest.mark.parametrize("case", KINDS, ids=name_of)
every_case = pytest.mark.parametrize("case", CASES.values(), ids=name_of)
with_distance = pytest.mark.parametrize("case", cases_that("dist"), ids=name_of)


def curve(case, t):
    """Return points at times t of a smooth curve from the first point to the second."""
    t = np.reshape(t, (-1,) + (1,) * len(case.space.shape))
    start, end, third = case.points[:3]
    wiggle = 0.3 * t * (1 - t) * (third - start)
    return case.space.projection((1 - t) * start + t * end + wiggle)


# Axioms of a metric.


SMALL = [case for case in cases_that("dist") if np.prod(case.space.shape) <= 9]


def many_points(case, n_samples, rng):
    """Return points far from each other and from any special position."""
    if isinstance(case.space, AlignedSurfaces):
        return np.random.default_rng(rng).standard_normal((n_samples, *case.space.shape))
    return case.space.random_point(n_samples, rng=rng)


def check_axioms(dist, a, b, c):
    ab, bc, ac = dist(a, b), dist(b, c), dist(a, c)
    np.testing.assert_array_equal(ab, dist(b, a))
    assert np.all(dist(a, a) == 0)
    assert np.all(ab > 0)
    assert np.all(ac <= ab + bc + 1e-12)


@pytest.mark.parametrize("case", SMALL, ids=name_of)
def test_axioms_on_many_triples(case):
    a, b, c = (many_points(case, 1_000, rng) for rng in (1, 2, 3))
    check_axioms(case.metric.dist, a, b, c)
    near = case.space.projection(a + 1e-7 * (b - a))
    check_axioms(case.metric.dist, a, near, c)
    check_axioms(case.metric.dist, near, a, b)


@every_case
def test_gram_matrices_hold_inner_products(case):
    metric, x, (v, w) = case.metric, case.points[0], case.tangent_vecs[:2]
    w = case.space.to_tangent(w, x)
    bound = metric.norm(v, x) * metric.norm(w, x)
    vectors = np.stack([v, w])
    gram = [[metric.inner_product(a, b, x) for b in vectors] for a in vectors]
    np.testing.assert_allclose(metric.gram_matrix(vectors, x), gram, atol=1e-7 * bound)
    averaged = np.mean([metric.gram_matrix(vectors, y) for y in case.points[:2]], axis=0)
    found = metric.gram_matrix(vectors, case.points[:2])
    np.testing.assert_allclose(found, averaged, atol=1e-9 * np.abs(averaged).max())


# Gradients.


def check_gradient(function, x, direction):
    gradient = grad(function)(x)
    assert np.all(np.isfinite(gradient))
    assert taylor_slope(function, x, direction, gradient) >= 1.9


@with_distance
def test_gradients_of_squared_dist(case):
    metric, projection, (x, y) = case.metric, case.space.projection, case.points[:2]
    v, w = case.tangent_vecs[:2]
    check_gradient(lambda p: metric.squared_dist(projection(p), y), x, v)
    check_gradient(lambda p: metric.squared_dist(x, projection(p)), y, w)
    check_gradient(lambda p: metric.dist(projection(p), y), x, v)


@every_case
def test_gradients_of_energy_and_length(case):
    metric, projection = case.metric, case.space.projection
    check_gradient(lambda p: metric.energy(projection(p)), case.points, case.tangent_vecs)
    check_gradient(lambda p: metric.length(projection(p)), case.points, case.tangent_vecs)


@every_kind
def test_squared_dists_and_gradient_are_those_of_single_segments(case):
    others, point = case.points[1:], case.points[0]
    weights = np.linspace(0.5, 2.0, len(others))
    squared, gradient = case.metric.squared_dists_and_gradient(point, others, weights)
    segments = [case.metric.energy_and_gradient(np.stack([other, point])) for other in others]
    np.testing.assert_allclose(squared, [value for value, _ in segments], rtol=1e-12)
    expected = sum(w * slopes[1] for w, (_, slopes) in zip(weights, segments, strict=True))
    np.testing.assert_allclose(gradient, expected, rtol=0, atol=1e-12 * np.abs(expected).max())


@every_case
def test_gradients_of_squared_norm(case):
    metric, projection = case.metric, case.space.projection
    x, v = case.points[0], case.tangent_vecs[0]
    if case.metric.has_inner_product:
        direction = case.space.to_tangent(case.tangent_vecs[1], x)
        # Some inner products do not depend on the base point; autograd warns of that.
        check_gradient(
            lambda p: metric.squared_norm(v, projection(p)) + 0.0 * anp.sum(p), x, direction
        )
        check_gradient(lambda p: metric.squared_norm(p, x), v, direction)
        assert np.all(grad(lambda p: metric.norm(p, x))(0 * v) == 0)


@with_distance
def test_coincident_points(case):
    x = case.points[0]
    for function in (case.metric.squared_dist, case.metric.dist):
        np.testing.assert_array_equal(function(case.points, case.points), 0.0)
        for argument in (0, 1):
            np.testing.assert_array_equal(grad(function, argument)(x, x.copy()), 0.0)
    still = np.repeat(case.points[:1], 3, axis=0)
    assert case.metric.energy(still) == case.metric.length(still) == 0
    np.testing.assert_array_equal(grad(case.metric.energy)(still), 0.0)
    np.testing.assert_array_equal(grad(case.metric.length)(still), 0.0)


# Energy and length.


@every_case
def test_energy_and_length_converge_to_the_integrals(case):
    """∫ ‖x'‖² dt and ∫ ‖x'‖ dt, by a Gauss rule and the inner product."""
    nodes, weights = np.polynomial.legendre.leggauss(30)
    nodes = 0.5 + 0.5 * nodes
    velocity = (curve(case, nodes + 1e-5) - curve(case, nodes - 1e-5)) / 2e-5
    points = curve(case, nodes)
    squared = case.metric.squared_norm(case.space.to_tangent(velocity, points), points)
    path = curve(case, np.linspace(0, 1, 257))
    np.testing.assert_allclose(case.metric.energy(path), 0.5 * weights @ squared, rtol=3e-3)
    length = 0.5 * weights @ np.sqrt(squared)
    np.testing.assert_allclose(case.metric.length(path), length, rtol=3e-3)


# Stacks and tables.


@with_distance
def test_dist_pairwise(case):
    metric, points = case.metric, case.points
    expected = metric.dist(points[:, None], points[None])
    double = metric.dist_pairwise(points, precision="double")
    np.testing.assert_allclose(double, expected, rtol=1e-12)
    matrix = metric.dist_pairwise(points)
    np.testing.assert_array_equal(matrix, matrix.T)
    np.testing.assert_array_equal(np.diag(matrix), 0.0)
    np.testing.assert_allclose(matrix, expected, rtol=1e-5)
    for n_jobs in (2, -1):
        np.testing.assert_array_equal(metric.dist_pairwise(points, n_jobs=n_jobs), matrix)
    np.testing.assert_array_equal(metric.dist_pairwise(points[:1]), [[0.0]])
    np.testing.assert_array_equal(metric.dist_pairwise(list(points)), matrix)
    assert metric.dist_pairwise(points[:0]).shape == (0, 0)


WITH_ROWS = [case for case in KINDS if "dist" in case.can and len(case.space.shape) > 1]


@pytest.mark.parametrize("case", WITH_ROWS, ids=name_of)
def test_rows_of_numbers_are_points(case):
    metric, points = case.metric, case.points
    rows = points.reshape(len(points), -1)
    expected = metric.dist(points[0], points[1:])
    np.testing.assert_array_equal(metric.dist(rows[0], rows[1:]), expected)
    np.testing.assert_array_equal(metric.dist_pairwise(rows), metric.dist_pairwise(points))


# Metrics that users define.


def hyperbolic_dist(a, b):
    gap = np.sum((a - b) ** 2)
    return np.arccosh(1 + gap / (2 * a[1] * b[1]))


def test_squared_dist_alone_is_enough():
    space = HalfPlane()
    metric, truth = HyperbolicDistance(space), HyperbolicInnerProduct(space)
    points = space.random_point(6, rng=3)
    a, b = np.random.default_rng(4).standard_normal((2, 6, 2))
    np.testing.assert_allclose(
        metric.inner_product(a, b, points), truth.inner_product(a, b, points), rtol=1e-6
    )
    np.testing.assert_allclose(metric.norm(a, points), truth.norm(a, points), rtol=1e-7)
    np.testing.assert_allclose(
        metric.dist(points[0], points[1]), hyperbolic_dist(points[0], points[1]), rtol=1e-12
    )
    assert np.all(metric.norm(0 * a, points) == 0)
    # Dilations are isometries; and norms grow with vectors, of any length.
    for factor in (1e-4, 1e4):
        found = metric.inner_product(factor * a, factor * b, factor * points)
        np.testing.assert_allclose(found, truth.inner_product(a, b, points), rtol=1e-6)
    for factor in (1e-9, 1e9):
        found = metric.inner_product(factor * a, b, points)
        np.testing.assert_allclose(found, factor * truth.inner_product(a, b, points), rtol=1e-6)


def test_midpoints_are_on_the_manifold():
    """A metric on normal fields that asks for unit vectors and has no closed form."""

    class Picky(RiemannianMetric):
        def inner_product(self, tangent_vec_a, tangent_vec_b, base_point):
            self.space.check_point(base_point, "base_point")
            return anp.sum(tangent_vec_a * tangent_vec_b, axis=(-2, -1))

    space = NormalFields(triangle_template(), equip=False)
    angles = np.linspace(0, 1, 401)
    path = np.stack([np.cos(angles), np.sin(angles), 0 * angles], axis=1)[:, None]
    np.testing.assert_allclose(Picky(space).length(path), 1.0, rtol=1e-5)


def test_inner_product_of_a_distance_alone_at_the_origin():
    """The step of the differences is small there too."""

    class Stretched(RiemannianMetric):
        def squared_dist(self, point_a, point_b):
            return anp.sum((anp.sinh(point_a) - anp.sinh(point_b)) ** 2, axis=-1)

    metric = Stretched(VectorSpace((3,)))
    a, b = np.array([[1.0, -2.0, 0.5], [3.0, 1.0, 1.0]])
    found = metric.inner_product(a, b, np.zeros(3))
    np.testing.assert_allclose(found, a @ b, rtol=1e-7)


# Bad input, and what geomstats has too.


@every_kind
def test_paths_are_checked(case):
    for function in (case.metric.energy, case.metric.length):
        with pytest.raises(ArgumentError, match="path must have at least two times; found 1"):
            function(case.points[:1])
        with pytest.raises(ArgumentError, match=r"path must have shape \(\.\.\., n_times, "):
            function(case.points[0])
        spoilt = case.points.copy()
        spoilt[2, ...] = np.nan
        with pytest.raises(ArgumentError, match=r"path holds \d+ NaN or infinite entries"):
            function(spoilt)


def test_the_closest_neighbour_as_geomstats_has_it():
    space = NormalFields(triangle_template())
    neighbors, points = space.random_point(6, rng=1), space.random_point(4, rng=2)
    expected = space.metric.cdist(points, neighbors).argmin(axis=1)
    found = space.metric.closest_neighbor_index(points, neighbors)
    np.testing.assert_array_equal(found, expected)
    assert space.metric.closest_neighbor_index(points[0], neighbors) == expected[0]


@every_kind
def test_unit_vectors(case):
    metric = case.metric
    units = metric.normalize(case.tangent_vecs, case.points)
    np.testing.assert_allclose(metric.norm(units, case.points), 1.0, rtol=1e-6)
    zero = np.zeros(case.space.shape)
    np.testing.assert_array_equal(metric.normalize(zero, case.points[0]), zero)


def test_base_points_are_optional_where_they_do_not_matter():
    metric = VectorSpace((3, 2)).metric
    a, b = metric.space.random_point(2, rng=1)
    assert metric.norm(a) == pytest.approx(np.linalg.norm(a))
    assert metric.inner_product(a, b) == pytest.approx(np.sum(a * b))
    for name in ("ebin 1 sphere", "normals sphere", "product", "mixed sphere", "edges"):
        case = CASES[name]
        with pytest.raises(ArgumentTypeError, match="point must be an array of real numbers"):
            case.metric.norm(case.tangent_vecs[0])
