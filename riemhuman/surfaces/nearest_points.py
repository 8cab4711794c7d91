"""Nearest points on a surface: their triangles and barycentric coordinates."""

from __future__ import annotations

import math
from itertools import chain
from typing import NamedTuple

import numpy as np
from scipy.spatial import cKDTree

from riemhuman.arrays import Array, Integers, Points, Triangles
from riemhuman.checks import real_array
from riemhuman.errors import ArgumentError
from riemhuman.io.mesh_arrays import check_triangles
from riemhuman.kernels.compilation import compiled
from riemhuman.kernels.threads import of_one_kind, slices

# Nearest vertices whose triangles are searched first.
_N_VERTICES = 3
# Points that are searched together.
_BLOCK = 8192
# Distances are compared with this factor, so that rounding excludes no triangle.
_SLACK = 1.0 + 1e-9


class SurfacePoints(NamedTuple):
    """Points of a surface.

    Attributes
    ----------
    triangles : array of int, shape (N,)
    barycentric : array, shape (N, 3)
        Barycentric coordinates in the triangles.

    Examples
    --------
    >>> bodies = rh.datasets.load_open_bodies("coarse")
    >>> points, _ = rh.surfaces.nearest_points(bodies[0][:3], bodies[0], bodies.template.faces)
    >>> points.triangles.shape, points.barycentric.shape
    ((3,), (3, 3))
    """

    triangles: Integers
    barycentric: Array


def nearest_points(queries: Array, points: Points, faces: Triangles) -> tuple[SurfacePoints, Array]:
    """Return the nearest points of a surface.

    A triangle with edges no longer than l has a corner within l/√3 of each of its points. So if a
    point of a triangle is nearer than the distance d found so far, a corner of the triangle is
    nearer than d + l/√3.

    Parameters
    ----------
    queries : array, shape (N, 3), in metres
    points : array, shape (V, 3), in metres
    faces : array of int, shape (F, 3)

    Returns
    -------
    places : SurfacePoints
    distances : array, shape (N,), in metres

    Examples
    --------
    >>> bodies = rh.datasets.load_open_bodies("coarse")
    >>> faces = bodies.template.faces
    >>> points, distances = rh.surfaces.nearest_points(bodies[0] + 0.01, bodies[0], faces)
    """
    queries = real_array(queries, "queries", ("n_queries", 3), batched=False)
    points = real_array(points, "points", ("n_points", 3), batched=False)
    faces = check_triangles(faces, len(points))
    if len(faces) == 0:
        raise ArgumentError("faces is empty; a surface needs at least one triangle")
    corners = points[faces]
    longest = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).max(axis=1)
    reach = np.zeros(len(points))
    np.maximum.at(reach, faces.ravel(), np.repeat(longest, 3) / math.sqrt(3.0))
    places = _NearestPlaces(queries, points, faces, _SLACK * reach)
    used = np.unique(faces)
    n_near = min(_N_VERTICES, len(used))
    _, near = cKDTree(points[used]).query(queries, k=range(1, n_near + 1))
    places.try_vertices(used[near].ravel(), n_near * np.arange(len(queries) + 1))
    # Few vertices have long edges; those with short edges need only be searched nearby.
    sizes = np.ceil(np.log2(np.maximum(reach[used], np.finfo(float).tiny)))
    for size in np.unique(sizes):
        members = used[sizes == size]
        tree, farthest = cKDTree(points[members]), _SLACK * reach[members].max()
        for part in slices(len(queries), _BLOCK):
            radii = np.sqrt(places.squares[part]) + farthest
            nearby = tree.query_ball_point(queries[part], radii)
            ends = np.cumsum([0, *map(len, nearby)])
            numbers = np.fromiter(chain.from_iterable(nearby), np.int64, ends[-1])
            places.try_vertices(members[numbers], ends, part)
    return places.result()


def nearest_points_around(
    queries: Array, vertices: Integers, points: Points, faces: Triangles
) -> tuple[SurfacePoints, Array]:
    """Return the nearest places in the triangles at given vertices, (N, k), of each query."""
    places = _NearestPlaces(queries, points, faces, np.full(len(points), np.inf))
    places.try_vertices(vertices.ravel(), vertices.shape[1] * np.arange(len(queries) + 1))
    return places.result()


class _NearestPlaces:
    """The nearest place of each query among the triangles that have been tried."""

    def __init__(self, queries: Array, points: Points, faces: Triangles, reach: Array) -> None:
        self._queries, self._points = of_one_kind(queries), of_one_kind(points)
        self._faces = of_one_kind(faces)
        # Every place in a triangle is within the reach of one of its corners.
        self._reach = reach
        # The triangles at all vertices in one row, and where those of each vertex start.
        order = np.argsort(faces.ravel(), kind="stable")
        self._around = order // 3
        self._starts = np.searchsorted(faces.ravel()[order], np.arange(len(points) + 1))
        self._triangles = np.zeros(len(queries), np.int64)
        self._barycentric = np.zeros((len(queries), 3))
        self.squares = np.full(len(queries), np.inf)

    def try_vertices(
        self, vertices: Integers, ends: Integers, part: slice[int | None] = slice(None)
    ) -> None:
        """Try the triangles at vertices[ends[i] : ends[i + 1]] for query i of a part."""
        _try_vertices(
            of_one_kind(self._queries[part]),
            vertices,
            ends,
            self._points,
            self._faces,
            self._around,
            self._starts,
            self._reach,
            self._triangles[part],
            self._barycentric[part],
            self.squares[part],
        )

    def result(self) -> tuple[SurfacePoints, Array]:
        return SurfacePoints(self._triangles, self._barycentric), np.sqrt(self.squares)


# More than eight arguments: a compiled loop takes plain arrays.
@compiled
def _try_vertices(
    queries: Array,
    vertices: Integers,
    ends: Integers,
    points: Points,
    faces: Triangles,
    around: Integers,
    starts: Integers,
    reach: Array,
    triangles: Integers,
    barycentric: Array,
    squares: Array,
) -> None:
    """Replace places by nearer ones in the triangles at some vertices of each query."""
    weights = np.empty(3)
    for i in range(len(queries)):
        query = queries[i]
        for vertex in vertices[ends[i] : ends[i + 1]]:
            square = 0.0
            for x in range(3):
                square += (query[x] - points[vertex, x]) ** 2
            if math.sqrt(square) - reach[vertex] > _SLACK * math.sqrt(squares[i]):
                continue
            for t in around[starts[vertex] : starts[vertex + 1]]:
                square = _closest_in_triangle(query, points, faces[t], weights)
                if square < squares[i]:
                    squares[i], triangles[i] = square, t
                    for corner in range(3):
                        barycentric[i, corner] = weights[corner]


@compiled
def _closest_in_triangle(query: Array, points: Points, corners: Integers, weights: Array) -> float:
    """Fill the barycentric coordinates of the closest point, and return its squared distance."""
    # The regions are those of Ericson, Real-Time Collision Detection, 2005, section 5.1.5.
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
    weights[0], weights[1], weights[2] = max(1.0 - v - w, 0.0), v, w
    square = 0.0
    for x in range(3):
        gap = query[x]
        for k in range(3):
            gap -= weights[k] * points[corners[k], x]
        square += gap * gap
    return square
