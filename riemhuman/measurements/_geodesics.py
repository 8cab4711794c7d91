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

import math
from dataclasses import dataclass, field
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy import sparse
from scipy.sparse.csgraph import dijkstra

from riemhuman.arrays import Array, Integers, Triangles
from riemhuman.checks import values_of
from riemhuman.errors import ArgumentError
from riemhuman.io.mesh_arrays import distinct_pairs
from riemhuman.kernels.compilation import compiled
from riemhuman.measurements._sections import MISSES, Cutter, Lines, side, weighted_vertices
from riemhuman.measurements._vertex_slopes import VertexSlopes

SurfacePoint = tuple[int, Array]
"""Number of a triangle, and barycentric coordinates in it, shape (3,)."""

# The strip changes if the path gets shorter by more than this share of its length.
_GAIN = 1e-12
# Barycentric coordinate below which the end of a path lies on an edge.
_ON_EDGE = 1e-12
# Number of points on an edge through which the first path may run.
_PER_EDGE = 2


AroundPoint = tuple[Integers, Array]
"""The triangles about a point, and its barycentric coordinates in them, shape (k, 3)."""

Strip = tuple[Integers, tuple[AroundPoint, AroundPoint]]
"""Triangles in order, and what is about the two ends of a path."""

Adjacency = tuple[Triangles, Triangles]
"""Triangles and their neighbours."""

Funnel = tuple[Integers, NDArray[np.complex128]]
"""Limits of the view from a bend, and three complex numbers."""


class Path(NamedTuple):
    """A path through a strip of n triangles, in arrays with room for any path.

    Only the first entries of each array are in use; loops are told n. Edge k, from 1 to n − 1, is
    that between the triangles k − 1 and k. Seen along the path, its ends are on the right (0) and
    on the left (1).
    """

    strip: Integers  # the n triangles in order
    edges: Integers  # the right and the left vertex of edge k in row k − 1
    # The strip laid flat in the complex plane: column k holds the right and the left end of edge k.
    # Columns 0 and n hold the start and the end of the path, each twice.
    sides: NDArray[np.complex128]
    # Where the shortest path in the strip bends: the number of the edge, and at which of its ends.
    # The last row in use stands for the end of the path, as edge n.
    bends: Integers
    crossings: Array  # where the path crosses edge k, from 0 (right) to 1 (left), at place k − 1


def _empty_path(size: int) -> Path:
    return Path(
        strip=np.empty(size, np.int64),
        edges=np.empty((size, 2), np.int64),
        sides=np.empty((2, size), np.complex128),
        bends=np.empty((size, 2), np.int64),
        crossings=np.empty(size),
    )


@dataclass(frozen=True, eq=False)
class _EdgePoints:
    """Points on the edges of a template, through which the first path may run."""

    places: Array
    faces: Integers  # the two triangles of each point
    inside: sparse.csr_array  # which points are on the edges of each triangle
    distances: sparse.csr_array  # between points in one triangle


