"""The discrete logarithm, and that it is the inverse of the discrete exponential."""

from warnings import catch_warnings, simplefilter

import bodies_in_motion as bodies
import numpy as np
import pytest
from cases import CASES, cases_that, deformations, name_of
from oracles import orders

from riemhuman.errors import ArgumentError, ConvergenceWarning
from riemhuman.geometry import ElasticMetric, VectorSpace
from riemhuman.solvers import (
    BasisPath,
    ClosedFormGeodesic,
    DiscreteExponential,
    DiscreteLogarithm,
)
from riemhuman.solvers.results import PathResult
from riemhuman.surfaces import DeformationBasis

CLOSED_FORM = [
    case
    for case in cases_that("dist", "exp", "log", "geodesic")
    if not case.name.startswith(("product", "flat", "rotations"))
]
OTHERS = [
    CASES[name] for name in ("mixed sphere", "all open", "srnf triangle", "half-plane, distance")
]


@pytest.mark.everyday("normals sphere")
@pytest.mark.parametrize("case", CLOSED_FORM, ids=name_of)
def test_second_order_against_closed_forms(case):
    start, end = case.points[:2]
    exact = case.metric.log(end, start)
    errors = []
    for n_steps in (4, 8):
        solver = DiscreteLogarithm(
            geodesic_solver=ClosedFormGeodesic(n_steps + 1), end_tolerance=0.1
        )
        result = solver.solve(case.metric, end, start)
        assert result.converged
        errors.append(np.abs(result.tangent_vec - exact).max())
    assert orders(errors) > 1.85
    assert result.energy == pytest.approx(float(case.metric.squared_dist(start, end)), rel=1e-8)


@pytest.mark.parametrize("case", OTHERS, ids=name_of)
def test_inverse_of_the_exponential_in_all_coordinates(case):
    start = case.points[0]
    velocity = 0.25 * (case.points[1] - start)
    forward = DiscreteExponential(n_steps=6, tolerance=1e-10).solve(case.metric, velocity, start)
    # Of a single triangle, some rotations change no term of the metric.
    loose = 0.1 if case.name == "srnf triangle" else 1e-4
    solver = DiscreteLogarithm(n_steps=6, end_tolerance=loose)
    back = solver.solve(case.metric, forward.end, start)
    size = float(case.metric.norm(velocity, start))
    error = float(case.metric.norm(back.tangent_vec - velocity, start))
    assert back.converged
    assert error < 1e-4 * size
    if case.name != "srnf triangle":
        # Even translations, which the metrics do not see: 1e-4 and more where the path drifts.
        assert np.abs(back.tangent_vec - velocity).max() < 3e-5
    assert back.energy == pytest.approx(forward.energy, rel=1e-6)


def test_a_solver_may_be_given():
    metric = ElasticMetric(bodies.space(), 1.0, 1.0, 0.0)
    start, end = bodies.body("resting"), bodies.body("arm raised")
    solver = BasisPath(bodies.basis(30), n_nodes=4)
    with pytest.warns(ConvergenceWarning, match="the exponential ends .* use more steps"):
        found = DiscreteLogarithm(bodies.basis(30), geodesic_solver=solver).solve(
            metric, end, start
        )
    assert found.end_error > 1e-4
    path = solver.solve(metric, start, end).path
    np.testing.assert_array_equal(found.path, path)
    first = 3.0 * (path[1] - path[0])
    assert metric.norm(found.tangent_vec - first, start) < 0.5 * metric.norm(first, start)


def test_path_stays_in_the_basis_and_the_difference():
    case = CASES["mixed sphere"]
    start, end = case.points[0], 0.7 * case.points[0] + 0.3 * case.points[1]
    basis = DeformationBasis(deformations(case.space.template, 4, rng=9), orthonormalize=True)
    found = DiscreteLogarithm(basis, n_steps=4).solve(case.metric, end, start)
    assert found.converged
    assert len(found.path) == 5
    joined = basis.extend((end - start)[None])
    assert len(joined) == 5
    for deformation in (*(found.path - start), found.tangent_vec):
        np.testing.assert_allclose(joined.project(deformation), deformation, atol=1e-10)


def test_bad_input():
    case = CASES["mixed triangle"]
    start, end = case.points[:2]
    with pytest.raises(ArgumentError, match="the basis belongs to another template"):
        DiscreteLogarithm(bodies.basis(20)).solve(case.metric, end, start)


@pytest.mark.parametrize(
    ("shares", "converged"), [((0.0, 1 / 3, 2 / 3, 1.0), True), ((0.0, 0.1, 0.5, 1.0), False)]
)
def test_a_path_that_is_no_geodesic_has_no_logarithm(shares, converged):
    """Of vectors, the straight path is one at constant speed alone."""
    space = VectorSpace((2, 2))
    start, end = space.random_point(2, rng=0)
    path = start + np.array(shares)[:, None, None] * (end - start)

    class Given:
        def solve(self, metric, start, end):
            return PathResult(path, 1.0, np.ones(1), n_iterations=70, n_evaluations=900)

    solver = DiscreteLogarithm(geodesic_solver=Given())
    with catch_warnings(record=True) as warnings:
        simplefilter("always")
        result = solver.solve(space.metric, end, start)
    assert result.converged == converged == (not warnings)
    assert result.n_iterations >= 70
    assert result.n_evaluations > 900
    np.testing.assert_array_equal(result.path, path)
