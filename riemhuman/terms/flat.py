r"""Terms whose fields are compared by their differences, as vectors."""

from __future__ import annotations

import math
from abc import abstractmethod

import autograd.numpy as np
import numpy as onp

from riemhuman.arrays import Array, FeatureRows, Fields, Points
from riemhuman.kernels.compilation import SUM, compiled
from riemhuman.kernels.surface import Derivatives, dot
from riemhuman.kernels.threads import CHUNK, LARGEST, UNDERFLOW
from riemhuman.terms.term import FieldSpaces, Term

# Numbers summed in the precision of the features before they join the sum over all.
_CHUNK = 2 * CHUNK


class FlatTerm(Term):
    r"""A term with the L² distance :math:`\int_T \|\varphi(f_1) - \varphi(f_2)\|^2 dx`.

    A subclass defines only `field`; distances of many pairs run in compiled loops.

    Parameters
    ----------
    weight : float above 0

    Examples
    --------
    >>> class AreaVectors(rh.terms.FlatTerm):
    ...     def field(self, first):
    ...         return first.area_vectors
    >>> bodies = rh.datasets.load_open_bodies("coarse")
    >>> metric = rh.SurfaceMetric(rh.AlignedSurfaces(bodies.template), [AreaVectors()])
    >>> bool(metric.dist(bodies[0], bodies[1]) > 0)
    True
    """

    single = True
    has_target_space = True

    def target_space(self, spaces: FieldSpaces) -> object:
        return spaces.vector_fields(self.n_features)

    def target_point(self, first: Derivatives) -> Array:
        return self.field(first)

    @abstractmethod
    def field(self, first: Derivatives) -> Array:
        """Return the field φ(f) of surfaces, shape (..., F, n).

        Parameters
        ----------
        first : Derivatives
            First derivatives of surfaces, arrays of shape (..., F) and (..., F, 3).
        """

    def fields(self, first: Derivatives) -> Fields:
        return (self.field(first),)

    def squared_dist(self, fields_a: Fields, fields_b: Fields) -> Array:
        difference = fields_a[0] - fields_b[0]
        return dot(difference, difference)

    def inner_product(self, changes_a: Fields, changes_b: Fields, fields: Fields) -> Array:
        return dot(changes_a[0], changes_b[0])

    def chart(self, fields: Fields) -> Array:
        return fields[0]

    def pack(self, fields: Fields, areas: Array, kept: FeatureRows) -> float:
        return _pack(np.sqrt(areas) * fields[0].T, kept)

    def squared_distances(self, a: FeatureRows, b: FeatureRows, areas: Array) -> Array:
        # A product of matrices, ‖a‖² + ‖b‖² − 2 ⟨a, b⟩, takes a third to a half of the time for
        # 256 bodies but loses the digits of what is close: of 4,950 open bodies' distances one in
        # a hundred is beyond the 5e-6 that features may be off, the worst 3e-5. Nor does BLAS
        # promise the same bits in other tiles, by which jobs check entries that they stored.
        squared = np.zeros((len(a), len(b)))
        _tile(a.reshape(len(a), -1), b.reshape(len(b), -1), a is b, squared)
        return squared


def _pack(rows: Array, kept: FeatureRows) -> float:
    """Write vectors; return the squared distance to the rounded ones."""
    written = kept[:, : rows.shape[1]]
    with np.errstate(over="ignore"):
        written[:] = rows
    if not np.abs(rows).max() < LARGEST:
        return math.inf
    return UNDERFLOW * rows.size + float(((rows - written) ** 2).sum())


Four = tuple[float, float, float, float]


