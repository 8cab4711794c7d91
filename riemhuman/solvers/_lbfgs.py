"""Minimisation by L-BFGS with an operator for the first inverse Hessian, for all solvers."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np
from autograd.core import make_vjp
from numpy import ndarray

from riemhuman.geometry import Manifold
from riemhuman.kernels.threads import combine_rows, pair_with_rows, single_threaded_libraries
from riemhuman.progress import ProgressBar
from riemhuman.solvers.results import Result, Status

Objective = Callable[[ndarray], tuple[float, ndarray]]
"""Returns value and gradient at x, shape (n,); the value is infinite outside the domain."""

Operator = Callable[[ndarray], ndarray]
"""Symmetric positive map from gradients to steps: an inverse Hessian up to a factor."""

# Number of steps that are remembered.
_MEMORY = 10

# Wolfe's conditions: the share of the decrease promised by the slope that a step must reach, and
# the share of the slope that it may leave.
_DECREASE = 1e-4
_SLOPE_LEFT = 0.9
_MOST_TRIALS = 20

# Steps, as shares of a full one, so short that the slope no longer predicts the value.
_SHORT = 1e-3

# Along directions that no step has explored the inverse Hessian is often larger than the operator:
# on geodesics of bodies, what was still to gain was three times a Newton step's in the median.
_CAUTION = 3.0
# Number of iterations from which on the gain of their second half estimates what is still to gain.
_SLOW = 10

# So many iterations must together gain more than this share of the required decrease.
_PATIENCE = 15
_STILL = 0.01

_AT_ZERO = "the value is no more than rounding errors"


@dataclass(frozen=True, repr=False)
class Minimum(Result):
    """The best point x and its value, and the values at the start and after each iteration.

    `gap` estimates how far the value is above its minimum; it is nan where there is no estimate.
    """

    x: ndarray
    value: float
    values: ndarray
    gap: float = np.nan


@dataclass(frozen=True)
class LBFGS:
    """A preconditioned quasi-Newton method for smooth functions, with kinks at most here and there.

    The search ends when a Newton step would gain at most the share `tolerance` of the value and the
    second half of many iterations has gained at most the share `recent_decrease`; or when many
    together have gained a small part of `tolerance`. The operator is formed anew after `refresh`.
    """

    tolerance: float
    max_iter: int = 1000
    recent_decrease: float = np.inf
    refresh: int = 50
    callback: Callable[[int, float, ndarray], object] | None = None
    progress: str = ""

    def minimize(
        self,
        objective: Objective,
        start: ndarray,
        inverse_hessian_at: Callable[[ndarray], Operator],
        *,
        floor: float = -np.inf,
        earlier: Sequence[float] | ndarray = (),
        freeze_at: Callable[[ndarray], Operator] | None = None,
    ) -> Minimum:
        """Minimise a function; if interrupted from the keyboard, return the best point so far.

        Values of at most `floor` are rounding errors and count as zero; those of iterations before
        these, `earlier`, count for `recent_decrease`. Where no step lowers the value though a
        Newton step promises to, there is a kink: the steps of `freeze_at`'s operators avoid it.
        """
        descent = _Descent(self, objective, start, floor, earlier, inverse_hessian_at, freeze_at)
        bar = ProgressBar(
            total=None, desc=self.progress, disable=not self.progress, unit=" iterations"
        )
        try:
            with bar:
                while descent.status is None:
                    if descent.advance():
                        bar.update()
                        bar.set_postfix_str(f"value {descent.value:.6g}", refresh=False)
                        if self.callback is not None:
                            self.callback(len(descent.values) - 1, descent.value, descent.x)
        except KeyboardInterrupt:
            descent.end(Status.INTERRUPTED, "interrupted from the keyboard")
        return descent.result()


class _Descent:
    """The state of one minimisation."""

    def __init__(
        self,
        settings: LBFGS,
        objective: Objective,
        start: ndarray,
        floor: float,
        earlier: Sequence[float] | ndarray,
        inverse_hessian_at: Callable[[ndarray], Operator],
        freeze_at: Callable[[ndarray], Operator] | None,
    ) -> None:
        self._settings, self._objective = settings, objective
        self._floor, self._earlier = floor, list(earlier)
        self.x = start
        self.value, self._gradient = objective(start)
        self.values, self._n_evaluations = [self.value], 1
        self.status: Status | None = None
        self._message, self._newton, self._newton_was_small = "", np.inf, False
        self._operator_at = inverse_hessian_at
        self._last_operator_at = freeze_at or inverse_hessian_at
        self._shortest = _SHORT if freeze_at else 0.0
        self._operator: Operator | None = None
        if not np.isfinite(self.value):
            self._newton = np.nan
            self.end(Status.OUTSIDE_MANIFOLD, "the start has no finite value")
        elif self.value <= floor:
            self.end(Status.CONVERGED, _AT_ZERO)
        elif not start.size:
            self._newton = 0.0
            self.end(Status.CONVERGED, "there is no direction to search in")

    def advance(self) -> bool:
        """Test whether to stop, and otherwise make a step; return whether one was made."""
        if self._operator is None:
            self._operator = self._operator_at(self.x)
            self._formed_after = len(self.values) - 1
            self._image, self._memory = self._operator(self._gradient), _Memory(self.x.size)
        direction = self._memory.direction(self._image)
        slope = float(self._gradient @ direction)
        self._test(slope)
        if self.status is not None:
            return False
        if self._n_since_formed == self._settings.refresh:
            self._operator = None
            return False
        trial = _search(self._objective, self.x, direction, self.value, slope)
        self._n_evaluations += trial.n_evaluations
        if trial.step > 0:
            step, image = trial.step * direction, self._operator(trial.gradient)
            self._memory.add(
                step, trial.gradient - self._gradient, image - self._image, trial.gradient
            )
            self.x, self.value = self.x + step, trial.value
            self._gradient, self._image = trial.gradient, image
            self.values.append(self.value)
        if trial.step == 0 or (trial.step < self._shortest and not self._newton_was_small):
            self._leave_kink(trial.step)
        return trial.step > 0

    def end(self, status: Status, message: str) -> None:
        self.status, self._message = status, message

    def result(self) -> Minimum:
        at_zero = self.value <= self._floor
        return Minimum(
            self.x,
            self.value,
            np.array(self.values),
            0.0 if at_zero else estimate_gap(self._newton, [*self._earlier, *self.values]),
            n_iterations=len(self.values) - 1,
            n_evaluations=self._n_evaluations,
            status=self.status or Status.MAX_ITER,
            message=self._message,
        )

    @property
    def _n_since_formed(self) -> int:
        return len(self.values) - 1 - self._formed_after

    def _test(self, slope: float) -> None:
        """Stop if a test is met, given the slope along the next step."""
        settings, value = self._settings, self.value
        quadratic = self._memory.scales.max() * float(self._gradient @ self._image)
        self._newton = 0.5 * max(quadratic, -slope)
        is_small = bool(self._newton <= settings.tolerance * value)
        self._newton_was_small |= is_small
        recent = _gain_of_second_half([*self._earlier, *self.values])
        since = self.values[self._formed_after :][-1 - _PATIENCE :]
        still = _STILL * settings.tolerance * abs(value)
        if value <= self._floor:
            self.end(Status.CONVERGED, _AT_ZERO)
        elif is_small and not recent > settings.recent_decrease * value:
            self.end(Status.CONVERGED, "the expected decrease is below the tolerance")
        elif len(since) > _PATIENCE and since[0] - value <= still:
            self._newton = np.nan
            self.end(Status.CONVERGED, "the value stands still")
        elif len(self.values) > settings.max_iter:
            self.end(Status.MAX_ITER, "the most iterations were made")

    def _leave_kink(self, step: float) -> None:
        """Go on with a new operator where hardly a step lowers the value, or stop."""
        self._newton = np.nan
        is_last = self._operator_at is self._last_operator_at
        if step == 0 and self._newton_was_small:
            self.end(Status.CONVERGED, "no step lowers the value further")
        elif is_last and self._n_since_formed < 2:
            self.end(Status.STALLED, "hardly a step lowers the value")
        elif len(self.values) > self._settings.max_iter:
            self.end(Status.MAX_ITER, "the most iterations were made")
        self._operator, self._operator_at = None, self._last_operator_at


def estimate_gap(newton: float, values: Sequence[float] | ndarray) -> float:
    """Return an estimate of how far the last of several values is above the minimum.

    `newton` is the estimated gain of a Newton step, nan where slopes do not show it, as at a kink;
    the estimate is nan where there are few values, too.
    """
    return float(np.fmax(_CAUTION * newton, _gain_of_second_half(values)))


def _gain_of_second_half(values: Sequence[float] | ndarray) -> float:
    """Return what the second half of iterations gained, nan if they are few."""
    n_iterations = len(values) - 1
    return float(values[n_iterations // 2] - values[-1]) if n_iterations >= _SLOW else np.nan


class _Trial(NamedTuple):
    """A step along a direction, with value and gradient there."""

    step: float
    value: float
    gradient: ndarray
    n_evaluations: int


def _search(
    objective: Objective, x: ndarray, direction: ndarray, value: float, slope: float
) -> _Trial:
    """Return a step that satisfies Wolfe's weak conditions, or the best that lowers the value."""
    low, high, step = 0.0, np.inf, 1.0
    best = _Trial(0.0, value, x, 0)
    for count in range(1, _MOST_TRIALS + 1):
        new_value, gradient = objective(x + step * direction)
        best = best._replace(n_evaluations=count)
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


