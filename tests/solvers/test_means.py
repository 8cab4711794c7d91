"""Fréchet means and medians: below every alternative, whatever the order and the start."""

from __future__ import annotations

from dataclasses import dataclass

import autograd.numpy as anp
import bodies_in_motion as bodies
import numpy as np
import pytest
from cases import HalfPlane, HyperbolicDistance, sphere_template, triangle_template

from riemhuman.datasets import load_open_bodies
from riemhuman.errors import (
    ArgumentError,
    ConvergenceWarning,
    DegenerateSurfaceError,
    NotDefinedError,
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
    RiemannianMetric,
    RotationMetric,
    VectorSpace,
)
from riemhuman.solvers import (
    BasisMean,
    DiscreteExponential,
    DiscreteLogarithm,
    GradientDescentMean,
    StreamingMean,
    StreamingMedian,
    means,
)
from riemhuman.solvers._dispersion import AreaCheck, Dispersion, MeanDistance, check_weights
from riemhuman.solvers.means import STARTS, default_mean_solver
from riemhuman.statistics import FrechetMean, GeometricMedian
from riemhuman.surfaces.measures import edge_lengths


@dataclass(frozen=True)
class AllDirections:
    """The basis of all coordinates of a point."""

    size: int

    @property
    def flat(self):
        """The unit vectors."""
        return np.eye(self.size)


def equipped(a, lam, c):
    space = AlignedSurfaces(load_open_bodies("coarse").template, equip=False)
    return space.equip_with_metric(ElasticMetric, a=a, lam=lam, c=c)


def five_people():
    """Return a space with the pose metric, and five people in one pose."""
    return equipped(0.0, 0.0, 1.0), load_open_bodies("coarse").points[0:50:10]


def one_person():
    """Return a space with (1, 1, 0), and one person in ten poses."""
    return equipped(1.0, 1.0, 0.0), load_open_bodies("coarse").points[:10]


SETS = {"five people": five_people, "one person": one_person}


def test_the_medoid_has_the_least_sum_of_squares():
    """By sums of cubes another of the first five points would be."""
    line = VectorSpace((1,))
    for points in ([0, 1, 2, 3, 6], [0, 6, 7, 8, 20]):
        dispersion = Dispersion(line.metric, np.array(points, dtype=float)[:, None])
        values = [dispersion.value(point) for point in dispersion.points]
        assert dispersion.medoid() == np.argmin(values)


@pytest.mark.parametrize("make", SETS.values(), ids=SETS)
def test_mean_is_below_the_euclidean_mean_and_every_sample(make):
    space, points = make()
    mean = FrechetMean(space, BasisMean(bodies.basis())).fit(points)
    dispersion = Dispersion(space.metric, points)
    assert mean.result_.converged
    assert mean.variance_ == pytest.approx(dispersion.value(mean.estimate_), rel=1e-10)
    assert mean.variance_ < dispersion.value(points.mean(axis=0))
    assert mean.variance_ < min(dispersion.value(point) for point in points)
    assert np.all(np.diff(mean.result_.variances) <= 0)
    assert mean.n_iter_ == len(mean.result_.variances) - 1


@pytest.mark.parametrize("make", SETS.values(), ids=SETS)
def test_mean_does_not_depend_on_the_order(make):
    space, points = make()
    solver = BasisMean(bodies.basis(), tolerance=1e-10)
    mean = FrechetMean(space, solver).fit(points)
    shuffled = FrechetMean(space, solver).fit(
        points[np.random.default_rng(1).permutation(len(points))]
    )
    assert shuffled.variance_ == pytest.approx(mean.variance_, rel=1e-6)
    gap = space.metric.dist(mean.estimate_, shuffled.estimate_)
    assert gap < 1e-3 * np.sqrt(mean.variance_)


def test_every_start_leads_to_the_same_mean():
    space, points = five_people()
    variances = [
        FrechetMean(space, BasisMean(bodies.basis(), start=start)).fit(points).variance_
        for start in STARTS
    ]
    np.testing.assert_allclose(variances, variances[0], rtol=1e-5)


def test_the_papers_algorithm_adds_the_basis_to_the_first_body():
    space, points = five_people()
    solver = BasisMean(bodies.basis(), start="first", with_differences=False)
    mean = FrechetMean(space, solver).fit(points)
    difference = mean.estimate_ - points[0]
    np.testing.assert_allclose(bodies.basis().project(difference), difference, atol=1e-12)
    assert mean.variance_ < Dispersion(space.metric, points).value(points[0])


@pytest.mark.parametrize("estimator", [FrechetMean, GeometricMedian])
def test_mean_of_copies_is_the_copy(estimator):
    space, points = five_people()
    mean = estimator(space, BasisMean(bodies.basis())).fit(np.repeat(points[:1], 4, axis=0))
    np.testing.assert_allclose(mean.estimate_, points[0], atol=1e-12)
    assert mean.variance_ == pytest.approx(0.0, abs=1e-20)
    assert mean.result_.converged
    assert mean.n_iter_ == len(mean.result_.variances) - 1
    assert mean.n_iter_ == (estimator is GeometricMedian)
    if estimator is FrechetMean:
        assert mean.result_.n_evaluations == 1


