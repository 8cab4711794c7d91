"""What every metric of the registry measures, and what it does with geodesics.

A property is a function that asserts; broken twins of a metric must not pass it.
"""

from types import SimpleNamespace

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
    sphere_template,
    triangle_template,
)
from oracles import taylor_slope

from riemhuman.errors import ArgumentError, ArgumentTypeError, NotDefinedError
from riemhuman.geometry import (
    AlignedSurfaces,
    ElasticMetric,
    NormalFields,
    RiemannianMetric,
    SRNFMetric,
    VectorSpace,
)

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


TIMES = np.linspace(0.0, 1.0, 9)


def every(*can):
    return pytest.mark.parametrize("case", cases_that(*can), ids=name_of)


# Declared capabilities.


@pytest.mark.parametrize("case", CASES.values(), ids=name_of)
def test_capabilities_are_as_declared(case):
    metric, (x, y), v = case.metric, case.points[:2], case.tangent_vecs[0]
    calls = {
        "geodesic": lambda: metric.geodesic(x, y)(0.5),
        "exp": lambda: metric.exp(1e-3 * v, x),
        "log": lambda: metric.log(y, x),
    }
    assert metric.has_closed_form_dist == ("dist" in case.can)
    assert metric.has_closed_form_geodesic == ("geodesic" in case.can)
    for capability, call in calls.items():
        if capability in case.can:
            assert np.all(np.isfinite(call()))
    if "dist" in case.can:
        assert np.isfinite(metric.dist(x, y))
    else:
        with pytest.raises(NotDefinedError, match=r"no closed form for .*geodesic_solver="):
            metric.dist(x, y)


def test_strategies_take_one_pair_after_the_other():
    class Straight:
        def solve(self, metric, other, base_point, end_point=0.0):
            assert base_point.shape == other.shape == (2,)
            return SimpleNamespace(
                end=base_point + other, tangent_vec=end_point + other - base_point
            )

    space = HalfPlane()
    solvers = ("exp_solver", "log_solver", "transport_solver")
    metric = HyperbolicInnerProduct(space, **dict.fromkeys(solvers, Straight()))
    points = space.random_point(6, rng=0).reshape(2, 3, 2)
    vectors = 0.1 * points[::-1]
    np.testing.assert_array_equal(metric.exp(vectors, points), points + vectors)
    np.testing.assert_array_equal(metric.exp(vectors, points[0, 1]), points[0, 1] + vectors)
    np.testing.assert_array_equal(metric.log(points, points[1, 2]), points - points[1, 2])
    carried = metric.parallel_transport(vectors, points, end_point=points)
    np.testing.assert_array_equal(carried, points + vectors - points)


# Closed forms of geodesics.


@every("geodesic", "exp", "log")
def test_exp_and_log(case):
    metric, base, points = case.metric, case.points[0], case.points[1:]
    velocities = metric.log(points, base)
    assert np.all(case.space.is_tangent(velocities, base))
    np.testing.assert_allclose(metric.exp(velocities, base), points, atol=1e-12)
    if all(weight > 0 for weight in getattr(metric, "weights", [1.0])):
        norms = metric.norm(velocities, base)
        np.testing.assert_allclose(norms, metric.dist(base, points), rtol=1e-12)
    assert np.all(np.abs(metric.log(base, base)) < 1e-12)
    small = 1e-3 * case.tangent_vecs
    there = metric.exp(small, case.points)
    assert np.all(case.space.belongs(there))
    np.testing.assert_allclose(metric.log(there, case.points), small, atol=1e-12)
    np.testing.assert_allclose(metric.exp(0 * small, case.points), case.points, atol=1e-14)


@every("geodesic", "log")
def test_geodesics(case):
    metric, start, end = case.metric, case.points[0], case.points[1]
    path = metric.geodesic(start, end)(TIMES)
    assert np.all(case.space.belongs(path))
    np.testing.assert_allclose(path[[0, -1]], [start, end], atol=1e-12)
    dist = metric.dist(start, end)
    np.testing.assert_allclose(metric.dist(path[:-1], path[1:]), dist / 8, rtol=1e-10)
    np.testing.assert_allclose(metric.length(path), dist, rtol=1e-12)
    np.testing.assert_allclose(metric.energy(path), dist**2, rtol=1e-12)
    shot = metric.geodesic(start, initial_tangent_vec=metric.log(end, start))(TIMES)
    np.testing.assert_allclose(shot, path, atol=1e-12)
    back = metric.geodesic(end, start)(1 - TIMES)
    np.testing.assert_allclose(back, path, atol=1e-12)


