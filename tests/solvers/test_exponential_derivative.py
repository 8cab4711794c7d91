"""Derivatives of the discrete exponential: against differences, and as autograd takes them."""

import autograd.numpy as np
import pytest
from autograd import grad
from cases import CASES, deformations, sphere_template, surfaces

from riemhuman.errors import ConvergenceWarning, NotDefinedError
from riemhuman.geometry.aligned_surfaces import AlignedSurfaces
from riemhuman.geometry.elastic_metric import ElasticMetric
from riemhuman.solvers import DiscreteExponential, exponential_derivative
from riemhuman.surfaces import DeformationBasis

TEMPLATE = sphere_template(0)
SOLVER = DiscreteExponential(n_steps=2, tolerance=1e-12)


def metric_with(solver):
    return ElasticMetric(AlignedSurfaces(TEMPLATE, equip=False), 1.0, 1.0, 1.0, exp_solver=solver)


METRIC = metric_with(SOLVER)
START, OTHER = surfaces(TEMPLATE, 2, rng=3)
VELOCITIES = 0.1 * deformations(TEMPLATE, 2, rng=1)


def test_derivatives_by_velocities_and_start():
    """Of two geodesics from one point, so that what they add up to is tried as well."""

    def objective(parameters):
        reached = METRIC.exp(parameters[1:], parameters[0])
        return np.sum(METRIC.squared_dist(reached, OTHER) * np.array([1.0, 2.0]))

    parameters = np.concatenate([START[None], VELOCITIES])
    slopes = grad(objective)(parameters)
    rng = np.random.default_rng(0)
    for part in ([1.0, 0.0, 0.0], [0.0, 1.0, 1.0]):
        step = 1e-4 * rng.normal(size=parameters.shape) * np.array(part)[:, None, None]
        difference = 0.5 * (objective(parameters + step) - objective(parameters - step))
        assert np.sum(slopes * step) == pytest.approx(difference, rel=1e-5)


def test_derivatives_by_every_point_of_the_path():
    path = SOLVER.solve(METRIC, VELOCITIES[0], START).path
    rng = np.random.default_rng(1)
    # Of differences between points, for translations are not determined.
    covectors = rng.normal(size=path.shape)
    covectors -= covectors.mean(axis=1, keepdims=True)
    by_velocity, _ = SOLVER.derivatives(METRIC, path, VELOCITIES[0], covectors)
    step = 1e-4 * rng.normal(size=START.shape)
    paths = [SOLVER.solve(METRIC, VELOCITIES[0] + s * step, START).path for s in (0.5, -0.5)]
    assert np.sum(by_velocity * step) == pytest.approx(
        np.sum(covectors * (paths[0] - paths[1])), rel=1e-4
    )


def test_unsolved_equations_are_said(monkeypatch):
    monkeypatch.setattr(exponential_derivative, "_MAX_ITER", 1)
    path = SOLVER.solve(METRIC, VELOCITIES[0], START).path
    with pytest.warns(ConvergenceWarning, match="derivative of the exponential is not exact"):
        SOLVER.derivatives(METRIC, path, VELOCITIES[0], np.ones_like(path) * START)


def test_where_there_are_no_derivatives():
    basis = DeformationBasis(deformations(TEMPLATE, 3, rng=2), orthonormalize=True)
    metric = metric_with(DiscreteExponential(basis, n_steps=2))
    with pytest.raises(NotDefinedError, match=r"DiscreteExponential\(\) without a basis"):
        grad(lambda v: np.sum(metric.exp(v, START)))(VELOCITIES[0])
    plane = CASES["half-plane, distance"]
    with pytest.raises(NotDefinedError, match="those of surfaces"):
        SOLVER.derivatives(plane.metric, plane.points[:2], plane.points[0], plane.points[:2])


def test_solvers_of_others_have_none():
    class Straight:
        def solve(self, metric, tangent_vec, base_point):
            class Found:
                end = base_point + tangent_vec

            return Found

    metric = metric_with(Straight())
    assert np.array_equal(metric.exp(VELOCITIES, START), START + VELOCITIES)
    with pytest.raises(NotDefinedError, match="Straight has no derivatives of exp"):
        grad(lambda v: np.sum(metric.exp(v, START)))(VELOCITIES[0])