def test_weights_pull_the_mean():
    space, points = five_people()
    solver = BasisMean(bodies.basis())
    alone = FrechetMean(space, solver).fit(points, weights=[0, 0, 1, 0, 0])
    assert space.metric.dist(alone.estimate_, points[2]) < 1e-6
    twice = FrechetMean(space, solver).fit(points[:2], weights=[2.0, 1.0])
    thrice = FrechetMean(space, solver).fit(points[[0, 0, 1]])
    assert twice.variance_ == pytest.approx(thrice.variance_, rel=1e-6)
    assert space.metric.dist(twice.estimate_, thrice.estimate_) < 1e-3 * np.sqrt(twice.variance_)


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


def near_points(space, n_points=5, rng=3):
    """Return points near enough for means to be unique."""
    points = space.random_point(n_points, rng=rng)
    center = points[0]
    return space.projection(center + 0.25 * (points - center))


@pytest.mark.parametrize("space", FIELDS.values(), ids=FIELDS)
def test_basis_mean_agrees_with_gradient_descent_on_fields(space):
    points = near_points(space)
    weights = [1.0, 2.0, 0.5, 1.0, 1.5]
    descent = FrechetMean(space, GradientDescentMean(tolerance=1e-12)).fit(points, weights=weights)
    size = int(np.prod(space.shape))
    solver = BasisMean(AllDirections(size), with_differences=False, tolerance=1e-16)
    direct = FrechetMean(space, solver).fit(points, weights=weights)
    assert direct.variance_ == pytest.approx(descent.variance_, rel=1e-10)
    assert space.metric.dist(direct.estimate_, descent.estimate_) < 1e-6 * np.sqrt(
        descent.variance_
    )
    assert space.belongs(descent.estimate_)


@pytest.mark.parametrize("space", FIELDS.values(), ids=FIELDS)
def test_logarithms_at_the_mean_cancel(space):
    points = near_points(space)
    mean = FrechetMean(space, GradientDescentMean()).fit(points)
    logs = space.metric.log(points, mean.estimate_)
    total = space.metric.norm(logs.mean(axis=0), mean.estimate_)
    assert total < 1e-7 * np.sqrt(mean.variance_)


def test_mean_of_vectors_is_their_average():
    space = FIELDS["vectors"]
    points = space.random_point(6, rng=0)
    weights = np.arange(1.0, 7.0)
    mean = FrechetMean(space, GradientDescentMean()).fit(points, weights=weights)
    np.testing.assert_allclose(mean.estimate_, np.average(points, axis=0, weights=weights))


def test_median_of_numbers_and_of_an_outlier():
    line = VectorSpace((1,))
    numbers = np.array([[0.0], [1.0], [2.0], [7.0], [100.0]])
    median = GeometricMedian(line, GradientDescentMean()).fit(numbers)
    np.testing.assert_allclose(median.estimate_, [2.0], atol=1e-6)


def test_median_of_weighted_numbers_is_one_of_them():
    """Where the median meets a sample, the others need not balance."""
    line = VectorSpace((1,))
    numbers, weights = np.array([[0.0], [1.0], [2.0], [3.0], [100.0]]), [1.0, 1.0, 3.0, 2.0, 1.0]
    median = GeometricMedian(line, GradientDescentMean()).fit(numbers, weights=weights)
    np.testing.assert_allclose(median.estimate_, [2.0], atol=1e-6)
    distances = np.abs(numbers[:, 0] - median.estimate_)
    shares = np.array(weights) / 8.0
    assert median.result_.variances[-1] == pytest.approx(shares @ distances)
    assert median.variance_ == pytest.approx(shares @ distances**2)
    assert median.n_iter_ == len(median.result_.variances) - 1 > 1
    assert np.all(np.diff(median.result_.variances) < 1e-9)


@pytest.mark.parametrize("step", [0.1, 1.0, 1.9, 2.1, 50.0])
def test_any_first_step_leads_to_the_mean(step):
    space = FIELDS["normals"]
    points = near_points(space)
    expected = FrechetMean(space, GradientDescentMean()).fit(points)
    mean = FrechetMean(space, GradientDescentMean(step=step)).fit(points)
    assert space.metric.dist(mean.estimate_, expected.estimate_) < 1e-7
    assert np.all(np.diff(mean.result_.variances) <= 1e-12 * mean.variance_)
    # An evaluation for the start, one for every step, and one whenever a step is halved.
    n_halvings = mean.result_.n_evaluations - mean.n_iter_ - 1
    assert (n_halvings > 0) == (step > 2)
    assert n_halvings < 20


def test_one_step_is_enough_among_vectors():
    space = FIELDS["vectors"]
    points = space.random_point(6, rng=0)
    start = np.full(space.shape, 3.0)
    found = GradientDescentMean().solve(space.metric, points, initial_point=start)
    assert (found.n_iterations, found.n_evaluations) == (1, 2)
    np.testing.assert_allclose(found.point, points.mean(axis=0), atol=1e-14)
    expected = [np.sum((points - x) ** 2, axis=(1, 2)).mean() for x in (start, found.point)]
    np.testing.assert_allclose(found.variances, expected)


