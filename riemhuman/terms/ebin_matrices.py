"""Functions of first fundamental forms, given as matrices, for the Ebin metric."""

from __future__ import annotations

import autograd.numpy as np
from numpy import ndarray

from riemhuman.kernels.linear import entry
from riemhuman.kernels.scalars import product_minus_square
from riemhuman.kernels.surface import DEGENERATE
from riemhuman.terms.ebin import angle_per_distance, excess, half_plane, hyperbolic_distance

_FEW_DIGITS = 1e5 * np.finfo(float).eps


def determinants(g: ndarray) -> ndarray:
    """Return det g to working precision, also for near-degenerate g.

    Parameters
    ----------
    g : array, shape (..., 2, 2)
        Symmetric matrices.

    Returns
    -------
    array, shape (...)
    """
    return product_minus_square(entry(g, 0, 0), entry(g, 1, 1), entry(g, 0, 1))


def is_degenerate(g: ndarray) -> ndarray:
    """Tell where g is singular to working precision: det g ≤ 8 ε g₁₁ g₂₂.

    Parameters
    ----------
    g : array, shape (..., 2, 2)
        Positive semidefinite matrices.

    Returns
    -------
    array of bool, shape (...)
    """
    return is_rounding_error(determinants(g), g)


def is_rounding_error(determinant: ndarray, g: ndarray) -> ndarray:
    """Return whether a known det g is rounding error alone, see `is_degenerate`.

    Parameters
    ----------
    determinant : array, shape (...)
        det g.
    g : array, shape (..., 2, 2)
        Positive semidefinite matrices.

    Returns
    -------
    array of bool, shape (...)
    """
    return determinant <= DEGENERATE * entry(g, 0, 0) * entry(g, 1, 1)


def has_lost_its_shape(g: ndarray) -> ndarray:
    """Tell where g overflows, or is so near to singular that det g has fewer than five digits.

    Parameters
    ----------
    g : array, shape (..., 2, 2)
        Symmetric matrices, or what became of them by overflow.

    Returns
    -------
    array of bool, shape (...)
    """
    # Written so that infinite entries, whose determinants are NaN, are told too.
    return ~(determinants(g) > _FEW_DIGITS * entry(g, 0, 0) * entry(g, 1, 1))


def coordinates(g: ndarray) -> tuple[ndarray, ndarray, ndarray]:
    """Return the half-plane coordinates x, y of ĝ and the radius s = (det g)^(1/4).

    A degenerate g is the apex s = 0 of the cone, where x = 0, y = 1 stand for the undefined ĝ.

    Parameters
    ----------
    g : array, shape (..., 2, 2)
        Positive semidefinite matrices.

    Returns
    -------
    x, y, s : array, shape (...)
    """
    determinant = determinants(g)
    degenerate = is_rounding_error(determinant, g)
    areas = np.sqrt(np.where(degenerate, 1.0, determinant))
    return half_plane(np.where(degenerate, 1.0, entry(g, 0, 0)), entry(g, 0, 1), areas, degenerate)


def angle(g1: ndarray, g2: ndarray, lam: float) -> ndarray:
    """Return θ, the angle between the two matrices on the cone, not cut off at π.

    Parameters
    ----------
    g1, g2 : array, shape (..., 2, 2)
        Positive semidefinite matrices.
    lam : float
        λ > 0.

    Returns
    -------
    array, shape (...)
    """
    x1, y1, _ = coordinates(g1)
    x2, y2, _ = coordinates(g2)
    return angle_per_distance(lam) * hyperbolic_distance(excess(x1, y1, x2, y2))
