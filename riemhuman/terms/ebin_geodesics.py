"""Geodesics of the Ebin metric in closed form: exponential, logarithm, and minimal paths."""

from __future__ import annotations

import autograd.numpy as np
from numpy import ndarray

from riemhuman.kernels.linear import entry
from riemhuman.kernels.scalars import (
    hyperbolic_sine_cardinal,
    inverse_hyperbolic_sine_cardinal,
    sine_cardinal,
)
from riemhuman.kernels.surface import symmetric_matrices
from riemhuman.terms.ebin import angle_per_distance, excess, hyperbolic_distance
from riemhuman.terms.ebin_matrices import angle, coordinates, is_degenerate
from riemhuman.terms.ebin_tangent import size, trace, traceless, unwhiten, whiten


def exp(delta_g: ndarray, g: ndarray, lam: float) -> tuple[ndarray, ndarray]:
    r"""Follow the geodesic from g with initial velocity δg for unit time.

    With A = g⁻¹δg, v its traceless part, δs = s tr A/4 and ν = √(tr v²/λ)/4, the cone unrolls
    to the straight line (s + δs, sν) = r(cos φ, sin φ) and

    .. math:: g(1) = \frac{r^2}{s^2}\, g \exp\left(\tfrac{\varphi}{\nu} v\right).

    Parameters
    ----------
    delta_g : array, shape (..., 2, 2)
        Symmetric matrices, tangent at g.
    g : array, shape (..., 2, 2)
        Positive definite matrices.
    lam : float
        λ > 0.

    Returns
    -------
    g_end : array, shape (..., 2, 2)
        End points; meaningless where the geodesic has met the apex.
    met_apex : array of bool, shape (...)
        Where, to working precision, the geodesic has left the manifold through the apex g = 0.
    """
    velocity = whiten(delta_g, g)
    shear = traceless(velocity)
    along = 1.0 + 0.25 * trace(velocity)
    across = angle_per_distance(lam) * size(shear)
    rounding = 8.0 * np.finfo(float).eps * angle_per_distance(lam) * _whitened_size(delta_g, g)
    met_apex = (along <= rounding) & (across <= rounding)
    end = traceless_exp(shear, angle_per_unit(along, across))
    radius_squared = along**2 + across**2
    return unwhiten(np.expand_dims(radius_squared, (-2, -1)) * end, g), met_apex


def _whitened_size(delta_g: ndarray, g: ndarray) -> ndarray:
    """Return the sum of the sizes of all terms of the whitened δg, a scale for its rounding."""
    x, y, _ = coordinates(g)
    skew = np.abs(x) / y
    e, m, last = (np.abs(entry(delta_g, i, j)) for i, j in ((0, 0), (0, 1), (1, 1)))
    return (e * (1.0 + skew) ** 2 + 2.0 * (1.0 + skew) * m / y + last / y**2) / entry(g, 0, 0)


def angle_per_unit(along: ndarray, across: ndarray) -> ndarray:
    """Return φ/ν, φ = atan2(ν, along), in its limit 1/along at ν = across = 0.

    Parameters
    ----------
    along, across : array, shape (...)
        Cartesian coordinates in the unrolled cone; across is at least 0.

    Returns
    -------
    array, shape (...)
    """
    straight = across == 0
    safe = np.where(straight & (along <= 0), 1.0, along)
    phi = np.arctan2(across, safe)
    return np.where(
        straight, 1.0 / np.where(straight, safe, 1.0), phi / np.where(straight, 1.0, across)
    )


def traceless_exp(v: ndarray, factor: ndarray) -> ndarray:
    """Return exp(factor · v) of symmetric traceless v, shape (..., 2, 2).

    Parameters
    ----------
    v : array, shape (..., 2, 2)
        Symmetric traceless matrices.
    factor : array, shape (...)
        Real factors.

    Returns
    -------
    array, shape (..., 2, 2)
    """
    length = factor * size(v)
    even, odd = np.cosh(length), factor * hyperbolic_sine_cardinal(length)
    diagonal, mixed = odd * entry(v, 0, 0), odd * entry(v, 0, 1)
    return symmetric_matrices(even + diagonal, mixed, even - diagonal)


