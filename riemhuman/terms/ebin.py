r"""The term of the Ebin (DeWitt) metric: symmetric positive definite 2 × 2 matrices on triangles.

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

import math

import autograd.numpy as np
import numpy as onp
from autograd.extend import defvjp, primitive
from numpy import ndarray

from riemhuman.checks import metric_weight
from riemhuman.kernels.compiled import FUSED, SUM, compiled
from riemhuman.kernels.scalars import (
    inverse_hyperbolic_sine_cardinal,
    sine_cardinal,
    square_root,
)
from riemhuman.kernels.surface import Derivatives
from riemhuman.kernels.tiles import CHUNK, LARGEST, SMALLEST, UNDERFLOW
from riemhuman.kernels.triangles import triangle
from riemhuman.terms.half_angle_fit import (
    LARGEST_LAMBDA,
    bounded_half_angle,
    excess_at_pi,
    half_angle,
    half_angle_polynomial,
)
from riemhuman.terms.term import Fields, Term


class EbinTerm(Term):
    r"""w · (Ebin metric), the pull-back by the first fundamental form (equation 2, corrected).

    Fields are x, y and s of g.

    Parameters
    ----------
    weight : float
        w > 0.
    lam : float
        λ > 0, the weight of changes of area.

    Examples
    --------
    >>> import riemhuman as rh
    >>> bodies = rh.datasets.load_open_bodies("coarse")
    >>> space = rh.AlignedSurfaces(bodies.template)
    >>> metric = rh.SurfaceMetric(space, [rh.terms.EbinTerm(1.0, lam=1.0)])
    >>> bool(metric.dist(bodies[0], bodies[1]) > 0)
    True
    """

    sees_rotations = False
    single = True
    area_power = 1.0

    def __init__(self, weight: float = 1.0, lam: float = 0.5) -> None:
        super().__init__(weight)
        self.lam = metric_weight(lam, "lam", strict=True)

    def fields(self, first: Derivatives) -> Fields:
        """Return x, y and s; x = 0, y = 1 and s = 0 on triangles without area.

        Not from the entries of g: slivers keep digits that those lose.

        Returns
        -------
        x, y, s : array, shape (..., F)
        """
        return half_plane(first.e, first.m, first.areas, first.degenerate)

    def squared_dist(self, fields_a: Fields, fields_b: Fields) -> ndarray:
        r"""Return the squared distances of matrices in the completion.

        .. math:: d^2 = 16\lambda\left((s_1-s_2)^2
                  + 4 s_1 s_2 \sin^2(\tfrac12\min(\pi,\theta))\right),

        which is Theorem 1 (corrected) without its cancellation for near-equal matrices. Degenerate
        matrices are the apex of the cone. The gradient is 0 where g₁ = g₂ or s = 0.
        """
        (x1, y1, s1), (x2, y2, s2) = fields_a, fields_b
        half = half_angle_sine_squared(excess(x1, y1, x2, y2), self.lam)
        return 16.0 * self.lam * ((s1 - s2) ** 2 + 4.0 * s1 * s2 * half)

    def inner_product(self, changes_a: Fields, changes_b: Fields, fields: Fields) -> ndarray:
        """Return 16λ δs δs' + 2 s² (δx δx' + δy δy')/y²."""
        (x1, y1, s1), (x2, y2, s2), (_, y, s) = changes_a, changes_b, fields
        return 16.0 * self.lam * s1 * s2 + 2.0 * (s / y) ** 2 * (x1 * x2 + y1 * y2)

    def form(self, first: Derivatives) -> ndarray:
        """Return 2(ε₁₁ − ε₂₂)² + 8ε₁₂² + 4λ(ε₁₁ + ε₂₂)².

        Parameters
        ----------
        first : Derivatives
            Not used: the form is constant.
        """
        rows = onp.zeros((3, 6))
        rows[0, [0, 3]] = math.sqrt(2.0), -math.sqrt(2.0)
        rows[1, [1, 2]] = math.sqrt(2.0)
        rows[2, [0, 3]] = 2.0 * math.sqrt(self.lam)
        return rows.T @ rows

    def chart(self, fields: Fields) -> ndarray:
        r"""Map matrices to R⁴ so that Euclidean distances are at most those of the term.

        With κ ≤ θ/ℓ and the logarithm L of ĝ at the identity, in R²,

        .. math:: \varphi = 4\sqrt{\lambda/2}\, s\,
                  (e^{i\sqrt2\kappa L_1}, e^{i\sqrt2\kappa L_2}) \in C^2 = R^4.

        ‖L − L'‖ ≤ ℓ, the hyperbolic plane being of negative curvature. Let z = κ‖L − L'‖ ≤ θ. If
        z ≤ π, ½ Σ cos(√2 κ (L_k − L'_k)) ≥ cos z by Jensen, as cos √t is convex for 0 ≤ t ≤ 2π²;
        and it never falls below −1. So ‖φ − φ'‖² ≤ 16λ (s² + s'² − 2 s s' cos min(π, θ)) = d².
        """
        x, y, s = fields
        # The logarithm lies along the spatial part of the point of the hyperboloid.
        spatial = np.stack([(1.0 - (x**2 + y**2)) / (2.0 * y), x / y], axis=-1)
        size = np.sqrt(np.sum(spatial**2, axis=-1, keepdims=True))
        logarithm = np.arcsinh(size) / np.where(size > 0, size, 1.0) * spatial
        angles = np.sqrt(2.0) * min(angle_per_distance(self.lam), STEEPEST) * logarithm
        circles = np.concatenate([np.cos(angles), np.sin(angles)], axis=-1)
        return 4.0 * np.sqrt(0.5 * self.lam) * s[..., None] * circles

    def feature_shape(self, n_faces: int) -> tuple[int, ...]:
        return (4, n_faces)

    def pack(self, fields: Fields, areas: ndarray, kept: ndarray) -> float:
        # Write x, y, 1/(√2 y) and √w s; return the squared distance to what is written.
        return _pack(*fields, np.sqrt(areas), self.lam, kept)

    def pack_surface(
        self, f: ndarray, faces: ndarray, frames: ndarray, areas: ndarray, kept: ndarray
    ) -> float:
        x, y, s = np.empty((3, len(faces)))
        _fill_half_plane(f, faces, frames, x, y, s)
        return _pack(x, y, s, np.sqrt(areas), self.lam, kept)

    def squared_distances(self, a: ndarray, b: ndarray, areas: ndarray) -> ndarray:
        real, squared = a.dtype.type, np.zeros((len(a), len(b)))
        if self.lam <= LARGEST_LAMBDA:
            reach, polynomial = excess_at_pi(self.lam), half_angle_polynomial(self.lam, a.dtype)
            _bounded_tile(a, b, real(1.0 / reach), polynomial, a is b, squared)
        else:
            _tile(a, b, real(0.25 / math.sqrt(2.0 * self.lam)), a is b, squared)
        return 16.0 * self.lam * squared

    def add_segments(self, records: ndarray, slopes: ndarray, areas: ndarray) -> float:
        return _segments(records, slopes, areas, self.weight, self.lam)


