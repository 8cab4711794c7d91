"""Minimisation: what it reaches, what it says, and what an interruption leaves."""

import numpy as np
import pytest
from scipy import optimize

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
    assert "still" not in found.message
    assert "tolerance" not in found.message
    assert not found.newton_was_small  # nobody asked
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


def test_a_start_at_the_floor_is_low_enough():
    found = minimize(lambda x: (1.0, np.ones(2)), np.zeros(2), expected_decrease=1e-9, floor=1.0)
    assert (found.converged, found.n_iterations, found.n_evaluations) == (True, 0, 1)
    assert found.message == "the value is no more than rounding errors"


def test_a_minimum_of_value_zero_is_one():
    found = minimize(lambda x: (0.0, 0 * x), np.zeros(2), expected_decrease=1e-9)
    assert (found.converged, found.n_iterations, found.n_evaluations) == (True, 0, 1)
    assert found.message == "the expected decrease is below the tolerance"


@pytest.mark.parametrize(("share", "is_met"), [(0.99, True), (1.01, False)])
def test_the_start_is_taken_where_a_newton_step_would_gain_little(share, is_met):
    """With the identity for Hessian, from x with value 2 + ½x² it gains ½x²."""
    tolerance = 0.125
    # The x with ½x² = share · tolerance · (2 + ½x²).
    x = np.sqrt(4.0 * share * tolerance / (1.0 - share * tolerance))
    found = minimize(
        lambda x: (2.0 + 0.5 * float(x @ x), x), np.array([x]), expected_decrease=tolerance
    )
    assert found.converged
    assert (found.n_iterations == 0) == is_met


def scripted(monkeypatch, script):
    """Have SciPy make these steps, each (value, slope, whether an iteration ends with it)."""

    def objective(x):
        value, slope, _ = script[int(x[0])]
        return value, np.array([slope])

    def walk(function, start, *, callback, **_):
        function(start)
        for place, (value, _, ends) in enumerate(script[1:], start=1):
            x = np.array([float(place)])
            function(x)
            try:
                if ends:
                    callback(optimize.OptimizeResult(x=x, fun=value))
            except StopIteration:
                break
        return optimize.OptimizeResult(success=True, message="the end of the script")

    monkeypatch.setattr(optimize, "minimize", walk)
    return objective


def test_the_test_is_of_the_last_value_and_gradient(monkeypatch):
    """A gradient with ½‖∇‖² = 2 is small beside 1000, where it began, and large beside 1."""
    script = [(1000.0, 99.0, True), (400.0, 40.0, True), (1.0, 2.0, True), (0.9, 0.1, True)]
    objective = scripted(monkeypatch, [*script, (0.8, 0.0, True)])
    found = minimize(objective, np.zeros(1), expected_decrease=0.01)
    np.testing.assert_array_equal(found.values, [1000.0, 400.0, 1.0, 0.9])
    assert found.x == [3.0]
    assert (found.value, found.n_iterations, found.n_evaluations) == (0.9, 3, 4)
    assert found.converged
    assert found.message == "the expected decrease is below the tolerance"


def test_the_end_of_scipy_is_no_convergence_where_decrease_is_expected(monkeypatch):
    objective = scripted(monkeypatch, [(3.0, 9.0, True), (2.0, 9.0, True)])
    found = minimize(objective, np.zeros(1), expected_decrease=0.01)
    assert (found.converged, found.message) == (False, "the end of the script")
    assert minimize(objective, np.zeros(1)).converged


@pytest.mark.parametrize("method", ["L-BFGS-B", "BFGS"])
def test_iterations_alone_are_limited(monkeypatch, method):
    """SciPy would count evaluations, too."""
    given = []

    def refuse(*_, options, **__):
        given.append(options)
        raise KeyboardInterrupt

    monkeypatch.setattr(optimize, "minimize", refuse)
    assert minimize(quadratic, np.zeros(3), method=method).interrupted
    minimize(quadratic, np.zeros(3), method=method, max_iter=7)
    assert [options["maxiter"] for options in given] == [1000, 7]
    assert all(options.get("maxfun", np.inf) == np.inf for options in given)


def test_standing_still_for_fifteen_iterations_ends_it(monkeypatch):
    level = [(2.0, 9.0, True)] * 20
    objective = scripted(monkeypatch, [(5.0, 9.0, True), (3.0, 9.0, True), *level])
    found = minimize(objective, np.zeros(1), expected_decrease=1e-3)
    np.testing.assert_array_equal(found.values, [5.0, 3.0, *[2.0] * 16])
    assert found.converged
    assert found.message == "the value has stood still for 15 iterations"
    without = minimize(objective, np.zeros(1))
    assert (without.n_iterations, without.message) == (21, "the end of the script")


def test_the_best_point_may_be_one_that_ends_no_iteration(monkeypatch):
    steps = [(5.0, 1.0, True), (2.0, 1.0, False), (4.0, 1.0, True), (2.0, 1.0, True)]
    found = minimize(scripted(monkeypatch, steps), np.zeros(1))
    np.testing.assert_array_equal(found.values, [5.0, 4.0, 2.0])
    assert (found.value, found.x) == (2.0, [1.0])


def test_start_without_a_finite_value():
    found = minimize(lambda x: (np.inf, 0 * x), np.zeros(2))
    assert not found.converged
    assert not found.interrupted
    assert (found.value, found.n_iterations, found.n_evaluations) == (np.inf, 0, 1)
    np.testing.assert_array_equal(found.x, 0.0)
    np.testing.assert_array_equal(found.values, [np.inf])
    assert "not finite" in found.message


