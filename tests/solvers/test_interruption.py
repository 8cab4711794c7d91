"""An interrupt ends the whole call, with what was reached or with KeyboardInterrupt."""

import numpy as np
import pytest
from cases import HalfPlane, sphere_template, surfaces

from riemhuman.errors import ConvergenceWarning
from riemhuman.geometry import AlignedSurfaces, ElasticMetric, RiemannianMetric, VectorSpace
from riemhuman.protocols import INTERRUPTED, uninterrupted, was_interrupted
from riemhuman.solvers import (
    DiscreteLogarithm,
    GradientDescentMean,
    LinearPath,
    PoleLadder,
    compare_paths,
)
from riemhuman.solvers.results import MeanResult, PathResult
from riemhuman.statistics import GeometricMedian, TangentPCA
from riemhuman.surfaces import DeformationBasis

SPACE = AlignedSurfaces(sphere_template(), equip=False)
METRIC = ElasticMetric(SPACE, 1.0, 1.0, 0.0)
POINTS = surfaces(SPACE.template, 3, rng=1, size=0.05)


class StraightPlane(RiemannianMetric):
    """A metric without closed forms."""

    def inner_product(self, tangent_vec_a, tangent_vec_b, base_point):
        """Return the product of coordinates."""
        return np.sum(tangent_vec_a * tangent_vec_b, axis=-1)


class Interrupted:
    """A solver that is interrupted in one of its calls, as solvers that minimise are."""

    def __init__(self, solver, number):
        self.solver, self.left = solver, number
        self.n_calls = 0

    def solve(self, *arguments, **options):
        """Solve, and say that it was interrupted when it is time."""
        self.n_calls += 1
        found = self.solver.solve(*arguments, **options)
        if self.n_calls == self.left:
            values = {name: getattr(found, name) for name in vars(found)}
            return type(found)(**(values | {"converged": False, "message": INTERRUPTED}))
        return found


@pytest.mark.parametrize("number", [1, 3])
@pytest.mark.filterwarnings("ignore::riemhuman.errors.ConvergenceWarning")
def test_a_median_ends_when_a_round_is_interrupted(number):
    space = VectorSpace((2,))
    points = np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 2.0], [5.0, 5.0]])
    solver = Interrupted(GradientDescentMean(), number)
    median = GeometricMedian(space, solver).fit(points)
    assert solver.n_calls == number
    assert median.result_.message == INTERRUPTED
    assert not median.result_.converged
    assert len(median.result_.variances) == number
    uninterrupted_median = GeometricMedian(space, GradientDescentMean()).fit(points)
    sums = uninterrupted_median.result_.variances
    np.testing.assert_allclose(median.result_.variances, sums[:number], rtol=1e-12)
    with pytest.warns(ConvergenceWarning, match="interrupted"):
        GeometricMedian(space, Interrupted(GradientDescentMean(), 2)).fit(points)


def test_a_table_of_distances_ends_with_one_that_is_interrupted():
    solver = Interrupted(LinearPath(3), 2)
    metric = StraightPlane(HalfPlane(), geodesic_solver=solver)
    points = HalfPlane().random_point(4)
    with pytest.raises(KeyboardInterrupt):
        metric.dist_pairwise(points)
    assert solver.n_calls == 2
    for call in (metric.dist, metric.squared_dist, metric.geodesic):
        solver.n_calls = 1
        with pytest.raises(KeyboardInterrupt):
            call(points[0], points[1])


@pytest.mark.filterwarnings("ignore::riemhuman.errors.ConvergenceWarning")
def test_what_is_made_of_geodesics_ends_with_one_that_is_interrupted():
    vector = POINTS[1] - POINTS[0]
    ladder = PoleLadder(geodesic_solver=Interrupted(LinearPath(3), 1))
    with pytest.raises(KeyboardInterrupt):
        ladder.solve(METRIC, vector, POINTS[0], end_point=POINTS[2])
    solvers = {
        "one": (Interrupted(LinearPath(3), 1), "shape"),
        "two": (Interrupted(LinearPath(3), 9), "shape"),
    }
    compared = compare_paths({"shape": METRIC}, POINTS[0], POINTS[1], solvers)
    assert [one.name for one in compared] == ["one"]
    assert solvers["two"][0].n_calls == 0
    solver = Interrupted(GradientDescentMean(), 1)
    with pytest.raises(KeyboardInterrupt):
        TangentPCA(VectorSpace((2,)), 1).fit(np.eye(2), base_point=solver)


def test_a_logarithm_ends_with_its_first_search(monkeypatch):
    calls = []

    def interrupted(solver, metric, start, end, initial_path=None):
        calls.append(solver)
        path = np.linspace(start, end, solver.n_nodes)
        return PathResult(path, 1.0, np.ones(1), converged=False, message=INTERRUPTED)

    monkeypatch.setattr("riemhuman.solvers.BasisPath.solve", interrupted)
    basis = DeformationBasis.from_laplacian(SPACE.template, 4)
    with pytest.warns(ConvergenceWarning, match="interrupted"):
        result = DiscreteLogarithm(basis, n_steps=3).solve(METRIC, POINTS[1], POINTS[0])
    assert len(calls) == 1
    assert was_interrupted(result)


def test_how_an_interruption_is_told():
    stopped = MeanResult(np.zeros(1), 0.0, np.zeros(1), converged=False, message=INTERRUPTED)
    slow = MeanResult(np.zeros(1), 0.0, np.zeros(1), converged=False, message="too slow")
    assert was_interrupted(stopped)
    assert not was_interrupted(slow)
    assert uninterrupted(slow) is slow
    with pytest.raises(KeyboardInterrupt):
        uninterrupted(stopped)
