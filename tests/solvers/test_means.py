"""Fréchet means and medians: below every alternative, whatever the order, start and batches."""

from types import SimpleNamespace

import bodies_in_motion as bodies
import numpy as np
import pytest
from cases import HalfPlane, HyperbolicDistance, sphere_template, triangle_template
from open_bodies import coarse_bodies

from riemhuman.datasets import load_open_bodies
from riemhuman.errors import (
    ArgumentError,
    ConvergenceWarning,
    DegenerateSurfaceError,
    OutsideManifoldError,
    StretchInvarianceWarning,
)
from riemhuman.geometry import (
    AlignedSurfaces,
    EbinMetric,
    ElasticMetric,
    FlatMetric,
    MetricFields,
    NormalFields,
    ProductManifold,
    RotationMetric,
    VectorSpace,
)
from riemhuman.solvers import BasisMean, FrechetMean, GeometricMedian, GradientDescentMean
from riemhuman.solvers._dispersion import Dispersion, area_check, metric_of_search
from riemhuman.surfaces.measures import edge_lengths, triangle_areas


def basis_of(vectors):
    """Return a basis of orthonormal rows, for points of any shape."""
    return SimpleNamespace(flat=vectors, check_fits=len, extend=len)


def every_direction(space):
    return basis_of(np.eye(int(np.prod(space.shape))))


def equipped(a, lam, c):
    space = AlignedSurfaces(coarse_bodies().template, equip=False)
    return space.equip_with_metric(ElasticMetric, a=a, lam=lam, c=c)


def five_people():
    """Return a space with the pose metric, and five people in one pose."""
    return equipped(0.0, 0.0, 1.0), coarse_bodies().points[0:50:10]


def one_person():
    """Return a space with (1, 1, 0), and one person in ten poses."""
    return equipped(1.0, 1.0, 0.0), coarse_bodies().points[:10]


SETS = {"five people": five_people, "one person": one_person}
FIELDS = {
    "normals": NormalFields(sphere_template()),
    "metrics": MetricFields(triangle_template()).equip_with_metric(EbinMetric, lam=2.0),
    "product": ProductManifold(
        [
            MetricFields(triangle_template()).equip_with_metric(EbinMetric, lam=2.0),
            NormalFields(triangle_template()),
        ]
    ),
    "vectors": VectorSpace((4, 2)),
}
on_fields = pytest.mark.parametrize("space", FIELDS.values(), ids=FIELDS)
LINE = VectorSpace((1,))


def near_points(space, n_points=5, rng=3):
    """Return points near enough for means to be unique."""
    points = space.random_point(n_points, rng=rng)
    return space.projection(points[0] + 0.25 * (points - points[0]))


def natural_poses(person, seed):
    """Return a template, and ten poses of one natural body that no setting was chosen on."""
    natural = load_open_bodies("coarse", variant="natural", people=seed)
    return natural.template, natural.points[10 * person : 10 * person + 10]


def test_the_default_mean_of_poses_is_a_body():
    """By normals alone its variance was larger than that of the vertex average."""
    template, points = natural_poses(3, 5)
    space = AlignedSurfaces(template).equip_with_metric(ElasticMetric, a=0.0, lam=0.0, c=1.0)
    mean = FrechetMean(space).fit(points)
    assert mean.result_.converged
    average = Dispersion(space.metric, points).value(points.mean(axis=0))
    assert mean.variance_ < 0.95 * average
    areas = [triangle_areas(f, template.faces).sum() for f in points]
    area = triangle_areas(mean.estimate_, template.faces).sum()
    assert 0.99 * min(areas) < area < 1.01 * max(areas)
    edges = edge_lengths(mean.estimate_, template.edges)
    ratios = edges / edge_lengths(points, template.edges).mean(axis=0)
    assert np.median(ratios) == pytest.approx(1.0, abs=0.005)
    assert np.quantile(ratios, 0.01) > 0.85
    # A search that takes much longer gains next to nothing.
    longer = BasisMean(tolerance=1e-9).solve(space.metric, points)
    assert longer.variances[-1] > mean.result_.variances[-1] * (1 - 3e-3)


