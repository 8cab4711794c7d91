"""Minima that are zero are found at once, by every solver, though rounding errors remain."""

import bodies_in_motion as bodies
import numpy as np
import pytest
from cases import CASES, name_of

from riemhuman.geometry import AlignedSurfaces, ElasticMetric
from riemhuman.solvers import (
    BasisMean,
    BasisPath,
    DiscreteExponential,
    DiscreteLogarithm,
    GradientDescentMean,
    LinearPath,
    PathStraightening,
    PoissonPath,
)

WEIGHTS = [(1.0, 1.0, 0.0), (0.0, 0.0, 1.0), (1.0, 1e-4, 0.0), (1.0, 0.1, 0.1)]
MOST_EVALUATIONS = 3
# Means and logarithms make seven, of a few searches that end at once.
MOST_OF_SEVERAL = 21

# Made when they are used: the basis takes a second, also where no test of this file runs.
PATHS = {
    "basis": lambda: BasisPath(bodies.basis(), n_nodes=5),
    "straightening": lambda: PathStraightening(n_nodes=5),
    "linear": lambda: LinearPath(5),
    "poisson": lambda: PoissonPath(5),
}


def moved(body, *, turn):
    """Return the same body elsewhere, within rounding errors of its coordinates."""
    if turn:
        axis = np.array([0.3, -0.8, 0.5])
        skew = np.cross(np.eye(3), axis / np.linalg.norm(axis))
        body = body @ (np.eye(3) + np.sin(1.1) * skew + (1 - np.cos(1.1)) * skew @ skew).T
    return body + [3.0, -2.0, 0.7]


@pytest.mark.parametrize("weights", WEIGHTS, ids=str)
@pytest.mark.parametrize("solver", PATHS.values(), ids=PATHS)
def test_paths_from_a_body_to_itself(weights, solver):
    metric = ElasticMetric(bodies.space(), *weights)
    body = bodies.body("elbow bent")
    for end in (body, moved(body, turn=False)):
        result = solver().solve(metric, body, end)
        assert result.converged
        assert result.n_evaluations <= MOST_EVALUATIONS
        assert result.energy <= 1e-20
        np.testing.assert_array_equal(result.path[[0, -1]], [body, end])


@pytest.mark.parametrize("name", ["basis", "straightening", "poisson"])
def test_paths_of_a_body_that_only_turns(name):
    """The metric does not see rotations where c = 0, but a straight path would shrink the body."""
    metric = ElasticMetric(bodies.space(), 1.0, 1.0, 0.0)
    body = bodies.body("elbow bent")
    end = moved(body, turn=True)
    result = PATHS[name]().solve(metric, body, end)
    assert result.converged
    assert result.n_evaluations <= MOST_EVALUATIONS
    assert result.energy <= 1e-20
    assert LinearPath(5).solve(metric, body, end).energy > 1e-3


@pytest.mark.everyday("free-(0.0, 0.0, 1.0)")
@pytest.mark.parametrize("weights", WEIGHTS, ids=str)
@pytest.mark.parametrize("basis", [bodies.basis, lambda: None], ids=["basis", "free"])
def test_logarithm_and_exponential_that_stay(weights, basis):
    metric = ElasticMetric(bodies.space(), *weights)
    body = bodies.body("elbow bent")
    for end in (body, moved(body, turn=False)):
        logarithm = DiscreteLogarithm(basis(), n_steps=4).solve(metric, end, body)
        assert logarithm.converged
        assert logarithm.n_evaluations <= MOST_OF_SEVERAL
        assert metric.norm(logarithm.tangent_vec, body) <= 1e-9
    still = DiscreteExponential(basis(), n_steps=4).solve(metric, np.zeros_like(body), body)
    assert still.converged
    np.testing.assert_allclose(still.end, body, atol=1e-12)


@pytest.mark.parametrize("weights", WEIGHTS, ids=str)
def test_means_and_medians_of_the_same_body(weights):
    space = AlignedSurfaces(bodies.space().template, equip=False)
    metric = space.equip_with_metric(
        ElasticMetric, a=weights[0], lam=weights[1], c=weights[2]
    ).metric
    body = bodies.body("elbow bent")
    points = np.stack([body, body, moved(body, turn=False)])
    solver = BasisMean(bodies.basis())
    for start in (None, points[0]):
        for exponent in (2, 1):
            result = solver.solve(metric, points, None, start, exponent)
            assert result.converged
            assert result.n_evaluations <= MOST_OF_SEVERAL
            assert result.variance <= 1e-20
            assert metric.dist(result.point, body) <= 1e-9


@pytest.mark.parametrize("case", [CASES["normals sphere"], CASES["ebin 1 sphere"]], ids=name_of)
def test_means_by_exponentials_of_the_same_point(case):
    point = case.points[0]
    noise = np.random.default_rng(3).uniform(-1e-15, 1e-15, point.shape)
    points = np.stack([point, point, case.space.projection(point * (1.0 + noise))])
    if case.name.startswith("ebin"):
        points = 0.5 * (points + np.swapaxes(points, -1, -2))
    result = GradientDescentMean().solve(case.metric, points)
    assert result.converged
    assert result.n_iterations <= 1
    assert result.variance <= 1e-20