@every("geodesic", "exp", "log")
def test_parallel_transport(case):
    """An isometry that keeps velocities, is undone by the way back, and is a ladder's limit."""
    metric, (start, end) = case.metric, case.points[:2]
    velocity = metric.log(end, start)
    v, w = case.space.to_tangent(case.tangent_vecs[:2], start)
    vectors = np.stack([v, w, velocity])
    moved = metric.parallel_transport(vectors, start, end_point=end)
    assert np.all(case.space.is_tangent(moved, end))
    for i, j in ((0, 0), (0, 1), (1, 1)):
        bound = metric.norm(vectors[i], start) * metric.norm(vectors[j], start)
        product = metric.inner_product(moved[i], moved[j], end)
        expected = metric.inner_product(vectors[i], vectors[j], start)
        assert product == pytest.approx(expected, abs=1e-11 * bound)
    size = np.abs(vectors).max()
    np.testing.assert_allclose(moved[2], -metric.log(start, end), atol=1e-11 * size)
    along = metric.parallel_transport(vectors, start, direction=velocity)
    np.testing.assert_allclose(along, moved, atol=1e-11 * size)
    back = metric.parallel_transport(moved, end, end_point=start)
    np.testing.assert_allclose(back, vectors, atol=1e-11 * size)
    # Transport to a near point, by a rung of Schild's ladder.
    step = 1e-4 * min(1.0, float(metric.norm(velocity, start)))
    short, rung = (step * metric.normalize(one, start) for one in (velocity, v))
    near, ahead = metric.exp(short, start), metric.exp(rung, start)
    middle = metric.exp(0.5 * metric.log(near, ahead), ahead)
    corner = metric.exp(2.0 * metric.log(middle, start), start)
    expected = metric.parallel_transport(rung, start, direction=short)
    gap = metric.norm(metric.log(corner, near) - expected, near)
    assert gap < 1e-6 * metric.norm(expected, near)


# Arguments.


def test_arguments_are_not_changed():
    for case in CASES.values():
        points, vectors = case.points.copy(), case.tangent_vecs.copy()
        points.setflags(write=False)
        vectors.setflags(write=False)
        case.metric.norm(vectors, points)
        case.metric.energy(points)
        if "dist" in case.can:
            case.metric.dist(points[0], points)
            case.metric.dist_pairwise(points)
        if "exp" in case.can:
            case.metric.exp(1e-3 * vectors, points)
            case.metric.geodesic(points[0], points[1])(TIMES)


# Metrics that users define.


def test_exp_and_log_alone_are_enough_for_geodesics():
    class Shifted(RiemannianMetric):
        def exp(self, tangent_vec, base_point):
            return base_point + tangent_vec

        def log(self, point, base_point):
            return point - base_point

    metric = Shifted(VectorSpace((2,)))
    assert metric.has_closed_form_geodesic
    path = metric.geodesic(np.zeros(2), np.array([2.0, 4.0]))([0.0, 0.25, 1.0])
    np.testing.assert_array_equal(path, [[0.0, 0.0], [0.5, 1.0], [2.0, 4.0]])


# Solvers as strategies.


class StraightLine:
    """A solver that takes the straight path."""

    def __init__(self, n_nodes=401):
        self.n_nodes = n_nodes

    def solve(self, metric, start, end):
        t = np.linspace(0, 1, self.n_nodes)[:, None]
        path = (1 - t) * start + t * end
        return SimpleNamespace(path=path, energy=metric.energy(path))


def test_solver_gives_distances_and_geodesics():
    metric = HyperbolicInnerProduct(HalfPlane(), geodesic_solver=StraightLine())
    a, b = np.array([0.5, 1.0]), np.array([0.5, 3.0])
    # The straight path is the geodesic here, at another speed.
    speed_2 = 4 * (1 - 1 / 3)
    np.testing.assert_allclose(metric.squared_dist(a, b), 4 / 3, rtol=1e-4)
    assert metric.squared_dist(a, b) < speed_2
    geodesic = metric.geodesic(a, b)
    np.testing.assert_allclose(geodesic([0.0, 0.3, 1.0]), [a, 0.7 * a + 0.3 * b, b], atol=1e-14)
    points = np.stack([a, b, a + 1])
    matrix = metric.dist_pairwise(points, n_jobs=2)
    np.testing.assert_array_equal(matrix, matrix.T)
    assert matrix[0, 1] == metric.dist(a, b)
    with pytest.raises(ArgumentError, match=r"one pair of points of shape \(2,\); found \(3, 2\)"):
        metric.dist(points, b)


def test_solver_interpolates_along_bends():
    """Every part of the path is that between its own two times, to the ends and beyond."""
    corners = np.array([[0.0, 1.0], [1.0, 3.0], [-2.0, 2.0], [-2.0, 7.0]])

    class Bent:
        def solve(self, metric, start, end):
            return SimpleNamespace(path=corners)

    metric = HyperbolicInnerProduct(HalfPlane(), geodesic_solver=Bent())
    geodesic = metric.geodesic(corners[0], corners[-1])
    times = np.array([-0.5, 0.0, 0.2, 0.5, 1.0, 1.2])
    expected = [[-1.5, -2.0], [0.0, 1.0], [0.6, 2.2], [-0.5, 2.5], [-2.0, 7.0], [-2.0, 10.0]]
    np.testing.assert_allclose(geodesic(times), expected, rtol=1e-14, atol=1e-14)
    np.testing.assert_allclose(geodesic(0.5), [[-0.5, 2.5]], rtol=1e-14)