def test_steps_that_never_lower_the_variance_end():
    class Backwards(FlatMetric):
        def log(self, point, base_point):
            """Return the logarithm with the wrong sign."""
            return -super().log(point, base_point)

    metric, points = Backwards(VectorSpace((2,))), np.array([[0.0, 0.0], [1.0, 3.0]])
    with pytest.warns(ConvergenceWarning, match="no step along .* lowers the variance"):
        found = GradientDescentMean().solve(metric, points)
    np.testing.assert_array_equal(found.point, points[0])
    assert (found.n_iterations, found.variance, found.converged) == (0, 5.0, False)
    # 2⁻¹⁹ is the last step above a millionth.
    assert found.n_evaluations == 21
    with pytest.warns(ConvergenceWarning, match="no step along .* lowers the variance"):
        found = GradientDescentMean(step=4e-6).solve(metric, points)
    # A millionth itself is still tried.
    assert found.n_evaluations == 4


LINE = VectorSpace((1,))


@pytest.mark.parametrize("scale", [1e-6, 1.0, 1e6])
def test_descent_stops_within_a_share_of_the_standard_deviation(scale):
    solver, points = GradientDescentMean(tolerance=1e-2), scale * np.array([[-1.0], [1.0]])
    for start, n_iterations in ((0.9e-2, 0), (1.1e-2, 1)):
        found = solver.solve(LINE.metric, points, initial_point=np.array([start * scale]))
        assert found.converged
        assert found.n_iterations == n_iterations


def test_no_step_raises_the_variance():
    # The whole step leads from 1 to −1.005, where the variance is half a hundredth larger.
    points, start = np.array([[-1.0], [1.0]]), np.array([1.0])
    found = GradientDescentMean(step=2.005).solve(LINE.metric, points, initial_point=start)
    np.testing.assert_allclose(found.variances[:2], [2.0, 1.0 + 0.0025**2], rtol=1e-12)
    assert np.all(np.diff(found.variances) <= 1e-12)


@pytest.mark.parametrize("scale", [2.0**-30, 2.0**30])
def test_median_takes_as_many_rounds_at_any_scale(scale):
    numbers, weights = np.array([[0.0], [1.0], [2.0], [3.0], [100.0]]), [1.0, 1.0, 3.0, 2.0, 1.0]
    one, other = (
        GeometricMedian(LINE, GradientDescentMean()).fit(factor * numbers, weights=weights)
        for factor in (1.0, scale)
    )
    assert one.n_iter_ == other.n_iter_
    np.testing.assert_allclose(other.estimate_, scale * one.estimate_, rtol=1e-9)


def test_settings_of_medians():
    median = GeometricMedian(LINE, GradientDescentMean())
    assert (median.tolerance, median.max_iter) == (1e-9, 200)
    for settings in ({"tolerance": 0.0}, {"max_iter": 0}):
        with pytest.raises(ArgumentError, match=next(iter(settings))):
            GeometricMedian(LINE, GradientDescentMean(), **settings).fit(np.ones((2, 1)))


def test_median_counts_the_evaluations_of_all_means():
    counts = []

    class Counted:
        """A solver that remembers how many evaluations it took."""

        def solve(self, *arguments, **settings):
            found = GradientDescentMean().solve(*arguments, **settings)
            counts.append(found.n_evaluations)
            return found

    median = GeometricMedian(LINE, Counted()).fit(np.array([[0.0], [1.0], [5.0]]))
    assert median.n_iter_ == len(counts) - 1 > 1
    assert median.result_.n_evaluations == sum(counts)


def test_gradient_of_the_dispersion():
    space = FIELDS["metrics"]
    points = near_points(space, 4)
    weights = np.array([3.0, 0.0, 1.0, 0.5])
    seen = []

    class Watched(EbinMetric):
        def energy_and_gradient(self, path):
            seen.append(path[0])
            return super().energy_and_gradient(path)

    dispersion = Dispersion(Watched(space, lam=2.0), points, weights)
    x = space.projection(points.mean(axis=0))
    value, gradient = dispersion.value_and_gradient(x)
    # Points of no weight are not looked at.
    np.testing.assert_array_equal(seen, points[weights > 0])
    squared = np.array([space.metric.squared_dist(point, x) for point in points])
    assert value == pytest.approx(weights @ squared / 4.5, rel=1e-12)
    assert dispersion.value(x) == pytest.approx(value, rel=1e-12)
    direction = space.random_tangent_vec(x, rng=3)
    ahead, behind = (dispersion.value(x + step * direction) for step in (1e-5, -1e-5))
    assert np.sum(gradient * direction) == pytest.approx((ahead - behind) / 2e-5, rel=1e-7)


def test_weights_of_any_sum():
    for sum_of_weights in (1e-6, 0.5, 1.0, 40.0):
        weights = sum_of_weights * np.array([0.25, 0.0, 0.75])
        np.testing.assert_allclose(check_weights(weights, 3), [0.25, 0.0, 0.75], rtol=1e-12)
    np.testing.assert_array_equal(check_weights(None, 4), [0.25] * 4)
    with pytest.raises(ArgumentError, match=r"weights must have shape \(3\); found \(1, 3\)"):
        check_weights(np.ones((1, 3)), 3)


