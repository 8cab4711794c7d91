"""Where points lie on a surface: the nearest triangle and the place in it."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.spatial import cKDTree

from riemhuman.kernels.compiled import compiled

_N_VERTICES = 3


class SurfacePlaces(NamedTuple):
    """Points of a surface.

    Attributes
    ----------
    triangles : array of int, shape (N,)
        The triangle of each point.
    barycentric : array, shape (N, 3)
        Its barycentric coordinates there.
    """

    triangles: np.ndarray
    barycentric: np.ndarray


def nearest_places(
    queries: np.ndarray, points: np.ndarray, faces: np.ndarray
) -> tuple[SurfacePlaces, np.ndarray]:
    """Return the nearest points of a surface, among the triangles at the nearest vertices.

    Parameters
    ----------
    queries : array, shape (N, 3)
        Points, metres.
    points : array, shape (V, 3)
        Vertices of the surface, metres.
    faces : array of int, shape (F, 3)
        Its triangles.

    Returns
    -------
    places : SurfacePlaces
    distances : array, shape (N,)
        Metres.
    """
    near = cKDTree(points).query(queries, k=_N_VERTICES)[1]
    order = np.argsort(faces.ravel(), kind="stable")
    starts = np.searchsorted(faces.ravel()[order], np.arange(len(points) + 1))
    triangles = np.empty(len(queries), np.int64)
    barycentric, distances = np.empty((len(queries), 3)), np.empty(len(queries))
    _fill_nearest(
        queries,
        near,
        points,
        faces,
        order // 3,
        starts,
        triangles,
        barycentric,
        distances,
    )
    return SurfacePlaces(triangles, barycentric), distances


@compiled
def _fill_nearest(
    queries: np.ndarray,
    near: np.ndarray,
    points: np.ndarray,
    faces: np.ndarray,
    around: np.ndarray,
    starts: np.ndarray,
    triangles: np.ndarray,
    barycentric: np.ndarray,
    distances: np.ndarray,
) -> None:
    weights = np.empty(3)
    for i in range(len(queries)):
        best = np.inf
        for vertex in near[i]:
            for t in around[starts[vertex] : starts[vertex + 1]]:
                square = _closest_in_triangle(queries[i], points, faces[t], weights)
                if square < best:
                    best = square
                    triangles[i] = t
                    for k in range(3):
                        barycentric[i, k] = weights[k]
        distances[i] = np.sqrt(best)


@compiled
def _closest_in_triangle(
    query: np.ndarray, points: np.ndarray, corners: np.ndarray, weights: np.ndarray
) -> float:
    """Fill the barycentric coordinates of the closest point; return its squared distance.

    By the regions of Ericson, Real-Time Collision Detection, 2005, section 5.1.5.
    """
    d1 = d2 = d3 = d4 = d5 = d6 = 0.0
    for x in range(3):
        a, b, c = points[corners[0], x], points[corners[1], x], points[corners[2], x]
        d1 += (b - a) * (query[x] - a)
        d2 += (c - a) * (query[x] - a)
        d3 += (b - a) * (query[x] - b)
        d4 += (c - a) * (query[x] - b)
        d5 += (b - a) * (query[x] - c)
        d6 += (c - a) * (query[x] - c)
    vc, vb, va = d1 * d4 - d3 * d2, d5 * d2 - d1 * d6, d3 * d6 - d5 * d4
    v = w = 0.0
    if d1 <= 0.0 and d2 <= 0.0:
        pass
    elif d3 >= 0.0 and d4 <= d3:
        v = 1.0
    elif d6 >= 0.0 and d5 <= d6:
        w = 1.0
    elif vc <= 0.0 and d1 >= 0.0 and d3 <= 0.0:
        v = d1 / (d1 - d3)
    elif vb <= 0.0 and d2 >= 0.0 and d6 <= 0.0:
        w = d2 / (d2 - d6)
    elif va <= 0.0 and d4 >= d3 and d5 >= d6:
        w = (d4 - d3) / ((d4 - d3) + (d5 - d6))
        v = 1.0 - w
    else:
        v, w = vb / (va + vb + vc), vc / (va + vb + vc)
    weights[0], weights[1], weights[2] = 1.0 - v - w, v, w
    square = 0.0
    for x in range(3):
        gap = query[x]
        for k in range(3):
            gap -= weights[k] * points[corners[k], x]
        square += gap * gap
    return square
