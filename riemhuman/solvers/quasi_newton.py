"""Minimisation by L-BFGS with an operator for the first inverse Hessian."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy import ndarray

from riemhuman.kernels.threads import combine_rows, pair_with_rows
from riemhuman.progress import ProgressBar
from riemhuman.protocols import INTERRUPTED
from riemhuman.solvers.minimization import Minimum, stands_still

# Steps that are remembered, and iterations after which the operator is formed anew.
_MEMORY = 10
_ROUND = 50

# Wolfe's conditions: the share of the decrease promised by the slope that a step must reach, and
# the share of the slope that it may leave.
_DECREASE = 1e-4
_SLOPE_LEFT = 0.9
_MOST_TRIALS = 20

# Steps, as shares of a full one, so short that the slope knows nothing of what lies ahead.
_SHORT = 1e-3

# Along directions that no step has explored the inverse Hessian is often larger than the operator:
# on geodesics of bodies, what was still to gain was three times a Newton step's in the median.
_CAUTION = 3.0
# From so many iterations on, the gain of their second half tells what slow ones leave.
_SLOW = 10

_STUCK = "hardly a step lowers the value"

Objective = Callable[[ndarray], tuple[float, ndarray]]
Operator = Callable[[ndarray], ndarray]


def descend(
    objective: Objective,
    start: ndarray,
    inverse_hessian: Operator,
    *,
    max_iter: int,
    expected_decrease: float,
    recent_decrease: float = np.inf,
    earlier: Sequence[float] | ndarray = (),
    newton_was_small: bool = False,
    shortest_step: float = 0.0,
    floor: float = -np.inf,
    callback: Callable[[int, float, ndarray], object] | None = None,
    progress: bool = False,
    description: str = "minimising",
) -> Minimum:
    """Minimise a smooth function.

    Parameters
    ----------
    objective : callable
        Returns value and gradient at x; the value is infinite outside the domain.
    start : array, shape (n,)
        Where to start.
    inverse_hessian : callable
        Symmetric positive operator that approximates the inverse Hessian up to a factor, which is
        estimated.
    max_iter : int
        Most iterations.
    expected_decrease : float
        Stop when a Newton step would gain at most this share of the value, as estimated from the
        operator and the last steps, or when many iterations together have gained a small part of
        that.
    recent_decrease : float
        A Newton step counts as small only if the second half of the iterations, where they are
        many, has gained at most this share of the value: along soft directions that no step has
        explored, an estimate is too small.
    earlier : sequence of float
        Values of iterations before these, which count for `recent_decrease`.
    newton_was_small : bool
        Whether a Newton step was small in iterations before these. If one was, and no step lowers
        the value in the end, it has converged.
    shortest_step : float
        Stop after a step below this share of a full one, too, while no Newton step was small.
    floor : float
        Value at which to stop, for minima that may be zero.
    callback : callable, optional
        Called with (iteration, value, x) after each iteration.
    progress : bool
        Whether to show a progress bar.
    description : str
        What the progress bar says.

    Returns
    -------
    Minimum
    """
    x, (value, gradient) = start, objective(start)
    values, n_evaluations = [value], 1
    image = inverse_hessian(gradient)
    memory = _Memory(start.size)
    converged, interrupted, message, newton = False, False, "", np.inf
    with ProgressBar(total=None, desc=description, disable=not progress, unit=" iterations") as bar:
        try:
            while not message:
                direction = memory.direction(image)
                slope = float(gradient @ direction)
                newton = 0.5 * max(memory.scales.max() * float(gradient @ image), -slope)
                is_small = bool(newton <= expected_decrease * value)
                newton_was_small |= is_small
                if value <= floor:
                    converged, message = True, "the value is no more than rounding errors"
                elif is_small and not (
                    gained_lately([*earlier, *values]) > recent_decrease * value
                ):
                    converged, message = True, "the expected decrease is below the tolerance"
                elif stands_still(expected_decrease, values):
                    converged, message, newton = True, "the value stands still", np.nan
                elif len(values) > max_iter:
                    message = "the most iterations were made"
                if message:
                    break
                found = _search(objective, x, direction, value, slope)
                n_evaluations += found.n_evaluations
                if not found.step:
                    # As at a kink, of which slopes know nothing.
                    converged, newton = newton_was_small, np.nan
                    message = _STUCK
                    break
                step = found.step * direction
                new_image = inverse_hessian(found.gradient)
                memory.add(step, found.gradient - gradient, new_image - image, found.gradient)
                x, value = x + step, found.value
                gradient, image = found.gradient, new_image
                values.append(value)
                bar.update()
                bar.set_postfix_str(f"value {value:.6g}", refresh=False)
                if callback is not None:
                    callback(len(values) - 1, value, x)
                if found.step < shortest_step and not newton_was_small:
                    newton, message = np.nan, _STUCK
        except KeyboardInterrupt:
            interrupted, message = True, INTERRUPTED
    return Minimum(
        x,
        value,
        np.array(values),
        interrupted,
        n_iterations=len(values) - 1,
        n_evaluations=n_evaluations,
        converged=converged,
        message=message,
        gap=0.0 if value <= floor else estimated_gap(newton, values),
        newton_was_small=newton_was_small,
    )


def estimated_gap(newton: float, values: Sequence[float] | ndarray) -> float:
    """Return an estimate of how far the last value is above the minimum.

    Parameters
    ----------
    newton : float
        Estimated gain of a Newton step, nan where the slope does not tell, as at a kink.
    values : sequence of float
        Values at the start and after each iteration.

    Returns
    -------
    float
        nan if there are few values, too.
    """
    return float(np.fmax(_CAUTION * newton, gained_lately(values)))


def gained_lately(values: Sequence[float] | ndarray) -> float:
    """Return what the second half of iterations gained.

    Parameters
    ----------
    values : sequence of float
        Values at the start and after each iteration.

    Returns
    -------
    float
        nan if the iterations are few.
    """
    n_iterations = len(values) - 1
    return float(values[n_iterations // 2] - values[-1]) if n_iterations >= _SLOW else np.nan


def descend_in_rounds(
    objective: Objective,
    start: ndarray,
    inverse_hessian_at: Callable[[ndarray], Operator],
    *,
    max_iter: int,
    holding_at: Callable[[ndarray], Operator] | None = None,
    earlier: Sequence[float] | ndarray = (),
    callback: Callable[[int, float, ndarray], object] | None = None,
    **settings: Any,
) -> Minimum:
    """Minimise a smooth function, with a new operator in every round.

    Parameters
    ----------
    objective : callable
        Returns value and gradient at x.
    start : array, shape (n,)
        Where to start.
    inverse_hessian_at : callable
        Returns the operator for `descend` at x.
    max_iter : int
        Most iterations of all rounds together.
    holding_at : callable, optional
        Returns another operator at x, where hardly a step lowers the value before a Newton step was
        small, as at a kink: one whose images leave out what is to blame.
    earlier : sequence of float
        Values of iterations before the start, see `descend`.
    callback : callable, optional
        Called with (iteration, value, x) after each iteration.
    **settings
        Passed to `descend`.

    Returns
    -------
    Minimum
    """
    x, values, n_evaluations, newton_was_small = start, np.empty(0), 0, False
    operator_at, holding_at = inverse_hessian_at, holding_at or inverse_hessian_at
    shortest_step = 0.0 if holding_at is inverse_hessian_at else _SHORT
    while True:
        done = max(len(values) - 1, 0)

        def report(iteration: int, value: float, x: ndarray) -> None:
            if callback is not None:
                callback(done + iteration, value, x)  # noqa: B023, used within this round

        found = descend(
            objective,
            x,
            operator_at(x),
            max_iter=min(_ROUND, max_iter - done),
            earlier=[*earlier, *values[:-1]],
            newton_was_small=newton_was_small,
            shortest_step=shortest_step,
            callback=report,
            **settings,
        )
        x, n_evaluations = found.x, n_evaluations + found.n_evaluations
        newton_was_small = found.newton_was_small
        values = np.concatenate([values[:-1], found.values])
        done = len(values) - 1
        stuck = found.message == _STUCK
        # A single step that leads to the next place to be stuck at is no way to go on.
        at_end = stuck and operator_at is holding_at and found.n_iterations < 2
        operator_at = holding_at if stuck else operator_at
        if found.converged or found.interrupted or at_end or done >= max_iter:
            gap = found.gap
            if gap != 0.0:
                gap = float(np.fmax(gap, estimated_gap(np.nan, [*earlier, *values])))
            return replace(
                found, values=values, gap=gap, n_iterations=done, n_evaluations=n_evaluations
            )


class _Trial:
    """A step along a direction, and what was found there."""

    def __init__(self, step: float, value: float, gradient: ndarray, n_evaluations: int) -> None:
        self.step, self.value, self.gradient = step, value, gradient
        self.n_evaluations = n_evaluations


def _search(
    objective: Objective, x: ndarray, direction: ndarray, value: float, slope: float
) -> _Trial:
    """Return a step that satisfies Wolfe's weak conditions, or the best that lowers the value."""
    low, high, step = 0.0, np.inf, 1.0
    best = _Trial(0.0, value, x, 0)
    for count in range(1, _MOST_TRIALS + 1):
        new_value, gradient = objective(x + step * direction)
        best.n_evaluations = count
        new_slope = float(gradient @ direction) if np.isfinite(new_value) else np.inf
        if not new_value <= value + _DECREASE * step * slope:
            high = step
            # The least value of the parabola through both values with the slope at 0.
            excess = new_value - value - step * slope
            step *= float(np.clip(-0.5 * step * slope / excess, 0.1, 0.5))
            step = max(step, low + 0.1 * (high - low))
        else:
            if new_value < best.value:
                best = _Trial(step, new_value, gradient, count)
            if new_slope >= _SLOPE_LEFT * slope:
                break
            low = step
            step = 2.0 * step if high == np.inf else 0.5 * (low + high)
    return best


