"""Medians of points read batch by batch are those by Weiszfeld's algorithm in memory."""

import bodies_in_motion as bodies
import numpy as np
import pytest

from riemhuman.datasets import load_open_bodies
from riemhuman.geometry.elastic_metric import ElasticMetric
from riemhuman.solvers import BasisMean, StreamingMedian
from riemhuman.solvers.dispersion import Dispersion, MeanDistance
from riemhuman.statistics import GeometricMedian

POINTS = load_open_bodies("coarse").points[:20:2]
WEIGHTS = np.array([1.0, 0.0, 2.0, 1.0, 0.0, 0.0, 0.0, 3.0, 1.0, 1.0])


def equipped(lengths=(1.0, 1.0, 0.1)):
    space = bodies.space()
    space.equip_with_metric(ElasticMetric, **dict(zip(("a", "lam", "c"), lengths, strict=True)))
    return space


def mean_distance(metric, weights, point):
    return np.average(np.sqrt(Dispersion(metric, POINTS).squared_dists(point)), weights=weights)


@pytest.mark.parametrize("weights", [None, WEIGHTS])
def test_the_mean_distance_is_that_of_weiszfelds_median(weights):
    space, basis = equipped(), bodies.basis(10)
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
    space, basis = equipped((1.0, 1.0, 1.0)), bodies.basis(10)
    near, far = POINTS[:5], load_open_bodies("coarse").points[97]
    solver = StreamingMedian(basis, batch_size=3)
    with_it = np.concatenate([near, 3.0 * far[None]])
    moved = []
    for one in (solver, BasisMean(basis)):
        centers = [one.solve(space.metric, points).point for points in (near, with_it)]
        moved.append(float(space.metric.dist(*centers)))
    assert moved[0] < 0.3 * moved[1]


def test_the_gradient_of_the_mean_distance():
    metric, rng = equipped().metric, np.random.default_rng(0)
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
    functional = MeanDistance(equipped().metric, POINTS, WEIGHTS, smoothing=1e-3)
    value = functional.value(POINTS[1])
    assert functional.curvature(value) == pytest.approx(1.0 / value, rel=1e-12)


def test_points_that_coincide():
    metric = equipped().metric
    result = StreamingMedian().solve(metric, np.stack([POINTS[0]] * 3))
    assert result.converged
    assert result.variance < 1e-12