@dataclass(frozen=True, eq=False)
class Mesh:
    """Vertices, triangles and adjacency of a template, and what is computed from them once."""

    vertices: Array
    faces: Triangles
    neighbours: Integers
    cutters: dict[tuple[tuple[str, ...], tuple[str, ...]], Cutter] = field(default_factory=dict)
    places: dict[str | tuple[tuple[str, float], ...], SurfacePoint] = field(default_factory=dict)
    _strips: dict[tuple[tuple[float, ...], ...], Strip] = field(default_factory=dict)

    @cached_property
    def corners(self) -> sparse.csr_array:
        """The matrix that sums the three corners of every triangle, shape (F, V)."""
        n_faces = len(self.faces)
        ones, ends = np.ones(3 * n_faces), 3 * np.arange(n_faces + 1)
        shape = n_faces, len(self.vertices)
        return sparse.csr_array((ones, self.faces.ravel(), ends), shape=shape)

    @cached_property
    def sides(self) -> sparse.csr_array:
        """The matrix of sides from first to second, then to third corners, shape (2F, V)."""
        columns = np.concatenate([self.faces[:, [1, 0]], self.faces[:, [2, 0]]])
        n_sides = len(columns)
        signs, ends = np.tile([1.0, -1.0], n_sides), 2 * np.arange(n_sides + 1)
        shape = n_sides, len(self.vertices)
        return sparse.csr_array((signs, columns.ravel(), ends), shape=shape)

    @cached_property
    def _edge_points(self) -> _EdgePoints:
        """Some points, evenly spaced, on every edge that two triangles share."""
        # Each of these edges is a side of two triangles.
        triangle, corner = np.nonzero(self.neighbours >= 0)
        sides = np.stack(
            [self.faces[triangle, corner], self.faces[triangle, (corner + 1) % 3]], axis=1
        )
        edges, edge_of_side, _ = distinct_pairs(np.sort(sides, axis=1))
        triangles_of_edge = triangle[np.argsort(edge_of_side.ravel())].reshape(-1, 2)
        starts, ends = self.vertices[edges[:, 0]], self.vertices[edges[:, 1]]
        shares = np.arange(1, _PER_EDGE + 1)[:, np.newaxis] / (_PER_EDGE + 1)
        places = starts[:, np.newaxis] + shares * (ends - starts)[:, np.newaxis]
        places = places.reshape(-1, 3)
        faces = np.repeat(triangles_of_edge, _PER_EDGE, axis=0)
        # Two points are linked if they are on the edges of one triangle.
        numbers = np.repeat(np.arange(len(places)), 2)
        inside = sparse.csr_array(
            (np.ones(len(numbers)), (faces.ravel(), numbers)), shape=(len(self.faces), len(places))
        )
        first, second = (inside.T @ inside).nonzero()
        lengths = np.linalg.norm(places[first] - places[second], axis=1)
        distances = sparse.csr_array((lengths, (first, second)), shape=(len(places),) * 2)
        return _EdgePoints(places, faces, inside, distances)

    def strip(self, start: SurfacePoint, end: SurfacePoint) -> Strip:
        """Return the strip of the shortest path through points on edges of the template."""
        key = tuple((face, *weights) for face, weights in (start, end))
        if key not in self._strips:
            ends = self._about(start), self._about(end)
            self._strips[key] = self._triangles_between(start, end, ends), ends
        return self._strips[key]

    def _about(self, point: SurfacePoint) -> AroundPoint:
        """Return the triangles that contain a point: several if it lies on an edge or a vertex."""
        face, weights = point
        weights = np.where(weights > _ON_EDGE, weights, 0.0)
        corners = self.faces[face]
        n_shared = np.isin(self.faces, corners[weights > 0.0]).sum(axis=1)
        around = np.flatnonzero(n_shared == np.count_nonzero(weights))
        return around, (self.faces[around][:, :, np.newaxis] == corners) @ weights

    def _near(self, point: SurfacePoint, around: Integers) -> tuple[Integers, Array]:
        """Return the points on edges of the triangles about a point, and how far they are."""
        (face, weights), points = point, self._edge_points
        near = np.unique(points.inside[around].indices)
        place = weights @ self.vertices[self.faces[face]]
        return near, np.linalg.norm(points.places[near] - place, axis=1)

    def _triangles_between(
        self, start: SurfacePoint, end: SurfacePoint, ends: tuple[AroundPoint, AroundPoint]
    ) -> Integers:
        (of_start, _), (of_end, _) = ends
        common = np.intersect1d(of_start, of_end)
        if len(common):
            return common[:1]
        points = self._edge_points
        (near_start, from_start), (near_end, to_end) = (
            self._near(point, around) for point, around in ((start, of_start), (end, of_end))
        )
        # The start becomes a node after those of the points.
        n_points, between = len(points.places), points.distances
        starts = np.append(between.indptr, between.nnz + len(near_start))
        entries = np.append(between.data, from_start), np.append(between.indices, near_start)
        graph = sparse.csr_array((*entries, starts), shape=(n_points + 1, n_points + 1))
        lengths, before = dijkstra(graph, indices=n_points, return_predecessors=True)
        totals = lengths[near_end] + to_end
        # Back from the end: two points that follow each other are in one triangle.
        strip_from_end: list[int] = []
        node, there = near_end[totals.argmin()] if np.isfinite(totals.min()) else -1, of_end
        while node >= 0:
            here = points.faces[node] if node < n_points else of_start
            strip_from_end.append(np.intersect1d(here, there)[0])
            node, there = before[node], here
        if not strip_from_end:
            raise ArgumentError(
                "a path along the surface must begin and end on one connected component"
            )
        strip: Integers = np.array(strip_from_end[::-1])
        distinct: Integers = strip[np.append(True, np.diff(strip) != 0)]
        return distinct


