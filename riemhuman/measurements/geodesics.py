"""Shortest paths on triangulated surfaces, whose lengths have derivatives: compiled loops.

A path runs through a strip of triangles. Laid flat, the strip has one shortest path in it, which
the funnel algorithm finds (Lee and Preparata, "Euclidean shortest paths in the presence of
rectilinear barriers", Networks 14, 1984). Where that bends at a vertex, the strip is led around
the other side of the vertex if the path gets shorter; where no change helps, it is a geodesic: no
path near it is shorter. All bodies start from the strip of the template, and so have like paths. A
length is stationary under moves of the crossings along their edges, so its derivatives are those
with the crossings held on their edges.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from autograd.extend import defvjp, primitive
from numpy import ndarray
from scipy import sparse
from scipy.sparse.csgraph import dijkstra

from riemhuman.errors import ArgumentError
from riemhuman.kernels.compiled import compiled

SurfacePoint = tuple[int, ndarray]
"""Number of a triangle, and barycentric coordinates in it, shape (3,)."""

# A path gets shorter by more than this share of its length, or its strip stays.
_GAIN = 1e-12
_MOST_ROUNDS = 200
_ROOM = 4


@dataclass(frozen=True, eq=False)
class Mesh:
    """What paths need of a template.

    Attributes
    ----------
    vertices : array, shape (V, 3)
        The template's own.
    faces : array of int, shape (F, 3)
        Triangles.
    neighbours : array of int, shape (F, 3)
        Triangle beyond the edge from corner k to k + 1; -1 at boundaries.
    """

    vertices: ndarray
    faces: ndarray
    neighbours: ndarray

    def strip(self, first: int, last: int) -> ndarray:
        """Return triangles from one to another, as a shortest path of centroids has them.

        Parameters
        ----------
        first, last : int
            Numbers of triangles.

        Returns
        -------
        strip : array of int

        Raises
        ------
        ArgumentError
            If the surface does not connect them.
        """
        one, corner = np.nonzero(self.neighbours >= 0)
        other = self.neighbours[one, corner]
        centroids = self.vertices[self.faces].mean(axis=1)
        lengths = np.linalg.norm(centroids[one] - centroids[other], axis=1)
        graph = sparse.csr_array((lengths, (one, other)), shape=(len(self.faces),) * 2)
        _, before = dijkstra(graph, indices=last, return_predecessors=True)
        strip = [first]
        while strip[-1] != last:
            if before[strip[-1]] < 0:
                raise ArgumentError("a path along the surface needs ends on one connected surface")
            strip.append(int(before[strip[-1]]))
        return np.array(strip)


@primitive
def geodesic_lengths(surfaces: ndarray, start: SurfacePoint, end: SurfacePoint, mesh: Mesh) -> Any:
    """Return the lengths of shortest paths, differentiable by autograd in the surfaces.

    Parameters
    ----------
    surfaces : array, shape (n, V, 3)
        Vertices.
    start, end : pair of int and array, shape (3,)
        Triangle and barycentric coordinates.
    mesh : Mesh
        The triangles.

    Returns
    -------
    lengths : array, shape (n,)
    """
    strip = mesh.strip(start[0], end[0])
    return np.array([_shortest(surface, start, end, mesh, strip)[0] for surface in surfaces])


def _pull_back(
    lengths: ndarray, surfaces: ndarray, start: SurfacePoint, end: SurfacePoint, mesh: Mesh
) -> Any:
    def pull_back(upstream: ndarray) -> ndarray:
        slopes, strip = np.zeros_like(surfaces), mesh.strip(start[0], end[0])
        for slope, surface, scale in zip(slopes, surfaces, upstream, strict=True):
            if scale == 0.0:
                continue
            _, vertices, weights = _shortest(surface, start, end, mesh, strip)
            points = np.einsum("kc,kcx->kx", weights, surface[vertices])
            steps = np.diff(points, axis=0)
            norms = np.linalg.norm(steps, axis=1, keepdims=True)
            steps = scale * np.divide(steps, norms, out=np.zeros_like(steps), where=norms > 0)
            pulls = np.zeros_like(points)
            pulls[1:] += steps
            pulls[:-1] -= steps
            np.add.at(slope, vertices, weights[:, :, np.newaxis] * pulls[:, np.newaxis])
        return slopes

    return pull_back


defvjp(geodesic_lengths, _pull_back, argnums=(0,))


def geodesic_path(surface: ndarray, start: SurfacePoint, end: SurfacePoint, mesh: Mesh) -> ndarray:
    """Return a shortest path.

    Parameters
    ----------
    surface : array, shape (V, 3)
        Vertices.
    start, end : pair of int and array, shape (3,)
        Triangle and barycentric coordinates.
    mesh : Mesh
        The triangles.

    Returns
    -------
    points : array, shape (k, 3)
        The ends, and the crossings with edges between them.
    """
    strip = mesh.strip(start[0], end[0])
    _, vertices, weights = _shortest(surface, start, end, mesh, strip)
    return np.einsum("kc,kcx->kx", weights, surface[vertices])


def _shortest(
    surface: ndarray, start: SurfacePoint, end: SurfacePoint, mesh: Mesh, first: ndarray
) -> tuple[float, ndarray, ndarray]:
    """Return the length of a path, and its points as combinations of three vertices each."""
    strip = np.empty(_ROOM * len(first) + 200, np.int64)
    strip[: len(first)] = first
    edges, places = np.empty((len(strip), 2), np.int64), np.empty(len(strip))
    length, size = _straighten(
        np.require(surface, np.float64, ["C", "W"]),
        mesh.faces,
        mesh.neighbours,
        strip,
        len(first),
        np.require(start[1], np.float64, ["C", "W"]),
        np.require(end[1], np.float64, ["C", "W"]),
        edges,
        places,
    )
    crossed = np.concatenate([edges[: size - 1], edges[: size - 1, :1]], axis=1)
    vertices = np.concatenate([mesh.faces[[start[0]]], crossed, mesh.faces[[end[0]]]])
    t = places[: size - 1]
    inner = np.stack([1.0 - t, t, np.zeros_like(t)], axis=1)
    weights = np.concatenate([np.atleast_2d(start[1]), inner, np.atleast_2d(end[1])])
    return float(length), vertices, weights


@compiled
def _corner_of(faces: Any, face: int, vertex: int) -> int:
    for k in range(3):
        if faces[face, k] == vertex:
            return k
    return -1


@compiled
def _product(f: Any, origin: int, one: int, other: int) -> float:
    """Return the inner product of the edges from a vertex to two others."""
    total = 0.0
    for x in range(3):
        total += (f[one, x] - f[origin, x]) * (f[other, x] - f[origin, x])
    return total


# In loops: numba takes seconds to compile assignments of arrays to parts of arrays.
@compiled
def _unfold(
    f: Any,
    faces: Any,
    neighbours: Any,
    strip: Any,
    size: int,
    start: Any,
    end: Any,
    edges: Any,
    right: Any,
    left: Any,
) -> bool:
    """Lay a strip flat; edges[k] leads from triangle k to k + 1, from its right to its left end.

    Rows 0 and `size` of `right` and `left` are the ends of the path, row k the edge k - 1.
    """
    face = strip[0]
    a, b, c = faces[face, 0], faces[face, 1], faces[face, 2]
    along = np.sqrt(_product(f, a, b, b))
    x = _product(f, a, b, c) / along
    flat = np.zeros((3, 2))
    flat[1, 0] = along
    flat[2, 0], flat[2, 1] = x, np.sqrt(max(_product(f, a, c, c) - x * x, 0.0))
    for k in range(2):
        right[0, k] = start[0] * flat[0, k] + start[1] * flat[1, k] + start[2] * flat[2, k]
        left[0, k] = right[0, k]
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
        for k in range(2):
            right[step, k], left[step, k] = flat[out, k], flat[(out + 1) % 3, k]
        corner = _corner_of(faces, beyond, q)
        if corner < 0 or faces[beyond, (corner + 1) % 3] != p:
            return False
        apex = faces[beyond, (corner + 2) % 3]
        along = np.sqrt(_product(f, p, q, q))
        x = _product(f, p, apex, q) / along
        height = np.sqrt(max(_product(f, p, apex, apex) - x * x, 0.0))
        e0, e1 = (left[step, 0] - right[step, 0]) / along, (left[step, 1] - right[step, 1]) / along
        for k in range(2):
            flat[corner, k], flat[(corner + 1) % 3, k] = left[step, k], right[step, k]
        flat[(corner + 2) % 3, 0] = right[step, 0] + x * e0 + height * e1
        flat[(corner + 2) % 3, 1] = right[step, 1] + x * e1 - height * e0
    for k in range(2):
        right[size, k] = end[0] * flat[0, k] + end[1] * flat[1, k] + end[2] * flat[2, k]
        left[size, k] = right[size, k]
    return True


@compiled
def _side(a: Any, b: Any, c: Any) -> float:
    """Return how far c lies to the left of the ray from a through b."""
    return (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])


@compiled
def _funnel(right: Any, left: Any, size: int, bends: Any, of_left: Any) -> int:
    """Find the shortest path through edges laid flat; return its number of bends."""
    count, apex, low, high = 0, 0, 0, 0
    place, lower, upper = right[0], right[0], left[0]
    k = 1
    while k <= size:
        if _side(place, lower, right[k]) >= 0.0:
            if low == apex or _side(place, upper, right[k]) < 0.0:
                low, lower = k, right[k]
            else:
                bends[count], of_left[count] = high, True
                count += 1
                apex, place = high, left[high]
                low, lower, upper = apex, place, place
                k = apex + 1
                continue
        if _side(place, upper, left[k]) <= 0.0:
            if high == apex or _side(place, lower, left[k]) > 0.0:
                high, upper = k, left[k]
            else:
                bends[count], of_left[count] = low, False
                count += 1
                apex, place = low, right[low]
                high, lower, upper = apex, place, place
                k = apex + 1
                continue
        k += 1
    return count


@compiled
def _cross_edges(
    right: Any, left: Any, size: int, bends: Any, of_left: Any, count: int, places: Any
) -> float:
    """Say where the path crosses each edge, from 0 at its right to 1; return the length."""
    length, k = 0.0, 1
    here = right[0]
    for number in range(count + 1):
        last = bends[number] if number < count else size
        goal = left[last] if number < count and of_left[number] else right[last]
        length += np.sqrt((goal[0] - here[0]) ** 2 + (goal[1] - here[1]) ** 2)
        while k <= last and k < size:
            one, other = _side(here, goal, right[k]), _side(here, goal, left[k])
            t = 0.5 if one == other else one / (one - other)
            if k == last:
                t = 1.0 if of_left[number] else 0.0
            places[k - 1] = min(max(t, 0.0), 1.0)
            k += 1
        here = goal
    return length


@compiled
def _led_around(
    faces: Any, neighbours: Any, strip: Any, size: int, vertex: int, edge: int, edges: Any, led: Any
) -> int:
    """Lead a strip around the other side of a vertex; return its new size, or -1."""
    first, last = edge, edge
    while first > 0 and (edges[first - 1, 0] == vertex or edges[first - 1, 1] == vertex):
        first -= 1
    while last + 1 < size - 1 and (edges[last + 1, 0] == vertex or edges[last + 1, 1] == vertex):
        last += 1
    # The strip crosses edges first to last, all at the vertex, on triangles first to last + 1.
    for k in range(first + 1):
        led[k] = strip[k]
    count, face, goal = first + 1, strip[first], strip[last + 1]
    vertex_was_left = edges[first, 1] == vertex
    while face != goal:
        corner = _corner_of(faces, face, vertex)
        if corner < 0:
            return -1
        # Of the two edges at the vertex, take the one that turns the other way about it.
        face = neighbours[face, corner if vertex_was_left else (corner + 2) % 3]
        if face < 0 or count >= len(led):
            return -1
        led[count] = face
        count += 1
    for k in range(last + 2, size):
        if count >= len(led):
            return -1
        led[count] = strip[k]
        count += 1
    # What goes to a triangle and straight back stays out of it.
    kept = 0
    for k in range(count):
        if kept >= 2 and led[kept - 2] == led[k]:
            kept -= 1
        elif kept >= 1 and led[kept - 1] == led[k]:
            continue
        else:
            led[kept] = led[k]
            kept += 1
    return kept


@compiled
def _straighten(
    f: Any,
    faces: Any,
    neighbours: Any,
    strip: Any,
    size: int,
    start: Any,
    end: Any,
    edges: Any,
    places: Any,
) -> Any:
    """Shorten a path until no change of its strip helps; return its length and triangles."""
    room = len(strip)
    right, left = np.empty((room + 1, 2)), np.empty((room + 1, 2))
    bends, of_left = np.empty(room + 1, np.int64), np.empty(room + 1, np.bool_)
    led, led_edges, led_places = np.empty_like(strip), np.empty_like(edges), np.empty_like(places)
    if not _unfold(f, faces, neighbours, strip, size, start, end, edges, right, left):
        return np.nan, size
    count = _funnel(right, left, size, bends, of_left)
    length = _cross_edges(right, left, size, bends, of_left, count, places)
    led_bends, led_left = np.empty_like(bends), np.empty_like(of_left)
    for _ in range(_MOST_ROUNDS):
        shorter = False
        for number in range(count):
            edge = bends[number] - 1
            if not 0 <= edge < size - 1:  # a bend at an end of the path
                continue
            vertex = edges[edge, 1] if of_left[number] else edges[edge, 0]
            led_size = _led_around(faces, neighbours, strip, size, vertex, edge, edges, led)
            if led_size < 1 or not _unfold(
                f, faces, neighbours, led, led_size, start, end, led_edges, right, left
            ):
                continue
            led_count = _funnel(right, left, led_size, led_bends, led_left)
            led_length = _cross_edges(
                right, left, led_size, led_bends, led_left, led_count, led_places
            )
            if led_length < length * (1.0 - _GAIN):
                for k in range(led_size):
                    strip[k], places[k] = led[k], led_places[k]
                    edges[k, 0], edges[k, 1] = led_edges[k, 0], led_edges[k, 1]
                for k in range(led_count):
                    bends[k], of_left[k] = led_bends[k], led_left[k]
                length, size, count, shorter = led_length, led_size, led_count, True
                break
        if not shorter:
            break
    return length, size
