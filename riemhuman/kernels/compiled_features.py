"""Compiled loops for what the distances of `compiled_pairs` need to know of each point.

With its features, every function returns how far each point is, at most, from the one that its
features stand for: 0 where they are in double precision, infinite where single precision has no
room for them. Rows of features are filled up with zeros, which add nothing to a distance, to whole
vector registers: F⁺ and k⁺ are F and k rounded up to a multiple of `LANES`.
"""

from __future__ import annotations

import math

import numpy as np
from numpy import ndarray

from riemhuman.kernels.compilation import njit
from riemhuman.kernels.surface import DEGENERATE

LANES = 64
"""Rows of features are as long as a multiple of this."""

# Squares of numbers beyond these, and their products, leave the range of single precision.
_LARGEST, _SMALLEST = 1e15, 1e-15
# What squares too small for single precision may add to a squared distance, per term.
_UNDERFLOW = 1e-34


def of_one_kind(array: ndarray) -> ndarray:
    """Return a read-only C-contiguous array, the one kind that loops are compiled for.

    Loops over another kind would be compiled again, and could add up in another order.

    Parameters
    ----------
    array : array, shape (...)
        Any array; it is left alone.

    Returns
    -------
    array, shape (...)
    """
    view = np.ascontiguousarray(array).view()
    view.flags.writeable = False
    return view


@njit(nogil=True)
def _triangle(
    f: ndarray, faces: ndarray, frames: ndarray, t: int
) -> tuple[float, float, float, float, float, float]:
    """Return f_u·f_u, f_u·f_v, f_u × f_v and its length, which is 0 for triangles without area."""
    one, two, three = faces[t, 0], faces[t, 1], faces[t, 2]
    scale_u, scale_v, skew = frames[t, 0], frames[t, 1], frames[t, 2]
    x, y, z = f[two, 0] - f[one, 0], f[two, 1] - f[one, 1], f[two, 2] - f[one, 2]
    u0, u1, u2 = x * scale_u, y * scale_u, z * scale_u
    v0 = (f[three, 0] - f[one, 0]) * scale_v - x * skew
    v1 = (f[three, 1] - f[one, 1]) * scale_v - y * skew
    v2 = (f[three, 2] - f[one, 2]) * scale_v - z * skew
    n0, n1, n2 = u1 * v2 - u2 * v1, u2 * v0 - u0 * v2, u0 * v1 - u1 * v0
    squared = n0 * n0 + n1 * n1 + n2 * n2
    e = u0 * u0 + u1 * u1 + u2 * u2
    g = v0 * v0 + v1 * v1 + v2 * v2
    area = 0.0 if squared <= DEGENERATE * e * g else math.sqrt(squared)
    return e, u0 * v0 + u1 * v1 + u2 * v2, n0, n1, n2, area


@njit(nogil=True)
def _half_plane(
    f: ndarray, faces: ndarray, frames: ndarray, x: ndarray, y: ndarray, s: ndarray
) -> None:
    for t in range(len(faces)):
        e, mixed, _, _, _, area = _triangle(f, faces, frames, t)
        if area > 0.0:
            x[t], y[t], s[t] = mixed / e, area / e, math.sqrt(area)
        else:
            x[t], y[t], s[t] = 0.0, 1.0, 0.0


@njit(nogil=True)
def _normals(f: ndarray, faces: ndarray, frames: ndarray, normals: ndarray, rooted: bool) -> None:
    """Write unit normals, or square root normals; 0 on triangles without area."""
    for t in range(len(faces)):
        _, _, n0, n1, n2, area = _triangle(f, faces, frames, t)
        scale = 0.0
        if area > 0.0:
            scale = 1.0 / (math.sqrt(area) if rooted else area)
        normals[t, 0], normals[t, 1], normals[t, 2] = n0 * scale, n1 * scale, n2 * scale


