"""Minimisation: what it reaches, what it says, and what an interruption leaves."""

import numpy as np
import pytest

from riemhuman.solvers import minimization
from riemhuman.solvers.minimization import LocalProblem, minimize, minimize_in_rounds

SCALES = np.array([1.0, 10.0, 100.0])


def quadratic(x):
    return 1.0 + 0.5 * float(SCALES @ (x - 1.0) ** 2), SCALES * (x - 1.0)


def rosenbrock(x):
    a, b = x
    value = (1 - a) ** 2 + 100 * (b - a**2) ** 2 + 1.0
    return float(value), np.array([-2 * (1 - a) - 400 * a * (b - a**2), 200 * (b - a**2)])


@pytest.mark.parametrize("method", ["L-BFGS-B", "BFGS"])
def test_minimum_of_a_quadratic(method):
    start = np.zeros(3)
    found = minimize(quadratic, start, method=method)
    np.testing.assert_allclose(found.x, 1.0, atol=1e-4)
    assert found.converged
    assert not found.interrupted
    assert found.value == quadratic(found.x)[0]
    assert found.n_iterations == len(found.values) - 1 > 0
    assert found.n_evaluations >= found.n_iterations + 1
    assert found.values[0] == quadratic(start)[0]
    assert np.all(np.diff(found.values) <= 0)
    np.testing.assert_array_equal(start, 0.0)


@pytest.mark.parametrize("tolerance", [1e-2, 1e-6, 1e-12])
def test_expected_decrease_bounds_what_is_left_to_gain(tolerance):
    """With the Hessian at least the identity, as here, ½‖∇‖² bounds the gain."""
    found = minimize(quadratic, np.zeros(3), expected_decrease=tolerance)
    assert found.converged
    assert not found.interrupted
    assert found.message == "the expected decrease is below the tolerance"
    assert found.value - 1.0 <= tolerance * found.value


def test_expected_decrease_is_not_fooled_by_short_steps():
    """SciPy's own test stops in a long valley where one step gains little; this one does not."""
    start = np.array([-1.2, 1.0])
    loose = minimize(rosenbrock, start, options={"ftol": 1e-2})
    assert loose.value > 1.01
    strict = minimize(rosenbrock, start, expected_decrease=1e-8)
    assert strict.converged
    assert strict.value < 1.0 + 1e-6


def test_start_at_the_minimum():
    found = minimize(quadratic, np.ones(3), expected_decrease=1e-9)
    assert not found.interrupted
    np.testing.assert_array_equal(found.values, [1.0])
    assert (found.converged, found.n_iterations, found.n_evaluations) == (True, 0, 1)
    np.testing.assert_array_equal(found.x, 1.0)


def test_start_without_a_finite_value():
    found = minimize(lambda x: (np.inf, 0 * x), np.zeros(2))
    assert not found.converged
    assert not found.interrupted
    assert (found.value, found.n_iterations, found.n_evaluations) == (np.inf, 0, 1)
    np.testing.assert_array_equal(found.x, 0.0)
    np.testing.assert_array_equal(found.values, [np.inf])
    assert "not finite" in found.message


def test_iteration_limit_is_said():
    found = minimize(rosenbrock, np.array([-1.2, 1.0]), max_iterations=3, expected_decrease=1e-9)
    assert found.n_iterations == 3
    assert not found.converged
    assert not found.interrupted
    assert "LIMIT" in found.message.upper()


def test_callback_sees_every_iteration():
    seen = []
    found = minimize(
        rosenbrock, np.zeros(2), callback=lambda k, value, x: seen.append((k, value, x.copy()))
    )
    assert [iteration for iteration, _, _ in seen] == list(range(1, found.n_iterations + 1))
    np.testing.assert_array_equal([value for _, value, _ in seen], found.values[1:])
    for _, value, x in seen:
        assert value == rosenbrock(x)[0]


def interrupt_at(count):
    def callback(iteration, value, x):
        if iteration == count:
            raise KeyboardInterrupt

    return callback


@pytest.mark.parametrize("method", ["L-BFGS-B", "BFGS"])
def test_interruption_in_the_callback_loses_nothing(method):
    found = minimize(rosenbrock, np.zeros(2), method=method, callback=interrupt_at(3))
    assert found.interrupted
    assert not found.converged
    assert "interrupted" in found.message
    assert found.n_iterations == 3
    assert found.value <= found.values.min()
    assert found.value == rosenbrock(found.x)[0]


def test_interruption_in_the_objective_loses_nothing():
    evaluated = []

    def objective(x):
        if len(evaluated) == 6:
            raise KeyboardInterrupt
        evaluated.append(rosenbrock(x)[0])
        return rosenbrock(x)

    found = minimize(objective, np.array([-1.2, 1.0]))
    assert found.interrupted
    assert found.value == min(evaluated)


def test_other_errors_pass():
    def callback(iteration, value, x):
        raise ZeroDivisionError

    with pytest.raises(ZeroDivisionError):
        minimize(quadratic, np.zeros(3), callback=callback)