def test_points_of_no_weight_are_not_looked_at():
    space = FIELDS["normals"]
    points = near_points(space, 3)
    opposite = np.concatenate([[-points[0]], points])
    weights = [0.0, 1.0, 2.0, 1.0]
    mean = FrechetMean(space, GradientDescentMean()).fit(opposite, weights=weights)
    expected = FrechetMean(space, GradientDescentMean()).fit(points, weights=weights[1:])
    assert space.metric.dist(mean.estimate_, expected.estimate_) < 1e-7
    assert mean.variance_ == pytest.approx(expected.variance_)


@pytest.mark.parametrize("space", FIELDS.values(), ids=FIELDS)
def test_median_has_the_least_sum_of_distances(space):
    points = near_points(space)
    median = GeometricMedian(space, GradientDescentMean()).fit(points)

    def total(point):
        return space.metric.dist(points, point).sum()

    mean = FrechetMean(space, GradientDescentMean()).fit(points).estimate_
    best = total(median.estimate_)
    assert best < total(mean)
    assert np.all(best <= [total(point) + 1e-9 for point in points])
    vectors = space.random_tangent_vec(median.estimate_, 8, rng=5)
    nearby = space.projection(median.estimate_ + 1e-3 * vectors)
    assert np.all(best <= [total(point) for point in nearby])


def test_median_of_bodies_is_below_their_mean():
    space, points = five_people()
    solver = BasisMean(bodies.basis())
    median = GeometricMedian(space, solver).fit(points)
    mean = FrechetMean(space, solver).fit(points)

    def total(point):
        return space.metric.dist(points, point).sum()

    assert total(median.estimate_) < total(mean.estimate_)


class VertexDistance(RiemannianMetric):
    """A user's metric by its squared distance alone."""

    def squared_dist(self, point_a, point_b):
        """Return Σ ‖a − b‖²."""
        return anp.sum((point_a - point_b) ** 2, axis=(-2, -1))


def test_users_metrics_run_unchanged():
    space, points = five_people()
    space.equip_with_metric(VertexDistance)
    mean = FrechetMean(space, BasisMean(bodies.basis().truncate(4))).fit(points)
    np.testing.assert_allclose(mean.estimate_, points.mean(axis=0), atol=1e-6)


def test_callback_and_interruption():
    space, points = one_person()
    seen = []

    def interrupt(iteration, variance, point):
        seen.append(variance)
        if iteration == 3:
            raise KeyboardInterrupt

    solver = BasisMean(bodies.basis(), callback=interrupt)
    with pytest.warns(ConvergenceWarning, match="interrupted"):
        mean = FrechetMean(space, solver).fit(points)
    assert len(seen) == 3
    assert not mean.result_.converged
    assert mean.variance_ <= seen[-1]
    assert mean.variance_ == pytest.approx(Dispersion(space.metric, points).value(mean.estimate_))


def test_what_has_not_converged_says_so():
    space, points = one_person()
    with pytest.warns(ConvergenceWarning, match="BasisMean.*2 iterations"):
        FrechetMean(space, BasisMean(bodies.basis(), max_iter=2)).fit(points)
    fields = FIELDS["normals"]
    with pytest.warns(ConvergenceWarning, match="GradientDescentMean"):
        FrechetMean(fields, GradientDescentMean(max_iter=1)).fit(near_points(fields))
    with pytest.warns(ConvergenceWarning, match="GeometricMedian"):
        GeometricMedian(fields, GradientDescentMean(), max_iter=1).fit(near_points(fields))


def test_weights_as_large_or_as_small_as_numbers_get():
    for size in (1e308, 1e-308):
        weights = check_weights(size * np.array([1.0, 0.0, 0.5, 1.5]), 4)
        np.testing.assert_allclose(weights, np.array([2, 0, 1, 3]) / 6, rtol=1e-14)


@pytest.mark.parametrize("name", ["a", "lam", "c"])
def test_weights_of_metrics_whose_distances_overflow_are_refused(name):
    with pytest.raises(ArgumentError, match=f"{name} must be at most 1e.?60; found 1e.?308"):
        equipped(**({"a": 1.0, "lam": 1.0, "c": 1.0} | {name: 1e308}))


