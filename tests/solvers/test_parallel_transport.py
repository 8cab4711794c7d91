"""Ladders: exact where closed forms are, of second order elsewhere."""

import numpy as np
import pytest
from cases import CASES, cases_that, deformations, name_of
from oracles import orders

from riemhuman.errors import (
    ArgumentError,
    ConvergenceWarning,
    NotDefinedError,
    OutsideManifoldError,
)
from riemhuman.solvers import (
    PathStraightening,
    PoleLadder,
)
from riemhuman.surfaces import DeformationBasis

FIELDS = cases_that("exp", "log", "geodesic")
CURVED = [case for case in FIELDS if case.name.startswith(("ebin", "product"))]
SPHERES = [case for case in FIELDS if case.name.startswith("normals")]


def vectors_at(case, rng=1):
    """Return two tangent vectors at the first point."""
    return case.space.random_tangent_vec(case.points[0], 2, rng=rng)


@pytest.mark.parametrize("case", FIELDS, ids=name_of)
def test_inner_products_are_kept_on_fields(case):
    start, end = case.points[:2]
    u, v = vectors_at(case)
    results = [PoleLadder(n_rungs=2).solve(case.metric, w, start, end_point=end) for w in (u, v)]
    carried = [result.tangent_vec for result in results]
    assert all(result.converged for result in results)
    assert np.all(case.space.is_tangent(np.stack(carried), end, atol=1e-8))
    inner = case.metric.inner_product
    size = np.sqrt(inner(u, u, start) * inner(v, v, start))
    assert abs(inner(*carried, end) - inner(u, v, start)) < 1e-8 * size
    np.testing.assert_array_equal(results[0].tangent_vecs[[0, -1]], [u, carried[0]])


@pytest.mark.everyday("ebin 0.0001 sphere", "ebin 0.5 triangle", "product of one")
@pytest.mark.parametrize("case", CURVED, ids=name_of)
def test_ladders_come_to_the_closed_form_at_second_order(case):
    start, end = case.points[:2]
    u, _ = vectors_at(case)
    exact = case.metric.parallel_transport(u, start, end_point=end)
    errors = []
    for n_rungs in (4, 8):
        path = case.metric.geodesic(start, end_point=end)(np.linspace(0.0, 1.0, n_rungs + 1))
        result = PoleLadder().solve(case.metric, u, start, path=path)
        assert len(result.path) == len(result.tangent_vecs) == n_rungs + 1
        errors.append(np.abs(result.tangent_vec - exact).max())
    assert orders(errors) > 1.85


@pytest.mark.parametrize("case", SPHERES, ids=name_of)
def test_pole_ladders_are_exact_on_symmetric_spaces(case):
    start, end = case.points[:2]
    u, _ = vectors_at(case)
    exact = case.metric.parallel_transport(u, start, end_point=end)
    one_rung = PoleLadder().solve(case.metric, u, start, path=np.stack([start, end]))
    np.testing.assert_allclose(one_rung.tangent_vec, exact, atol=1e-12)


def test_half_plane_against_the_known_transport():
    """Along the vertical line x = const from y₀ to y₁ vectors grow by y₁/y₀."""
    case = CASES["half-plane, distance"]
    start, end = np.array([0.2, 1.0]), np.array([0.2, 2.0])
    path = np.stack([np.full(5, 0.2), 2.0 ** np.linspace(0, 0.25, 5)], axis=1)
    vector = np.array([0.3, -0.7])
    result = PoleLadder(tolerance=1e-9).solve(case.metric, vector, start, path=path)
    assert result.n_evaluations > result.n_iterations > 4
    assert result.message == "4 rungs"
    np.testing.assert_array_equal(result.path, path)
    np.testing.assert_array_equal(result.tangent_vecs[[0, -1]], [vector, result.tangent_vec])
    # Vectors grow in proportion to y all along.
    growth = 2.0 ** np.linspace(0, 0.25, 5)[:, None]
    np.testing.assert_allclose(result.tangent_vecs, growth * vector, rtol=5e-4)
    solver = PathStraightening(n_nodes=5)
    found = PoleLadder(geodesic_solver=solver, tolerance=1e-9).solve(
        case.metric, vector, start, end_point=end
    )
    assert len(found.path) == 5
    np.testing.assert_allclose(found.tangent_vec, 2.0 * vector, rtol=2e-2)