def test_progress_goes_to_standard_error(capsys):
    minimize(quadratic, np.zeros(3), progress=True, description="straightening")
    shown = capsys.readouterr()
    assert shown.out == ""
    assert "straightening" in shown.err
    minimize(quadratic, np.zeros(3))
    assert capsys.readouterr().err == ""


# In rounds.


def whitened(function, unit=5.0):
    """Return local problems in variables scaled by √unit/√SCALES, the inverse root Hessian."""

    def around(x):
        scale = np.sqrt(unit / SCALES[: len(x)])

        def position(variables):
            return x + scale * variables

        def objective(variables):
            value, gradient = function(position(variables))
            return value / unit, scale * gradient / unit

        return LocalProblem(objective, position, unit)

    return around


def test_rounds_reach_the_minimum_in_one_newton_step():
    found = minimize_in_rounds(
        whitened(quadratic), np.zeros(3), max_iterations=50, expected_decrease=1e-10
    )
    assert found.converged
    assert found.n_iterations <= 2
    np.testing.assert_allclose(found.x, 1.0, atol=1e-4)


def test_rounds_keep_one_history():
    seen = []
    found = minimize_in_rounds(
        whitened(rosenbrock),
        np.array([-1.2, 1.0]),
        max_iterations=200,
        expected_decrease=1e-10,
        iterations_per_round=4,
        callback=lambda *state: seen.append(state),
    )
    assert found.converged
    assert found.n_iterations > 4
    np.testing.assert_allclose(found.x, 1.0, atol=1e-4)
    np.testing.assert_allclose(found.value, rosenbrock(found.x)[0], rtol=1e-12)
    assert len(found.values) == found.n_iterations + 1
    assert np.all(np.diff(found.values) <= 1e-12)
    assert [iteration for iteration, _, _ in seen] == list(range(1, found.n_iterations + 1))
    for _, value, x in seen:
        np.testing.assert_allclose(value, rosenbrock(x)[0], rtol=1e-12)


def test_rounds_stop_at_the_limit_and_on_interruption():
    start = np.array([-1.2, 1.0])
    settings = {"expected_decrease": 1e-10, "iterations_per_round": 3}
    limited = minimize_in_rounds(whitened(rosenbrock), start, max_iterations=7, **settings)
    assert limited.n_iterations == 7
    assert not limited.converged
    stopped = minimize_in_rounds(
        whitened(rosenbrock), start, max_iterations=100, callback=interrupt_at(5), **settings
    )
    assert stopped.interrupted
    assert stopped.n_iterations == 5
    assert stopped.value <= stopped.values.min() * (1 + 1e-12)


def test_a_kink_does_not_hold_the_minimiser_for_ever():
    def kinked(x):
        return 1.0 + np.abs(x).sum(), np.where(x >= 0, 1.0, -1.0)

    start = np.array([0.3, -0.71, 0.113])
    found = minimize(kinked, start, expected_decrease=1e-4, max_iterations=100_000)
    assert found.value == pytest.approx(1.0, abs=0.5)
    assert found.n_iterations < 1000


def test_standing_still_is_measured_over_many_iterations():
    def slow(x):
        return 1.0 + 1e-6 * (1 - x[0]), np.array([1.0])

    values = [slow(np.array([0.01 * k]))[0] for k in range(30)]
    assert minimization._stands_still(1e-3, values)
    assert not minimization._stands_still(1e-4, values[:15])
    assert not minimization._stands_still(1e-9, values)
    level = [2.0] * minimization._PATIENCE
    assert not minimization._stands_still(1e-3, level)
    assert minimization._stands_still(1e-3, [2.0, *level])
    # A share of the expected decrease, itself a share of the value.
    gain = 2.0 * 1e-3 * minimization._STILL
    assert minimization._stands_still(1e-3, [2.0 + 0.99 * gain, *level])
    assert not minimization._stands_still(1e-3, [2.0 + 1.01 * gain, *level])
    assert minimization._stands_still(1e-3, [-2.0 + 0.99 * gain, *[-2.0] * minimization._PATIENCE])


def test_an_interruption_between_rounds_keeps_what_was_reached():
    def around(x):
        if x.any():
            raise KeyboardInterrupt
        return whitened(rosenbrock)(x)

    found = minimize_in_rounds(
        around, np.zeros(2), max_iterations=50, expected_decrease=1e-10, iterations_per_round=3
    )
    assert found.interrupted
    assert not found.converged
    assert found.n_iterations == len(found.values) - 1 == 3
    assert found.n_evaluations >= 4
    assert found.value == found.values[-1]
    np.testing.assert_allclose(found.value, rosenbrock(found.x)[0], rtol=1e-12)
    with pytest.raises(KeyboardInterrupt):
        minimize_in_rounds(around, np.ones(2), max_iterations=50, expected_decrease=1e-10)
