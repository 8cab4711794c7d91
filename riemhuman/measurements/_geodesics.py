"""Geodesics on triangulated surfaces and the derivatives of their lengths, in compiled loops.

A path runs through a strip of triangles. Laid flat, the strip contains one shortest path, which
the funnel algorithm finds (Lee and Preparata, "Euclidean shortest paths in the presence of
rectilinear barriers", Networks 14, 1984). Where the path bends at a vertex, the strip is rerouted
around the other side of the vertex if that makes the path shorter. When no rerouting helps, the
path is a geodesic: no path near it is shorter. The search starts on all bodies from one strip, so
their paths correspond: that of the template's shortest path through points on its edges. The length
is stationary in the crossings, so its derivatives are those with the crossings fixed on their
edges.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import autograd.numpy as anp
import numpy as np
from numpy import ndarray
from scipy import sparse
from scipy.sparse.csgraph import dijkstra

from riemhuman.checks import values_of
from riemhuman.errors import ArgumentError
from riemhuman.kernels.compilation import compiled
from riemhuman.measurements._sections import MISSES, Lines, side

SurfacePoint = tuple[int, ndarray]
"""Number of a triangle, and barycentric coordinates in it, shape (3,)."""

# The strip changes if the path gets shorter by more than this share of its length.
_GAIN = 1e-12
# Number of triangles at a vertex around which a strip may be rerouted.
_MOST_AROUND = 200
# Barycentric coordinate below which the end of a path lies on an edge.
_ON_EDGE = 1e-12
# Number of points on an edge through which the first path may run.
_PER_EDGE = 2


@dataclass(frozen=True, eq=False)
class Mesh:
    """Vertices, triangles and adjacency of a template, and what is computed once of them."""

    vertices: ndarray
    faces: ndarray
    neighbours: ndarray
    cutters: dict[Any, Any] = field(default_factory=dict)
    places: dict[Any, SurfacePoint] = field(default_factory=dict)
    _strips: dict[Any, ndarray] = field(default_factory=dict)

    @cached_property
    def _points(self) -> tuple[ndarray, ndarray, Any, Any]:
        """Points on edges, the two triangles of each, those in a triangle, and their distances."""
        face, corner = np.nonzero(self.neighbours >= 0)
        sides = np.stack([self.faces[face, corner], self.faces[face, (corner + 1) % 3]], axis=1)
        edges, numbers = np.unique(np.sort(sides, axis=1), axis=0, return_inverse=True)
        faces = np.repeat(face[np.argsort(numbers.ravel())].reshape(-1, 2), _PER_EDGE, axis=0)
        along = np.arange(1, _PER_EDGE + 1)[:, np.newaxis] / (_PER_EDGE + 1)
        starts, ends = (self.vertices[edges[:, [k]]] for k in range(2))
        points = (starts + along * (ends - starts)).reshape(-1, 3)
        incidence = faces.ravel(), np.repeat(np.arange(len(points)), 2)
        shape = len(self.faces), len(points)
        inside = sparse.csr_array((np.ones(len(incidence[0])), incidence), shape=shape)
        one, other = sparse.triu(inside.T @ inside, 1).nonzero()
        ways = np.linalg.norm(points[one] - points[other], axis=1), one, other
        return points, faces, inside, ways

    def strip(self, start: SurfacePoint, end: SurfacePoint) -> ndarray:
        """Return the triangles on the shortest path through points on edges of the template."""
        key = tuple((face, *weights) for face, weights in (start, end))
        if key in self._strips:
            return self._strips[key]
        points, faces, inside, ways = self._points
        parts: list[Any] = [ways]
        of_ends: list[ndarray] = []
        for face, weights in (start, end):
            # A point on an edge or a vertex lies in several triangles.
            corners = self.faces[face][weights > _ON_EDGE]
            around = np.flatnonzero(np.isin(self.faces, corners).sum(axis=1) == len(corners))
            near = np.unique(inside[around].indices)
            lengths = np.linalg.norm(
                points[near] - weights @ self.vertices[self.faces[face]], axis=1
            )
            parts.append((lengths, near, np.full(len(near), len(points) + len(of_ends))))
            of_ends.append(around)
        common = np.intersect1d(of_ends[0], of_ends[1])
        if len(common):
            return common[:1]
        lengths, one, other = (np.concatenate(part) for part in zip(*parts, strict=True))
        graph = sparse.csr_array((lengths, (one, other)), shape=(len(points) + 2,) * 2)
        _, before = dijkstra(graph, False, len(points), return_predecessors=True)
        passed: list[int] = []
        step, there = before[-1], of_ends[1]
        while step >= 0:
            here = faces[step] if step < len(points) else of_ends[0]
            passed.insert(0, np.intersect1d(here, there)[0])
            step, there = before[step], here
        if not passed:
            raise ArgumentError(
                "a path along the surface must begin and end on one connected component"
            )
        strip = np.array(passed)
        self._strips[key] = strip[np.append(True, np.diff(strip) != 0)]
        return self._strips[key]


def geodesics(surfaces: Any, start: SurfacePoint, end: SurfacePoint, mesh: Mesh) -> Lines:
    """Return the geodesics from start to end on surfaces: their ends and crossings with edges."""
    strip, values = mesh.strip(start, end), values_of(surfaces)
    found = [_shortest(surface, start, end, mesh, strip) for surface in values]
    vertices, weights = (np.concatenate(parts) for parts in zip(*found, strict=True))
    counts = np.array([len(part) for part, _ in found])
    bodies = np.repeat(np.arange(len(found)), counts)
    points = anp.sum(weights[:, :, None] * surfaces[bodies[:, None], vertices], axis=1)
    return Lines(points, bodies, np.where(counts > 0, 0, MISSES))


def _shortest(
    surface: ndarray, start: SurfacePoint, end: SurfacePoint, mesh: Mesh, first: ndarray
) -> tuple[ndarray, ndarray]:
    """Return three vertices and their weights for each point of a path; none if there is none."""
    f = np.require(surface, np.float64, ["C", "W"])
    ends = np.zeros((2, 3), np.int64), np.zeros((2, 3))
    for k, (face, coordinates) in enumerate((start, end)):
        ends[0][k] = mesh.faces[face]
        ends[1][k] = np.where(coordinates > _ON_EDGE, coordinates, 0.0)
    length, edges, t, _, _ = _straighten(f, (mesh.faces, mesh.neighbours), first, ends)
    if np.isnan(length):
        return ends[0][:0], ends[1][:0]
    crossed = np.concatenate([edges, edges[:, :1]], axis=1)
    inner = np.stack([1.0 - t, t, np.zeros_like(t)], axis=1)
    vertices = np.concatenate([ends[0][:1], crossed, ends[0][1:]])
    return vertices, np.concatenate([start[1][None], inner, end[1][None]])


@compiled
def _corner_of(faces: Any, face: int, vertex: int) -> int:
    for k in range(3):
        if faces[face, k] == vertex:
            return k
    return -1


@compiled
def _product(f: Any, origin: int, a: int, b: int) -> float:
    """Return the inner product of the edges from a vertex to two others."""
    total = 0.0
    for x in range(3):
        total += (f[a, x] - f[origin, x]) * (f[b, x] - f[origin, x])
    return total


@compiled
def _in_triangle(corners: Any, vertices: Any, weights: Any) -> Any:
    """Return coordinates in a triangle of a point in another one; empty if it lies elsewhere."""
    coordinates = np.zeros(3)
    for k in range(3):
        if weights[k] > 0.0:
            found = False
            for j in range(3):
                if corners[j] == vertices[k]:
                    coordinates[j], found = weights[k], True
            if not found:
                return coordinates[:0]
    return coordinates


@compiled
def _trimmed(faces: Any, strip: Any, ends: Any) -> Any:
    """Return a strip without the triangles that it leaves, or enters, where the path ends."""
    # From within the edge by which the path leaves a triangle, the funnel would have no direction.
    vertices, weights = ends
    first, last = 0, len(strip) - 1
    while first < last and len(_in_triangle(faces[strip[first + 1]], vertices[0], weights[0])):
        first += 1
    while last > first and len(_in_triangle(faces[strip[last - 1]], vertices[1], weights[1])):
        last -= 1
    return strip[first : last + 1]


@compiled
def _apex(f: Any, p: int, q: int, apex: int) -> complex:
    """Return the apex of a triangle in the plane where p is 0 and q lies on the positive axis."""
    x = _product(f, p, q, apex) / np.sqrt(_product(f, p, q, q))
    return complex(x, np.sqrt(max(_product(f, p, apex, apex) - x * x, 0.0)))


@compiled
def _unfold(f: Any, mesh: Any, strip: Any, ends: Any, edges: Any, sides: Any) -> bool:
    """Lay a strip flat; edges[k] is the right and the left vertex between triangles k and k + 1."""
    # Columns of `sides` are their places in the complex plane, between both ends of the path.
    (faces, neighbours), (vertices, weights) = mesh, ends
    corners, size = faces[strip[0]], len(strip)
    flat = np.zeros(3, np.complex128)
    flat[1] = np.sqrt(_product(f, corners[0], corners[1], corners[1]))
    flat[2] = _apex(f, corners[0], corners[1], corners[2])
    start = _in_triangle(corners, vertices[0], weights[0])
    sides[:, 0] = np.sum(start * flat)
    for step in range(1, size):
        face, beyond = strip[step - 1], strip[step]
        out = -1
        for k in range(3):
            if neighbours[face, k] == beyond:
                out = k
        if out < 0:
            return False
        p, q = faces[face, out], faces[face, (out + 1) % 3]
        edges[step - 1, 0], edges[step - 1, 1] = p, q
        right, left = flat[out], flat[(out + 1) % 3]
        sides[0, step], sides[1, step] = right, left
        corner = _corner_of(faces, beyond, q)
        if corner < 0 or faces[beyond, (corner + 1) % 3] != p:
            return False
        third = (corner + 2) % 3
        scale = 1.0 / np.sqrt(_product(f, p, q, q))
        away = scale * _apex(f, p, q, faces[beyond, third]).conjugate()
        flat[corner], flat[(corner + 1) % 3] = left, right
        flat[third] = right + away * (left - right)
    end = _in_triangle(faces[strip[-1]], vertices[1], weights[1])
    sides[:, size] = np.sum(end * flat)
    return True


@compiled
def _funnel(sides: Any) -> Any:
    """Return the bends of the shortest path, with its end, and the side on which each one is."""
    size = sides.shape[1]
    bends, which = np.empty(size, np.int64), np.zeros(size, np.int64)
    count, apex, place, k = 0, 0, sides[0, 0], 1
    # What limits the view from the last bend, to the right and to the left.
    limits, views = np.zeros(2, np.int64), np.array([place, place])
    while k < size:
        for own in range(2):
            other, point, turn = 1 - own, sides[own, k], 1.0 - 2.0 * own
            if turn * side(place, views[own], point) < 0.0:
                continue
            if limits[own] == apex or turn * side(place, views[other], point) < 0.0:
                limits[own], views[own] = k, point
                continue
            apex, place = limits[other], views[other]
            bends[count], which[count] = apex, other
            count, k = count + 1, apex
            limits[:], views[:] = apex, place
            break
        k += 1
    bends[count] = size - 1
    return bends[: count + 1], which[: count + 1]


@compiled
def _cross_edges(sides: Any, bends: Any, which: Any) -> Any:
    """Return the length of the path, and where it crosses edges, from 0 (right) to 1 (left)."""
    length, k, places = 0.0, 1, np.empty(sides.shape[1] - 2)
    here = sides[0, 0]
    for number in range(len(bends)):
        last, own = bends[number], which[number]
        goal = sides[own, last]
        length += abs(goal - here)
        while k <= min(last, len(places)):
            on_right, on_left = side(here, goal, sides[0, k]), side(here, goal, sides[1, k])
            t = 0.5 if on_right == on_left else on_right / (on_right - on_left)
            places[k - 1] = float(own) if k == last else min(max(t, 0.0), 1.0)
            k += 1
        here = goal
    return length, places


@compiled
def _reroute(mesh: Any, strip: Any, vertex: int, edge: int, edges: Any) -> Any:
    """Return a strip rerouted around the other side of a vertex; empty if that has a boundary."""
    faces, neighbours = mesh
    size, new = len(strip), np.empty(len(strip) + _MOST_AROUND, np.int64)
    first, last = edge, edge
    while first > 0 and (edges[first - 1, 0] == vertex or edges[first - 1, 1] == vertex):
        first -= 1
    while last + 1 < size - 1 and (edges[last + 1, 0] == vertex or edges[last + 1, 1] == vertex):
        last += 1
    # Edges first to last meet the vertex; they lie between triangles first to last + 1.
    for k in range(first + 1):
        new[k] = strip[k]
    count, face, goal = first + 1, strip[first], strip[last + 1]
    vertex_was_left = edges[first, 1] == vertex
    while face != goal:
        corner = _corner_of(faces, face, vertex)
        if corner < 0:
            return new[:0]
        # Leave by the edge at the vertex that turns the other way around it.
        face = neighbours[face, corner if vertex_was_left else (corner + 2) % 3]
        if face < 0 or count >= first + _MOST_AROUND:
            return new[:0]
        new[count] = face
        count += 1
    for k in range(last + 2, size):
        new[count] = strip[k]
        count += 1
    # Remove triangles that the strip enters and leaves by the same edge.
    kept = 0
    for k in range(count):
        if kept >= 2 and new[kept - 2] == new[k]:
            kept -= 1
        elif kept >= 1 and new[kept - 1] == new[k]:
            continue
        else:
            new[kept] = new[k]
            kept += 1
    return new[:kept]


@compiled
def _path_in(f: Any, mesh: Any, strip: Any, ends: Any) -> Any:
    """Return the length of a strip's shortest path, its edges, places on them, bends and sides."""
    size = len(strip)
    edges, sides = np.zeros((size - 1, 2), np.int64), np.empty((2, size + 1), np.complex128)
    length, places = np.nan, np.zeros(size - 1)
    bends = which = np.empty(0, np.int64)
    # Edges without length lead to NaN, with which `_funnel` would never end.
    if _unfold(f, mesh, strip, ends, edges, sides) and np.isfinite(sides).all():
        bends, which = _funnel(sides)
        length, places = _cross_edges(sides, bends, which)
    return length, edges, places, bends, which


@compiled
def _straighten(f: Any, mesh: Any, strip: Any, ends: Any) -> Any:
    """Shorten the path in a strip until no rerouting helps."""
    strip = _trimmed(mesh[0], strip, ends)
    path = _path_in(f, mesh, strip, ends)
    shorter = True
    while shorter:  # ends: no strip comes twice
        shorter = False
        length, edges, _, bends, which = path
        for number in range(len(bends)):
            edge = bends[number] - 1
            if not 0 <= edge < len(edges):  # the bend is an end of the path
                continue
            vertex = edges[edge, which[number]]
            other = _reroute(mesh, strip, vertex, edge, edges)
            if len(other) == 0:
                continue
            other = _trimmed(mesh[0], other, ends)
            moved = _path_in(f, mesh, other, ends)
            if moved[0] < length * (1.0 - _GAIN):
                strip, path, shorter = other, moved, True
                break
    return path
