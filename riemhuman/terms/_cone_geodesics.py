r"""Geodesics of the cones of `riemhuman.terms.cone`: exponential, logarithm, paths, transport.

Points are positive definite matrices g, shape (..., 2, 2), with the Ebin metric of one λ, or pairs
of g and a unit normal n, shape (..., 3), with weights (a, b, c). A geodesic lies in a flat plane of
the cone, spanned by the radial direction and a direction across it.
"""

from __future__ import annotations

from collections.abc import Sequence

import autograd.numpy as np
from autograd.extend import defvjp, primitive

from riemhuman.arrays import Array, Booleans
from riemhuman.kernels import sphere
from riemhuman.kernels.sphere import sine_cardinal
from riemhuman.kernels.surface import DEGENERATE, dot, square_root, symmetric_matrices
from riemhuman.terms.cone import (
    ConeTerm,
    excess,
    half_plane,
    hyperbolic_distance,
    inverse_hyperbolic_sine_cardinal,
)

Parts = Sequence[Array]


# Matrices and their half-plane coordinates.


@primitive
def product_minus_square(a: Array, b: Array, c: Array) -> Array:
    """Return ab − c² to working precision, however much the two terms cancel, shape (...)."""
    # Both products are formed with their rounding errors (Dekker's algorithm).
    product, product_error = _exact_product(a, b)
    square, square_error = _exact_product(c, c)
    return (product - square) + (product_error - square_error)


def _exact_product(a: Array, b: Array) -> tuple[Array, Array]:
    """Return the rounded product and its rounding error."""
    product = a * b
    (a_high, a_low), (b_high, b_low) = _halves(a), _halves(b)
    error = a_low * b_low - (((product - a_high * b_high) - a_low * b_high) - a_high * b_low)
    return product, error


def _halves(a: Array) -> tuple[Array, Array]:
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


def determinants(g: Array) -> Array:
    """Return det g to working precision, also for near-degenerate g."""
    return product_minus_square(g[..., 0, 0], g[..., 1, 1], g[..., 0, 1])


def is_rounding_error(determinant: Array, g: Array) -> Booleans:
    """Return whether a known det g is rounding error alone: det g ≤ 8 ε g₁₁ g₂₂."""
    return determinant <= DEGENERATE * g[..., 0, 0] * g[..., 1, 1]


def is_degenerate(g: Array) -> Booleans:
    """Return whether g is singular to working precision."""
    return is_rounding_error(determinants(g), g)


def coordinates(g: Array) -> tuple[Array, Array, Array]:
    """Return the half-plane coordinates x, y of ĝ and the radius s = (det g)^(1/4)."""
    # A degenerate g is the apex s = 0 of the cone, where x = 0, y = 1 stand for the undefined ĝ.
    determinant = determinants(g)
    degenerate = is_rounding_error(determinant, g)
    areas = np.sqrt(np.where(degenerate, 1.0, determinant))
    return half_plane(np.where(degenerate, 1.0, g[..., 0, 0]), g[..., 0, 1], areas, degenerate)


def unit_determinant(g: Array) -> Array:
    """Return ĝ = g/√det g; the identity stands in where g is degenerate."""
    x, y, _ = coordinates(g)
    return symmetric_matrices(1.0 / y, x / y, (x**2 + y**2) / y)


# Tangent vectors: symmetric matrices.


def trace(matrices: Array) -> Array:
    """Return the traces."""
    return matrices[..., 0, 0] + matrices[..., 1, 1]


def traceless(matrices: Array) -> Array:
    """Return A − ½ tr(A) I of symmetric matrices A."""
    half = 0.5 * (matrices[..., 0, 0] - matrices[..., 1, 1])
    return symmetric_matrices(half, matrices[..., 0, 1], -half)


def symmetric_part(matrices: Array) -> Array:
    """Return ½(A + Aᵀ)."""
    return 0.5 * (matrices + np.swapaxes(matrices, -1, -2))


def size(v: Array) -> Array:
    """Return √(½ tr v²) of symmetric traceless v."""
    return square_root(v[..., 0, 0] ** 2 + v[..., 0, 1] ** 2)


