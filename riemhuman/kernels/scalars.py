"""Scalar functions with a removable singularity, and derivatives that stay finite there."""

from __future__ import annotations

import autograd.numpy as np
from autograd.extend import defvjp, primitive
from numpy import ndarray


@primitive
def square_root(x: ndarray) -> ndarray:
    """Return the square root, with subgradient 0 at 0 (rounding below 0 counts as 0).

    Parameters
    ----------
    x : array, shape (...)
        Real numbers.

    Returns
    -------
    array, shape (...)
    """
    return np.sqrt(np.maximum(x, 0.0))


def _square_root_slope(answer: ndarray) -> ndarray:
    return np.where(answer > 0, 0.5 / np.where(answer > 0, answer, 1.0), 0.0)


defvjp(
    square_root,
    lambda answer, x: lambda upstream: upstream * _square_root_slope(square_root(x)),
)


@primitive
def product_minus_square(a: ndarray, b: ndarray, c: ndarray) -> ndarray:
    """Return ab − c² to working precision, however much the two terms cancel, shape (...).

    Both products are formed with their rounding errors (Dekker's algorithm).

    Parameters
    ----------
    a, b, c : array, shape (...)
        Finite numbers, below 1e150 in size.

    Returns
    -------
    array, shape (...)
    """
    product, product_error = _exact_product(a, b)
    square, square_error = _exact_product(c, c)
    return (product - square) + (product_error - square_error)


def _exact_product(a: ndarray, b: ndarray) -> tuple[ndarray, ndarray]:
    """Return the rounded product and its rounding error."""
    product = a * b
    (a_high, a_low), (b_high, b_low) = _halves(a), _halves(b)
    error = a_low * b_low - (((product - a_high * b_high) - a_low * b_high) - a_high * b_low)
    return product, error


def _halves(a: ndarray) -> tuple[ndarray, ndarray]:
    """Return two numbers of half the digits that add up to a."""
    shifted = 134217729.0 * a  # 2²⁷ + 1
    high = shifted - (shifted - a)
    return high, a - high


defvjp(
    product_minus_square,
    lambda answer, a, b, c: lambda upstream: upstream * b,
    lambda answer, a, b, c: lambda upstream: upstream * a,
    lambda answer, a, b, c: lambda upstream: -2.0 * upstream * c,
)


def sine_cardinal(x: ndarray) -> ndarray:
    """Return sin(x)/x, 1 at 0.

    Parameters
    ----------
    x : array, shape (...)
        Real numbers.

    Returns
    -------
    array, shape (...)
    """
    return np.where(x == 0, 1.0, np.sin(x) / np.where(x == 0, 1.0, x))


def inverse_hyperbolic_sine_cardinal(x: ndarray) -> ndarray:
    """Return x/sinh(x), 1 at 0.

    Parameters
    ----------
    x : array, shape (...)
        Real numbers.

    Returns
    -------
    array, shape (...)
    """
    safe = np.where(x == 0, 1.0, x)
    # exp(-x) keeps the quotient finite where sinh overflows.
    decay = np.exp(-np.abs(safe))
    return np.where(x == 0, 1.0, 2.0 * np.abs(safe) * decay / -np.expm1(-2.0 * np.abs(safe)))


def hyperbolic_sine_cardinal(x: ndarray) -> ndarray:
    """Return sinh(x)/x, 1 at 0.

    Parameters
    ----------
    x : array, shape (...)
        Real numbers.

    Returns
    -------
    array, shape (...)
    """
    return np.where(x == 0, 1.0, np.sinh(x) / np.where(x == 0, 1.0, x))