@njit(nogil=True)
def _pack_half_plane(
    x: ndarray, y: ndarray, s: ndarray, roots: ndarray, lam: float, kept: ndarray
) -> float:
    """Write features; return the squared distance of the point that they stand for."""
    gap = 0.0
    for t in range(len(x)):
        h, radius = math.sqrt(0.5) / y[t], roots[t] * s[t]
        kept[0, t], kept[1, t], kept[2, t], kept[3, t] = x[t], y[t], h, radius
        dx, dy = x[t] - kept[0, t], y[t] - kept[1, t]
        # sin²(½θ) ≤ ¼θ² and ℓ² ≤ 2m bound the angle.
        angle = min((dx * dx + dy * dy) * h * h / (4.0 * lam), 4.0)
        gap += (radius - kept[3, t]) ** 2 + radius * kept[3, t] * angle
        inside = abs(x[t]) < _LARGEST and _SMALLEST < y[t] < _LARGEST and radius < _LARGEST
        if not inside:
            gap = math.inf
    return 16.0 * lam * gap


@njit(nogil=True)
def _pack_normals(normals: ndarray, weights: ndarray, kept: ndarray) -> float:
    gap = 0.0
    for t in range(len(normals)):
        chord = 0.0
        for k in range(3):
            kept[k, t] = normals[t, k]
            chord += (normals[t, k] - kept[k, t]) ** 2
        # An angle of at most π/2 changes by at most √2 times the change of its chord.
        gap += 2.0 * weights[t] * chord
    return gap


@njit(nogil=True)
def _pack_vector(vector: ndarray, roots: ndarray, kept: ndarray) -> float:
    gap = 0.0
    for k in range(len(vector)):
        scaled = roots[k] * vector[k]
        kept[k] = scaled
        gap += (scaled - kept[k]) ** 2
        if not abs(scaled) < _LARGEST:
            gap = math.inf
    return gap


def metric_field_features(
    x: ndarray, y: ndarray, s: ndarray, weights: ndarray, lam: float, precision: str
) -> tuple[ndarray, ndarray]:
    """Return the features of metric fields.

    Parameters
    ----------
    x, y, s : array, shape (n, F)
        Half-plane coordinates and radii, see `ebin.coordinates`.
    weights : array, shape (F,)
        Weights w of the triangles.
    lam : float
        λ > 0.
    precision : {"single", "double"}
        Precision of the features.

    Returns
    -------
    features : array, shape (n, 4, F⁺)
        x, y, 1/(√2 y) and √w s.
    rounding : array, shape (n,)
        Bound on the distance to the metric fields that the features stand for.
    """
    features = _zeros((len(x), 4, len(weights)), precision)
    roots = np.sqrt(weights)
    gaps = [_pack_half_plane(x[i], y[i], s[i], roots, lam, kept) for i, kept in enumerate(features)]
    return features, _rounding(gaps, 16.0 * lam * len(weights), precision)


def surface_metric_field_features(
    points: ndarray,
    faces: ndarray,
    frames: ndarray,
    weights: ndarray,
    lam: float,
    precision: str,
) -> tuple[ndarray, ndarray]:
    """Return the features of the metric fields of surfaces, see `metric_field_features`.

    Parameters
    ----------
    points : array, shape (n, V, 3)
        Surfaces.
    faces : array of int, shape (F, 3)
        Triangles.
    frames : array, shape (F, 3)
        Template frames: 1/u₂, 1/v₃, u₃/(v₃u₂).
    weights : array, shape (F,)
        Template areas w.
    lam : float
        λ > 0.
    precision : {"single", "double"}
        Precision of the features.

    Returns
    -------
    features : array, shape (n, 4, F⁺)
    rounding : array, shape (n,)
    """
    features = _zeros((len(points), 4, len(faces)), precision)
    roots = np.sqrt(weights)
    x, y, s = np.empty((3, len(faces)))
    gaps = []
    for f, kept in zip(of_one_kind(points), features, strict=True):
        _half_plane(f, faces, frames, x, y, s)
        gaps.append(_pack_half_plane(x, y, s, roots, lam, kept))
    return features, _rounding(gaps, 16.0 * lam * len(faces), precision)


def normal_features(normals: ndarray, weights: ndarray, precision: str) -> tuple[ndarray, ndarray]:
    """Return the features of normal fields.

    Parameters
    ----------
    normals : array, shape (n, F, 3)
        Unit normals.
    weights : array, shape (F,)
        Weights w of the triangles.
    precision : {"single", "double"}
        Precision of the features.

    Returns
    -------
    features : array, shape (n, 3, F⁺)
        Components of the normals.
    rounding : array, shape (n,)
        Bound on the distance to the normal fields that the features stand for.
    """
    features = _zeros((len(normals), 3, len(weights)), precision)
    gaps = [
        _pack_normals(n, weights, kept)
        for n, kept in zip(of_one_kind(normals), features, strict=True)
    ]
    return features, _rounding(gaps, weights.max() * len(weights), precision)


