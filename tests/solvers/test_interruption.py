"""An interrupt ends the whole call with KeyboardInterrupt, which carries the best so far."""

import numpy as np
import pytest
from cases import HalfPlane, sphere_template, surfaces

from riemhuman.geometry import AlignedSurfaces, ElasticMetric, RiemannianMetric, VectorSpace
from riemhuman.solvers import (
    GradientDescentMean,
    Interrupted,
    LinearPath,
    PoleLadder,
    compare_paths,
)
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
