"""Minimisation by L-BFGS with an operator for the first inverse Hessian, for all solvers."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple, Required, TypedDict, Unpack

import numpy as np
from autograd.core import make_vjp
from tqdm import tqdm

from riemhuman.arrays import Array, Callback, TangentVectors
from riemhuman.geometry.point_space import PointSpace
from riemhuman.kernels.threads import (
    check_interrupt,
    combine_rows,
    is_abandoned,
    pair_with_rows,
    single_threaded_libraries,
    slices,
)
from riemhuman.solvers.results import INTERRUPTED_MESSAGE, Result, Status

Objective = Callable[[Array], tuple[float, Array]]
"""Returns value and gradient at x, shape (n,); the value is infinite outside the domain."""

Operator = Callable[[Array], Array]
"""Symmetric positive map from gradients to steps: an inverse Hessian up to a factor."""

# Number of steps remembered, and of their entries that are read together.
_MEMORY = 10
_IN_CACHE = 16384

# Wolfe's conditions: the share of the decrease promised by the slope that a step must reach, and
# the share of the slope that it may leave.
_DECREASE = 1e-4
_SLOPE_LEFT = 0.9
_MOST_TRIALS = 20
# A step is taken although the slope is still steep if it is at least this share of one that is too
# long. The value may jump between them, as where a triangle loses its area and its normal turns
# over. After a step right up to the jump, every further one would be tiny.
_NEAR = 0.9

# Along directions that no step has explored the inverse Hessian is often larger than the operator:
# on geodesics of bodies, what was still to gain was three times a Newton step's in the median, and
# up to fourteen times.
_CAUTION = 5.0
# After this many iterations, the gain of their second half estimates the gain still possible.
_SLOW = 10

# This many iterations must together gain more than this share of the required decrease.
_PATIENCE = 15
_STILL = 0.01


@dataclass(frozen=True, repr=False)
class Minimum(Result):
    """The best point x and its value, and the values at the start and after each iteration."""

    x: Array
    value: float
    values: Array
    gap: float = np.nan


@dataclass(frozen=True)
class Descent:
    """A preconditioned quasi-Newton method for functions that are smooth almost everywhere."""

    # The search ends when a Newton step would gain at most the share `tolerance` of the value and
    # the second half of many iterations has gained at most the share `recent_decrease`; or when
    # many together have gained a small part of `tolerance`. The operator is formed anew after
    # `refresh` iterations, and after a step of less than the share `shortest` of a full one. Values
    # of at most `floor` are rounding errors and count as zero; those of iterations before these,
    # `earlier`, count for `recent_decrease`.
    objective: Objective
    start: Array
    inverse_hessian_at: Callable[[Array], Operator]
    tolerance: float
    max_iter: int = 1000
    recent_decrease: float = np.inf
    refresh: int = 50
    shortest: float = 0.0
    floor: float = -np.inf
    earlier: Sequence[float] | Array = ()
    callback: Callback | None = None
    progress: str = ""

    def minimize(self) -> Minimum:
        """Return the minimum; if interrupted from the keyboard, the best point so far."""
        run = _Run(self)
        bar = tqdm(total=None, desc=self.progress, disable=not self.progress, unit=" iterations")
        try:
            run.begin()
            with bar:
                while run.status is None:
                    if run.advance():
                        bar.update()
                        bar.set_postfix_str(f"value {run.value:.6g}", refresh=False)
                        if self.callback is not None:
                            self.callback(run.n_iterations, run.value, run.x)
        except KeyboardInterrupt:
            if is_abandoned():
                raise
            run.interrupt()
        return run.minimum()


class _Run:
    """A descent on its way: its last point, what is known there, and how it ended."""

    def __init__(self, descent: Descent) -> None:
        self._descent = descent
        self.x = descent.start
        self.value = np.inf
        self.status: Status | None = None
        self._message = ""
        self._values: list[float] = []
        self._n_evaluations = 0
        self._gradient = np.zeros_like(descent.start)
        # The operator P, the image P g of the gradient, and the steps since P was formed.
        self._operator: Operator | None = None
        self._formed_after = 0
        self._image = self._gradient
        self._memory = _Memory()
        # What a Newton step would gain, and whether that was once below the tolerance.
        self._newton = np.inf
        self._newton_was_small = False

    @property
    def n_iterations(self) -> int:
        return len(self._values) - 1

    def begin(self) -> None:
        """Evaluate the start; end there if it is outside the domain, or there is no variable."""
        self.value, self._gradient = self._descent.objective(self.x)
        self._values, self._n_evaluations = [self.value], 1
        if not np.isfinite(self.value):
            self._newton = np.nan
            self._end(Status.OUTSIDE_MANIFOLD, "the value at the start is not finite")
        elif not self.x.size:
            self._newton = 0.0
            self._end(Status.CONVERGED, "there is no direction to search in")

    def advance(self) -> bool:
        """Stop if a test says so, otherwise make a step; return whether one was made."""
        descent = self._descent
        if self.value <= descent.floor:
            self._end(Status.CONVERGED, "the value is at the level of rounding errors")
            return False
        operator = self._operator
        if operator is None:
            operator = self._form_operator()
        direction = self._memory.direction(self._gradient, self._image)
        slope = float(self._gradient @ direction)
        self._test(slope)
        if self.status is not None:
            return False
        if self._n_since_formed == descent.refresh:
            self._operator = None
            return False
        trial = _line_search(descent.objective, self.x, direction, self.value, slope)
        self._n_evaluations += trial.n_evaluations
        if trial.step > 0:
            image = operator(trial.gradient)
            change, change_of_image = trial.gradient - self._gradient, image - self._image
            self._memory.add(trial.step * direction, change, change_of_image)
            self.x, self.value = trial.x, trial.value
            self._gradient, self._image = trial.gradient, image
            self._values.append(self.value)
        is_short = not self._newton_was_small and trial.step < descent.shortest
        if trial.step == 0 or is_short:
            self._restart(trial.step)
        return trial.step > 0

    def interrupt(self) -> None:
        """End at the best point so far, at worst the start."""
        if not self._values:
            self.value, _ = self._descent.objective(self.x)
            self._values = [self.value]
        self._end(Status.INTERRUPTED, INTERRUPTED_MESSAGE)

    def minimum(self) -> Minimum:
        gap = 0.0
        if self.value > self._descent.floor:
            # A Newton step's gain is nan where slopes do not predict it, as at a kink.
            gap = float(np.fmax(_CAUTION * self._newton, self._recent_gain))
        return Minimum(
            self.x,
            self.value,
            np.array(self._values),
            gap,
            n_iterations=self.n_iterations,
            n_evaluations=self._n_evaluations,
            status=self.status or Status.MAX_ITER,
            message=self._message,
        )

    def _end(self, status: Status, message: str) -> None:
        self.status, self._message = status, message

    def _form_operator(self) -> Operator:
        """Form the operator at the last point, and forget the steps with another one."""
        operator = self._descent.inverse_hessian_at(self.x)
        self._operator, self._formed_after = operator, self.n_iterations
        self._image, self._memory = operator(self._gradient), _Memory()
        return operator

    @property
    def _n_since_formed(self) -> int:
        return self.n_iterations - self._formed_after

    @property
    def _recent_gain(self) -> float:
        """The gain of the second half of the iterations, nan if there are few."""
        values = [*self._descent.earlier, *self._values]
        n_iterations = len(values) - 1
        return values[n_iterations // 2] - values[-1] if n_iterations >= _SLOW else np.nan

    @property
    def _has_settled(self) -> bool:
        """Whether many iterations with one operator have together gained almost nothing."""
        if self._n_since_formed < _PATIENCE:
            return False
        gain = self._values[-1 - _PATIENCE] - self.value
        return gain <= _STILL * self._descent.tolerance * abs(self.value)

    def _test(self, slope: float) -> None:
        """Stop if a test is met, given the slope along the next step."""
        descent, value = self._descent, self.value
        quadratic = self._memory.scales.max() * float(self._gradient @ self._image)
        self._newton = 0.5 * max(quadratic, -slope)
        newton_is_small = bool(self._newton <= descent.tolerance * value)
        if newton_is_small:
            self._newton_was_small = True
        if newton_is_small and not self._recent_gain > descent.recent_decrease * value:
            self._end(Status.CONVERGED, "the expected decrease is below the tolerance")
        elif self._has_settled:
            self._newton = np.nan
            self._end(Status.CONVERGED, "the value no longer changes")
        elif self.n_iterations >= descent.max_iter:
            self._end(Status.MAX_ITER, "the maximum number of iterations was reached")

    def _restart(self, step: float) -> None:
        """Continue with a new operator if steps hardly lower the value, or stop."""
        self._newton = np.nan
        if step == 0 and self._newton_was_small:
            self._end(Status.CONVERGED, "no step lowers the value further")
        elif self._n_since_formed < 2:
            self._end(Status.STALLED, "almost no step lowers the value")
        self._operator = None


class _Trial(NamedTuple):
    """A step along a direction, and the point there with its value and gradient."""

    step: float
    x: Array
    value: float
    gradient: Array
    n_evaluations: int


def _line_search(
    objective: Objective, x: Array, direction: TangentVectors, value: float, slope: float
) -> _Trial:
    """Return a step that satisfies Wolfe's weak conditions, or the best that lowers the value."""
    # The first condition holds at `low` and fails at `high`.
    low, high, step = 0.0, np.inf, 1.0
    best = _Trial(0.0, x, value, x, 0)
    for count in range(1, _MOST_TRIALS + 1):
        check_interrupt()
        new_x = x + step * direction
        new_value, gradient = objective(new_x)
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
                best = _Trial(step, new_x, new_value, gradient, count)
            if new_slope >= _SLOPE_LEFT * slope:
                break
            low = step
            step = 2.0 * step if high == np.inf else 0.5 * (low + high)
        if low >= _NEAR * high:
            break
    return best