def surface_normal_features(
    points: ndarray, faces: ndarray, frames: ndarray, weights: ndarray, precision: str
) -> tuple[ndarray, ndarray, ndarray]:
    """Return the features of the normal fields of surfaces, see `normal_features`.

    Parameters
    ----------
    points : array, shape (n, V, 3)
        Surfaces.
    faces : array of int, shape (F, 3)
        Triangles.
    frames : array, shape (F, 3)
        Template frames: 1/u₂, 1/v₃, u₃/(v₃u₂).
    weights : array, shape (F,)
        Template areas w.
    precision : {"single", "double"}
        Precision of the features.

    Returns
    -------
    features : array, shape (n, 3, F⁺)
    rounding : array, shape (n,)
    degenerate : array of bool, shape (n, F)
        Triangles without area, which have no normal.
    """
    features = _zeros((len(points), 3, len(faces)), precision)
    degenerate = np.empty((len(points), len(faces)), dtype=bool)
    normals = np.empty((len(faces), 3))
    gaps = []
    for i, f in enumerate(of_one_kind(points)):
        kept = features[i]
        _normals(f, faces, frames, normals, False)
        gaps.append(_pack_normals(normals, weights, kept))
        degenerate[i] = ~normals.any(axis=1)
    return features, _rounding(gaps, weights.max() * len(faces), precision), degenerate


def vector_features(vectors: ndarray, weights: ndarray, precision: str) -> tuple[ndarray, ndarray]:
    """Return the features of vectors with a weighted sum of squares for squared norm.

    Parameters
    ----------
    vectors : array, shape (n, k)
        Vectors.
    weights : array, shape (k,)
        Weights w of the components.
    precision : {"single", "double"}
        Precision of the features.

    Returns
    -------
    features : array, shape (n, k⁺)
        Components times √w.
    rounding : array, shape (n,)
        Bound on the distance to the vectors that the features stand for.
    """
    features = _zeros(vectors.shape, precision)
    roots = np.sqrt(weights)
    gaps = [
        _pack_vector(v, roots, kept) for v, kept in zip(of_one_kind(vectors), features, strict=True)
    ]
    return features, _rounding(gaps, len(weights), precision)


def surface_root_normal_features(
    points: ndarray, faces: ndarray, frames: ndarray, weights: ndarray, precision: str
) -> tuple[ndarray, ndarray]:
    """Return the features of the square root normal fields of surfaces, see `vector_features`.

    Parameters
    ----------
    points : array, shape (n, V, 3)
        Surfaces.
    faces : array of int, shape (F, 3)
        Triangles.
    frames : array, shape (F, 3)
        Template frames: 1/u₂, 1/v₃, u₃/(v₃u₂).
    weights : array, shape (F,)
        Template areas w.
    precision : {"single", "double"}
        Precision of the features.

    Returns
    -------
    features : array, shape (n, (3F)⁺)
    rounding : array, shape (n,)
    """
    features = _zeros((len(points), 3 * len(faces)), precision)
    roots = np.repeat(np.sqrt(weights), 3)
    normals = np.empty((len(faces), 3))
    gaps = []
    for f, kept in zip(of_one_kind(points), features, strict=True):
        _normals(f, faces, frames, normals, True)
        gaps.append(_pack_vector(normals.reshape(-1), roots, kept))
    return features, _rounding(gaps, 3 * len(faces), precision)


def _zeros(shape: tuple[int, ...], precision: str) -> ndarray:
    *leading, length = shape
    padded = -(-length // LANES) * LANES
    return np.zeros((*leading, padded), dtype=np.float32 if precision == "single" else np.float64)


def _rounding(gaps: list[float], n_terms: float, precision: str) -> ndarray:
    if precision == "double":
        return np.zeros(len(gaps))
    return np.sqrt(np.asarray(gaps, dtype=np.float64) + _UNDERFLOW * n_terms)