STEEPEST = 18.0
"""The largest κ of `EbinTerm.chart`: steeper charts are tighter, but wind bodies around in too many
dimensions."""


def half_plane(
    e: ndarray, m: ndarray, areas: ndarray, degenerate: ndarray
) -> tuple[ndarray, ndarray, ndarray]:
    """Return the coordinates x, y of ĝ, and s, of [[e, m], [m, g]].

    Parameters
    ----------
    e, m : array, shape (...)
        Entries; e is never 0.
    areas : array, shape (...)
        Area ratios √det g, never 0.
    degenerate : array of bool, shape (...)
        Where s = 0, x = 0 and y = areas/e count instead.

    Returns
    -------
    x, y, s : array, shape (...)
    """
    s = np.where(degenerate, 0.0, np.sqrt(areas))
    return np.where(degenerate, 0.0, m / e), areas / e, s


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


@compiled(forceinline=True)
def _half_angle(m: float, kappa: float) -> tuple[float, float]:
    """Return sin²(½ min(π, θ)) and its slope in m = cosh ℓ − 1, where θ = κℓ."""
    if m < 0.02:
        # ℓ² and its slope as power series in m.
        squared = m * (2 + m * (-1 / 3 + m * (4 / 45 + m * (-1 / 35 + m * (16 / 1575)))))
        squared += m**6 * (-8 / 2079 + m * (32 / 21021))
        slope = 2 + m * (-2 / 3 + m * (4 / 15 + m * (-4 / 35 + m * (16 / 315))))
        slope += m**5 * (-16 / 693 + m * (32 / 3003))
        if kappa * kappa * squared < 0.05:
            t = kappa * kappa * squared
            value = t * (1 / 4 + t * (-1 / 48 + t * (1 / 1440 + t * (-1 / 80640 + t / 7257600))))
            rate = 1 / 4 + t * (-1 / 24 + t * (1 / 480 + t * (-1 / 20160 + t / 1451520)))
            return value, rate * kappa * kappa * slope
        length = math.sqrt(squared)
        ratio = 0.5 * slope
    else:
        length = 2.0 * math.asinh(math.sqrt(0.5 * m))
        ratio = length / math.sqrt(m * (m + 2.0))
    theta = kappa * length
    if theta >= math.pi:
        return 1.0, 0.0
    half = math.sin(0.5 * theta)
    slope = 0.5 * kappa * kappa * math.sin(theta) / theta * ratio
    return half * half, slope


