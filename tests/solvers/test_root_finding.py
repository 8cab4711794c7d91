"""Roots of systems near the identity."""

import numpy as np
import pytest

from riemhuman.solvers import root_finding
from riemhuman.solvers.root_finding import find_root


def system(size=12, strength=0.6):
    """Return F(x) = x + strength · sin(Ax) − b with its root, and a count of evaluations."""
    rng = np.random.default_rng(0)
    matrix = rng.standard_normal((size, size)) / size
    root = rng.standard_normal(size)
    right = root + strength * np.sin(matrix @ root)
    calls = []

    def function(x):
        calls.append(x)
        return x + strength * np.sin(matrix @ x) - right

    return function, root, calls


def test_finds_the_root():
    function, root, calls = system()
    found = find_root(function, np.zeros(12), tolerance=1e-12, max_iter=50)
    np.testing.assert_allclose(found.x, root, atol=1e-11)
    assert found.residual <= 1e-12
    assert found.n_evaluations == len(calls)
    assert found.n_iterations <= 15


def test_linear_systems_need_no_more_steps_than_unknowns():
    rng = np.random.default_rng(1)
    matrix = np.eye(6) + 0.8 * rng.standard_normal((6, 6))
    right = rng.standard_normal(6)
    found = find_root(lambda x: matrix @ x - right, np.zeros(6), tolerance=1e-9, max_iter=50)
    np.testing.assert_allclose(found.x, np.linalg.solve(matrix, right), rtol=1e-6)
    assert found.n_iterations <= 8


def test_a_root_at_the_start_takes_one_evaluation():
    found = find_root(lambda x: x, np.zeros(3), tolerance=1e-12, max_iter=5)
    assert (found.n_iterations, found.n_evaluations, found.residual) == (0, 1, 0.0)
    # A norm of exactly the tolerance is within it.
    found = find_root(lambda x: x + 1.0, np.zeros(1), tolerance=1.0, max_iter=5)
    assert (found.n_iterations, found.n_evaluations, found.residual) == (0, 1, 1.0)


def test_steps_that_leave_the_domain_are_halved():
    def function(x):
        return None if abs(x[0]) > 1.0 else 3.0 * (x - 0.9)

    found = find_root(function, np.zeros(1), tolerance=1e-9, max_iter=50)
    np.testing.assert_allclose(found.x, 0.9, rtol=1e-8)
    outside = find_root(function, np.ones(1) * 2, tolerance=1e-9, max_iter=5)
    assert outside == (2.0, np.inf, 0, 1)


def test_stops_at_the_most_iterations_with_the_best_point():
    function, _, _ = system(strength=3.0)
    found = find_root(function, np.zeros(12), tolerance=1e-12, max_iter=2)
    assert found.n_iterations <= 2
    assert found.residual == np.linalg.norm(function(found.x))
    assert found.residual <= np.linalg.norm(function(np.zeros(12)))


def points_asked(function, start, max_iter):
    """Return where a function is evaluated, and what is found."""
    asked = []

    def recorded(x):
        asked.append(float(x[0]))
        return function(x)

    found = find_root(recorded, np.array([start]), tolerance=1e-9, max_iter=max_iter)
    return asked, found


@pytest.mark.parametrize(("slope", "halved"), [(2.9, False), (3.0, False), (3.1, True)])
def test_steps_that_more_than_double_the_residual_are_halved(slope, halved):
    # From 0 a whole step leads to the slope, where the residual is slope − 1 times that at 0.
    asked, found = points_asked(lambda x: slope * (x - 1.0), 0.0, 1)
    np.testing.assert_allclose(asked, [0.0, slope, 0.5 * slope] if halved else [0.0, slope])
    assert found.n_evaluations == len(asked)
    assert found.x[0] == (0.5 * slope if halved else 0.0)


def test_a_domain_without_a_way_on_ends_the_search():
    asked, found = points_asked(lambda x: np.ones(1) if x[0] == 0.0 else None, 0.0, 9)
    np.testing.assert_allclose(asked, [0.0, *(-(0.5**k) for k in range(8))])
    assert (found.x[0], found.residual) == (0.0, 1.0)
    assert (found.n_iterations, found.n_evaluations) == (0, 9)


@pytest.mark.parametrize("residuals", [[4.0, 2.0, 3.0, 2.5], [4.0, 2.0, 2.5, 2.0]])
def test_the_best_point_tells_the_step_that_found_it_first(residuals):
    values = iter(residuals)
    found = find_root(lambda x: np.array([next(values)]), np.zeros(1), tolerance=1e-9, max_iter=3)
    assert (found.residual, found.n_iterations, found.n_evaluations) == (2.0, 1, 4)


def test_steps_are_those_of_anderson_from_the_newest_alone(monkeypatch):
    """x − F − Σ γᵢ (sᵢ − yᵢ) with the least ‖F − Σ γᵢ yᵢ‖, for two steps s and changes y of F."""
    monkeypatch.setattr(root_finding, "_MEMORY", 2)
    function, _, calls = system(strength=0.9)
    find_root(function, np.zeros(12), tolerance=1e-9, max_iter=7)
    values = [function(x) for x in tuple(calls)]
    for k in range(2, 7):
        steps, changes = (np.diff(some[k - 2 : k + 1], axis=0).T for some in (calls, values))
        gammas = np.linalg.lstsq(changes, values[k], rcond=None)[0]
        expected = calls[k] - values[k] - (steps - changes) @ gammas
        np.testing.assert_allclose(calls[k + 1], expected, atol=1e-12)


@pytest.mark.parametrize("memory", [2, 20])
def test_lengths_by_a_matrix_are_those_in_its_variables(monkeypatch, memory):
    """The same search in x with lengths by A, and in Lᵀ x with Euclidean ones, A = L Lᵀ."""
    monkeypatch.setattr(root_finding, "_MEMORY", memory)
    rng = np.random.default_rng(5)
    lower = np.tril(rng.normal(size=(6, 6))) + 4.0 * np.eye(6)
    target = rng.normal(size=6)

    def residual(x):
        return (x - target) + 0.1 * np.sin(x)

    def with_dual(x):
        return residual(x), lower @ lower.T @ residual(x)

    def in_variables(variables):
        return lower.T @ residual(np.linalg.solve(lower.T, variables))

    settings = {"tolerance": 1e-10, "max_iter": 30}
    one = find_root(with_dual, np.zeros(6), **settings)
    other = find_root(in_variables, np.zeros(6), **settings)
    assert one.residual <= 1e-10
    assert one.n_iterations == other.n_iterations
    np.testing.assert_allclose(lower.T @ one.x, other.x, atol=1e-9)
