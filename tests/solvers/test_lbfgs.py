"""L-BFGS with an operator: what it reaches, in how many evaluations, and how it stops."""

from functools import cache

import numpy as np
import pytest
from scipy import optimize

from riemhuman.solvers import _lbfgs
from riemhuman.solvers._lbfgs import Descent
from riemhuman.solvers.results import Status

SETTINGS = {"max_iter": 500, "tolerance": 1e-10}


def minimize(function, start, operator_at, floor=-np.inf, **settings):
    """Return the minimum, with an operator that depends on the point."""
    return Descent(function, start, operator_at, floor=floor, **settings).minimize()


def descend(function, start, operator, **settings):
    """Return the minimum, with one operator."""
    return minimize(function, start, lambda x: operator, **settings)


@cache
def problem(condition=1e4):
    """Return a convex function above 1, of minimum 1, with its Hessian at the origin."""
    size, rng = 60, np.random.default_rng(0)
    axes = np.linalg.qr(rng.standard_normal((size, size)))[0]
    hessian = axes * np.geomspace(1.0, condition, size) @ axes.T
    slope = hessian @ rng.standard_normal(size)

    def function(x):
        value = 0.5 * x @ hessian @ x - slope @ x + 0.1 * np.sum(x**4)
        return float(value) + offset, hessian @ x - slope + 0.4 * x**3

    offset = 0.0
    least = optimize.minimize(
        function, np.zeros(size), jac=True, method="BFGS", options={"gtol": 1e-7, "maxiter": 9999}
    )
    offset = 1.0 - float(least.fun)
    return function, hessian


@pytest.mark.parametrize("factor", [1e-3, 1.0, 1e3])
def test_near_hessians_save_iterations_whatever_their_size(factor):
    """The operator need not know the scale: the first step finds it."""
    function, hessian = problem()
    near = factor * np.linalg.inv(hessian + 0.5 * np.diag(np.diag(hessian)) / 10)
    start = np.zeros(len(hessian))
    plain = descend(function, start, lambda gradient: factor * gradient, **SETTINGS)
    found = descend(function, start, lambda gradient: near @ gradient, **SETTINGS)
    assert found.converged
    assert found.value == pytest.approx(1.0, rel=1e-6)
    assert found.n_iterations < plain.n_iterations / 2


def steps_tried(value, slope):
    """Return the steps that a search along a line tries, and the one it takes."""
    tried = []

    def objective(x):
        tried.append(float(x[0]))
        return value(x[0]), np.array([slope(x[0])])

    at_zero = np.zeros(1)
    found = _lbfgs._line_search(objective, at_zero, np.ones(1), value(0.0), slope(0.0))
    assert found.n_evaluations == len(tried)
    return tried, found.step


@pytest.mark.parametrize(("least", "second"), [(0.4, 0.4), (0.2, 0.2), (0.04, 0.1)])
def test_a_step_too_far_is_followed_by_the_least_of_a_parabola(least, second):
    """But no less than a tenth of it."""
    tried, _ = steps_tried(lambda t: 3.0 + (t - least) ** 2, lambda t: 2.0 * (t - least))
    np.testing.assert_allclose(tried[:2], [1.0, second])


def test_a_step_that_gains_next_to_nothing_is_shortened():
    """Half of what Wolfe's first condition asks for: 1e-4 of what the slope promises."""
    tried, step = steps_tried(lambda t: (1.0 - 5e-5) * t**2 - t, lambda t: 2.0 * t - 1.0)
    assert tried[0] == 1.0
    assert step == pytest.approx(0.5, rel=1e-4)


def test_steps_double_while_the_slope_is_steep():
    tried, step = steps_tried(lambda t: 0.5 * (t - 30.0) ** 2, lambda t: t - 30.0)
    assert (tried, step) == ([1.0, 2.0, 4.0], 4.0)


@pytest.mark.parametrize("beyond", [10.0, np.inf])
def test_between_steps_too_short_and_too_long_there_is_another(beyond):
    """A steep descent to a wall, which is not approached by more than nine tenths."""
    tried, step = steps_tried(lambda t: -t if t < 2.5 else beyond, lambda t: -1.0)
    assert tried[:3] == [1.0, 2.0, 4.0]
    assert len(tried) < 10
    assert 0.9 * 2.5 <= step < 2.5


def test_a_wall_far_ahead_of_the_first_step_is_kept_away_from():
    """The first trial lies 1,000 times too far: the step still ends short of the wall."""
    tried, step = steps_tried(lambda t: -t if t < 1e-3 else 1.0, lambda t: -1.0)
    assert len(tried) < 15
    assert 0.9e-3 <= step < 1e-3


def test_the_domain_is_not_left():
    """− log x + x, infinite below 0; the first step would leave it."""

    def function(x):
        if x[0] <= 0:
            return np.inf, np.zeros(1)
        return float(x[0] - np.log(x[0])), 1.0 - 1.0 / x

    found = descend(function, np.array([40.0]), lambda g: 100.0 * g, **SETTINGS)
    assert found.converged
    assert found.x[0] == pytest.approx(1.0, abs=1e-4)