def test_the_way_and_the_vector_extend_a_basis():
    case = CASES["mixed open"]
    metric, (u, v) = case.metric, case.tangent_vecs[:2]
    path = case.points[0] + np.linspace(0.0, 0.1, 3)[:, None, None] * v
    template = case.space.template
    basis = DeformationBasis(deformations(template, 3, rng=9), orthonormalize=True)
    longer = basis.extend(np.stack([path[-1] - path[0], u]))
    assert len(longer) == len(basis) + 2
    found, expected = (
        PoleLadder(basis=one).solve(metric, u, path[0], path=path).tangent_vec
        for one in (basis, longer)
    )
    np.testing.assert_allclose(found, expected, atol=1e-9)


def test_says_when_an_equation_was_not_solved():
    case = CASES["mixed sphere"]
    path = np.stack([case.points[0], 0.8 * case.points[0] + 0.2 * case.points[1]])
    ladder = PoleLadder(max_iter=2)
    with pytest.warns(ConvergenceWarning, match="1 rungs; an equation was solved only to"):
        result = ladder.solve(case.metric, case.tangent_vecs[0], path[0], path=path)
    assert not result.converged


def test_along_an_initial_velocity():
    case = CASES["ebin 1 sphere"]
    vector, start, end = case.tangent_vecs[1], *case.points[:2]
    ladder = PoleLadder(n_rungs=4)
    direction = case.metric.log(end, start)
    found = ladder.solve(case.metric, vector, start, direction)
    expected = ladder.solve(case.metric, vector, start, end_point=end)
    np.testing.assert_allclose(found.tangent_vec, expected.tangent_vec, rtol=0, atol=1e-8)
    np.testing.assert_allclose(found.path, expected.path, rtol=0, atol=1e-9)


def test_bad_input():
    case = CASES["mixed triangle"]
    start, end = case.points[:2]
    vector = case.tangent_vecs[0]
    ladder = PoleLadder()
    for arguments in ({}, {"end_point": end, "path": case.points}):
        with pytest.raises(ArgumentError, match="exactly one of direction, end_point and path"):
            ladder.solve(case.metric, vector, start, **arguments)
    with pytest.raises(NotDefinedError, match="geodesic_solver=BasisPath"):
        ladder.solve(case.metric, vector, start, end_point=end)
    with pytest.raises(ArgumentError, match="path must have at least two times; found 1"):
        ladder.solve(case.metric, vector, start, path=case.points[:1])
    with pytest.raises(ArgumentError, match="path must start at base_point; it is off by"):
        ladder.solve(case.metric, vector, end, path=case.points)
    ebin = CASES["ebin 1 sphere"]
    with pytest.raises(ArgumentError, match="direction or end_point, and not both"):
        ebin.metric.parallel_transport(ebin.tangent_vecs[0], ebin.points[0])
    with pytest.raises(OutsideManifoldError, match="stays clear of g = 0"):
        ebin.metric.parallel_transport(
            ebin.tangent_vecs[0], ebin.points[0], direction=-3.0 * ebin.points[0]
        )


def test_no_vector_and_no_way_are_carried_as_they_are():
    case = CASES["half-plane, distance"]
    vector, start = np.array([0.3, -0.7]), np.array([0.2, 1.0])
    path = np.stack([start, start, 2.0 * start])
    carried = PoleLadder().solve(case.metric, vector, start, path=path).tangent_vecs
    np.testing.assert_array_equal(carried[1], vector)
    assert np.abs(carried[2] - vector).max() > 0.1
    nothing = PoleLadder().solve(case.metric, np.zeros(2), start, path=path)
    np.testing.assert_array_equal(nothing.tangent_vecs, 0.0)
    assert (nothing.n_iterations, nothing.n_evaluations, nothing.converged) == (0, 0, True)
