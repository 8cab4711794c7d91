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
    """What a search for a root has reached.

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

    Anderson acceleration of x ← x − F(x): of the last steps and what they changed in F, the
    combination that would have cancelled F best (Walker and Ni, "Anderson acceleration for
    fixed-point iterations", SIAM Journal on Numerical Analysis 49, 2011). Steps that leave the
    domain, or make F much larger, are halved.

    Parameters
    ----------
    function : callable
        Takes x to F(x), shape (n,), or to None outside its domain. Where lengths are not
        Euclidean but by a positive matrix A, it takes x to F(x) and A F(x).
    start : array, shape (n,)
        Where to start.
    tolerance : float
        Norm of F at which to stop.
    max_iter : int
        Most steps.

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
    steps: list[ndarray] = []
    changes: list[ndarray] = []
    duals: list[ndarray] = []
    for iteration in range(1, max_iter + 1):
        if best.residual <= tolerance:
            break
        direction = -value
        if changes:
            known = np.stack(changes, axis=1)
            if dual is value:
                weights = np.linalg.lstsq(known, value, rcond=None)[0]
            else:
                products = known.T @ np.stack([*duals, dual], axis=1)
                weights = np.linalg.lstsq(products[:, :-1], products[:, -1], rcond=None)[0]
            direction = direction - (np.stack(steps, axis=1) - known) @ weights
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
        steps, changes = [*steps, direction][-_MEMORY:], [*changes, new_value - value][-_MEMORY:]
        if new_dual is not new_value:
            duals = [*duals, new_dual - dual][-_MEMORY:]
        x, value, dual = x + direction, new_value, new_dual
        if residual < best.residual:
            best = Root(x, residual, iteration, n_evaluations)
    return best._replace(n_evaluations=n_evaluations)


def _length(value: ndarray, dual: ndarray) -> float:
    # Rounding errors alone make it negative.
    return float(np.sqrt(max(value @ dual, 0.0)))
