"""Roots of systems of equations whose derivative is near the identity."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy import ndarray

# Earlier steps that the next one is found from.
_MEMORY = 20

# A step is halved while the residual would grow by more than this factor.
_GROWTH = 2.0
_MOST_HALVINGS = 8


class Root(NamedTuple):
    """The result of a search for a root.

    Attributes
    ----------
    x : array, shape (n,)
        The best point evaluated.
    residual : float
        Norm of the function there.
    n_iterations, n_evaluations : int
        Steps, and evaluations of the function.
    """

    x: ndarray
    residual: float
    n_iterations: int
    n_evaluations: int


def find_root(
    function: Callable[[ndarray], ndarray | tuple[ndarray, ndarray] | None],
    start: ndarray,
    *,
    tolerance: float,
    max_iter: int,
) -> Root:
    """Find a root of a function whose derivative is near the identity.

    Anderson acceleration of x ← x − F(x): the combination of the last steps that would have reduced
    F most (Walker and Ni, "Anderson acceleration for fixed-point iterations", SIAM Journal on
    Numerical Analysis 49, 2011). Steps that leave the domain, or make F much larger, are halved.

    Parameters
    ----------
    function : callable
        Maps x to F(x), shape (n,), or to None outside its domain. If lengths are measured by a
        positive matrix A, it maps x to F(x) and A F(x).
    start : array, shape (n,)
        Where to start.
    tolerance : float
        Norm of F at which to stop.
    max_iter : int
        Largest number of steps.

    Returns
    -------
    Root
        Its residual is infinite if the start is outside the domain.
    """
    x, found = start, function(start)
    n_evaluations = 1
    if found is None:
        return Root(start, np.inf, 0, n_evaluations)
    value, dual = found if isinstance(found, tuple) else (found, found)
    best = Root(x, _length(value, dual), 0, n_evaluations)
    memory = _Memory(euclidean=dual is value)
    for iteration in range(1, max_iter + 1):
        if best.residual <= tolerance:
            break
        direction = memory.direction(value, dual)
        for _ in range(_MOST_HALVINGS):
            found = function(x + direction)
            n_evaluations += 1
            if found is not None:
                new_value, new_dual = found if isinstance(found, tuple) else (found, found)
                residual = _length(new_value, new_dual)
                if residual <= _GROWTH * _length(value, dual):
                    break
            direction = 0.5 * direction
        if found is None:
            break
        memory.add(direction, new_value - value, new_dual - dual)
        x, value, dual = x + direction, new_value, new_dual
        if residual < best.residual:
            best = Root(x, residual, iteration, n_evaluations)
    return best._replace(n_evaluations=n_evaluations)


class _Memory:
    """The last steps, with what they changed in F and in A F."""

    def __init__(self, euclidean: bool) -> None:
        self._euclidean = euclidean
        self._steps: list[ndarray] = []
        self._changes: list[ndarray] = []
        self._duals: list[ndarray] = []
        # Of changes in F with changes in A F.
        self._products = np.empty((0, 0))

    def add(self, step: ndarray, change: ndarray, dual: ndarray) -> None:
        """Remember a step, and forget the oldest ones."""
        if len(self._steps) == _MEMORY:
            for kept in (self._steps, self._changes, self._duals):
                del kept[0]
            self._products = self._products[1:, 1:]
        self._steps.append(step)
        self._changes.append(change)
        self._duals.append(dual)
        if not self._euclidean:
            column = np.array([other @ dual for other in self._changes])
            row = np.array([change @ other for other in self._duals[:-1]])
            self._products = np.vstack([self._products, row])
            self._products = np.column_stack([self._products, column])

    def direction(self, value: ndarray, dual: ndarray) -> ndarray:
        """Return the next step from a point with the values F and A F."""
        direction = -value
        if not self._steps:
            return direction
        if self._euclidean:
            weights = np.linalg.lstsq(np.stack(self._changes, axis=1), value, rcond=None)[0]
        else:
            shares = np.array([change @ dual for change in self._changes])
            weights = np.linalg.lstsq(self._products, shares, rcond=None)[0]
        for weight, step, change in zip(weights, self._steps, self._changes, strict=True):
            direction -= weight * (step - change)
        return direction


def _length(value: ndarray, dual: ndarray) -> float:
    # Rounding errors alone make it negative.
    return float(np.sqrt(max(value @ dual, 0.0)))