def test_refusals():
    space, points = five_people()
    solver = BasisMean(bodies.basis())
    with pytest.raises(ArgumentError, match="points.*n_points, 1202, 3"):
        FrechetMean(space, solver).fit(points[0])
    with pytest.raises(ArgumentError, match="at least one point"):
        FrechetMean(space, solver).fit(points[:0])
    with pytest.raises(ArgumentError, match="points.*NaN"):
        FrechetMean(space, solver).fit(points * np.nan)
    with pytest.raises(ArgumentError, match="weights"):
        FrechetMean(space, solver).fit(points, weights=[1.0, 2.0])
    with pytest.raises(ArgumentError, match="smallest is -1"):
        FrechetMean(space, solver).fit(points, weights=[1, 1, 1, 1, -1])
    with pytest.raises(ArgumentError, match="largest 0"):
        check_weights(np.zeros(3), 3)
    with pytest.raises(ArgumentError, match="3606.*12"):
        FrechetMean(space, BasisMean(AllDirections(12))).fit(points)
    with pytest.raises(NotDefinedError, match="log"):
        FrechetMean(space, GradientDescentMean()).fit(points)
    with pytest.raises(ArgumentError, match="start.*'median'"):
        BasisMean(bodies.basis(), start="median")
    fields = NormalFields(triangle_template())
    with pytest.raises(OutsideManifoldError, match="antipodal"):
        FrechetMean(fields, GradientDescentMean()).fit(np.array([[[0, 0, 1.0]], [[0, 0, -1.0]]]))


@pytest.mark.parametrize("scale", [1e-6, 1.0, 1e6])
def test_points_that_coincide_to_rounding(scale):
    space = FIELDS["vectors"]
    point = scale * np.random.default_rng(8).uniform(0.5, 1.0, space.shape)
    solver = BasisMean(AllDirections(8), with_differences=False)
    for apart, coincide in ((1e-15, True), (1e-7, False), (1e-3, False)):
        points = np.stack([point, (1.0 + apart) * point])
        found = solver.solve(space.metric, points, initial_point=point)
        assert found.converged
        assert (found.message == "all points coincide") == coincide
        assert (found.n_iterations == 0) == coincide
        np.testing.assert_allclose(found.point, points.mean(axis=0), rtol=max(1e-2 * apart, 1e-15))


@pytest.mark.parametrize("space", FIELDS.values(), ids=FIELDS)
def test_descent_from_the_mean_itself_takes_no_step(space):
    point = space.random_point(rng=9)
    found = GradientDescentMean().solve(space.metric, np.stack([point, point, point]))
    assert found.converged
    assert (found.n_iterations, found.n_evaluations) == (0, 1)
    np.testing.assert_array_equal(found.point, point)


@pytest.mark.sampled(5)
@pytest.mark.parametrize("space", FIELDS.values(), ids=FIELDS)
@pytest.mark.parametrize("start", STARTS)
def test_where_the_search_over_a_basis_starts(space, start):
    points = near_points(space)
    weights = np.array([1.0, 2.0, 0.5, 3.0, 1.5])
    value = Dispersion(space.metric, points, weights).value
    at_points = [value(point) for point in points]
    average = value(space.projection(np.average(points, axis=0, weights=weights)))
    expected = {
        "first": at_points[0],
        "medoid": min(at_points),
        "euclidean": average,
        "lowest": min(*at_points, average),
    }
    solver = BasisMean(AllDirections(int(np.prod(space.shape))), start=start)
    found = solver.solve(space.metric, points, weights)
    assert found.variances[0] == pytest.approx(expected[start], rel=1e-12)
    assert found.converged


def test_the_lowest_start_may_be_a_point():
    """Of a heavy point and one beyond a fold the average is worse than either."""

    class Folded(RiemannianMetric):
        def squared_dist(self, point_a, point_b):
            """Return the squared distance on the parabola y = 30 x²."""
            lift = anp.stack([point_a, 30.0 * point_a**2]) - anp.stack([point_b, 30.0 * point_b**2])
            return anp.sum(lift**2, axis=(0, -1))

    metric, points = Folded(VectorSpace((1,))), np.array([[-1.0], [1.0], [1.1]])
    found = BasisMean(AllDirections(1)).solve(metric, points, weights=np.array([1.0, 9.0, 0.0]))
    # d² from the other is 4; the rest of the weight is at the point.
    assert found.variances[0] == pytest.approx(0.4)


@pytest.mark.parametrize(("share", "is_met"), [(0.97, True), (1.03, False)])
def test_tolerance_of_means_is_the_share_that_a_newton_step_would_gain(share, is_met):
    """Among vectors a shift s from their average adds ‖s‖² to the variance."""
    space = FIELDS["vectors"]
    points, weights = space.random_point(6, rng=0), np.arange(1.0, 7.0)
    average = np.average(points, axis=0, weights=weights)
    start = average + 0.1 * space.random_point(rng=5)
    gain = np.sum((start - average) ** 2)
    variance = Dispersion(space.metric, points, weights).value(start)
    solver = BasisMean(
        AllDirections(8), with_differences=False, tolerance=float(gain / variance / share)
    )
    found = solver.solve(space.metric, points, weights, initial_point=start)
    assert found.converged
    assert (found.n_iterations == 0) == is_met
    assert found.variances[0] == pytest.approx(variance)
    if is_met:
        np.testing.assert_allclose(found.point, start, rtol=1e-14)
        assert found.n_evaluations == 1


@dataclass(frozen=True)
class Rows:
    """A basis of these vectors."""

    flat: np.ndarray


