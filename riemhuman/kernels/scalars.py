"""Scalar functions with a removable singularity, and derivatives that stay finite there."""

from __future__ import annotations

import autograd.numpy as np
from autograd.extend import defvjp, primitive
from numpy import ndarray


@primitive
def square_root(x: ndarray) -> ndarray:
    """Return the square root, with subgradient 0 at 0 (rounding below 0 counts as 0)."""
    return np.sqrt(np.maximum(x, 0.0))


def _square_root_slope(answer: ndarray) -> ndarray:
    return np.where(answer > 0, 0.5 / np.where(answer > 0, answer, 1.0), 0.0)


defvjp(
    square_root,
    lambda answer, x: lambda upstream: upstream * _square_root_slope(square_root(x)),
)


def sine_cardinal(x: ndarray) -> ndarray:
    """Return sin(x)/x, 1 at 0."""
    return np.where(x == 0, 1.0, np.sin(x) / np.where(x == 0, 1.0, x))


def inverse_hyperbolic_sine_cardinal(x: ndarray) -> ndarray:
    """Return x/sinh(x), 1 at 0."""
    safe = np.where(x == 0, 1.0, x)
    # exp(-x) keeps the quotient finite where sinh overflows.
    decay = np.exp(-np.abs(safe))
    return np.where(x == 0, 1.0, 2.0 * np.abs(safe) * decay / -np.expm1(-2.0 * np.abs(safe)))


def hyperbolic_sine_cardinal(x: ndarray) -> ndarray:
    """Return sinh(x)/x, 1 at 0."""
    return np.where(x == 0, 1.0, np.sinh(x) / np.where(x == 0, 1.0, x))
