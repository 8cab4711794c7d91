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
from riemhuman.kernels.tiles import CHUNK, LARGEST, SMALLEST, UNDERFLOW, of_one_kind
from riemhuman.kernels.triangles import triangle
from riemhuman.terms.half_angle_fit import (
    LARGEST_LAMBDA,
    bounded_half_angle,
    excess_at_pi,
    half_angle,
    half_angle_and_slope,
    half_angle_polynomial,
)
from riemhuman.terms.term import Fields, Term


class EbinTerm(Term):
    r"""w · (Ebin metric), the pull-back by the first fundamental form (equation 2, corrected).

    Fields are x, y and s of g.

    Parameters
    ----------
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

    is_rotation_invariant = True
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
        return _pack(*map(of_one_kind, (x, y, s)), np.sqrt(areas), self.lam, kept)

    def squared_distances(self, a: ndarray, b: ndarray, areas: ndarray) -> ndarray:
        real, squared = a.dtype.type, np.zeros((len(a), len(b)))
        if self.lam <= LARGEST_LAMBDA:
            reach, polynomial = excess_at_pi(self.lam), half_angle_polynomial(self.lam, a.dtype)
            _tile(a, b, real(1.0 / reach), polynomial, a is b, squared)
        else:
            _tile(a, b, real(0.25 / math.sqrt(2.0 * self.lam)), None, a is b, squared)
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


@compiled
def _segments(
    records: ndarray, slopes: ndarray, areas: ndarray, weight: float, lam: float
) -> float:
    n_times, _, n_faces = records.shape
    # Of each surface x, y and s, and the slopes by them.
    points, added = onp.empty((n_times, 3, n_faces)), onp.zeros((n_times, 3, n_faces))
    for i in range(n_times):
        _half_planes(records[i], points[i])
    total = 0.0
    for i in range(n_times - 1):
        total += _segment(points[i], points[i + 1], added[i], added[i + 1], areas, weight, lam)
    for i in range(n_times):
        _add_slopes(records[i], points[i], added[i], slopes[i])
    return total


@compiled(forceinline=True, fastmath=FUSED)
def _half_planes(record: ndarray, point: ndarray) -> None:
    area, e, m = record[9], record[10], record[11]
    x, y, s = point[0], point[1], point[2]
    for t in range(len(area)):
        x[t], y[t], s[t] = _half_plane(area[t], e[t], m[t])


@compiled(forceinline=True, fastmath=SUM)
def _segment(
    one: ndarray,
    other: ndarray,
    by_one: ndarray,
    by_other: ndarray,
    areas: ndarray,
    weight: float,
    lam: float,
) -> float:
    """Return the sum of w d², and add its slopes by x, y and s of both."""
    x1, y1, s1, x2, y2, s2 = one[0], one[1], one[2], other[0], other[1], other[2]
    by_x1, by_y1, by_s1 = by_one[0], by_one[1], by_one[2]
    by_x2, by_y2, by_s2 = by_other[0], by_other[1], by_other[2]
    half_kappa, total = 0.25 / math.sqrt(2.0 * lam), 0.0
    for t in range(len(areas)):
        factor = 16.0 * lam * weight * areas[t]
        dx, dy, ds = x1[t] - x2[t], y1[t] - y2[t], s1[t] - s2[t]
        inverse = 1.0 / (y1[t] * y2[t])
        m = 0.5 * (dx * dx + dy * dy) * inverse
        half, rate = half_angle_and_slope(m, half_kappa)
        total += factor * _cone(s1[t], s2[t], half)
        by_s1[t] += factor * (2.0 * ds + 4.0 * s2[t] * half)
        by_s2[t] += factor * (-2.0 * ds + 4.0 * s1[t] * half)
        rate *= factor * 4.0 * s1[t] * s2[t] * inverse
        by_x1[t] += rate * dx
        by_x2[t] -= rate * dx
        by_y1[t] += rate * (dy - m * y2[t])
        by_y2[t] -= rate * (dy + m * y1[t])
    return total


@compiled(forceinline=True, fastmath=FUSED)
def _add_slopes(record: ndarray, point: ndarray, added: ndarray, slope: ndarray) -> None:
    """Add slopes by x, y and s up to slopes by the area ratio, e and m; at the apex are none."""
    e, x, y, s = record[10], point[0], point[1], point[2]
    by_x, by_y, by_s = added[0], added[1], added[2]
    by_area, by_e, by_m = slope[9], slope[10], slope[11]
    for t in range(len(e)):
        inside = s[t] > 0.0
        inverse = 1.0 / e[t] if inside else 0.0
        in_s = 0.5 * by_s[t] / s[t] if inside else 0.0
        by_area[t] += by_y[t] * inverse + in_s
        by_e[t] -= (by_x[t] * x[t] + by_y[t] * y[t]) * inverse
        by_m[t] += by_x[t] * inverse


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
def _chunk(
    a: ndarray,
    b: ndarray,
    scale: float,
    coefficients: tuple[float, ...] | None,
    first: int,
    last: int,
) -> float:
    x1, y1, h1, s1 = a[0, first:last], a[1, first:last], a[2, first:last], a[3, first:last]
    x2, y2, h2, s2 = b[0, first:last], b[1, first:last], b[2, first:last], b[3, first:last]
    total = type(scale)(0.0)
    for t in range(last - first):
        m = _excess(x1[t], y1[t], h1[t], x2[t], y2[t], h2[t])
        # Known when this is compiled.
        if coefficients is None:
            half = half_angle(m, scale)
        else:
            half = bounded_half_angle(m, scale, coefficients)
        total += _cone(s1[t], s2[t], half)
    return total


@compiled
def _tile(
    a: ndarray,
    b: ndarray,
    scale: float,
    coefficients: tuple[float, ...] | None,
    within: bool,
    squared: ndarray,
) -> None:
    """Add sums over triangles, with ½κ as the scale, or 1/m_π and a polynomial's coefficients."""
    n_values = a.shape[2]
    for first in range(0, n_values, CHUNK):
        last = min(first + CHUNK, n_values)
        for i in range(len(a)):
            for j in range(i + 1 if within else 0, len(b)):
                squared[i, j] += _chunk(a[i], b[j], scale, coefficients, first, last)
