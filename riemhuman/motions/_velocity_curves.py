r"""The curves of transported velocities that `RateInvariantMetric` compares, and their matching.

The fields Φ(f_k) of the frames are joined by geodesics. The velocity at the middle of each geodesic
is transported to one point, where velocities in orthonormal coordinates add up to a polygon. Its
sides depend on how densely frames are sampled; the cubic spline through its vertices hardly does.

Two polygons with segments v_i and w_j have, after the best re-timing, the squared distance L + M −
2F of their lengths L, M and

.. math:: F = \max \int \cos^+\angle(v, w) \sqrt{ds\, dt}

over monotone matchings of arc lengths s and t. Within a pair of segments the cosine is constant, so
the best matching is a straight line through it (Lahiri, Robinson and Klassen, "Precise matching of
PL curves in R^N in the square root velocity framework", 2015). Its entry and exit are searched
among equally spaced positions on every side.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from riemhuman.arrays import Array
from riemhuman.errors import NotDefinedError
from riemhuman.geometry import (
    EbinMetric,
    FlatMetric,
    NormalFieldMetric,
    ProductManifold,
    ProductMetric,
    RiemannianMetric,
    RotationFieldMetric,
)
from riemhuman.kernels.compilation import compiled
from riemhuman.motions._frames import Motion, frame_runs

if TYPE_CHECKING:
    from scipy.interpolate import CubicSpline


# Steps in which the length of the spline is measured, for every side and chord.
_FINER = 8
# Steps that are measured together.
_RUN = 128

# Sides below this share of the longest are pauses.
_STILL = 1e-6

# Eigenvalues of Gram matrices below this share of the largest belong to no tangent vector.
_NO_LENGTH = 1e-12

# Standard deviations after which a Gaussian is cut off.
_CUT_OFF = 4.0


class TransportedVelocities:
    """Velocities of motions, transported to the fields of one reference surface."""

    def __init__(self, metric: RiemannianMetric, reference: Array, *, heading: bool = True) -> None:
        if not metric.has_target_metric:
            raise NotDefinedError(
                f"rate-invariant distances need a metric of fields with log and transport, such as "
                f"ElasticMetric, RotationMetric or SRNFMetric; found {type(metric).__name__}"
            )
        self._metric = metric
        self._heading = heading
        self._fields = metric.target_metric
        self._base = metric.map(reference)
        if isinstance(self._fields, ProductMetric):
            metrics = [factor.metric for factor in self._fields.space.factors]
            factors = zip(metrics, self._parts(self._base), self._fields.weights, strict=True)
            self._roots = [_roots_at(base, metric, weight) for metric, base, weight in factors]
        else:
            self._roots = [_roots_at(self._base, self._fields, 1.0)]

    def segments(self, motion: Motion, name: str = "motion") -> Array:
        """Return log Φ(f_{k+1}) at Φ(f_k), transported, in coordinates, shape (n_frames - 1, p)."""
        rows: list[Array] = []
        last = None
        for run in frame_runs(self._metric.space, motion, name, self._heading):
            fields = self._metric.map(run)
            joined = fields if last is None else np.concatenate([last, fields])
            last = fields[-1:]
            starts = joined[:-1]
            velocities = self._fields.log(joined[1:], starts)
            half = 0.5 * velocities
            middles = self._fields.exp(half, starts)
            velocities = self._fields.parallel_transport(velocities, starts, direction=half)
            transported = self._fields.parallel_transport(
                velocities, middles, end_point=np.broadcast_to(self._base, middles.shape)
            )
            parts = zip(self._parts(transported), self._roots, strict=True)
            rows.append(np.concatenate([_coordinates(*part) for part in parts], axis=1))
        return np.concatenate(rows)

    def _parts(self, fields: Array) -> Sequence[Array]:
        """Return fields or vectors in each factor of their space."""
        space = self._fields.space
        if isinstance(space, ProductManifold):
            return space.project_from_product(fields)
        return [fields]


def _coordinates(vectors: Array, roots: Array) -> Array:
    """Return orthonormal coordinates of tangent vectors, shape (n, F r)."""
    n_triangles, n_entries, _ = roots.shape
    entries = vectors.reshape(-1, n_triangles, n_entries)
    coordinates: Array = np.einsum("nfi,fir->nfr", entries, roots)
    return coordinates.reshape(len(vectors), -1)


def _roots_at(base: Array, metric: RiemannianMetric, weight: float) -> Array:
    """Return what maps tangent vectors at a point to orthonormal coordinates.

    That is an array (F, m, r), for m entries of a vector on each of F triangles.
    """
    if not isinstance(metric, (EbinMetric, FlatMetric, NormalFieldMetric, RotationFieldMetric)):
        raise NotDefinedError(
            f"rate-invariant distances need the fields of an elastic metric, of rotations or of "
            f"flat terms; found {type(metric).__name__}"
        )
    count, *entries = metric.space.shape
    size = math.prod(entries)
    units = np.broadcast_to(np.eye(size).reshape(size, 1, *entries), (size, count, *entries))
    basis = metric.space.to_tangent(units, base)
    # These metrics are sums over triangles: each triangle has a Gram matrix of its own.
    fields = basis.reshape(size, count, size)
    lowered = metric.covector(basis, base).reshape(size, count, size)
    values, vectors = np.linalg.eigh(weight * np.einsum("ifk,jfk->fij", lowered, fields))
    has_length = values.max(axis=0) > _NO_LENGTH * values.max()
    return np.asarray((np.sqrt(np.maximum(values, 0.0))[:, None] * vectors)[..., has_length])


def even_segments(segments: Array, n_segments: int, smoothing: float) -> tuple[Array, Array]:
    """Return chords of equal arcs of a smooth spline, and where on a polygon they begin and end."""
    from scipy.interpolate import CubicSpline  # takes long to import

    n = len(segments)
    products = segments @ segments.T
    lengths = np.sqrt(np.diag(products))
    moving = np.flatnonzero(lengths > _STILL * lengths.max())
    if len(moving) == 0:
        return np.zeros((n_segments, segments.shape[1])), np.linspace(0.0, n, n_segments + 1)
    # The spline passes vertices at equal intervals of time, where a motion that reverses slows
    # down; pauses take no time. Its points are sums of sides: these are their coefficients.
    corners = np.tri(len(moving) + 1, len(moving), -1)
    curve = CubicSpline(np.arange(len(corners)), corners)
    within = products[np.ix_(moving, moving)]
    finer = _FINER * n_segments
    times = _even_times(curve, within, finer)
    curve = CubicSpline(np.arange(finer + 1), _smooth(curve(times), smoothing * finer))
    even = _even_times(curve, within, n_segments)
    times = np.interp(even, np.arange(finer + 1), times)
    sides = np.minimum(times.astype(int), len(moving) - 1)
    places = moving[sides] + (times - sides)
    places[0] = 0.0
    places[-1] = n
    return np.diff(curve(even), axis=0) @ segments[moving], places


def _even_times(curve: CubicSpline, within: Array, n_arcs: int) -> Array:
    """Return times of a spline between which lie arcs of equal length, shape (n_arcs + 1,)."""
    n_pieces = len(curve.x) - 1
    finer = _FINER * math.ceil(n_arcs / n_pieces)
    times = np.linspace(0.0, n_pieces, n_pieces * finer + 1)
    squares = []
    for first in range(0, len(times) - 1, _RUN):
        steps = np.diff(curve(times[first : first + _RUN + 1]), axis=0)
        squares.append(np.sum(steps @ within * steps, axis=1))
    lengths = np.sqrt(np.maximum(np.concatenate(squares), 0.0))
    arcs = np.concatenate([[0.0], np.cumsum(lengths)])
    return np.interp(np.linspace(0.0, arcs[-1], n_arcs + 1), arcs, times)


def _smooth(points: Array, deviation: float) -> Array:
    """Return Gaussian means of points in a row, continued point-symmetrically beyond the ends."""
    from scipy.ndimage import gaussian_filter1d  # takes long to import

    n_beyond = math.ceil(_CUT_OFF * deviation)
    beyond = ((n_beyond, n_beyond), (0, 0))
    extended = np.pad(points, beyond, "reflect", reflect_type="odd")
    smooth: Array = gaussian_filter1d(extended, deviation, axis=0, truncate=_CUT_OFF)
    return smooth[n_beyond:-n_beyond]


def best_matching(products: Array, n_steps: int) -> tuple[float, Array]:
    """Return F for inner products of segments, and the places that the best matching joins.

    Places are counted in segments of each polygon; the best matching is straight between them. They
    are among `n_steps` equally spaced ones in every segment.
    """
    n, m = products.shape
    steps = np.arange(n_steps + 1.0)
    roots = np.sqrt(np.outer(steps, steps)) / n_steps
    lower = np.zeros((n + 1, m, n_steps + 1))
    left = np.zeros((n, m + 1, n_steps + 1))
    path = np.zeros((n + m + 2, 2))
    _fill_gains(products, roots, lower, left)
    length = _trace_gains(products, roots, lower, left, path)
    gain = float(max(lower[n, m - 1, n_steps], left[n - 1, m, n_steps]))
    return gain, path[:length][::-1]


@compiled
def _fill_gains(products: Array, roots: Array, lower: Array, left: Array) -> None:
    """Compute the largest gains on the sides of all cells."""
    n, m = products.shape
    last = len(roots) - 1
    for i in range(n):
        for j in range(m):
            gain = products[i, j]
            for k in range(last + 1):
                high = max(left[i, j, last], lower[i, j, k])
                right = max(lower[i, j, last], left[i, j, k])
                if gain > 0.0:
                    for p in range(k + 1):
                        high = max(high, lower[i, j, p] + gain * roots[last, k - p])
                        right = max(right, left[i, j, p] + gain * roots[k - p, last])
                    for p in range(last + 1):
                        high = max(high, left[i, j, p] + gain * roots[last - p, k])
                        right = max(right, lower[i, j, p] + gain * roots[k, last - p])
                lower[i + 1, j, k], left[i, j + 1, k] = high, right


@compiled
def _trace_gains(products: Array, roots: Array, lower: Array, left: Array, path: Array) -> int:
    """Write where the best matching enters cells, the last first, to (0, 0); return how many."""
    n, m = products.shape
    last, length = len(roots) - 1, 1
    # The exit of a cell: after `up` steps of the first polygon and `along` of the second.
    i, j, up, along = n - 1, m - 1, last, last
    path[0, 0], path[0, 1] = n, m
    inside = True
    while inside:
        gain = max(products[i, j], 0.0)
        best, best_up, best_along = -math.inf, 0, 0
        for p in range(along + 1):
            value = lower[i, j, p] + gain * roots[up, along - p]
            if value > best:
                best, best_along = value, p
        for p in range(up + 1):
            value = left[i, j, p] + gain * roots[up - p, along]
            if value > best:
                best, best_up, best_along = value, p, 0
        path[length, 0], path[length, 1] = i + best_up / last, j + best_along / last
        length += 1
        # Into the cell below, beside, or past the corner; along the border if there is none.
        below, beside = best_up == 0 and i > 0, best_along == 0 and j > 0
        inside, up, along = below or beside, best_up, best_along
        if below:
            i, up = i - 1, last
        if beside:
            j, along = j - 1, last
    # The path is 0 beyond its last entry, which may lie on the border.
    return length + 1 if path[length - 1, 0] + path[length - 1, 1] > 0.0 else length