# Bad input.


def test_arguments_of_geodesics_are_checked():
    metric, (x, y) = CASES["normals sphere"].metric, CASES["normals sphere"].points[:2]
    for arguments in ((x,), (x, y, CASES["normals sphere"].tangent_vecs[0])):
        with pytest.raises(ArgumentError, match="needs end_point or initial_tangent_vec, and not"):
            metric.geodesic(*arguments)
    geodesic = metric.geodesic(x, y)
    with pytest.raises(ArgumentError, match=r"t must be a number or have shape \(n_times,\)"):
        geodesic([[0.0, 1.0]])
    with pytest.raises(ArgumentError, match="t holds 1 NaN"):
        geodesic(np.nan)


BAD_POINTS = {
    "nan": (lambda x: np.where(np.arange(x.size).reshape(x.shape) == 1, np.nan, x), "NaN"),
    "complex": (lambda x: x + 1j, "complex128"),
    "none": (lambda x: None, "must be an array of real numbers; found NoneType None"),
    "flat": (lambda x: x.ravel()[:-1], "must have shape"),
}

LIBRARY_CASES = [case for case in KINDS if not case.name.startswith("half-plane")]


@pytest.mark.parametrize("case", LIBRARY_CASES, ids=name_of)
def test_stacks_of_different_lengths_are_refused(case):
    metric, points, vectors = case.metric, case.points, case.tangent_vecs
    calls = [lambda: metric.norm(vectors[:3], points[:2])]
    if "dist" in case.can:
        calls.append(lambda: metric.dist(points[:3], points[:2]))
    if "exp" in case.can:
        calls += [
            lambda: metric.exp(vectors[:3], points[:2]),
            lambda: metric.log(points[:3], points[:2]),
            lambda: metric.parallel_transport(vectors[:3], points[:3], end_point=points[:2]),
        ]
    for call in calls:
        with pytest.raises(
            ArgumentError, match=r"must be stacks of the same length, or single; found"
        ):
            call()


@pytest.mark.parametrize("name", ["geodesic", "exp", "log", "transport"])
def test_what_is_no_strategy_is_refused(name):
    for wrong, found in ((SimpleNamespace, "the class SimpleNamespace"), (CASES, "dict")):
        message = f"{name}_solver must be an object with a method solve, .*; found {found}"
        with pytest.raises(ArgumentTypeError, match=message):
            ElasticMetric(CASES["mixed open"].space, **{f"{name}_solver": wrong})


@pytest.mark.parametrize(("spoil", "found"), BAD_POINTS.values(), ids=BAD_POINTS)
@pytest.mark.parametrize("case", LIBRARY_CASES, ids=name_of)
def test_bad_points_are_refused(case, spoil, found):
    metric, (x, y), v = case.metric, case.points[:2], case.tangent_vecs[0]
    wrong = spoil(x)
    calls = {"initial_point": lambda: metric.geodesic(wrong, y)}
    # The inner product of a vector space is the same everywhere, and asks for no point.
    if wrong is not None or case.name != "flat":
        calls["base_point"] = lambda: metric.norm(v, wrong)
    if "dist" in case.can:
        calls |= {
            "point_a": lambda: metric.dist(wrong, y),
            "point_b": lambda: metric.squared_dist(x, wrong),
        }
    if wrong is not None:
        calls["end_point"] = lambda: metric.geodesic(x, wrong)
    if "exp" in case.can:
        calls |= {
            "tangent_vec": lambda: metric.exp(spoil(v), x),
            "point": lambda: metric.log(wrong, x),
        }
        if wrong is not None:
            calls["initial_tangent_vec"] = lambda: metric.geodesic(x, initial_tangent_vec=spoil(v))
    for name, call in calls.items():
        with pytest.raises((ArgumentError, ArgumentTypeError)) as error:
            call()
        assert name in str(error.value) or name == "base_point" or "product" in case.name
        assert found in str(error.value)
    for call in (lambda: metric.norm(spoil(v), x), lambda: metric.inner_product(v, spoil(v), x)):
        with pytest.raises((ArgumentError, ArgumentTypeError), match=found):
            call()


@pytest.mark.parametrize("metric_class", [ElasticMetric, SRNFMetric])
def test_a_template_is_no_space(metric_class):
    """As users of other libraries write it."""
    message = f"{metric_class.__name__} takes a space of points, such as AlignedSurfaces"
    with pytest.raises(ArgumentTypeError, match=message):
        metric_class(sphere_template())