def log(g1: ndarray, g2: ndarray, lam: float) -> ndarray:
    r"""Return the initial velocity of the minimal geodesic from g₁ to g₂, where θ < π.

    .. math:: \delta g = g_1\left(\frac{s_2\sin\theta}{s_1\theta} L_0
              + 2\,\frac{s_2\cos\theta - s_1}{s_1} I\right)

    Parameters
    ----------
    g1, g2 : array, shape (..., 2, 2)
        Positive definite matrices.
    lam : float
        λ > 0.

    Returns
    -------
    array, shape (..., 2, 2)
    """
    s1, s2 = coordinates(g1)[2], coordinates(g2)[2]
    shear, length = traceless_log(g1, g2)
    theta = angle_per_distance(lam) * length
    stretch = 2.0 * ((s2 - s1) - 2.0 * s2 * np.sin(0.5 * theta) ** 2) / s1
    velocity = (s2 / s1 * sine_cardinal(theta))[..., None, None] * shear
    return unwhiten(velocity + stretch[..., None, None] * np.eye(2), g1)


def traceless_log(g1: ndarray, g2: ndarray) -> tuple[ndarray, ndarray]:
    """Return g₁L₀, whitened, and ℓ = √(½ tr L₀²), L₀ the traceless part of log(g₁⁻¹g₂).

    L₀ is a multiple of the traceless part of ĝ₁⁻¹ĝ₂, because the exponential of a traceless
    2 × 2 matrix is cosh ℓ I + (sinh ℓ/ℓ) L₀.

    Parameters
    ----------
    g1, g2 : array, shape (..., 2, 2)
        Positive definite matrices.

    Returns
    -------
    shear : array, shape (..., 2, 2)
    length : array, shape (...)
    """
    x1, y1, _ = coordinates(g1)
    x2, y2, _ = coordinates(g2)
    length = hyperbolic_distance(excess(x1, y1, x2, y2))
    # Moving g₁ to the identity takes ĝ₂ to [[1, x], [x, x² + y²]]/y; in terms of differences
    # nothing cancels for near-equal matrices.
    x, y = (x2 - x1) / y1, y2 / y1
    diagonal = 0.5 * ((y1 - y2) / y1 * (1.0 + y) - x**2)
    scale = inverse_hyperbolic_sine_cardinal(length) / y
    return scale[..., None, None] * symmetric_matrices(diagonal, x, -diagonal), length


def geodesic(g1: ndarray, g2: ndarray, t: ndarray, lam: float) -> ndarray:
    """Return the minimal path of the completion from g₁ to g₂ at time t.

    For θ ≥ π, or a degenerate end point, it runs straight through the apex g = 0.

    Parameters
    ----------
    g1, g2 : array, shape (..., 2, 2)
        Positive semidefinite matrices.
    t : array, shape (...)
        Times in [0, 1], broadcast with the leading axes.
    lam : float
        λ > 0.

    Returns
    -------
    array, shape (..., 2, 2)
    """
    degenerate = is_degenerate(g1) | is_degenerate(g2)
    through_apex = degenerate | (angle(g1, g2, lam) >= np.pi)

    s1, s2 = coordinates(g1)[2], coordinates(g2)[2]
    signed = s1 - t * (s1 + s2)
    unit1, unit2 = _unit_determinant(g1), _unit_determinant(g2)
    broken = signed[..., None, None] ** 2 * np.where((signed >= 0)[..., None, None], unit1, unit2)

    inside = ~through_apex[..., None, None]
    start, end = np.where(inside, g1, np.eye(2)), np.where(inside, g2, np.eye(2))
    straight, _ = exp(t[..., None, None] * log(start, end, lam), start, lam)
    return np.where(inside, straight, broken)


def _unit_determinant(g: ndarray) -> ndarray:
    """Return ĝ = g/√det g; the identity stands in where g is degenerate."""
    x, y, _ = coordinates(g)
    return symmetric_matrices(1.0 / y, x / y, (x**2 + y**2) / y)
