"""Minimisation with SciPy, with a history, interruption, and a stopping test of its own."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy import ndarray
from scipy import optimize

from riemhuman.progress import ProgressBar
from riemhuman.solvers._lbfgs import Minimum
from riemhuman.solvers.results import Status

# Iterations that together must gain more than `_STILL` times the expected decrease.
_PATIENCE = 15
_STILL = 0.01

# Iterations after which a preconditioner is formed anew, and steps that SciPy remembers.
_ROUND = 25
_MEMORY = 20

WALL = 10.0
"""Value of points that a search must leave again, where objectives start at about one."""

Objective = Callable[[ndarray], tuple[float, ndarray]]


class _Record:
    """The objective, remembering the best point and the last gradient."""

    def __init__(self, objective: Objective, start: ndarray) -> None:
        self.objective = objective
        self.last_value, self.last_gradient = objective(start)
        self.last_x = self.best_x = start.copy()
        self.best_value = self.last_value
        self.n_evaluations = 1

    def __call__(self, x: ndarray) -> tuple[float, ndarray]:
        if np.array_equal(x, self.last_x):
            # SciPy asks for the start once more.
            return self.last_value, self.last_gradient
        value, gradient = self.objective(x)
        self.n_evaluations += 1
        self.last_x, self.last_value, self.last_gradient = x.copy(), value, gradient
        if value < self.best_value:
            self.best_value, self.best_x = value, x.copy()
        return value, gradient


def minimize(
    objective: Objective,
    start: ndarray,
    *,
    method: str = "L-BFGS-B",
    max_iter: int = 1000,
    expected_decrease: float | None = None,
    floor: float = -np.inf,
    options: Mapping[str, Any] | None = None,
    callback: Callable[[int, float, ndarray], Any] | None = None,
    progress: bool = False,
    description: str = "minimising",
) -> Minimum:
    """Minimise a smooth function.

    Parameters
    ----------
    objective : callable
        Returns value and gradient at x.
    start : array, shape (n,)
        Starting point.
    method : str
        "L-BFGS-B" or "BFGS" of `scipy.optimize.minimize`.
    max_iter : int
        Most iterations.
    expected_decrease : float, optional
        For variables in which the Hessian is about the identity: stop when ½‖gradient‖², the gain
        of a Newton step, is at most this share of the value, or when many iterations together have
        gained a small part of that, as at a minimum where the function has a kink. Replaces SciPy's
        tests, one of which mistakes a single short step for convergence.
    floor : float
        Value at which to stop, for minima that may be zero: smaller values are rounding errors.
    options : mapping, optional
        More options of SciPy's method.
    callback : callable, optional
        Called with (iteration, value, x) after each iteration.
    progress : bool
        Whether to show a progress bar.
    description : str
        Text of the progress bar.

    Returns
    -------
    Minimum
    """
    record = _Record(objective, start)
    value = record.last_value
    values = [value]
    if not np.isfinite(value):
        message = "the value at the start is not finite"
        return Minimum(
            start, value, np.array(values), n_evaluations=1, status=Status.STALLED, message=message
        )
    met_test = expected_decrease is not None and _is_met(
        expected_decrease, value, record.last_gradient
    )
    is_still, at_floor = False, value <= floor

    def after_iteration(intermediate_result: optimize.OptimizeResult) -> None:
        nonlocal met_test, is_still, at_floor
        values.append(float(intermediate_result.fun))
        bar.update()
        bar.set_postfix_str(f"value {values[-1]:.6g}", refresh=False)
        if callback is not None:
            callback(len(values) - 1, values[-1], intermediate_result.x.copy())
        at_floor = record.best_value <= floor
        if at_floor:
            raise StopIteration
        if expected_decrease is None:
            return
        if np.array_equal(intermediate_result.x, record.last_x):
            met_test = _is_met(expected_decrease, values[-1], record.last_gradient)
        is_still = stands_still(expected_decrease, values)
        if met_test or is_still:
            raise StopIteration

    settings: dict[str, Any] = {"maxiter": max_iter}
    if method == "L-BFGS-B":
        settings["maxfun"] = np.inf
    if expected_decrease is not None:
        settings |= {"ftol": 0.0, "gtol": 0.0, "maxcor": _MEMORY}
    settings |= options or {}

    converged, interrupted, message = met_test or at_floor, False, ""
    with ProgressBar(total=None, desc=description, disable=not progress, unit=" iterations") as bar:
        if not converged:
            try:
                result = optimize.minimize(
                    record,
                    start,
                    jac=True,
                    method=method,
                    callback=after_iteration,
                    options=settings,
                )
                converged = met_test or is_still or at_floor
                if expected_decrease is None and not at_floor:
                    converged = bool(result.success)
                message = str(result.message)
            except KeyboardInterrupt:
                converged, interrupted, message = False, True, "interrupted from the keyboard"
    if at_floor:
        message = "the value is no more than rounding errors"
    elif met_test:
        message = "the expected decrease is below the tolerance"
    elif is_still:
        message = f"the value has stood still for {_PATIENCE} iterations"
    return Minimum(
        record.best_x,
        record.best_value,
        np.array(values),
        n_iterations=len(values) - 1,
        n_evaluations=record.n_evaluations,
        status=Status.INTERRUPTED if interrupted else Status.of(converged),
        message=message,
    )


@dataclass(frozen=True)
class LocalProblem:
    """A minimisation in preconditioned variables around one point.

    Attributes
    ----------
    objective : callable
        Maps variables to value and gradient, in units of `unit`; 0 is the point itself.
    position : callable
        Maps variables to x.
    unit : float
        Unit of the values.
    """

    objective: Objective
    position: Callable[[ndarray], ndarray]
    unit: float


def minimize_in_rounds(
    local_problem: Callable[[ndarray], LocalProblem],
    start: ndarray,
    *,
    max_iter: int,
    expected_decrease: float,
    floor: float = -np.inf,
    iterations_per_round: int = _ROUND,
    options: Mapping[str, Any] | None = None,
    callback: Callable[[int, float, ndarray], Any] | None = None,
    progress: bool = False,
    description: str = "minimising",
) -> Minimum:
    """Minimise a smooth function, with the preconditioner formed anew after every round.

    Parameters
    ----------
    local_problem : callable
        Maps x to the problem in preconditioned variables around it.
    start : array
        Starting point.
    max_iter : int
        Largest number of iterations of all rounds together.
    expected_decrease : float
        Stopping test, see `minimize`.
    floor : float
        Value at which to stop, see `minimize`.
    iterations_per_round : int
        Largest number of iterations of one round.
    options : mapping, optional
        More options of SciPy's method.
    callback : callable, optional
        Called with (iteration, value, x) after each iteration.
    progress : bool
        Whether to show a progress bar.
    description : str
        Text of the progress bar.

    Returns
    -------
    Minimum
    """
    x, values, n_evaluations = start, np.empty(0), 0
    while True:
        try:
            local = local_problem(x)
        except KeyboardInterrupt:
            if not len(values):
                raise
            return Minimum(
                x,
                values[-1],
                values,
                n_iterations=len(values) - 1,
                n_evaluations=n_evaluations,
                status=Status.INTERRUPTED,
                message="interrupted from the keyboard",
            )
        n_before = max(len(values) - 1, 0)

        def report(iteration: int, value: float, variables: ndarray) -> None:
            if callback is not None:
                position = local.position(variables)  # noqa: B023, used within this round
                callback(n_before + iteration, value * local.unit, position)  # noqa: B023

        found = minimize(
            local.objective,
            np.zeros(start.size),
            max_iter=min(iterations_per_round, max_iter - n_before),
            expected_decrease=expected_decrease,
            floor=floor / local.unit,
            options=options,
            callback=report,
            progress=progress,
            description=description,
        )
        x = local.position(found.x)
        n_evaluations += found.n_evaluations
        values = np.concatenate([values[:-1], found.values * local.unit])
        n_iterations = len(values) - 1
        stuck = found.n_iterations == 0
        if (
            found.converged
            or found.status is Status.INTERRUPTED
            or stuck
            or n_iterations >= max_iter
        ):
            return Minimum(
                x,
                found.value * local.unit,
                values,
                n_iterations=n_iterations,
                n_evaluations=n_evaluations,
                status=found.status,
                message=found.message,
            )


def _is_met(expected_decrease: float, value: float, gradient: ndarray) -> bool:
    return 0.5 * float(gradient @ gradient) <= expected_decrease * value


def stands_still(expected_decrease: float, values: list[float]) -> bool:
    """Return whether many iterations have gained only a small part of the required decrease.

    Parameters
    ----------
    expected_decrease : float
        Share of the value at which a minimisation stops.
    values : list of float
        Values after each iteration.

    Returns
    -------
    bool
    """
    if len(values) <= _PATIENCE:
        return False
    before, now = values[-1 - _PATIENCE], values[-1]
    return before - now <= _STILL * expected_decrease * abs(now)