@pytest.mark.parametrize("make", SETS.values(), ids=SETS)
def test_mean_is_below_the_euclidean_mean_and_every_sample(make):
    """By what is searched: a metric of normals alone is searched with one of lengths beside it."""
    space, points = make()
    solver = BasisMean(bodies.basis(20), tolerance=1e-10)
    mean = FrechetMean(space, solver).fit(points)
    dispersion = Dispersion(space.metric, points)
    assert mean.result_.converged
    assert mean.variance_ == pytest.approx(dispersion.value(mean.estimate_), rel=1e-10)
    of_search = Dispersion(metric_of_search(space.metric, solver.companion_weight), points)
    assert mean.result_.variances[-1] < of_search.value(points.mean(axis=0))
    assert mean.variance_ < min(dispersion.value(point) for point in points)
    assert np.all(np.diff(mean.result_.variances) <= 0)
    assert mean.n_iter_ == len(mean.result_.variances) - 1
    order = np.random.default_rng(1).permutation(len(points))
    shuffled = FrechetMean(space, solver).fit(points[order])
    assert shuffled.variance_ == pytest.approx(mean.variance_, rel=1e-6)
    gap = space.metric.dist(mean.estimate_, shuffled.estimate_)
    assert gap < 1e-3 * np.sqrt(mean.variance_)


def test_the_papers_algorithm_adds_the_basis_to_the_first_body():
    space, points = five_people()
    solver = BasisMean(bodies.basis(), with_differences=False)
    mean = solver.solve(space.metric, points, initial_point=points[0])
    difference = mean.point - points[0]
    np.testing.assert_allclose(bodies.basis().project(difference), difference, atol=1e-12)
    assert mean.variance < Dispersion(space.metric, points).value(points[0])


def test_weights_pull_the_mean():
    space, points = five_people()
    solver = BasisMean(bodies.basis())
    alone = FrechetMean(space, solver).fit(points, weights=[0, 0, 1, 0, 0])
    assert space.metric.dist(alone.estimate_, points[2]) < 1e-6
    twice = FrechetMean(space, solver).fit(points[:2], weights=[2.0, 1.0])
    thrice = FrechetMean(space, solver).fit(points[[0, 0, 1]])
    assert twice.variance_ == pytest.approx(thrice.variance_, rel=1e-6)
    assert space.metric.dist(twice.estimate_, thrice.estimate_) < 1e-3 * np.sqrt(twice.variance_)


@pytest.mark.everyday("metrics", "vectors")
@on_fields
def test_means_on_fields(space):
    """By descent along logarithms, which cancel at the mean, over a basis, and in batches."""
    points, weights = near_points(space), np.array([1.0, 2.0, 0.5, 1.0, 1.5])
    solver = GradientDescentMean(tolerance=1e-12)
    mean = FrechetMean(space, solver).fit(points, weights=weights)
    logs = space.metric.log(points, mean.estimate_)
    total = np.average(logs, axis=0, weights=weights)
    assert space.metric.norm(total, mean.estimate_) < 1e-7 * np.sqrt(mean.variance_)
    assert space.belongs(mean.estimate_)
    over_all = BasisMean(every_direction(space), with_differences=False, tolerance=1e-14)
    batches = [points[:2], points[2:]]
    for other in (
        FrechetMean(space, over_all).fit(points, weights=weights),
        FrechetMean(space, BasisMean(tolerance=1e-14)).fit(points, weights=weights),
        FrechetMean(space, solver).fit(batches, weights=weights),
        FrechetMean(space, over_all).fit(batches, weights=weights),
    ):
        assert other.variance_ == pytest.approx(mean.variance_, rel=1e-10)
        gap = space.metric.dist(other.estimate_, mean.estimate_)
        assert gap < 1e-6 * np.sqrt(mean.variance_)


