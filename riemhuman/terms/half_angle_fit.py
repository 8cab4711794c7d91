"""Polynomials for sin²(½θ) where λ is small, fitted once for every λ."""

from __future__ import annotations

from functools import cache

import numpy as np
from numpy.polynomial import Chebyshev, Polynomial

LARGEST_LAMBDA = 0.01
"""Up to this λ the polynomials are exact to rounding errors."""

_DEGREES = {np.dtype(np.float32): 7, np.dtype(np.float64): 12}


def excess_at_pi(lam: float) -> float:
    """Return m_π, the value of cosh ℓ − 1 where θ = π.

    Parameters
    ----------
    lam : float
        λ > 0, at most `LARGEST_LAMBDA`.

    Returns
    -------
    float
    """
    return float(2.0 * np.sinh(np.pi * np.sqrt(2.0 * lam)) ** 2)


@cache
def half_angle_polynomial(lam: float, dtype: np.dtype) -> tuple[float, ...]:
    """Return the coefficients P of sin²(½θ) = z P(z), z = m/m_π in [0, 1].

    Parameters
    ----------
    lam : float
        λ > 0, at most `LARGEST_LAMBDA`.
    dtype : dtype
        float32 or float64: the precision of the coefficients, and for which they are enough.

    Returns
    -------
    tuple of float
        Coefficients, constant term first.
    """
    kappa, reach = 0.5 / np.sqrt(2.0 * lam), excess_at_pi(lam)

    def quotient(z: np.ndarray) -> np.ndarray:
        return np.sin(kappa * np.arcsinh(np.sqrt(0.5 * reach * z))) ** 2 / z

    fit = Chebyshev.interpolate(quotient, _DEGREES[dtype], domain=[0.0, 1.0])
    powers = fit.convert(kind=Polynomial, domain=[-1.0, 1.0], window=[-1.0, 1.0])
    return tuple(dtype.type(c) for c in powers.coef)