@compiled(fastmath=SUM)
def _tile(a: Array, b: Array, within: bool, squared: Array) -> None:
    """Add the squared distances of rows, 4 × 4 pairs at a time; rows at the edge come again."""
    end_a, end_b = len(a) - 1, len(b) - 1
    zero = a.dtype.type(0.0)
    for first in range(0, a.shape[1], _CHUNK):
        start, stop = onp.uintp(first), onp.uintp(min(first + _CHUNK, a.shape[1]))
        for j in range(0, len(b), 4):
            b0, b1 = b[j], b[min(j + 1, end_b)]
            b2, b3 = b[min(j + 2, end_b)], b[min(j + 3, end_b)]
            for i in range(0, min(j + 4, len(a)) if within else len(a), 4):
                a0, a1 = a[i], a[min(i + 1, end_a)]
                a2, a3 = a[min(i + 2, end_a)], a[min(i + 3, end_a)]
                # As in a matrix product, each number read is used in four sums.
                s0: Four = (zero, zero, zero, zero)
                s1 = s2 = s3 = s0
                for t in range(start, stop):  # unsigned: see `cone._fill_angles`
                    y = (b0[t], b1[t], b2[t], b3[t])
                    s0, s1 = _add(s0, a0[t], y), _add(s1, a1[t], y)
                    s2, s3 = _add(s2, a2[t], y), _add(s3, a3[t], y)
                sums = (s0, s1, s2, s3)
                for k in range(4):
                    for m in range(4):
                        if i + k <= end_a and j + m <= end_b:
                            squared[i + k, j + m] += sums[k][m]


@compiled(forceinline=True, fastmath=SUM)
def _add(sums: Four, x: float, y: Four) -> Four:
    d0, d1, d2, d3 = x - y[0], x - y[1], x - y[2], x - y[3]
    return sums[0] + d0 * d0, sums[1] + d1 * d1, sums[2] + d2 * d2, sums[3] + d3 * d3


class RootNormalTerm(FlatTerm):
    r"""w ∫ ‖q₁ − q₂‖² of the square root normal fields :math:`q = \sqrt{A}\, n`.

    Parameters
    ----------
    weight : float above 0

    Examples
    --------
    >>> bodies = rh.datasets.load_open_bodies("coarse")
    >>> space = rh.AlignedSurfaces(bodies.template)
    >>> metric = rh.SurfaceMetric(space, [rh.terms.RootNormalTerm(1.0)])
    >>> bool(metric.dist(bodies[0], bodies[1]) > 0)
    True
    """

    area_power = 1.0

    def field(self, first: Derivatives) -> Array:
        roots = first.area_vectors / np.sqrt(first.areas)[..., None]
        return np.where(first.degenerate[..., None], 0.0, roots)

    def form(self, first: Derivatives) -> Array:
        swelling = np.array([0.5, 0.0, 0.0, 0.5, 0.0, 0.0])
        return np.outer(swelling, swelling) + np.diag([0.0, 0.0, 0.0, 0.0, 1.0, 1.0])

    def pack_record(self, record: Array, areas: Array, kept: FeatureRows) -> float:
        return _pack(np.sqrt(areas * record[9]) * record[6:9], kept)

    def add_segments(self, records: Array, slopes: Array, areas: Array) -> float:
        return _segments(records, slopes, areas, self.weight)


@compiled
def _segments(records: Array, slopes: Array, areas: Array, weight: float) -> float:
    total = 0.0
    for i in range(len(records) - 1):
        total += _segment(records[i], records[i + 1], slopes[i], slopes[i + 1], areas, weight)
    return total


# Without fused multiply-add, because the difference of equal roots must be 0.
@compiled(forceinline=True, fastmath={"nsz", "reassoc"})
def _segment(
    start: Points,
    end: Points,
    start_slopes: Array,
    end_slopes: Array,
    areas: Array,
    weight: float,
) -> float:
    """Return the sum of w ‖q₁ − q₂‖², and add its slopes by normals and area ratios."""
    total = 0.0
    for t in range(len(areas)):
        s1, s2 = math.sqrt(start[9, t]), math.sqrt(end[9, t])
        factor = weight * areas[t]
        along_start = along_end = 0.0
        for k in range(6, 9):
            step = s1 * start[k, t] - s2 * end[k, t]
            total += factor * step * step
            step *= 2.0 * factor
            start_slopes[k, t] += step * s1
            end_slopes[k, t] -= step * s2
            along_start += step * start[k, t]
            along_end += step * end[k, t]
        start_slopes[9, t] += 0.5 * along_start / s1 if s1 > 0.0 else 0.0
        end_slopes[9, t] -= 0.5 * along_end / s2 if s2 > 0.0 else 0.0
    return total