@pytest.mark.parametrize("scale", [1e-6, 1.0, 1e6])
def test_differences_join_the_basis(scale):
    """From the first point and a vector of the basis alone the average is out of reach."""
    space = FIELDS["vectors"]
    points = scale * (2.0 + 1e-3 * space.random_point(5, rng=4))
    basis = Rows(np.eye(8)[:1])
    found = BasisMean(basis, start="first", tolerance=1e-14).solve(space.metric, points)
    np.testing.assert_allclose(found.point, points.mean(axis=0), atol=1e-7 * scale)
    without = BasisMean(basis, start="first", with_differences=False).solve(space.metric, points)
    np.testing.assert_array_equal(without.point.ravel()[1:], points[0].ravel()[1:])
    assert without.variance > found.variance


@pytest.mark.parametrize("height", [0.0, 1.0])
def test_nothing_but_differences_joins_the_basis(height):
    """Points on a line stay on it, though the metric would have their mean elsewhere."""

    class Bent(RiemannianMetric):
        def squared_dist(self, point_a, point_b):
            """Return the squared distance of (x, y + x²)."""
            x, y = (point_a - point_b)[..., 0], (point_a - point_b)[..., 1]
            return x**2 + (y + point_a[..., 0] ** 2 - point_b[..., 0] ** 2) ** 2

    metric = Bent(VectorSpace((2,)))
    points = np.array([[0.0, height], [1.0, height], [-1.5, height]])
    line = Rows(np.array([[1.0, 0.0]]))
    found = BasisMean(line, start="first").solve(metric, points)
    assert found.n_iterations > 0
    assert found.point[1] == height
    free = BasisMean(AllDirections(2), start="first").solve(metric, points)
    assert free.variance < found.variance
    lift = (1 + 1.5**2) / 3 - (0.5 / 3) ** 2
    np.testing.assert_allclose(free.point[1], height + lift, atol=1e-3)


@pytest.mark.parametrize("space", FIELDS.values(), ids=FIELDS)
def test_callback_of_the_search_over_a_basis(space):
    points, seen = near_points(space), []
    solver = BasisMean(
        AllDirections(int(np.prod(space.shape))),
        start="first",
        tolerance=1e-14,
        callback=lambda *state: seen.append(state),
    )
    found = solver.solve(space.metric, points)
    assert [iteration for iteration, _, _ in seen] == list(range(1, found.n_iterations + 1))
    value = Dispersion(space.metric, points).value
    for iteration, variance, point in seen:
        assert variance == pytest.approx(found.variances[iteration], rel=1e-12)
        assert value(point) == pytest.approx(variance, rel=1e-10)
    assert found.n_evaluations >= found.n_iterations + 1
    assert value(found.point) == pytest.approx(found.variance, rel=1e-10)


def test_zeros_coincide():
    zeros = np.zeros((3, 4, 2))
    found = BasisMean(AllDirections(8)).solve(FIELDS["vectors"].metric, zeros)
    assert (found.variance, found.n_evaluations, found.converged) == (0.0, 1, True)
    assert found.message == "all points coincide"
    np.testing.assert_array_equal(found.point, zeros[0])


def test_means_have_a_solver_that_suits_the_metric():
    space = NormalFields(triangle_template())
    points = near_points(space)
    expected = FrechetMean(space, GradientDescentMean()).fit(points).estimate_
    np.testing.assert_array_equal(FrechetMean(space).fit(points).estimate_, expected)
    half_plane = HalfPlane().equip_with_metric(HyperbolicDistance)
    points = half_plane.random_point(5, rng=2)
    mean = FrechetMean(half_plane).fit(points)
    assert isinstance(default_mean_solver(half_plane.metric), BasisMean)
    slopes = Dispersion(half_plane.metric, points).value_and_gradient(mean.estimate_)[1]
    assert np.abs(slopes).max() < 1e-4
    strategies = {"exp_solver": DiscreteExponential(), "log_solver": DiscreteLogarithm()}
    metric = HyperbolicDistance(half_plane, **strategies)
    assert isinstance(default_mean_solver(metric), BasisMean)
    median = GeometricMedian(half_plane).fit(points).estimate_
    assert half_plane.metric.dist(median, mean.estimate_) < half_plane.metric.dist(*points[:2])


def test_without_a_basis_the_differences_are_needed():
    with pytest.raises(ArgumentError, match="with_differences must be True where there is no basi"):
        BasisMean(with_differences=False)


@pytest.mark.parametrize("start", ["euclidean", "lowest"])
@pytest.mark.parametrize("weights", [(1.0, 1.0, 0.1), (0.0, 0.0, 1.0)])
def test_mean_of_a_body_and_itself_turned_by_half_a_turn(weights, start):
    """Their average has triangles without area; the search starts at one of the two."""
    points = np.stack([bodies.body("resting"), bodies.body("resting") * [-1.0, 1.0, -1.0]])
    metric = ElasticMetric(bodies.space(), *weights)
    assert not metric.space.belongs(points.mean(axis=0))
    result = BasisMean(start=start, tolerance=1e-3).solve(metric, points)
    assert metric.space.belongs(result.point)
    assert result.variances[-1] <= result.variances[0]


POINTS = load_open_bodies("coarse").points[:20:2]
WEIGHTS = np.array([1.0, 0.0, 2.0, 1.0, 0.0, 0.0, 0.0, 3.0, 1.0, 1.0])