class _Memory:
    """The last steps s with an operator P, and of the changes y of the gradient their images P y.

    L-BFGS's two loops need only their inner products, which are kept: vectors of millions of
    numbers are read once for all products and once for the sum, not twice in either loop. They are
    kept in single precision: that halves what is read, and directions need no more digits.
    """

    def __init__(self) -> None:
        # The steps, then the images, each in the row of its number. Numbers are reused: those in
        # use, from the first step to the last.
        self._rows = np.zeros((2, _MEMORY, 0), np.float32)
        self._numbers: list[int] = []
        # Entry [i, j]: s_i·y_j, and y_i·P y_j.
        self._along = self._squares = np.zeros((0, 0))

    def add(self, step: Array, change: Array, image: Array) -> None:
        along, square = float(step @ change), float(change @ image)
        if not (along > 0.0 and square > 0.0):
            return
        if not self._numbers:
            self._rows = np.empty((2, _MEMORY, len(step)), np.float32)
        kept = slice(max(0, len(self._numbers) - _MEMORY + 1), None)
        number = len(self._numbers) if len(self._numbers) < _MEMORY else self._numbers[0]
        self._numbers = [*self._numbers[kept], number]
        self._rows[0, number], self._rows[1, number] = step, image
        by_steps, by_images = self._products(change)
        by_steps[-1], by_images[-1] = along, square
        self._along = _bordered(self._along[kept, kept], by_steps)
        self._squares = _bordered(self._squares[kept, kept], by_images)

    @property
    def scales(self) -> Array:
        """The factors by which P is nearest to the inverse Hessian along each step."""
        if not self._numbers:
            return np.ones(1)
        scales: Array = np.diag(self._along) / np.diag(self._squares)
        return scales

    def direction(self, gradient: Array, image: Array) -> Array:
        """Return −H g, given g and P g, by L-BFGS's two loops."""
        n, scale = len(self._numbers), self.scales[-1]
        along, squares = self._along, self._squares
        by_steps, by_changes = self._products(gradient)
        # H g = γ (P g − Σ a_i P y_i) + Σ (a_i − b_i) s_i.
        a, rest = np.zeros(n), np.zeros(n)
        for i in reversed(range(n)):
            a[i] = (by_steps[i] - along[i, i + 1 :] @ a[i + 1 :]) / along[i, i]
        for i in range(n):
            b = scale * (by_changes[i] - squares[i] @ a) + along[:i, i] @ rest[:i]
            rest[i] = a[i] - b / along[i, i]
        factors = np.zeros((2, _MEMORY), np.float32)
        factors[:, self._numbers] = -rest, scale * a
        step_down: Array = -scale * image
        if n:
            for part in slices(len(step_down), _IN_CACHE):
                for rows, of_rows in zip(self._rows, factors, strict=True):
                    step_down[part] += of_rows[:n] @ rows[:n, part]
        return step_down

    def _products(self, vector: Array) -> Array:
        """Return the products of all steps, and of all images, with a vector."""
        n = len(self._numbers)
        products = np.zeros((2, n))
        # A vector of any size has entries of about 1 in single precision.
        size = max(vector.max(), -vector.min()) if n else 0.0
        if size > 0.0:
            for part in slices(len(vector), _IN_CACHE):
                entries = (vector[part] / size).astype(np.float32)
                for rows, of_rows in zip(self._rows, products, strict=True):
                    of_rows += rows[:n, part] @ entries
        return size * products[:, self._numbers]