def whiten(delta_g: Array, g: Array) -> Array:
    """Return L⁻¹ δg L⁻ᵀ with the Cholesky factor of g = L Lᵀ."""
    # Symmetric and similar to g⁻¹δg, whose digits are lost where g is strongly anisotropic.
    # L = √g₁₁ [[1, 0], [x, y]]; adding zeros broadcasts.
    x, y, _ = coordinates(g)
    e = delta_g[..., 0, 0] + np.zeros_like(x)
    m = 0.5 * (delta_g[..., 0, 1] + delta_g[..., 1, 0])
    mixed = (m - x * e) / y
    last = ((delta_g[..., 1, 1] - x * m) / y - x * mixed) / y
    first = g[..., 0, 0]
    return symmetric_matrices(e / first, mixed / first, last / first)


def unwhiten(matrices: Array, g: Array) -> Array:
    """Return L W Lᵀ of symmetric W, where g = L Lᵀ: the inverse of `whiten`."""
    x, y, _ = coordinates(g)
    e = matrices[..., 0, 0] + np.zeros_like(x)
    m, last = matrices[..., 0, 1], matrices[..., 1, 1]
    mixed = x * e + y * m
    first, corner = g[..., 0, 0], x * mixed + y * (x * m + y * last)
    return symmetric_matrices(first * e, first * mixed, first * corner)


def inner_product(a: Parts, b: Parts, point: Parts, cone: ConeTerm) -> Array:
    """Return the inner product of tangent vectors (equation 2, both terms under the integral)."""
    first, second = whiten(a[0], point[0]), whiten(b[0], point[0])
    shear = np.sum(traceless(first) * traceless(second), axis=(-2, -1))
    values = cone.a * shear + cone.b * trace(first) * trace(second)
    for u, v in zip(a[1:], b[1:], strict=True):
        values = values + cone.c * dot(u, v)
    return values * np.sqrt(determinants(point[0]))


def hyperbolic_sine_cardinal(x: Array) -> Array:
    """Return sinh(x)/x, 1 at 0."""
    return np.where(x == 0, 1.0, np.sinh(x) / np.where(x == 0, 1.0, x))


def traceless_exp(v: Array, factor: Array) -> Array:
    """Return exp(factor · v) of symmetric traceless v."""
    length = factor * size(v)
    even, odd = np.cosh(length), factor * hyperbolic_sine_cardinal(length)
    diagonal, mixed = odd * v[..., 0, 0], odd * v[..., 0, 1]
    return symmetric_matrices(even + diagonal, mixed, even - diagonal)


def traceless_log(g1: Array, g2: Array) -> tuple[Array, Array]:
    """Return g₁L₀, whitened, and ℓ = √(½ tr L₀²), L₀ the traceless part of log(g₁⁻¹g₂)."""
    # exp of a traceless 2 × 2 matrix is cosh ℓ I + (sinh ℓ/ℓ) L₀: L₀ is along that of ĝ₁⁻¹ĝ₂.
    (x1, y1, _), (x2, y2, _) = coordinates(g1), coordinates(g2)
    length = hyperbolic_distance(excess(x1, y1, x2, y2))
    # Moving g₁ to the identity takes ĝ₂ to [[1, x], [x, x² + y²]]/y; in terms of differences
    # nothing cancels for near-equal matrices.
    x, y = (x2 - x1) / y1, y2 / y1
    diagonal = 0.5 * ((y1 - y2) / y1 * (1.0 + y) - x**2)
    scale = inverse_hyperbolic_sine_cardinal(length) / y
    return scale[..., None, None] * symmetric_matrices(diagonal, x, -diagonal), length


# Geodesics of points (g,) or (g, n).


def exp(velocity: Parts, point: Parts, cone: ConeTerm) -> tuple[Parts, Booleans]:
    """Follow the geodesic with an initial velocity for unit time."""
    # With A = g⁻¹δg, v its traceless part, δs = s tr A/4 and ν² = (a tr v² + c |δn|²)/(16b), the
    # cone unrolls to the line (s + δs, sν) = r(cos φ, sin φ): g(1) = r²/s² g exp(φ/ν v), and n
    # follows a great circle with velocity (φ/ν) δn. The second result says where, to working
    # precision, the geodesic has left the manifold through the apex g = 0.
    (delta_g, *turns), (g, *normals) = velocity, point
    shear, along, across = _unroll(velocity, g, cone)
    factor = angle_per_unit(along, across)[..., None]
    ends = [sphere.exp(factor * turn, n) for turn, n in zip(turns, normals, strict=True)]
    end = traceless_exp(shear, angle_per_unit(along, across))
    end = unwhiten(np.expand_dims(along**2 + across**2, (-2, -1)) * end, g)
    return (end, *ends), _has_met_apex(along, across, delta_g, g, cone)