class Reader:
    """Slices of points, and how many were read at once."""

    def __init__(self, points):
        self.points, self.largest = points, 0

    def __len__(self):
        return len(self.points)

    def __getitem__(self, some):
        found = self.points[some]
        self.largest = max(self.largest, len(found))
        return found


@pytest.mark.parametrize("lengths", [(1.0, 1.0, 0.1), (0.0, 0.0, 1.0)])
@pytest.mark.parametrize("weights", [None, WEIGHTS])
def test_the_mean_is_that_of_the_points_in_memory(lengths, weights):
    metric, basis = ElasticMetric(bodies.space(), *lengths), bodies.basis(20)
    reader = Reader(POINTS)
    streaming = StreamingMean(basis, with_differences=False, sample_size=3, batch_size=4)
    found = streaming.solve(metric, reader, weights)
    origin = found.point
    whole = BasisMean(basis, with_differences=False, tolerance=1e-9).solve(
        metric, POINTS, weights, initial_point=origin
    )
    assert found.converged
    assert reader.largest == 4
    assert found.variance == pytest.approx(Dispersion(metric, POINTS, weights).value(found.point))
    assert found.variance <= whole.variance * (1 + 2e-5)


def test_a_better_mean_than_that_of_the_sample():
    metric, basis = ElasticMetric(bodies.space(), 1.0, 1.0, 0.1), bodies.basis(20)
    sample = BasisMean(basis).solve(metric, POINTS[[0, 9]])
    found = StreamingMean(basis, sample_size=2, batch_size=3).solve(metric, POINTS)
    assert found.variance < 0.99 * Dispersion(metric, POINTS).value(sample.point)


@pytest.mark.parametrize(
    ("weights", "size", "chosen"),
    [(None, 4, [0, 3, 6, 9]), (None, 99, range(10)), (WEIGHTS, 3, [0, 3, 9])],
    ids=str,
)
def test_the_sample_is_evenly_spaced_among_points_that_have_a_weight(weights, size, chosen):
    sample = means._Sample(Reader(POINTS), weights, size)
    np.testing.assert_array_equal(sample.points, POINTS[list(chosen)])
    np.testing.assert_array_equal(sample.weights, sample.all_weights[list(chosen)])


def test_arrays_mapped_from_files_serve(tmp_path):
    np.save(tmp_path / "bodies.npy", POINTS)
    mapped = np.load(tmp_path / "bodies.npy", mmap_mode="r")
    space = bodies.space()
    space.equip_with_metric(ElasticMetric, a=1.0, lam=1.0, c=0.1)
    solver = StreamingMean(sample_size=5, batch_size=4)
    mean = FrechetMean(space, solver=solver).fit(mapped)
    assert mean.variance_ == pytest.approx(solver.solve(space.metric, POINTS).variance)


@pytest.mark.parametrize("setting", ["sample_size", "batch_size"])
def test_settings_are_checked(setting):
    with pytest.raises(ArgumentError, match=setting):
        StreamingMean(**{setting: 0})


@pytest.mark.parametrize("solver", [StreamingMean, StreamingMedian])
@pytest.mark.parametrize(
    ("change", "error", "message"),
    [
        (lambda body: np.nan * body, ArgumentError, "NaN"),
        (lambda body: 1000.0 * body, ArgumentError, r"points\[2\].*millimetres"),
        (lambda body: 0.0 * body, DegenerateSurfaceError, r"item \(2,\)"),
    ],
)
def test_a_wrong_body_is_named_by_its_batch(solver, change, error, message):
    points = POINTS.copy()
    points[6] = change(points[6])
    metric = ElasticMetric(bodies.space(), 1.0, 1.0, 0.1)
    with pytest.raises(error, match=r"^points\[4:8\]: .*" + message):
        solver(sample_size=2, batch_size=4).solve(metric, points)


def test_no_points():
    with pytest.raises(ArgumentError, match="at least one point"):
        StreamingMean().solve(ElasticMetric(bodies.space()), POINTS[:0])


POINTS = load_open_bodies("coarse").points[:20:2]
WEIGHTS = np.array([1.0, 0.0, 2.0, 1.0, 0.0, 0.0, 0.0, 3.0, 1.0, 1.0])


def equipped_by(lengths=(1.0, 1.0, 0.1)):
    space = bodies.space()
    space.equip_with_metric(ElasticMetric, **dict(zip(("a", "lam", "c"), lengths, strict=True)))
    return space


def mean_distance(metric, weights, point):
    return np.average(np.sqrt(Dispersion(metric, POINTS).squared_dists(point)), weights=weights)


@pytest.mark.parametrize("weights", [None, WEIGHTS])
def test_the_mean_distance_is_that_of_weiszfelds_median(weights):
    space, basis = equipped_by(), bodies.basis(10)
    solver = StreamingMedian(basis, with_differences=False, sample_size=4, batch_size=4)
    found = GeometricMedian(space, solver=solver).fit(POINTS, weights=weights)
    solver = BasisMean(basis, with_differences=False)
    # The same family of points: that of the streamed median.
    family = FromPoint(solver, found.estimate_)
    best = GeometricMedian(space, solver=family, tolerance=1e-7).fit(POINTS, weights=weights)
    reached = mean_distance(space.metric, weights, found.estimate_)
    assert found.result_.converged
    assert found.result_.variances[-1] == pytest.approx(reached, rel=1e-6)
    assert reached <= mean_distance(space.metric, weights, best.estimate_) * (1 + 2e-6)
    mean = family.solve(space.metric, POINTS, weights).point
    assert reached < mean_distance(space.metric, weights, mean)