@compiled(fastmath=FUSED)
def _segments(
    records: ndarray, slopes: ndarray, areas: ndarray, weight: float, lam: float
) -> float:
    n_times, kappa, total = records.shape[1], 0.5 / math.sqrt(2.0 * lam), 0.0
    x, y, s = onp.empty(n_times), onp.empty(n_times), onp.empty(n_times)
    slope_x, slope_y, slope_s = onp.empty(n_times), onp.empty(n_times), onp.empty(n_times)
    for t in range(len(records)):
        factor = 16.0 * lam * weight * areas[t]
        for i in range(n_times):
            x[i], y[i], s[i] = _half_plane(records[t, i, 9], records[t, i, 10], records[t, i, 11])
            slope_x[i] = slope_y[i] = slope_s[i] = 0.0
        for i in range(n_times - 1):
            j = i + 1
            dx, dy, ds = x[i] - x[j], y[i] - y[j], s[i] - s[j]
            inverse = 1.0 / (y[i] * y[j])
            m = 0.5 * (dx * dx + dy * dy) * inverse
            half, rate = _half_angle(m, kappa)
            total += factor * (ds * ds + 4.0 * s[i] * s[j] * half)
            slope_s[i] += factor * (2.0 * ds + 4.0 * s[j] * half)
            slope_s[j] += factor * (-2.0 * ds + 4.0 * s[i] * half)
            rate *= factor * 4.0 * s[i] * s[j] * inverse
            slope_x[i] += rate * dx
            slope_x[j] -= rate * dx
            slope_y[i] += rate * (dy - m * y[j])
            slope_y[j] -= rate * (dy + m * y[i])
        for i in range(n_times):
            if s[i] > 0.0:
                inverse = 1.0 / records[t, i, 10]
                slopes[t, i, 9] += slope_y[i] * inverse + 0.5 * slope_s[i] / s[i]
                slopes[t, i, 10] -= (slope_x[i] * x[i] + slope_y[i] * y[i]) * inverse
                slopes[t, i, 11] += slope_x[i] * inverse
    return total


@compiled(forceinline=True)
def _half_plane(area: float, e: float, m: float) -> tuple[float, float, float]:
    """Return x, y and s; those of the apex where the area is 0."""
    if area > 0.0:
        return m / e, area / e, math.sqrt(area)
    return 0.0, 1.0, 0.0


@compiled
def _fill_half_plane(
    f: ndarray, faces: ndarray, frames: ndarray, x: ndarray, y: ndarray, s: ndarray
) -> None:
    for t in range(len(faces)):
        e, m, _, _, _, area = triangle(f, faces, frames, t)
        x[t], y[t], s[t] = _half_plane(area, e, m)