def test_mean_of_vectors_is_their_average_in_one_step():
    space = FIELDS["vectors"]
    points = space.random_point(6, rng=0)
    weights = np.arange(1.0, 7.0)
    mean = FrechetMean(space).fit(points, weights=weights)
    np.testing.assert_allclose(mean.estimate_, np.average(points, axis=0, weights=weights))
    start = np.full(space.shape, 3.0)
    one_step = GradientDescentMean().solve(space.metric, points, initial_point=start)
    assert (one_step.n_iterations, one_step.n_evaluations) == (1, 2)
    expected = [np.sum((points - x) ** 2, axis=(1, 2)).mean() for x in (start, one_step.point)]
    np.testing.assert_allclose(one_step.variances, expected)


@pytest.mark.parametrize(
    ("solver", "in_batches"), [(GradientDescentMean(), False), (BasisMean(), True)]
)
def test_median_of_weighted_numbers_is_one_of_them(solver, in_batches):
    """Where the median meets a sample, the others need not balance."""
    numbers, weights = np.array([[0.0], [1.0], [2.0], [3.0], [100.0]]), [1.0, 1.0, 3.0, 2.0, 1.0]
    points = [numbers[:3], numbers[3:]] if in_batches else numbers
    median = GeometricMedian(LINE, solver).fit(points, weights=weights)
    np.testing.assert_allclose(median.estimate_, [2.0], atol=2e-4)
    distances = np.abs(numbers[:, 0] - median.estimate_)
    shares = np.array(weights) / 8.0
    assert median.result_.variances[-1] == pytest.approx(shares @ distances, rel=1e-5)
    assert median.variance_ == pytest.approx(shares @ distances**2)
    assert median.n_iter_ == len(median.result_.variances) - 1
    assert np.all(np.diff(median.result_.variances) < 1e-9)


@pytest.mark.everyday("normals", "metrics")
@on_fields
def test_median_has_the_least_sum_of_distances(space):
    points = near_points(space, 3)
    median = GeometricMedian(space, GradientDescentMean(tolerance=1e-8)).fit(points)

    def total(point):
        return space.metric.dist(points, point).sum()

    best = total(median.estimate_)
    assert best < total(FrechetMean(space).fit(points).estimate_)
    assert np.all(best <= [total(point) + 1e-9 for point in points])
    vectors = space.random_tangent_vec(median.estimate_, 8, rng=5)
    nearby = space.projection(median.estimate_ + 1e-3 * vectors)
    assert np.all(best <= [total(point) for point in nearby])
    over_all = GeometricMedian(space, BasisMean(tolerance=1e-7)).fit(points)
    assert total(over_all.estimate_) == pytest.approx(best, rel=1e-5)


def test_steps_that_never_lower_the_variance_end():
    class Backwards(FlatMetric):
        def log(self, point, base_point):
            """Return the logarithm with the wrong sign."""
            return -super().log(point, base_point)

    metric, points = Backwards(VectorSpace((2,))), np.array([[0.0, 0.0], [1.0, 3.0]])
    with pytest.warns(ConvergenceWarning, match="no step along .* lowers the variance"):
        result = GradientDescentMean().solve(metric, points)
    np.testing.assert_array_equal(result.point, points[0])
    assert (result.n_iterations, result.variance, result.converged) == (0, 5.0, False)


def test_points_without_weight_do_not_count():
    space = FIELDS["normals"]
    points = near_points(space, 3)
    opposite = np.concatenate([[-points[0]], points])
    mean = FrechetMean(space).fit(opposite, weights=[0.0, 1.0, 2.0, 1.0])
    expected = FrechetMean(space).fit(points, weights=[1.0, 2.0, 1.0])
    assert space.metric.dist(mean.estimate_, expected.estimate_) < 1e-7
    assert mean.variance_ == pytest.approx(expected.variance_)