class FromPoint:
    """A mean solver that searches from one point, whatever it is asked to start from."""

    def __init__(self, solver, point):
        self.solver, self.point = solver, point

    def solve(self, metric, points, weights=None, initial_point=None):
        return self.solver.solve(metric, points, weights, self.point)


def test_one_body_far_away_hardly_moves_it():
    space, basis = equipped_by((1.0, 1.0, 1.0)), bodies.basis(10)
    near, far = POINTS[:5], load_open_bodies("coarse").points[97]
    solver = StreamingMedian(basis, batch_size=3)
    with_it = np.concatenate([near, 3.0 * far[None]])
    moved = []
    for one in (solver, BasisMean(basis)):
        centers = [one.solve(space.metric, points).point for points in (near, with_it)]
        moved.append(float(space.metric.dist(*centers)))
    assert moved[0] < 0.3 * moved[1]


def test_the_gradient_of_the_mean_distance():
    metric, rng = equipped_by().metric, np.random.default_rng(0)
    functional = MeanDistance(metric, POINTS, WEIGHTS, smoothing=1e-3)
    direction = 1e-3 * rng.standard_normal(POINTS[0].shape)
    value, gradient = functional.value_and_gradient(POINTS[0])
    assert value == pytest.approx(functional.value(POINTS[0]), rel=1e-12)
    errors = [
        functional.value(POINTS[0] + step * direction) - value - step * np.sum(gradient * direction)
        for step in (1e-3, 1e-4)
    ]
    assert abs(errors[1]) < 0.02 * abs(errors[0])


def test_the_curvature_of_the_mean_distance_is_one_over_it():
    functional = MeanDistance(equipped_by().metric, POINTS, WEIGHTS, smoothing=1e-3)
    value = functional.value(POINTS[1])
    assert functional.curvature(value) == pytest.approx(1.0 / value, rel=1e-12)


def test_points_that_coincide():
    metric = equipped_by().metric
    result = StreamingMedian().solve(metric, np.stack([POINTS[0]] * 3))
    assert result.converged
    assert result.variance < 1e-12


def edge_range(companion_weight, weights=None):
    """Return how far edges of a pose mean leave the range of the ten poses, as ratios."""
    data = load_open_bodies("coarse")
    points, metric = data.points[:10], ElasticMetric(bodies.space(), 0.0, 0.0, 1.0)
    solver = BasisMean(bodies.basis(), companion_weight=companion_weight, max_iter=200)
    found = solver.solve(metric, points)
    assert found.variance == pytest.approx(Dispersion(metric, points).value(found.point))
    edges = data.template.edges
    given, own = edge_lengths(points, edges), edge_lengths(found.point, edges)
    return (own / given.min(axis=0)).min(), (own / given.max(axis=0)).max()


def test_arms_of_a_pose_mean_are_no_rubber():
    shortest, longest = edge_range(1.0)
    assert shortest > 0.8
    assert longest < 1.15


def test_a_metric_of_normals_alone_sees_no_lengths():
    with pytest.warns(StretchInvarianceWarning, match=r"c=1.0\) does not see the lengths of edges"):
        shortest, _ = edge_range(0.0)
    assert shortest < 0.75


def test_a_mean_by_rotations_alone_warns_too():
    points = load_open_bodies("coarse").points[:2]
    with pytest.warns(StretchInvarianceWarning, match=r"RotationMetric"):
        BasisMean(tolerance=0.5).solve(RotationMetric(bodies.space()), points)


def test_triangles_that_shrink_away_are_said():
    """Of fifteen unlike bodies under the space's own metric, whose λ is 1e-4."""
    points = load_open_bodies("coarse").points[::7]
    metric = ElasticMetric(bodies.space(), 1.0, 1e-4, 0.0)
    seen = []
    solver = BasisMean(bodies.basis(), callback=lambda *state: seen.append(state))
    with pytest.raises(DegenerateSurfaceError, match=r"use lam = 1, or a medoid"):
        solver.solve(metric, points)
    assert len(seen) < 10


def test_a_triangle_has_collapsed_below_a_hundredth_of_its_median_area():
    space = AlignedSurfaces(triangle_template(), equip=False)
    flat = space.template.vertices
    check = AreaCheck(space, np.stack([flat, 2.0 * flat, 3.0 * flat]))
    check.refuse_collapse(0.2 * np.sqrt(1.02) * flat)
    with pytest.raises(DegenerateSurfaceError, match="1 of 1 triangles"):
        check.refuse_collapse(0.2 * np.sqrt(0.98) * flat)


def test_bad_input():
    with pytest.raises(ArgumentError, match="companion_weight must be"):
        BasisMean(companion_weight=-1.0)
