"""The discrete exponential: its order, what it conserves, how it stops."""

from __future__ import annotations

import bodies_in_motion as bodies
import numpy as np
import pytest
from cases import (
    CASES,
    HalfPlane,
    HyperbolicInnerProduct,
    cases_that,
    name_of,
    sphere_template,
)
from oracles import orders

from riemhuman.errors import (
    ArgumentError,
    ConvergenceWarning,
    OutsideManifoldError,
)
from riemhuman.geometry import AlignedSurfaces, ElasticMetric
from riemhuman.solvers import DiscreteExponential

# The product's blocks are not seen by the preconditioner of all coordinates; a weight of 0 leaves
# velocities without effect; flat space is exact at any step.
CLOSED_FORM = [
    case
    for case in cases_that("dist", "exp", "log")
    if case.name not in ("product", "product of one", "flat")
]
SURFACES = [
    CASES[name]
    for name in ("stretch sphere", "mixed sphere", "mixed open", "all triangle", "srnf open")
]
PLANES = [CASES[name] for name in CASES if name.startswith("half-plane")]


@pytest.mark.everyday("ebin 0.5 triangle")
@pytest.mark.parametrize("case", CLOSED_FORM, ids=name_of)
def test_second_order_against_closed_forms(case):
    start, end = case.points[:2]
    velocity = case.metric.log(end, start)
    errors = []
    for n_steps in (4, 8):
        result = DiscreteExponential(n_steps=n_steps).solve(case.metric, velocity, start)
        assert result.converged
        assert len(result.path) == n_steps + 1
        assert np.all(case.space.belongs(result.path))
        errors.append(np.abs(result.end - end).max())
    assert orders(errors) > 1.85


@pytest.mark.everyday("all triangle")
@pytest.mark.parametrize("case", SURFACES + PLANES, ids=name_of)
def test_second_order_without_closed_forms(case):
    start = case.points[0]
    velocity = 0.25 * (case.points[1] - start)
    results = [
        DiscreteExponential(n_steps=n_steps, tolerance=1e-10).solve(case.metric, velocity, start)
        for n_steps in (2, 4, 8, 16)
    ]
    ends = np.stack([result.end for result in results])
    assert np.all(orders(np.abs(np.diff(ends, axis=0)).reshape(3, -1).max(axis=1)) > 1.85)
    squared_speed = float(case.metric.squared_norm(velocity, start))
    drifts = [np.ptp(result.energies) / squared_speed for result in results]
    assert drifts[-1] < 1e-4
    errors = [abs(result.energy - squared_speed) for result in results]
    assert np.all(orders(errors)[:2] > 1.7) or max(errors) < 1e-8 * squared_speed


@pytest.mark.parametrize("name", ["all sphere", "mixed open", "all triangle", "stretch triangle"])
def test_stops_where_triangles_vanish(name):
    """A surface that shrinks at one and a half times its size a unit of time is gone at 2/3."""
    case = CASES[name]
    start = case.points[0]
    solver = DiscreteExponential(n_steps=30, n_doublings=0)
    with pytest.warns(ConvergenceWarning, match="degenerates|no next point solves"):
        result = solver.solve(case.metric, -1.5 * (start - start.mean(axis=0)), start)
    assert not result.complete
    assert not result.converged
    assert result.message.startswith(f"step {len(result.path)} of 30: ")
    assert 17 <= len(result.path) <= 21
    assert np.all(case.space.belongs(result.path))
    assert len(result.energies) == len(result.path) - 1


def test_says_when_an_equation_was_not_solved():
    case = CASES["mixed sphere"]
    solver = DiscreteExponential(n_steps=4, max_iter=3)
    with pytest.warns(ConvergenceWarning, match="step 4 of 4: the equation is solved to .* only"):
        result = solver.solve(case.metric, 0.3 * case.tangent_vecs[0], case.points[0])
    assert result.complete
    assert not result.converged


def test_metrics_take_it_as_exp_solver():
    solver = DiscreteExponential(n_steps=2)
    space = AlignedSurfaces(sphere_template())
    for metric, name in (
        (ElasticMetric(space, 1.0, 0.1, 0.1, exp_solver=solver), "mixed sphere"),
        (HyperbolicInnerProduct(HalfPlane(), exp_solver=solver), "half-plane, inner product"),
    ):
        start, velocity = CASES[name].points[0], 0.2 * CASES[name].tangent_vecs[0]
        end = metric.exp(velocity, start)
        np.testing.assert_array_equal(end, solver.solve(metric, velocity, start).end)
        several = metric.exp(np.stack([velocity, 0.5 * velocity]), start)
        assert several.shape == (2, *start.shape)
        np.testing.assert_array_equal(several[0], end)
        curve = metric.geodesic(start, initial_tangent_vec=velocity)
        np.testing.assert_allclose(curve([0.0, 0.5, 1.0])[1:], several[::-1], atol=1e-12)


def test_an_exponential_that_does_not_exist_is_refused():
    case = CASES["all sphere"]
    metric = ElasticMetric(case.space, 1.0, 1.0, 1.0, exp_solver=DiscreteExponential(n_doublings=0))
    with (
        pytest.raises(OutsideManifoldError, match=r"DiscreteExponential.* at step [67] of 10"),
        pytest.warns(ConvergenceWarning),
    ):
        metric.exp(-1.5 * case.points[0], case.points[0])


def test_bad_input():
    metric, start = CASES["mixed triangle"].metric, CASES["mixed triangle"].points[0]
    solver = DiscreteExponential()
    with pytest.raises(ArgumentError, match="tangent_vec holds 9 NaN"):
        solver.solve(metric, np.nan * start, start)
    with pytest.raises(ArgumentError, match="the basis belongs to another template"):
        DiscreteExponential(bodies.basis(20)).solve(metric, start, start)