def test_iteration_limit_is_said():
    found = minimize(rosenbrock, np.array([-1.2, 1.0]), max_iter=3, expected_decrease=1e-9)
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
        whitened(quadratic), np.zeros(3), max_iter=50, expected_decrease=1e-10
    )
    assert found.converged
    assert found.n_iterations <= 2
    np.testing.assert_allclose(found.x, 1.0, atol=1e-4)


def test_rounds_keep_one_history():
    seen = []
    found = minimize_in_rounds(
        whitened(rosenbrock),
        np.array([-1.2, 1.0]),
        max_iter=200,
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


def counting(local_problem):
    """Return local problems that list where they are asked for."""
    asked = []

    def around(x):
        asked.append(x)
        return local_problem(x)

    return around, asked


def test_rounds_have_their_length():
    around, asked = counting(whitened(rosenbrock))
    settings = {"max_iter": 7, "expected_decrease": 1e-10}
    start = np.array([-1.2, 1.0])
    seen = []
    found = minimize_in_rounds(
        around, start, iterations_per_round=3, callback=lambda *s: seen.append(s), **settings
    )
    assert found.n_iterations == 7
    assert len(asked) == 3
    np.testing.assert_array_equal(asked[0], start)
    np.testing.assert_allclose(asked[1:], [seen[2][2], seen[5][2]], rtol=1e-12)
    around, asked = counting(whitened(rosenbrock))
    assert minimize_in_rounds(around, start, iterations_per_round=1, **settings).n_iterations == 7
    assert len(asked) == 7


def test_rounds_end_where_no_step_lowers_the_value(capsys):
    def misled(x):
        value, gradient = quadratic(x)
        return value, -gradient

    around, asked = counting(whitened(misled))
    found = minimize_in_rounds(around, np.zeros(3), max_iter=50, expected_decrease=1e-6)
    assert (found.converged, found.interrupted, found.n_iterations) == (False, False, 0)
    assert found.value == pytest.approx(quadratic(np.zeros(3))[0])
    assert len(asked) == 1
    assert capsys.readouterr().err == ""


def test_rounds_count_every_evaluation():
    counted = []

    def counted_rosenbrock(x):
        counted.append(x)
        return rosenbrock(x)

    settings = {"expected_decrease": 1e-10, "iterations_per_round": 4}
    start = np.array([-1.2, 1.0])
    for limit in (6, 200):
        counted.clear()
        found = minimize_in_rounds(whitened(counted_rosenbrock), start, max_iter=limit, **settings)
        assert found.n_evaluations == len(counted)


def test_rounds_stop_at_the_limit_and_on_interruption():
    start = np.array([-1.2, 1.0])
    settings = {"expected_decrease": 1e-10, "iterations_per_round": 3}
    limited = minimize_in_rounds(whitened(rosenbrock), start, max_iter=7, **settings)
    assert limited.n_iterations == 7
    assert not limited.converged
    stopped = minimize_in_rounds(
        whitened(rosenbrock), start, max_iter=100, callback=interrupt_at(5), **settings
    )
    assert stopped.interrupted
    assert stopped.n_iterations == 5
    assert stopped.value <= stopped.values.min() * (1 + 1e-12)


def test_a_kink_does_not_hold_the_minimiser_for_ever():
    def kinked(x):
        return 1.0 + np.abs(x).sum(), np.where(x >= 0, 1.0, -1.0)

    start = np.array([0.3, -0.71, 0.113])
    found = minimize(kinked, start, expected_decrease=1e-4, max_iter=100_000)
    assert found.value == pytest.approx(1.0, abs=0.5)
    assert found.n_iterations < 1000


def test_standing_still_is_measured_over_many_iterations():
    def slow(x):
        return 1.0 + 1e-6 * (1 - x[0]), np.array([1.0])

    values = [slow(np.array([0.01 * k]))[0] for k in range(30)]
    assert minimization.stands_still(1e-3, values)
    assert not minimization.stands_still(1e-4, values[:15])
    assert not minimization.stands_still(1e-9, values)
    assert not minimization.stands_still(1e-3, [*[2.0] * 30, 1.0])
    assert minimization.stands_still(1e-3, [9.0] * 5 + [2.0] * 16)
    assert not minimization.stands_still(1e-3, [9.0] * 5 + [2.0] * 15)
    level = [2.0] * minimization._PATIENCE
    assert not minimization.stands_still(1e-3, level)
    assert minimization.stands_still(1e-3, [2.0, *level])
    assert minimization.stands_still(1e-3, [0.0, *[0.0] * minimization._PATIENCE])
    # A share of the expected decrease, itself a share of the value.
    gain = 2.0 * 1e-3 * minimization._STILL
    assert minimization.stands_still(1e-3, [2.0 + 0.99 * gain, *level])
    assert not minimization.stands_still(1e-3, [2.0 + 1.01 * gain, *level])
    assert minimization.stands_still(1e-3, [-2.0 + 0.99 * gain, *[-2.0] * minimization._PATIENCE])


def test_an_interruption_between_rounds_keeps_what_was_reached():
    def around(x):
        if x.any():
            raise KeyboardInterrupt
        return whitened(rosenbrock)(x)

    found = minimize_in_rounds(
        around, np.zeros(2), max_iter=50, expected_decrease=1e-10, iterations_per_round=3
    )
    assert found.interrupted
    assert not found.converged
    assert found.n_iterations == len(found.values) - 1 == 3
    assert found.n_evaluations >= 4
    assert found.value == found.values[-1]
    np.testing.assert_allclose(found.value, rosenbrock(found.x)[0], rtol=1e-12)
    with pytest.raises(KeyboardInterrupt):
        minimize_in_rounds(around, np.ones(2), max_iter=50, expected_decrease=1e-10)