def _bordered(matrix: Array, column: Array) -> Array:
    """Return a matrix with one more column, and the same numbers as one more row."""
    n = len(column)
    larger = np.empty((n, n))
    larger[: n - 1, : n - 1] = matrix
    larger[:, -1] = larger[-1] = column
    return larger


class DescentSettings(TypedDict, total=False):
    """Settings of `Descent`."""

    tolerance: Required[float]
    max_iter: int
    recent_decrease: float
    refresh: int
    shortest: float
    floor: float
    earlier: Sequence[float] | Array
    progress: str


def minimize_from(
    origin: Array,
    space: PointSpace,
    directions: TangentVectors | None,
    function: Objective,
    inverse_hessian_at: Callable[[Array], Operator],
    callback: Callback | None = None,
    **settings: Unpack[DescentSettings],
) -> Minimum:
    """Return the points projection(origin + Σ_j x_j D_j) of least value, D_j the directions."""
    # The origin may be several points, each with coordinates x of its own. Without directions, x
    # are all their entries. The function returns a value, infinite where points are not allowed,
    # and its gradient at points; operators, formed at points, act on gradients in coordinates.
    # Settings are those of `Descent`.
    n_origins = origin.size // int(np.prod(space.shape))
    space.warn_of_tears(origin, directions)

    def shifted(x: Array) -> Array:
        if directions is not None:
            x = combine_rows(x.reshape(n_origins, len(directions)), directions)
        return origin + x.reshape(origin.shape)

    def points(x: Array) -> Array:
        with np.errstate(divide="ignore", invalid="ignore"):
            return space.projection(shifted(x))

    def objective(x: Array) -> tuple[float, Array]:
        with np.errstate(divide="ignore", invalid="ignore"):
            pull_back, at = make_vjp(space.projection, shifted(x))
        value, gradient = function(at)
        rows = pull_back(gradient.reshape(origin.shape)).reshape(n_origins, -1)
        if directions is not None:
            rows = pair_with_rows(rows, directions)
        return value if np.isfinite(value) else np.inf, rows.ravel()

    def report(iteration: int, value: float, x: Array) -> None:
        if callback is not None:
            callback(iteration, value, points(x))

    size = origin.size if directions is None else n_origins * len(directions)
    with single_threaded_libraries():
        minimum = Descent(
            objective,
            np.zeros(size),
            lambda x: inverse_hessian_at(points(x)),
            callback=report,
            **settings,
        ).minimize()
    return replace(minimum, x=points(minimum.x))
