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
    hyperbolic_sine_cardinal,
    inverse_hyperbolic_sine_cardinal,
    product_minus_square,
    sine_cardinal,
    square_root,
)
from riemhuman.kernels.surface import DEGENERATE, symmetric_matrices


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
    return _is_degenerate(g, determinants(g))


def _is_degenerate(g: ndarray, determinant: ndarray) -> ndarray:
    return determinant <= DEGENERATE * g[..., 0, 0] * g[..., 1, 1]


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
    degenerate = _is_degenerate(g, determinant)
    root = np.sqrt(np.where(degenerate, 1.0, determinant))
    e = np.where(degenerate, 1.0, g[..., 0, 0])
    x = np.where(degenerate, 0.0, g[..., 0, 1] / e)
    return x, root / e, np.where(degenerate, 0.0, np.sqrt(root))


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
    return matrices[..., 0, 0] + matrices[..., 1, 1]


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
    half = 0.5 * (matrices[..., 0, 0] - matrices[..., 1, 1])
    return symmetric_matrices(half, matrices[..., 0, 1], -half)


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
    e = delta_g[..., 0, 0] + np.zeros_like(x)
    m = 0.5 * (delta_g[..., 0, 1] + delta_g[..., 1, 0])
    mixed = (m - x * e) / y
    last = ((delta_g[..., 1, 1] - x * m) / y - x * mixed) / y
    return symmetric_matrices(e, mixed, last) / g[..., :1, :1]


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
    e = matrices[..., 0, 0] + np.zeros_like(x)
    m, last = matrices[..., 0, 1], matrices[..., 1, 1]
    mixed = x * e + y * m
    return g[..., :1, :1] * symmetric_matrices(e, mixed, x * mixed + y * (x * m + y * last))


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
    linear = (factor * hyperbolic_sine_cardinal(length))[..., None, None] * v
    return np.cosh(length)[..., None, None] * np.eye(2) + linear


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
    return square_root(v[..., 0, 0] ** 2 + v[..., 0, 1] ** 2)


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
    return unwhiten(radius_squared[..., None, None] * end, g), met_apex


def _whitened_size(delta_g: ndarray, g: ndarray) -> ndarray:
    """Return the sum of the sizes of all terms of the whitened δg, a scale for its rounding."""
    x, y, _ = coordinates(g)
    skew = np.abs(x) / y
    e, m, last = (np.abs(delta_g[..., i, j]) for i, j in ((0, 0), (0, 1), (1, 1)))
    return (e * (1.0 + skew) ** 2 + 2.0 * (1.0 + skew) * m / y + last / y**2) / g[..., 0, 0]


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
    unit1, unit2 = unit_determinant(g1), unit_determinant(g2)
    broken = signed[..., None, None] ** 2 * np.where((signed >= 0)[..., None, None], unit1, unit2)

    inside = ~through_apex[..., None, None]
    start, end = np.where(inside, g1, np.eye(2)), np.where(inside, g2, np.eye(2))
    straight, _ = exp(t[..., None, None] * log(start, end, lam), start, lam)
    return np.where(inside, straight, broken)


def unit_determinant(g: ndarray) -> ndarray:
    """Return ĝ = g/√det g; the identity stands in where g is degenerate.

    Parameters
    ----------
    g : array, shape (..., 2, 2)
        Positive semidefinite matrices.

    Returns
    -------
    array, shape (..., 2, 2)
    """
    x, y, _ = coordinates(g)
    return symmetric_matrices(1.0 / y, x / y, (x**2 + y**2) / y)
