"""`LBFGS` under the name that means and transfer still call; it goes with them."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy import ndarray

from riemhuman.solvers._lbfgs import LBFGS, Minimum, Objective, Operator


def descend_in_rounds(
    objective: Objective,
    start: ndarray,
    inverse_hessian_at: Callable[[ndarray], Operator],
    *,
    max_iter: int,
    expected_decrease: float,
    recent_decrease: float = np.inf,
    refresh: int = 50,
    floor: float = -np.inf,
    callback: Callable[[int, float, ndarray], Any] | None = None,
    progress: bool = False,
    description: str = "minimising",
) -> Minimum:
    """Return the minimum that `LBFGS` finds."""
    minimizer = LBFGS(
        expected_decrease,
        max_iter,
        recent_decrease,
        refresh,
        callback,
        description if progress else "",
    )
    return minimizer.minimize(objective, start, inverse_hessian_at, floor=floor)
