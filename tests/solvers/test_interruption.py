"""An interrupt ends the whole call with KeyboardInterrupt, which carries the best so far."""

from dataclasses import replace

import numpy as np
import pytest
from cases import HalfPlane, sphere_template, surfaces

from riemhuman.geometry import (
    AlignedSurfaces,
    ElasticMetric,
    FlatMetric,
    RiemannianMetric,
    VectorSpace,
)
from riemhuman.solvers import (
    BasisMean,
    GradientDescentMean,
    Interrupted,
    LinearPath,
    PoleLadder,
    Status,
    compare_paths,
)
from riemhuman.solvers._lbfgs import LBFGS
from riemhuman.statistics import GeometricMedian, TangentPCA

SPACE = AlignedSurfaces(sphere_template(), equip=False)
METRIC = ElasticMetric(SPACE, 1.0, 1.0, 0.0)
POINTS = surfaces(SPACE.template, 3, rng=1, size=0.05)


class StraightPlane(RiemannianMetric):
    """A metric without closed forms."""

    def inner_product(self, tangent_vec_a, tangent_vec_b, base_point):
        """Return the product of coordinates."""
        return np.sum(tangent_vec_a * tangent_vec_b, axis=-1)


class InterruptedSolver:
    """A solver that is interrupted in one of its calls."""

    def __init__(self, solver, number):
        self.solver, self.number = solver, number
        self.n_calls = 0

    def solve(self, *arguments, **options):
        """Solve, or raise `Interrupted` in the call of that number."""
        self.n_calls += 1
        result = self.solver.solve(*arguments, **options)
        if self.n_calls == self.number:
            raise Interrupted(result)
        return result


def plane_median(number):
    solver = InterruptedSolver(GradientDescentMean(), number)
    points = np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 2.0], [5.0, 5.0]])
    GeometricMedian(VectorSpace((2,)), solver).fit(points)


def table_of_distances(number):
    metric = StraightPlane(HalfPlane(), geodesic_solver=InterruptedSolver(LinearPath(3), number))
    metric.dist_pairwise(HalfPlane().random_point(4, rng=0))


def transport(number):
    ladder = PoleLadder(geodesic_solver=InterruptedSolver(LinearPath(3), number))
    ladder.solve(METRIC, POINTS[1] - POINTS[0], POINTS[0], end_point=POINTS[2])


def comparison(number):
    solvers = {"one": (InterruptedSolver(LinearPath(3), number), "shape")}
    compare_paths({"shape": METRIC}, POINTS[0], POINTS[1], solvers)


def components(number):
    solver = InterruptedSolver(GradientDescentMean(), number)
    TangentPCA(VectorSpace((2,)), 1).fit(np.eye(2), base_point=solver)


@pytest.mark.parametrize(
    ("call", "number"),
    [
        (plane_median, 1),
        (table_of_distances, 2),
        (transport, 1),
        (comparison, 1),
        (components, 1),
    ],
)
def test_a_call_ends_with_the_solver_that_is_interrupted(call, number):
    with pytest.raises(KeyboardInterrupt) as caught:
        call(number)
    assert caught.value.result.converged


class InterruptedVectors(FlatMetric):
    """Vectors, with an interrupt in one of the calls of a method."""

    def __init__(self, name, number):
        super().__init__(VectorSpace((2,)))
        method, calls = getattr(self, name), iter(range(1, 10**6))

        def interrupted(*arguments, **options):
            if next(calls) == number:
                raise KeyboardInterrupt
            return method(*arguments, **options)

        setattr(self, name, interrupted)


SQUARE = np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 2.0], [5.0, 5.0]])


@pytest.mark.parametrize("number", [1, 2, 4, 6])
def test_a_descent_ends_with_the_best_so_far(number):
    metric = InterruptedVectors("log", number)
    with pytest.raises(Interrupted) as caught:
        GradientDescentMean().solve(metric, SQUARE, exponent=1)
    result = caught.value.result
    assert result.status is Status.INTERRUPTED
    assert result.variance == pytest.approx(np.mean(metric.squared_dist(result.point, SQUARE)))


def test_no_search_of_a_median_in_batches_swallows_an_interrupt():
    """Each of its searches, from a mean of a sample to a median of all, ends all of them."""
    interrupts, metric = 0, VectorSpace((2,)).metric
    minimize = LBFGS.minimize
    for number in range(1, 4):
        calls = iter(range(1, 10))

        def interrupted(minimizer, *arguments, number=number, calls=calls, **options):
            minimum = minimize(minimizer, *arguments, **options)
            return replace(minimum, status=Status.INTERRUPTED) if next(calls) == number else minimum

        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(LBFGS, "minimize", interrupted)
            try:
                BasisMean().solve(metric, [SQUARE[:2], SQUARE[2:]], exponent=1)
            except Interrupted:
                interrupts += 1
    assert interrupts == 3