def geodesics(surfaces: Array, start: SurfacePoint, end: SurfacePoint, mesh: Mesh) -> Lines:
    """Return the geodesics from start to end on surfaces: their ends and crossings with edges."""
    strip, ends = mesh.strip(start, end)
    most = len(mesh.faces) + 1
    paths = _empty_path(most), _empty_path(most)
    funnel = np.empty(2, np.int64), np.empty(3, np.complex128)
    adjacency = mesh.faces, mesh.neighbours
    corners = mesh.faces[[start[0], end[0]]]
    vertices_of_lines: list[Integers] = []
    weights_of_lines: list[Array] = []
    for f in np.require(values_of(surfaces), np.float64, ["C", "W"]):
        paths[0].strip[: len(strip)] = strip
        which, n = _straighten(f, adjacency, ends, len(strip), paths, funnel)
        if n < 0:
            vertices_of_lines.append(np.empty((0, 3), np.int64))
            weights_of_lines.append(np.empty((0, 3)))
            continue
        # A crossing is on an edge, whose first vertex fills the place of a third one.
        path = paths[which]
        crossed = np.append(path.edges[:n], path.edges[:n, :1], axis=1)
        t = path.crossings[:n, np.newaxis]
        inner = np.concatenate([1.0 - t, t, np.zeros_like(t)], axis=1)
        vertices_of_lines.append(np.concatenate([corners[:1], crossed, corners[1:]]))
        weights_of_lines.append(np.concatenate([start[1][np.newaxis], inner, end[1][np.newaxis]]))
    vertices = np.concatenate(vertices_of_lines)
    weights = np.concatenate(weights_of_lines)
    counts = np.array([len(line) for line in vertices_of_lines])
    bodies = np.repeat(np.arange(len(counts)), counts)
    points = weighted_vertices(surfaces, bodies[:, None], vertices, weights)

    def pull(upstream: Array, numbers: Integers, slopes: VertexSlopes) -> None:
        of_vertices = weights[numbers][..., np.newaxis] * upstream[:, np.newaxis]
        slopes.add(bodies[numbers, np.newaxis], vertices[numbers], of_vertices)

    return Lines(points, bodies, np.where(counts > 0, 0, MISSES), pull)


@compiled
def _straighten(
    f: Array,
    mesh: Adjacency,
    ends: tuple[AroundPoint, AroundPoint],
    size: int,
    paths: tuple[Path, Path],
    funnel: Funnel,
) -> tuple[int, int]:
    """Shorten the path in the strip of the first buffer until no rerouting helps.

    Return which of the two buffers holds the best path, and how many edges that crosses; -1 if
    there is none.
    """
    trial, best = paths
    which = 1  # of the buffers holds the best path
    length = np.inf
    best_size, number, n_bends = 0, 0, 0
    while size > 0:  # ends: no strip comes twice
        size = _trim(trial.strip, size, ends)
        if _unfold(f, mesh, ends, trial, size, funnel[1]):
            count = _funnel(trial, size, funnel)
            moved = _cross_edges(trial, size, count)
            # Change the strip only if that gains more than rounding.
            if moved < length * (1.0 - _GAIN):
                which = 1 - which
                trial, best = best, trial
                length = moved
                best_size, number, n_bends = size, 0, count
        size = 0
        while size == 0 and number < n_bends:
            edge, bend_side = best.bends[number, 0] - 1, best.bends[number, 1]
            number += 1
            if 0 <= edge < best_size - 1:  # the bend is no end of the path
                vertex = best.edges[edge, bend_side]
                size = _reroute(mesh, best, best_size, edge, vertex, trial.strip)
    return which, best_size - 1


@compiled
def _index_of(numbers: Integers, number: int) -> int:
    for k in range(len(numbers)):
        if numbers[k] == number:
            return k
    return -1


@compiled
def _product(f: Array, origin: int, a: int, b: int) -> float:
    """Return the inner product of the edges from a vertex to two others."""
    total = 0.0
    for x in range(3):
        total += (f[a, x] - f[origin, x]) * (f[b, x] - f[origin, x])
    return total


@compiled
def _trim(strip: Integers, size: int, ends: tuple[AroundPoint, AroundPoint]) -> int:
    """Remove triangles that a strip leaves, or enters, where the path ends; return the size."""
    # From within the edge by which the path leaves a triangle, the funnel would have no direction.
    (about_start, _), (about_end, _) = ends
    first, last = 0, size - 1
    while first < last and _index_of(about_start, strip[first + 1]) >= 0:
        first += 1
    while last > first and _index_of(about_end, strip[last - 1]) >= 0:
        last -= 1
    for k in range(first, last + 1):
        strip[k - first] = strip[k]
    return last + 1 - first