class _Memory:
    """The last steps s with the images P y of their changes of the gradient."""

    def __init__(self, size: int) -> None:
        # Each step beside its image: their products with a vector are one pass over all numbers.
        self._rows = np.empty((_MEMORY, 2, size))
        self._order: list[int] = []
        # sᵢ·g and (P yᵢ)·g with the last gradient.
        self._pairs = np.empty((0, 2))
        # sᵢ·yⱼ where j is not older than i, and yᵢ·P yⱼ.
        self._along, self._squares = np.zeros((2, _MEMORY, _MEMORY))

    def add(self, step: ndarray, change: ndarray, image: ndarray, gradient: ndarray) -> None:
        """Remember a step s, the change y of the gradient, P y, and the gradient it led to."""
        along, square = float(step @ change), float(change @ image)
        is_curved = along > 0.0 and square > 0.0
        if is_curved:
            k = len(self._order) if len(self._order) < _MEMORY else self._order.pop(0)
            self._order.append(k)
            self._rows[k] = step, image
        known = len(self._order)
        products = pair_with_rows(np.stack([gradient, change]), self._flat(known))
        self._pairs, with_change = products.reshape(2, known, 2)
        if is_curved:
            self._along[:known, k] = with_change[:, 0]
            self._squares[:known, k] = self._squares[k, :known] = with_change[:, 1]

    @property
    def scales(self) -> ndarray:
        """The factors by which P is nearest to the inverse Hessian along each step."""
        order = self._order
        if not order:
            return np.ones(1)
        return self._along[order, order] / self._squares[order, order]

    def direction(self, image: ndarray) -> ndarray:
        """Return −H g of the last gradient, given P g: L-BFGS's two loops, in inner products."""
        order = self._order
        if not order:
            return -image
        known = len(order)
        with_steps, with_images = self._pairs.T
        scale = self.scales[-1]
        first, second = np.zeros((2, known))
        for i in reversed(order):
            first[i] = (with_steps[i] - self._along[i, :known] @ first) / self._along[i, i]
        for i in order:
            along = scale * (with_images[i] - self._squares[i, :known] @ first)
            along += self._along[:known, i] @ second
            second[i] = first[i] - along / self._along[i, i]
        coefficients = np.column_stack([-second, scale * first]).reshape(1, -1)
        combined = combine_rows(coefficients, self._flat(known))[0]
        combined -= scale * image
        return combined

    def _flat(self, known: int) -> ndarray:
        """Return the first steps, each followed by its image."""
        return self._rows[:known].reshape(2 * known, self._rows.shape[-1])
