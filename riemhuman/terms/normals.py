"""The terms of normals and of rotations: squared angles between unit vectors or quaternions."""

from __future__ import annotations

import math

import autograd.numpy as np
import numpy as onp
from autograd.extend import defvjp, primitive

from riemhuman.arrays import Array, FeatureRows, Fields, Points, TangentVectors
from riemhuman.kernels.compilation import FUSED, SUM, compiled
from riemhuman.kernels.rotations import quaternions
from riemhuman.kernels.surface import Derivatives, dot, polar_frames, square_root
from riemhuman.kernels.threads import CHUNK, UNDERFLOW
from riemhuman.terms._polynomial_fits import NO, PRECISION, YES, Flag, squared_arc_and_slope
from riemhuman.terms.term import FieldSpaces, Term


class _AngleTerm(Term):
    """A term of one unit vector a triangle, or one unit quaternion, whose sign has no effect."""

    needs_area = True
    is_stretch_invariant = True
    single = True
    _either_sign: Flag = NO
    _factor = 1.0

    def pack(self, fields: Fields, areas: Array, kept: FeatureRows) -> float:
        return self._factor * _pack(np.ascontiguousarray(fields[0].T), areas, kept)

    def squared_distances(self, a: FeatureRows, b: FeatureRows, areas: Array) -> Array:
        largest, squared = areas.max(), np.zeros((len(a), len(b)))
        relative = np.zeros(a.shape[2], dtype=a.dtype)
        relative[: len(areas)] = areas / largest
        _tile(a, b, relative, PRECISION[a.dtype], self._either_sign, a is b, squared)
        scaled: Array = self._factor * largest * squared
        return scaled


class NormalTerm(_AngleTerm):
    r"""w ∫ d_{S²}(n₁, n₂)² dx, the pull-back of a product of spheres by unit normals (Theorem 2).

    Parameters
    ----------
    weight : float above 0

    Examples
    --------
    >>> bodies = rh.datasets.load_open_bodies("coarse")
    >>> space = rh.AlignedSurfaces(bodies.template)
    >>> metric = rh.SurfaceMetric(space, [rh.terms.NormalTerm(1.0)])
    >>> bool(metric.dist(bodies[0], bodies[1]) > 0)
    True
    """

    n_features = 3
    has_target_space = True

    def target_space(self, spaces: FieldSpaces) -> object:
        return spaces.normal_fields()

    def target_point(self, first: Derivatives) -> Array:
        return self.fields(first)[0]

    def fields(self, first: Derivatives) -> Fields:
        return (first.area_vectors / first.areas[..., None],)

    def squared_dist(self, fields_a: Fields, fields_b: Fields) -> Array:
        difference, total = fields_a[0] - fields_b[0], fields_a[0] + fields_b[0]
        return squared_arc(dot(difference, difference), dot(total, total))

    def inner_product(self, changes_a: Fields, changes_b: Fields, fields: Fields) -> Array:
        return dot(changes_a[0], changes_b[0])

    def form(self, first: Derivatives) -> Array:
        return np.diag([0.0, 0.0, 0.0, 0.0, 1.0, 1.0])

    def chart(self, fields: Fields) -> Array:
        return fields[0]

    def pack_record(self, record: Array, areas: Array, kept: FeatureRows) -> float:
        return _pack(record[6:9], areas, kept)

    def add_segments(self, records: Array, slopes: Array, areas: Array) -> float:
        return _segments(records, slopes, areas, self.weight)


class RotationTerm(_AngleTerm):
    r"""w ∫ θ² dx, with θ ∈ [0, π] the angle of the rotation from R₁ to R₂, where df = R √g.

    Rotations are stored as unit quaternions of either sign: θ is twice the smaller of the angles
    between one quaternion and plus or minus the other.

    Parameters
    ----------
    weight : float above 0

    Examples
    --------
    >>> bodies = rh.datasets.load_open_bodies("coarse")
    >>> space = rh.AlignedSurfaces(bodies.template)
    >>> bool(rh.RotationMetric(space, time=0.0).dist(bodies[0], bodies[1]) > 0)
    True
    """

    n_features = 4
    _either_sign = YES
    _factor = 4.0  # θ is twice the angle of quaternions

    def fields(self, first: Derivatives) -> Fields:
        return (quaternions(polar_frames(first.f_u, first.f_v)),)

    def squared_dist(self, fields_a: Fields, fields_b: Fields) -> Array:
        difference, total = fields_a[0] - fields_b[0], fields_a[0] + fields_b[0]
        p, q = dot(difference, difference), dot(total, total)
        return 4.0 * squared_arc(np.minimum(p, q), np.maximum(p, q))

    def inner_product(self, changes_a: Fields, changes_b: Fields, fields: Fields) -> Array:
        return 4.0 * dot(changes_a[0], changes_b[0])


@primitive
def squared_arc(p: Array, q: Array) -> Array:
    """Return θ² = (2 atan2(√p, √q))² from p = ‖n₁ − n₂‖² and q = ‖n₁ + n₂‖².

    No digits are lost near 0 and π, as they are with the arc cosine of n₁·n₂. At antipodal
    points, where θ² has no derivative, the subgradient 0 in q is taken.
    """
    return 4.0 * np.arctan2(np.sqrt(p), np.sqrt(q)) ** 2