@compiled(fastmath=SUM)
def _pack(x: ndarray, y: ndarray, s: ndarray, roots: ndarray, lam: float, kept: ndarray) -> float:
    # Apart from `_fill_half_plane`, and without branches, so that it runs in vector registers.
    gap, steepness = UNDERFLOW * len(x), 0.25 / lam
    for t in range(len(x)):
        h, radius = math.sqrt(0.5) / y[t], roots[t] * s[t]
        kept[0, t], kept[1, t], kept[2, t], kept[3, t] = x[t], y[t], h, radius
        dx, dy = x[t] - kept[0, t], y[t] - kept[1, t]
        # sin²(½θ) ≤ ¼θ² and ℓ² ≤ 2m bound the angle.
        angle = min((dx * dx + dy * dy) * h * h * steepness, 4.0)
        step = (radius - kept[3, t]) ** 2 + radius * kept[3, t] * angle
        inside = (abs(x[t]) < LARGEST) & (y[t] > SMALLEST) & (y[t] < LARGEST) & (radius < LARGEST)
        gap += step if inside else math.inf
    return 16.0 * lam * gap


@compiled(forceinline=True, fastmath=FUSED)
def _excess(x1: float, y1: float, h1: float, x2: float, y2: float, h2: float) -> float:
    """Return m = cosh ℓ − 1, with h = 1/(√2 y)."""
    x, y = x1 - x2, y1 - y2
    return (x * x + y * y) * (h1 * h2)


@compiled(forceinline=True, fastmath=FUSED)
def _cone(s1: float, s2: float, half: float) -> float:
    """Return (s₁ − s₂)² + 4 s₁ s₂ sin²(½θ)."""
    s, product = s1 - s2, s1 * s2
    product += product
    return s * s + (product + product) * half


@compiled(forceinline=True, fastmath=SUM)
def _chunk(a: ndarray, b: ndarray, half_kappa: float, first: int, last: int) -> float:
    x1, y1, h1, s1 = a[0, first:last], a[1, first:last], a[2, first:last], a[3, first:last]
    x2, y2, h2, s2 = b[0, first:last], b[1, first:last], b[2, first:last], b[3, first:last]
    total = type(half_kappa)(0.0)
    for t in range(last - first):
        m = _excess(x1[t], y1[t], h1[t], x2[t], y2[t], h2[t])
        total += _cone(s1[t], s2[t], half_angle(m, half_kappa))
    return total


@compiled(forceinline=True, fastmath=SUM)
def _bounded_chunk(
    a: ndarray,
    b: ndarray,
    inverse_reach: float,
    coefficients: tuple[float, ...],
    first: int,
    last: int,
) -> float:
    x1, y1, h1, s1 = a[0, first:last], a[1, first:last], a[2, first:last], a[3, first:last]
    x2, y2, h2, s2 = b[0, first:last], b[1, first:last], b[2, first:last], b[3, first:last]
    total = type(inverse_reach)(0.0)
    for t in range(last - first):
        m = _excess(x1[t], y1[t], h1[t], x2[t], y2[t], h2[t])
        half = bounded_half_angle(m, inverse_reach, coefficients)
        total += _cone(s1[t], s2[t], half)
    return total


@compiled
def _tile(a: ndarray, b: ndarray, half_kappa: float, within: bool, squared: ndarray) -> None:
    n_values = a.shape[2]
    for first in range(0, n_values, CHUNK):
        last = min(first + CHUNK, n_values)
        for i in range(len(a)):
            for j in range(i + 1 if within else 0, len(b)):
                squared[i, j] += _chunk(a[i], b[j], half_kappa, first, last)


@compiled
def _bounded_tile(
    a: ndarray,
    b: ndarray,
    inverse_reach: float,
    coefficients: tuple[float, ...],
    within: bool,
    squared: ndarray,
) -> None:
    n_values = a.shape[2]
    for first in range(0, n_values, CHUNK):
        last = min(first + CHUNK, n_values)
        for i in range(len(a)):
            for j in range(i + 1 if within else 0, len(b)):
                squared[i, j] += _bounded_chunk(
                    a[i], b[j], inverse_reach, coefficients, first, last
                )