@dataclass(frozen=True)
class Coordinates:
    r"""The points projection(origin + Σ_j x_j D_j) of a manifold; by default all entries are free.

    The origin may be several points, shape (m, \*shape), each with coordinates of its own. The rows
    of `directions` are the D_j.
    """

    space: Manifold
    origin: ndarray
    directions: ndarray | None = None

    def points(self, x: ndarray) -> ndarray:
        with np.errstate(divide="ignore", invalid="ignore"):
            return self.space.projection(self._shifted(x))

    def minimize(
        self,
        minimizer: LBFGS,
        function: Callable[[ndarray], tuple[float, ndarray]],
        inverse_hessian_at: Callable[[ndarray], Operator],
        freeze_at: Callable[[ndarray], Operator] | None = None,
        **settings: Any,
    ) -> Minimum:
        """Return the points of least value, reached from the origin.

        The function returns a value, infinite where points are not allowed, and its gradient at
        points; operators, formed at points, act on gradients in coordinates.
        """
        shape = self.origin.shape

        def objective(x: ndarray) -> tuple[float, ndarray]:
            with np.errstate(divide="ignore", invalid="ignore"):
                pull_back, points = make_vjp(self.space.projection, self._shifted(x))
            value, gradient = function(points)
            rows = pull_back(gradient.reshape(shape)).reshape(self._n_origins, -1)
            if self.directions is not None:
                rows = pair_with_rows(rows, self.directions)
            return value if np.isfinite(value) else np.inf, rows.ravel()

        def report(iteration: int, value: float, x: ndarray) -> None:
            if minimizer.callback is not None:
                minimizer.callback(iteration, value, self.points(x))

        start = np.zeros(self.origin.size)
        if self.directions is not None:
            start = np.zeros(self._n_origins * len(self.directions))
        with single_threaded_libraries():
            minimum = replace(minimizer, callback=report).minimize(
                objective,
                start,
                lambda x: inverse_hessian_at(self.points(x)),
                freeze_at=None if freeze_at is None else lambda x: freeze_at(self.points(x)),
                **settings,
            )
        return replace(minimum, x=self.points(minimum.x))

    @property
    def _n_origins(self) -> int:
        return self.origin.size // int(np.prod(self.space.shape))

    def _shifted(self, x: ndarray) -> ndarray:
        if self.directions is not None:
            x = combine_rows(x.reshape(self._n_origins, len(self.directions)), self.directions)
        return self.origin + x.reshape(self.origin.shape)