def _slope_in_p(p: Array, q: Array) -> Array:
    a, b = square_root(p), square_root(q)
    coincident = a == 0
    half_over_a = np.arctan2(a, b) / np.where(coincident, 1.0, a)
    return np.where(coincident, 4.0 / (p + q), 4.0 * half_over_a * b / (p + q))


def _slope_in_q(p: Array, q: Array) -> Array:
    a, b = square_root(p), square_root(q)
    antipodal = b == 0
    slope = -4.0 * np.arctan2(a, b) * a / (np.where(antipodal, 1.0, b) * (p + q))
    return np.where(antipodal, 0.0, slope)


defvjp(
    squared_arc,
    lambda answer, p, q: lambda upstream: upstream * _slope_in_p(p, q),
    lambda answer, p, q: lambda upstream: upstream * _slope_in_q(p, q),
)


Vector = tuple[float, float, float, float]


@compiled(forceinline=True, fastmath=FUSED)
def arc_pair(a: Vector, b: Vector, either_sign: Flag, double: Flag) -> tuple[float, Vector, Vector]:
    """Return θ² between unit vectors and its slopes by both, for all loops over pairs.

    Normals have a last component of 0; quaternions may have either sign. Slopes are in multiples
    of the vectors, which are normal to the sphere, as it suits rounding: near antipodal normals
    their difference is hardly more than such multiples.
    """
    real = type(a[0])
    acute = a[0] * b[0] + a[1] * b[1] + a[2] * b[2] + a[3] * b[3] >= real(0.0)
    sign = real(1.0) if acute else real(-1.0)
    x, y = a[0] - sign * b[0], a[1] - sign * b[1]
    z, w = a[2] - sign * b[2], a[3] - sign * b[3]
    chord = x * x + y * y + z * z + w * w
    if len(either_sign) == 0:
        squared, slope = squared_arc_and_slope(chord, acute, double)
        by_a, by_b = real(2.0) * sign * slope, real(-2.0) * slope
    else:
        squared, slope = squared_arc_and_slope(chord, True, double)
        by_a, by_b = real(2.0) * slope, real(-2.0) * sign * slope
    slopes_a = (by_a * x, by_a * y, by_a * z, by_a * w)
    return squared, slopes_a, (by_b * x, by_b * y, by_b * z, by_b * w)


@compiled
def _segments(records: Array, slopes: Array, areas: Array, weight: float) -> float:
    for i in range(len(records)):
        for area in records[i, 9]:
            if area == 0.0:
                return math.inf
    total = 0.0
    for i in range(len(records) - 1):
        total += add_segment(records[i], records[i + 1], slopes[i], slopes[i + 1], areas, weight)
    return total


@compiled(forceinline=True, fastmath=SUM)
def add_segment(
    start: Points,
    end: Points,
    start_slopes: Array,
    end_slopes: Array,
    areas: Array,
    weight: float,
) -> float:
    """Return the sum of w θ², and add its slopes by both normals."""
    x1, y1, z1, x2, y2, z2 = start[6], start[7], start[8], end[6], end[7], end[8]
    by_x1, by_y1, by_z1 = start_slopes[6], start_slopes[7], start_slopes[8]
    by_x2, by_y2, by_z2 = end_slopes[6], end_slopes[7], end_slopes[8]
    total = 0.0
    for t in range(len(areas)):
        a, b = (x1[t], y1[t], z1[t], 0.0), (x2[t], y2[t], z2[t], 0.0)
        squared, by_a, by_b = arc_pair(a, b, NO, YES)
        factor = weight * areas[t]
        total += factor * squared
        by_x1[t] += factor * by_a[0]
        by_y1[t] += factor * by_a[1]
        by_z1[t] += factor * by_a[2]
        by_x2[t] += factor * by_b[0]
        by_y2[t] += factor * by_b[1]
        by_z2[t] += factor * by_b[2]
    return total


def _pack(vectors: TangentVectors, areas: Array, kept: FeatureRows) -> float:
    """Write unit vectors; return the squared distance to the rounded ones."""
    kept[:, : len(areas)] = vectors
    chords = ((vectors - kept[:, : len(areas)]) ** 2).sum(axis=0)
    # An angle of at most π/2 changes by at most √2 times the change of its chord.
    return UNDERFLOW * float(areas.max()) * len(areas) + 2.0 * float((areas * chords).sum())


@compiled(fastmath=SUM)
def _tile(
    a: Array,
    b: Array,
    weights: Array,
    double: Flag,
    either_sign: Flag,
    within: bool,
    squared: Array,
) -> None:
    """Add sums over triangles of weighted squared arcs."""
    n_values, zero = a.shape[2], weights.dtype.type(0.0)
    for first in range(0, n_values, CHUNK):
        start, stop = onp.uintp(first), onp.uintp(min(first + CHUNK, n_values))
        for i in range(len(a)):
            x1, y1, z1, w1 = a[i, 0], a[i, 1], a[i, 2], a[i, -1]
            for j in range(i + 1 if within else 0, len(b)):
                x2, y2, z2, w2 = b[j, 0], b[j, 1], b[j, 2], b[j, -1]
                total = zero
                for t in range(start, stop):  # unsigned: see `cone._fill_angles`
                    if len(either_sign) == 0:
                        one, other = (x1[t], y1[t], z1[t], zero), (x2[t], y2[t], z2[t], zero)
                    else:
                        one, other = (x1[t], y1[t], z1[t], w1[t]), (x2[t], y2[t], z2[t], w2[t])
                    total += weights[t] * arc_pair(one, other, either_sign, double)[0]
                squared[i, j] += total