@compiled
def _unfold(
    f: Array,
    mesh: Adjacency,
    ends: tuple[AroundPoint, AroundPoint],
    path: Path,
    size: int,
    corners: NDArray[np.complex128],
) -> bool:
    """Lay the strip of a path flat in the complex plane: fill its edges and their sides."""
    # The first and the last column of `sides` are the ends of the path.
    faces, neighbours = mesh
    strip, edges, sides = path.strip, path.edges, path.sides
    total = 0.0j
    for step in range(size):
        face = strip[step]
        if step == 0:
            p, q = faces[face, 1], faces[face, 0]
            corner = 0
            right = 0.0j
            left = complex(math.sqrt(_product(f, p, q, q)), 0.0)
        else:
            p, q = edges[step - 1, 0], edges[step - 1, 1]
            right, left = sides[0, step], sides[1, step]
            corner = _index_of(faces[face], q)
            if corner < 0 or faces[face, (corner + 1) % 3] != p:
                return False
        # The third vertex, where p is 0 and q is 1.
        third = (corner + 2) % 3
        squared, apex = _product(f, p, q, q), faces[face, third]
        x = _product(f, p, q, apex) / squared
        y = math.sqrt(max(_product(f, p, apex, apex) / squared - x * x, 0.0))
        corners[corner], corners[(corner + 1) % 3] = left, right
        along = left - right
        turned = complex(x * along.real + y * along.imag, x * along.imag - y * along.real)
        corners[third] = right + turned
        total += corners[third]
        for end in range(2):
            if step == end * (size - 1):
                about, coordinates = ends[end]
                row, place = _index_of(about, face), 0.0j
                for k in range(3):
                    share = coordinates[row, k]
                    place += complex(share * corners[k].real, share * corners[k].imag)
                sides[0, end * size], sides[1, end * size] = place, place
        if step < size - 1:
            out = _index_of(neighbours[face], strip[step + 1])
            if out < 0:
                return False
            for k in range(2):
                edges[step, k] = faces[face, (out + k) % 3]
                sides[k, step + 1] = corners[(out + k) % 3]
    # Edges without length lead to NaN, with which `_funnel` would never end.
    return math.isfinite(total.real) and math.isfinite(total.imag)


@compiled
def _funnel(path: Path, size: int, funnel: Funnel) -> int:
    """Find the bends of the shortest path, with its end, and their sides; return how many."""
    bends, sides = path.bends, path.sides
    limits, views = funnel
    count, apex, k = 0, 0, 1
    place = sides[0, 0]
    # The limits of the view from the last bend, to the right and to the left.
    limits[:] = apex
    views[:2] = place
    while k <= size:
        for near in range(2):
            far = 1 - near
            point = sides[near, k]
            turn = 1.0 - 2.0 * near  # 1 on the right, -1 on the left
            if turn * side(place, views[near], point) < 0.0:
                continue
            if limits[near] == apex or turn * side(place, views[far], point) < 0.0:
                limits[near], views[near] = k, point
                continue
            apex, place = limits[far], views[far]
            bends[count, 0], bends[count, 1] = apex, far
            count += 1
            k = apex
            limits[:] = apex
            views[:2] = place
            break
        k += 1
    bends[count, 0], bends[count, 1] = size, 0
    return count + 1


@compiled
def _cross_edges(path: Path, size: int, n_bends: int) -> float:
    """Find where the path crosses edges; return its length."""
    bends, sides, crossings = path.bends, path.sides, path.crossings
    length = 0.0
    k = 1
    here = sides[0, 0]
    for number in range(n_bends):
        last, near = bends[number, 0], bends[number, 1]
        goal = sides[near, last]
        length += math.hypot(goal.real - here.real, goal.imag - here.imag)
        while k <= min(last, size - 1):
            on_right, on_left = side(here, goal, sides[0, k]), side(here, goal, sides[1, k])
            t = 0.5 if on_right == on_left else on_right / (on_right - on_left)
            crossings[k - 1] = float(near) if k == last else min(max(t, 0.0), 1.0)
            k += 1
        here = goal
    return length


@compiled
def _reroute(mesh: Adjacency, path: Path, size: int, edge: int, vertex: int, new: Integers) -> int:
    """Write a strip rerouted around the other side of a vertex; 0 if that has a boundary."""
    faces, neighbours = mesh
    strip, edges = path.strip, path.edges
    first, last = edge, edge
    while first > 0 and _index_of(edges[first - 1], vertex) >= 0:
        first -= 1
    while last + 1 < size - 1 and _index_of(edges[last + 1], vertex) >= 0:
        last += 1
    # Edges first to last meet the vertex; they lie between triangles first to last + 1.
    for k in range(first + 1):
        new[k] = strip[k]
    count = first + 1
    face, goal = strip[first], strip[last + 1]
    vertex_was_left = edges[first, 1] == vertex
    while face != goal:
        corner = _index_of(faces[face], vertex)
        if corner < 0:
            return 0
        # Leave by the edge at the vertex that turns the other way around it.
        face = neighbours[face, corner if vertex_was_left else (corner + 2) % 3]
        if face < 0 or count + size - last > len(new):
            return 0
        new[count] = face
        count += 1
    for k in range(last + 2, size):
        new[count] = strip[k]
        count += 1
    # Remove triangles that the strip enters and leaves by the same edge.
    length = 0
    for k in range(count):
        if length >= 2 and new[length - 2] == new[k]:
            length -= 1
        elif length == 0 or new[length - 1] != new[k]:
            new[length] = new[k]
            length += 1
    return length