def _unroll(velocity: Parts, g: Array, cone: ConeTerm) -> tuple[Array, Array, Array]:
    """Return the whitened shear of δg, and the end in the unrolled cone where s = 1."""
    whitened = whiten(velocity[0], g)
    shear = traceless(whitened)
    across = _angle(cone, size(shear), [square_root(dot(u, u)) for u in velocity[1:]])
    return shear, 1.0 + 0.25 * trace(whitened), across


def _angle(cone: ConeTerm, length: Array, turns: Parts) -> Array:
    """Return ψ of a hyperbolic length and, where there are normals, their angle."""
    psi = cone.angle_per_length * length
    return square_root(psi**2 + (cone.angle_per_turn * turns[0]) ** 2) if turns else psi


def _has_met_apex(
    along: Array, across: Array, delta_g: Array, g: Array, cone: ConeTerm
) -> Booleans:
    x, y, _ = coordinates(g)
    skew = np.abs(x) / y
    e, m, last = (np.abs(delta_g[..., i, j]) for i, j in ((0, 0), (0, 1), (1, 1)))
    # The sum of the sizes of all terms of the whitened δg scales its rounding errors.
    size = (e * (1.0 + skew) ** 2 + 2.0 * (1.0 + skew) * m / y + last / y**2) / g[..., 0, 0]
    rounding = 8.0 * np.finfo(float).eps * size
    rounding = np.maximum(cone.angle_per_length, cone.angle_per_turn) * rounding
    return (along <= rounding) & (across <= rounding)


def angle_per_unit(along: Array, across: Array) -> Array:
    """Return φ/ν, φ = atan2(ν, along) of ν = across ≥ 0, in its limit 1/along at ν = 0."""
    straight = across == 0
    safe = np.where(straight & (along <= 0), 1.0, along)
    phi = np.arctan2(across, safe)
    return np.where(
        straight, 1.0 / np.where(straight, safe, 1.0), phi / np.where(straight, 1.0, across)
    )


def log(start: Parts, end: Parts, cone: ConeTerm) -> tuple[Parts, Array]:
    """Return the initial velocity of the minimal geodesic, where ψ < π, and ψ."""
    # δg = g₁ (s₂ sin ψ/(s₁ψ) L₀ + 2 (s₂ cos ψ − s₁)/s₁ I), δn = s₂ sin ψ/(s₁ψ) log n₂.
    (g1, *n1), (g2, *n2) = start, end
    shear, length = traceless_log(g1, g2)
    turns = [sphere.log(a, b) for a, b in zip(n1, n2, strict=True)]
    psi = _angle(cone, length, [square_root(dot(turn, turn)) for turn in turns])
    s1, s2 = coordinates(g1)[2], coordinates(g2)[2]
    stretch = 2.0 * ((s2 - s1) - 2.0 * s2 * np.sin(0.5 * psi) ** 2) / s1
    share = s2 / s1 * sine_cardinal(psi)
    velocity = share[..., None, None] * shear + stretch[..., None, None] * np.eye(2)
    return (unwhiten(velocity, g1), *(share[..., None] * turn for turn in turns)), psi


def angle(start: Parts, end: Parts, cone: ConeTerm) -> Array:
    """Return ψ, the angle between two points on the cone, not cut off at π."""
    (x1, y1, _), (x2, y2, _) = coordinates(start[0]), coordinates(end[0])
    turns = [sphere.angle(a, b) for a, b in zip(start[1:], end[1:], strict=True)]
    return _angle(cone, hyperbolic_distance(excess(x1, y1, x2, y2)), turns)