def test_a_search_that_stops_early_says_so():
    space, points = one_person()
    with pytest.warns(ConvergenceWarning, match="BasisMean.*2 iterations"):
        FrechetMean(space, BasisMean(bodies.basis(), max_iter=2)).fit(points)
    with pytest.warns(ConvergenceWarning, match="BasisMean.*9 iterations"):
        FrechetMean(space, BasisMean(max_iter=9)).fit(points)
    fields = FIELDS["normals"]
    with pytest.warns(ConvergenceWarning, match="GradientDescentMean"):
        FrechetMean(fields, GradientDescentMean(max_iter=1)).fit(near_points(fields))


def test_wrong_points_and_settings():
    space, points = five_people()
    solver = BasisMean(bodies.basis())
    for wrong, message in (
        (points[0], "points.*n_points, 1202, 3"),
        (points[:0], "at least one point"),
        (points * np.nan, "points.*NaN"),
        ((point for point in points), "can be read again.*generator"),
        ([points[:0]], "at least one point"),
    ):
        with pytest.raises(ArgumentError, match=message):
            FrechetMean(space, solver).fit(wrong)
    with pytest.raises(ArgumentError, match="3606.*12"):
        FrechetMean(space, BasisMean(basis_of(np.eye(12)))).fit(points)
    fields = NormalFields(triangle_template())
    with pytest.raises(OutsideManifoldError, match="antipodal"):
        FrechetMean(fields).fit(np.array([[[0, 0, 1.0]], [[0, 0, -1.0]]]))


@pytest.mark.everyday("product")
@on_fields
def test_where_the_search_over_a_basis_starts(space):
    points = near_points(space)
    weights = np.array([1.0, 2.0, 0.5, 3.0, 1.5])
    value = Dispersion(space.metric, points, weights).value
    average = value(space.projection(np.average(points, axis=0, weights=weights)))
    lowest = min(average, *(value(point) for point in points))
    states = []
    solver = BasisMean(every_direction(space), callback=lambda *s: states.append(s))
    result = solver.solve(space.metric, points, weights)
    assert result.variances[0] == pytest.approx(lowest, rel=1e-12)
    assert result.converged
    assert [iteration for iteration, _, _ in states] == list(range(1, result.n_iterations + 1))
    for iteration, variance, point in states:
        assert variance == pytest.approx(result.variances[iteration], rel=1e-12)
        assert value(point) == pytest.approx(variance, rel=1e-10)


def test_the_solver_suits_the_metric():
    space = NormalFields(triangle_template())
    points = near_points(space)
    expected = FrechetMean(space, GradientDescentMean()).fit(points).estimate_
    np.testing.assert_array_equal(FrechetMean(space).fit(points).estimate_, expected)
    half_plane = HalfPlane().equip_with_metric(HyperbolicDistance)
    points = half_plane.random_point(5, rng=2)
    mean = FrechetMean(half_plane).fit(points)
    slopes = Dispersion(half_plane.metric, points).value_and_gradient(mean.estimate_)[1]
    assert np.abs(slopes).max() < 1e-2
    median = GeometricMedian(half_plane).fit(points).estimate_
    assert half_plane.metric.dist(median, mean.estimate_) < half_plane.metric.dist(*points[:2])


@pytest.fixture(scope="module")
def ten_bodies():
    """Return two people in five poses."""
    return coarse_bodies().points[:20:2]


WEIGHTS = np.array([1.0, 0.0, 2.0, 1.0, 0.0, 0.0, 0.0, 3.0, 1.0, 1.0])


def batches_of(points, size):
    return [points[first : first + size] for first in range(0, len(points), size)]