def test_minima_at_zero_stop_at_the_floor():
    def function(x):
        return float(x @ x) ** 2, 4.0 * float(x @ x) * x

    found = descend(function, np.ones(3), lambda g: g, floor=1e-20, **SETTINGS)
    assert found.converged
    assert found.value <= 1e-20
    assert "rounding" in found.message
    assert found.gap == 0.0
    without = descend(function, np.ones(3), lambda g: g, **SETTINGS)
    assert without.n_iterations > found.n_iterations
    in_rounds = minimize(function, np.ones(3), lambda x: lambda g: g, floor=1e-20, **SETTINGS)
    assert in_rounds.n_iterations >= _lbfgs._SLOW
    assert in_rounds.gap == 0.0


def test_a_start_outside_the_domain_is_no_minimum():
    found = descend(lambda x: (np.inf, np.zeros(2)), np.ones(2), lambda g: g, **SETTINGS)
    assert found.status is Status.OUTSIDE_MANIFOLD
    assert np.isnan(found.gap)


def test_no_step_lowers_a_value_with_a_wrong_gradient():
    found = descend(lambda x: (float(x @ x), -x), np.ones(2), lambda g: g, **SETTINGS)
    assert found.status is Status.STALLED
    assert found.n_iterations == 0
    assert np.isnan(found.gap)


def test_the_slope_at_a_kink_tells_nothing():
    """A steep cusp beside a bowl: as where a triangle of a path has vanished."""

    def function(x):
        root = np.sqrt(abs(x[0])) + 1e-12
        cusp = 1e-2 * np.sign(x[0]) / (2.0 * root)
        bowl = np.geomspace(1.0, 1e3, len(x) - 1) * x[1:]
        value = 1.0 + 1e-2 * root + 0.5 * float(bowl @ x[1:])
        return value, np.concatenate([[cusp], bowl])

    start = np.concatenate([[1e-4], np.ones(9)])
    found = minimize(function, start, lambda x: lambda g: g, max_iter=200, tolerance=1e-12)
    assert abs(found.x[0]) < 1e-6
    assert found.gap == found.values[found.n_iterations // 2] - found.value


@pytest.mark.parametrize("refresh", [15, 50])
def test_many_iterations_end_when_they_gain_little(refresh):
    """The operator sees little of the soft directions, so that Newton steps seem small early."""
    function, _ = problem(condition=1e3)
    settings = {"max_iter": 500, "tolerance": 1e-2, "refresh": refresh}
    start, operator_at = np.zeros(60), lambda x: lambda g: 1e-3 * g
    early = minimize(function, start, operator_at, **settings)
    found = minimize(function, start, operator_at, recent_decrease=1e-3, **settings)
    assert early.converged
    assert early.values[early.n_iterations // 2] - early.value > 1e-3 * early.value
    assert found.converged
    assert early.value > 1.1
    assert found.value < 1.001


def test_the_operator_is_formed_anew():
    function, _ = problem()
    formed, seen = [], []

    def operator_at(x):
        formed.append(x)
        return lambda g: g / 1e3

    found = minimize(
        function,
        np.zeros(60),
        operator_at,
        max_iter=12,
        refresh=5,
        tolerance=1e-12,
        callback=lambda *s: seen.append(s),
    )
    assert (len(formed), found.n_iterations, found.status) == (3, 12, Status.MAX_ITER)
    assert [iteration for iteration, _, _ in seen] == list(range(1, 13))
    np.testing.assert_array_equal(formed[1], seen[4][2])
    np.testing.assert_allclose(found.values[1:], [value for _, value, _ in seen])


def test_interruption_anywhere_keeps_the_best_point():
    function, _ = problem()
    for stop in range(2, 9):
        calls = []

        def interrupted(x, calls=calls, stop=stop):
            calls.append(x)
            if len(calls) == stop:
                raise KeyboardInterrupt
            return function(x)

        found = descend(interrupted, np.zeros(60), lambda g: g / 1e3, **SETTINGS)
        assert found.status is Status.INTERRUPTED
        assert np.all(np.diff(found.values) < 0)
        assert found.n_iterations == len(found.values) - 1
        assert found.value == function(found.x)[0] == found.values[-1]


def test_a_search_ends_where_the_value_no_longer_changes():
    """The gain of iterations before these hides that the last ones gain almost nothing."""
    function, _ = problem()
    earlier, start = np.full(1000, 1e6), np.zeros(60)
    settings = {"max_iter": 500, "tolerance": 1e-4, "recent_decrease": 1e-3, "earlier": earlier}
    settings["refresh"] = 1000
    found = minimize(function, start, lambda x: lambda g: 1e-4 * g, **settings)
    assert found.message == "the value no longer changes"
    gains = -np.diff(found.values)
    assert found.n_iterations > 15
    assert gains[-15:].sum() <= 1e-6 * found.value < gains[-16:].sum()
