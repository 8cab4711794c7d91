r"""The Ebin (DeWitt) metric on symmetric positive definite 2 × 2 matrices, point by point.

With s = (det g)^(1/4) and ĝ = g/√det g, equation 2 of the paper (both terms under the integral)
is the metric of a cone over the hyperbolic plane,

.. math:: ((\delta g, \delta g))_g
          = 16\lambda\, ds^2 + s^2 \operatorname{tr}((\hat g^{-1} d\hat g)^2).

ĝ is the point x + iy, x = g₁₂/g₁₁, y = √det g/g₁₁, of the upper half-plane, so distances, too, come
without the logarithm of a matrix: if ℓ is the hyperbolic distance of two such points, then
tr L₀² = 2ℓ² for the traceless part L₀ of log(g₁⁻¹g₂) (Theorem 1, with K₀ and θ corrected:
K₀ = K − ½ tr(g₁⁻¹K) g₁ and θ = √(tr((g₁⁻¹K₀)²)/λ)/4).
"""

from __future__ import annotations

import autograd.numpy as np
from autograd.extend import defvjp, primitive
from numpy import ndarray

from riemhuman.kernels.scalars import (
    inverse_hyperbolic_sine_cardinal,
    product_minus_square,
    sine_cardinal,
    square_root,
)
from riemhuman.kernels.surface import DEGENERATE, cross, dot

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
    return product_minus_square(g[..., 0, 0], g[..., 1, 1], g[..., 0, 1])


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
    return determinants(g) <= DEGENERATE * g[..., 0, 0] * g[..., 1, 1]


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
    return ~(determinants(g) > _FEW_DIGITS * g[..., 0, 0] * g[..., 1, 1])


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
    return _coordinates(g[..., 0, 0], g[..., 0, 1], g[..., 1, 1], determinants(g))


def coordinates_of_derivatives(f_u: ndarray, f_v: ndarray) -> tuple[ndarray, ndarray, ndarray]:
    """Return the `coordinates` of the first fundamental forms of surfaces.

    det g = ‖f_u × f_v‖² comes with relative errors of ε times the aspect ratio of a triangle; once
    the entries of g are rounded, the square of that ratio counts.

    Parameters
    ----------
    f_u, f_v : array, shape (..., 3)
        Partial derivatives.

    Returns
    -------
    x, y, s : array, shape (...)
    """
    area_vectors = cross(f_u, f_v)
    squared_areas = dot(area_vectors, area_vectors)
    return _coordinates(dot(f_u, f_u), dot(f_u, f_v), dot(f_v, f_v), squared_areas)


def _coordinates(
    e: ndarray, m: ndarray, g: ndarray, determinant: ndarray
) -> tuple[ndarray, ndarray, ndarray]:
    """Return the coordinates of [[e, m], [m, g]]."""
    degenerate = determinant <= DEGENERATE * e * g
    root = np.sqrt(np.where(degenerate, 1.0, determinant))
    e = np.where(degenerate, 1.0, e)
    return np.where(degenerate, 0.0, m / e), root / e, np.where(degenerate, 0.0, np.sqrt(root))


def excess(x1: ndarray, y1: ndarray, x2: ndarray, y2: ndarray) -> ndarray:
    """Return cosh ℓ − 1 of two points of the half-plane, without cancellation.

    Parameters
    ----------
    x1, y1, x2, y2 : array, shape (...)
        Coordinates of the two points, y₁ > 0 and y₂ > 0.

    Returns
    -------
    array, shape (...)
    """
    return ((x1 - x2) ** 2 + (y1 - y2) ** 2) / (2.0 * y1 * y2)


def hyperbolic_distance(m: ndarray) -> ndarray:
    """Return ℓ = 2 arcsinh √(m/2) from m = cosh ℓ − 1.

    Parameters
    ----------
    m : array, shape (...)
        Values of `excess`.

    Returns
    -------
    array, shape (...)
    """
    return 2.0 * np.arcsinh(square_root(0.5 * m))


def angle_per_distance(lam: float) -> float:
    """Return θ/ℓ = 1/(2√(2λ)), the angle on the cone for a unit of hyperbolic distance.

    Parameters
    ----------
    lam : float
        λ > 0.

    Returns
    -------
    float
    """
    return 0.5 / np.sqrt(2.0 * lam)


@primitive
def half_angle_sine_squared(m: ndarray, lam: float) -> ndarray:
    """Return sin²(½ min(π, θ)) as a smooth function of m = cosh ℓ − 1.

    Parameters
    ----------
    m : array, shape (...)
        Values of `excess`.
    lam : float
        λ > 0.

    Returns
    -------
    array, shape (...)
    """
    theta = angle_per_distance(lam) * hyperbolic_distance(m)
    return np.sin(0.5 * np.minimum(np.pi, theta)) ** 2


def _half_angle_slope(m: ndarray, lam: float) -> ndarray:
    length = hyperbolic_distance(m)
    kappa = angle_per_distance(lam)
    theta = np.minimum(np.pi, kappa * length)
    slope = 0.5 * kappa**2 * sine_cardinal(theta) * inverse_hyperbolic_sine_cardinal(length)
    return np.where(theta < np.pi, slope, 0.0)


defvjp(
    half_angle_sine_squared,
    lambda answer, m, lam: lambda upstream: upstream * _half_angle_slope(m, lam),
    argnums=(0,),
)


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


def squared_dist(g1: ndarray, g2: ndarray, lam: float) -> ndarray:
    r"""Return the squared distance of matrices in the completion.

    .. math:: d^2 = 16\lambda\left((s_1-s_2)^2 + 4 s_1 s_2 \sin^2(\tfrac12\min(\pi,\theta))\right),

    which is Theorem 1 (corrected) without its cancellation for near-equal matrices. Degenerate
    matrices are the apex of the cone. The gradient is 0 where g₁ = g₂ or s = 0.

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
    return squared_dist_of_coordinates(coordinates(g1), coordinates(g2), lam)


def squared_dist_of_coordinates(
    coordinates1: tuple[ndarray, ...], coordinates2: tuple[ndarray, ...], lam: float
) -> ndarray:
    """Return the squared distance of matrices given by their `coordinates`.

    Parameters
    ----------
    coordinates1, coordinates2 : tuple of array, shape (...)
        x, y and s of both matrices.
    lam : float
        λ > 0.

    Returns
    -------
    array, shape (...)
    """
    x1, y1, s1 = coordinates1
    x2, y2, s2 = coordinates2
    half = half_angle_sine_squared(excess(x1, y1, x2, y2), lam)
    return 16.0 * lam * ((s1 - s2) ** 2 + 4.0 * s1 * s2 * half)
