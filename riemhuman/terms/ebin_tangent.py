"""Tangent vectors of the Ebin metric: symmetric 2 × 2 matrices, their traces and inner product."""

from __future__ import annotations

import autograd.numpy as np
from numpy import ndarray

from riemhuman.kernels.linear import entry
from riemhuman.kernels.scalars import square_root
from riemhuman.kernels.surface import symmetric_matrices
from riemhuman.terms.ebin_matrices import coordinates, determinants


def trace(matrices: ndarray) -> ndarray:
    """Return the traces.

    Parameters
    ----------
    matrices : array, shape (..., 2, 2)
        Matrices.

    Returns
    -------
    array, shape (...)
    """
    return entry(matrices, 0, 0) + entry(matrices, 1, 1)


def traceless(matrices: ndarray) -> ndarray:
    """Return A − ½ tr(A) I of symmetric matrices.

    Parameters
    ----------
    matrices : array, shape (..., 2, 2)
        Symmetric matrices A.

    Returns
    -------
    array, shape (..., 2, 2)
    """
    half = 0.5 * (entry(matrices, 0, 0) - entry(matrices, 1, 1))
    return symmetric_matrices(half, entry(matrices, 0, 1), -half)


def symmetric_part(matrices: ndarray) -> ndarray:
    """Return ½(A + Aᵀ).

    Parameters
    ----------
    matrices : array, shape (..., 2, 2)
        Matrices A.

    Returns
    -------
    array, shape (..., 2, 2)
    """
    return 0.5 * (matrices + np.swapaxes(matrices, -1, -2))


def size(v: ndarray) -> ndarray:
    """Return √(½ tr v²) of symmetric traceless v.

    Parameters
    ----------
    v : array, shape (..., 2, 2)
        Symmetric traceless matrices.

    Returns
    -------
    array, shape (...)
    """
    return square_root(entry(v, 0, 0) ** 2 + entry(v, 0, 1) ** 2)


def inner_product(a: ndarray, b: ndarray, g: ndarray, lam: float) -> ndarray:
    r"""Return the inner product of tangent vectors (equation 2, both terms under the integral).

    .. math:: \left(\operatorname{tr}(g^{-1}a_0\, g^{-1}b_0) + \lambda\operatorname{tr}(g^{-1}a)
              \operatorname{tr}(g^{-1}b)\right)\sqrt{\det g}

    Parameters
    ----------
    a, b : array, shape (..., 2, 2)
        Symmetric matrices, tangent at g.
    g : array, shape (..., 2, 2)
        Positive definite matrices.
    lam : float
        λ.

    Returns
    -------
    array, shape (...)
    """
    a, b = whiten(a, g), whiten(b, g)
    shear = np.sum(traceless(a) * traceless(b), axis=(-2, -1))
    return (shear + lam * trace(a) * trace(b)) * np.sqrt(determinants(g))


def whiten(delta_g: ndarray, g: ndarray) -> ndarray:
    """Return L⁻¹ δg L⁻ᵀ with the Cholesky factor of g = L Lᵀ, shape (..., 2, 2).

    It is symmetric and similar to g⁻¹δg, so that all traces are the same, and keeps the digits
    that g⁻¹δg loses where g is strongly anisotropic.

    Parameters
    ----------
    delta_g : array, shape (..., 2, 2)
        Symmetric matrices.
    g : array, shape (..., 2, 2)
        Positive definite matrices.

    Returns
    -------
    array, shape (..., 2, 2)
    """
    # L = √g₁₁ [[1, 0], [x, y]]; adding zeros broadcasts.
    x, y, _ = coordinates(g)
    e = entry(delta_g, 0, 0) + np.zeros_like(x)
    m = 0.5 * (entry(delta_g, 0, 1) + entry(delta_g, 1, 0))
    mixed = (m - x * e) / y
    last = ((entry(delta_g, 1, 1) - x * m) / y - x * mixed) / y
    first = entry(g, 0, 0)
    return symmetric_matrices(e / first, mixed / first, last / first)


def unwhiten(matrices: ndarray, g: ndarray) -> ndarray:
    """Return L W Lᵀ, where g = L Lᵀ, the inverse of `whiten`, shape (..., 2, 2).

    Parameters
    ----------
    matrices : array, shape (..., 2, 2)
        Symmetric matrices W.
    g : array, shape (..., 2, 2)
        Positive definite matrices.

    Returns
    -------
    array, shape (..., 2, 2)
    """
    x, y, _ = coordinates(g)
    e = entry(matrices, 0, 0) + np.zeros_like(x)
    m, last = entry(matrices, 0, 1), entry(matrices, 1, 1)
    mixed = x * e + y * m
    first, corner = entry(g, 0, 0), x * mixed + y * (x * m + y * last)
    return symmetric_matrices(first * e, first * mixed, first * corner)