@pytest.mark.parametrize(
    ("kind", "lengths", "weighted"),
    [
        ("mean", (0.0, 0.0, 1.0), True),
        ("median", (1.0, 1.0, 0.1), False),
        pytest.param("median", (1.0, 1.0, 0.1), True, marks=pytest.mark.slow),
    ],
)
def test_batches_lead_to_what_all_points_in_memory_have(ten_bodies, kind, lengths, weighted):
    """From the mean of a sample of three points."""
    space, basis = equipped(*lengths), bodies.basis(20)
    weights = WEIGHTS if weighted else None
    estimator = {"mean": FrechetMean, "median": GeometricMedian}[kind]
    solver = BasisMean(basis, with_differences=False, sample_size=3, tolerance=1e-7)
    result = estimator(space, solver).fit(batches_of(ten_bodies, 4), weights=weights).result_
    assert result.converged
    dispersion = Dispersion(space.metric, ten_bodies, weights)
    assert result.variance == pytest.approx(dispersion.value(result.point))
    again = solver.solve(
        space.metric, ten_bodies, weights, result.point, exponent=2 - (kind == "median")
    )
    assert result.variances[-1] == pytest.approx(again.variances[-1], rel=2e-5)


@pytest.mark.parametrize(
    ("change", "error", "message"),
    [
        (lambda body: np.nan * body, ArgumentError, "NaN"),
        (lambda body: 1000.0 * body, ArgumentError, r"points\[2\].*millimetres"),
        (lambda body: 0.0 * body, DegenerateSurfaceError, r"item \(2,\)"),
    ],
)
def test_a_wrong_body_is_named_by_its_batch(ten_bodies, change, error, message):
    points = ten_bodies.copy()
    points[6] = change(points[6])
    metric = ElasticMetric(bodies.space(), 1.0, 1.0, 0.1)
    with pytest.raises(error, match=r"^points\[4:8\]: .*" + message):
        BasisMean(sample_size=2).solve(metric, batches_of(points, 4))


def test_edges_of_a_pose_mean_keep_their_lengths():
    data = coarse_bodies()
    points, metric = data.points[:10:2], ElasticMetric(bodies.space(), 0.0, 0.0, 1.0)
    edges = edge_lengths(points, data.template.edges)

    def range_of(companion_weight):
        solver = BasisMean(bodies.basis(), companion_weight=companion_weight, max_iter=200)
        result = solver.solve(metric, points)
        assert result.variance == pytest.approx(Dispersion(metric, points).value(result.point))
        lengths = edge_lengths(result.point, data.template.edges)
        return (lengths / edges.min(axis=0)).min(), (lengths / edges.max(axis=0)).max()

    shortest, longest = range_of(1.0)
    assert shortest > 0.8
    assert longest < 1.15
    with pytest.warns(StretchInvarianceWarning, match=r"does not measure the lengths of edges"):
        assert range_of(0.0)[0] < 0.75
    with pytest.warns(StretchInvarianceWarning, match=r"RotationMetric"):
        BasisMean(bodies.basis(5), tolerance=0.5).solve(RotationMetric(bodies.space()), points[:2])


def test_triangles_that_collapse_are_refused():
    """Of fifteen unlike bodies under the space's own metric, whose λ is 1e-4."""
    points = coarse_bodies().points[::7]
    metric = ElasticMetric(bodies.space(), 1.0, 1e-4, 0.0)
    with pytest.raises(DegenerateSurfaceError, match=r"use lam = 1, or a medoid"):
        BasisMean(bodies.basis()).solve(metric, points)
    space = AlignedSurfaces(triangle_template(), equip=False)
    flat = space.template.vertices
    check = area_check(space, np.stack([flat, 2.0 * flat, 3.0 * flat]))
    # A hundredth of the median area, that of the second.
    check(0.2 * np.sqrt(1.02) * flat)
    with pytest.raises(DegenerateSurfaceError, match="1 of 1 triangles"):
        check(0.2 * np.sqrt(0.98) * flat)