def runs_through_apex(start: Parts, end: Parts, cone: ConeTerm) -> Booleans:
    """Return whether the minimal path runs through g = 0: ψ ≥ π, or an end is degenerate."""
    ends_there = is_degenerate(start[0]) | is_degenerate(end[0])
    return ends_there | (angle(start, end, cone) >= np.pi)


def geodesic(start: Parts, end: Parts, t: Array, cone: ConeTerm) -> Parts:
    """Return the minimal path of the completion at times t in [0, 1]."""
    through_apex = runs_through_apex(start, end, cone)
    # Where the path runs through the apex there is no logarithm: a path that stays at the identity
    # stands in, and is replaced below.
    resting = np.eye(2), *start[1:]
    first, last = _chosen(through_apex, resting, start), _chosen(through_apex, resting, end)
    (delta_g, *turns), _ = log(first, last, cone)
    velocity = t[..., None, None] * delta_g, *(t[..., None] * turn for turn in turns)
    clear_of_apex, _ = exp(velocity, first, cone)
    return _chosen(through_apex, _path_through_apex(start, end, t), clear_of_apex)


def _path_through_apex(start: Parts, end: Parts, t: Array) -> Parts:
    """Return the straight path through the apex g = 0, where the normal jumps."""
    (g1, *n1), (g2, *n2) = start, end
    s1, s2 = coordinates(g1)[2], coordinates(g2)[2]
    signed_radius = s1 - t * (s1 + s2)
    before, after = (unit_determinant(g1), *n1), (unit_determinant(g2), *n2)
    shape, *normals = _chosen(signed_radius >= 0, before, after)
    return signed_radius[..., None, None] ** 2 * shape, *normals


def _chosen(condition: Booleans, points: Parts, others: Parts) -> Parts:
    """Return the points of the triangles where a condition holds, and others elsewhere."""
    (g, *normals), (other_g, *other_normals) = points, others
    chosen = [
        np.where(condition[..., None], a, b) for a, b in zip(normals, other_normals, strict=True)
    ]
    return np.where(condition[..., None, None], g, other_g), *chosen


def parallel_transport(vector: Parts, point: Parts, velocity: Parts, cone: ConeTerm) -> Parts:
    """Transport tangent vectors along the geodesic with an initial velocity for unit time."""
    # The part in the plane of the geodesic keeps its Cartesian components; of the rest, hyperbolic
    # plane and sphere carry shears and turns along. The geodesic stays clear of the apex.
    g = point[0]
    shear, along, across = _unroll(velocity, g, cone)
    phi, ratio = np.arctan2(across, along), np.sqrt(along**2 + across**2)
    whitened = whiten(vector[0], g)
    radial, strain = 0.25 * trace(whitened), traceless(whitened)
    # The unit vector of the link along the geodesic; at rest there is none.
    moving = across > 0
    inverse = np.where(moving, 1.0, 0.0) / np.where(moving, across, 1.0)
    ahead = inverse[..., None, None] * shear
    # Inner products of the link: κ² times those of shears, and of changes of the normal. One of
    # radius 2 has δs = 1, so that ½ tr is twice the radial part.
    xi = 0.5 * cone.angle_per_length**2 * np.sum(ahead * strain, axis=(-2, -1))
    turning = [inverse[..., None] * turn for turn in velocity[1:]]
    for turn, u in zip(turning, vector[1:], strict=True):
        xi = xi + cone.angle_per_turn**2 * dot(turn, u)
    cosine, sine = np.cos(phi), np.sin(phi)
    new_radial = radial * cosine + xi * sine
    gain = xi * (cosine - 1.0) - radial * sine
    strain = strain + gain[..., None, None] * ahead
    factor = angle_per_unit(along, across)
    # Of the end r² g exp(L) the whitening goes by r exp(L/2).
    half = traceless_exp(shear, 0.5 * factor)
    whole = strain + 2.0 * new_radial[..., None, None] * np.eye(2)
    carried = unwhiten(ratio[..., None, None] * symmetric_part(half @ whole @ half), g)
    turned = []
    for u, turn, n, delta_n in zip(vector[1:], turning, point[1:], velocity[1:], strict=True):
        arc = factor[..., None] * delta_n
        end = sphere.parallel_transport(u + gain[..., None] * turn, n, arc)
        turned.append(end / ratio[..., None])
    return carried, *turned
