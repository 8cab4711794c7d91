r"""Lines on triangulated surfaces: their points as functions of the vertices, and their lengths.

The plane through o with normal n crosses the edge from a to b at c = a + t (b − a), with
t = d_a/(d_a − d_b) and d_x = n·(x − o). The section starts at the crossing nearest to o and runs
from triangle to triangle until it closes. Which edges it crosses is found in compiled loops; its
points are piecewise smooth in the vertices and in the plane, and autograd differentiates what is
measured on them. With e = b − a and h = d_a − d_b,

.. math:: dc = (1 - t)\, da + t\, db + \frac{e}{h}\,
          \big(n \cdot ((1 - t)\, da + t\, db - do) + (c - o) \cdot dn\big).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import autograd.numpy as np
import numpy as onp
from autograd.extend import defvjp, defvjp_argnums, primitive
from numpy.typing import NDArray

from riemhuman.arrays import Array, Booleans, Integers, Triangles
from riemhuman.checks import values_of
from riemhuman.io.mesh_arrays import distinct_pairs
from riemhuman.kernels.compilation import compiled
from riemhuman.measurements._vertex_slopes import Pull, VertexSlopes, fixed

FOREIGN = 0
MEASURED = 1
LEFT_OUT = 2
"""Roles of triangles: the line must not meet them, is measured on them, or passes over them."""

MISSES = -1
MEETS_OTHER_PART = -2
OPEN = -3
"""Why there is no section: the plane misses the part, or the line leaves it or meets a boundary."""


Places = Integers | tuple[Integers, Integers]
"""Indices of an axis, or of two."""

Cutter = tuple[Triangles, Integers, NDArray[onp.uint8], Integers]
"""Triangles, their neighbours, their roles, and the numbers of those where a section may start."""


PullOfPoints = Callable[[Array, Integers, VertexSlopes], None]
"""Adds the derivatives by vertices, given those by the points of a line with some numbers."""


@dataclass(frozen=True, eq=False)
class Lines:
    """A line on each of n surfaces, or none: points in order, and the surface of each."""

    points: Array  # (k, 3), differentiable by autograd
    bodies: Integers  # (k,)
    statuses: Integers  # (n,) 0, or why there is none
    pull: PullOfPoints

    def select(self, choose: Callable[[Array, onp.intp], Integers]) -> Lines:
        """Return other lines through the points that a function of each line's points chooses."""
        values = values_of(self.points)
        chosen_points = []
        ends = onp.searchsorted(self.bodies, onp.arange(len(self.statuses) + 1))
        for body in onp.flatnonzero(self.statuses == 0):
            first, last = ends[body], ends[body + 1]
            chosen_points.append(first + choose(values[first:last], body))
        numbers = onp.concatenate([*chosen_points, onp.empty(0, onp.int64)])

        def pull(upstream: Array, which: Integers, slopes: VertexSlopes) -> None:
            self.pull(upstream, numbers[which], slopes)

        return Lines(self.points[numbers], self.bodies[numbers], self.statuses, pull)

    def closed(self) -> Lines:
        """Return lines that end at their first points."""
        return self.select(lambda points, _: _circular(onp.arange(len(points))))

    def hulls(self, normals: Array) -> Lines:
        """Return the convex hulls of lines in planes with these normals, shape (n, 3), closed."""

        def around(points: Array, body: onp.intp) -> Integers:
            # Coordinates other than that of the normal's largest entry, in cyclic order.
            x, y = [[1, 2], [2, 0], [0, 1]][onp.abs(normals[body]).argmax()]
            numbers = onp.empty(len(points), onp.int64)
            return _circular(numbers[: _hull(points[:, x] + 1j * points[:, y], numbers)])

        return self.select(around)

    @property
    def lengths(self) -> Array:
        """Lengths of the lines, shape (n,); NaN where there is none."""
        return _total_lengths(self.points, self.bodies, self.statuses)

    def pull_lengths(self, slopes: VertexSlopes) -> None:
        """Add the derivatives of the lengths by the vertices."""
        ones = onp.ones(len(self.statuses))
        upstream = _slopes_of_lengths(self.points, self.bodies, ones)
        self.pull(upstream, onp.arange(len(self.points)), slopes)

    def extents(self, directions: Array, pull_directions: Pull = fixed) -> Lines:
        """Return the extents of the lines along unit vectors, shape (n, 3), as straight lines."""
        axes, is_line = values_of(directions), self.statuses == 0

        def ends(points: Array, body: onp.intp) -> Integers:
            along = points @ axes[body]
            return onp.array([along.argmin(), along.argmax()])

        outer = self.select(ends)
        first = onp.arange(0, len(outer.bodies), 2)

        def pull_axes(upstream: Array, slopes: VertexSlopes) -> None:
            pull_directions(_add_at(axes, onp.flatnonzero(is_line), upstream), slopes)

        line = straight_lines(
            outer.points[::2],
            outer.points[1::2],
            directions[is_line],
            pulls=(
                lambda upstream, slopes: outer.pull(upstream, first, slopes),
                lambda upstream, slopes: outer.pull(upstream, first + 1, slopes),
                pull_axes,
            ),
        )
        return Lines(line.points, outer.bodies, self.statuses, line.pull)


def _steps(points: Array, bodies: Integers) -> tuple[Array, Array]:
    """Return the steps along lines, and their lengths: from line to line, none."""
    steps = (points[1:] - points[:-1]) * (bodies[1:] == bodies[:-1])[:, None]
    return steps, onp.sqrt(onp.einsum("kx,kx->k", steps, steps))


@primitive
def _total_lengths(points: Array, bodies: Integers, statuses: Integers) -> Array:
    totals = onp.bincount(bodies[1:], _steps(points, bodies)[1], len(statuses))
    return onp.where(statuses == 0, totals, onp.nan)


def _slopes_of_lengths(points: Array, bodies: Integers, upstream: Array) -> Array:
    steps, lengths = _steps(points, bodies)
    # Points coincide where a plane meets a vertex: a root of zero has no derivative.
    pull = steps * (upstream[bodies[1:]] / onp.where(lengths, lengths, 1.0))[:, None]
    slopes = onp.zeros_like(points)
    slopes[:-1] -= pull
    slopes[1:] += pull
    return slopes


def _traced_lengths(
    _: Array, points: Array, bodies: Integers, statuses: Integers
) -> Callable[[Array], Array]:
    return lambda upstream: _slopes_of_lengths(points, bodies, upstream)


defvjp(_total_lengths, _traced_lengths, argnums=(0,))


@primitive
def weighted_vertices(
    surfaces: Array, bodies: Integers, vertices: Integers, weights: Array
) -> Array:
    """Return sums of vertices of bodies with weights, over the last axis of all three."""
    sums: Array = (weights[..., None, :] @ surfaces[bodies, vertices])[..., 0, :]
    return sums


def _add_at(like: Array, places: Places, slopes: Array) -> Array:
    """Return slopes added up at places of an array of zeros."""
    total = onp.zeros_like(like)
    onp.add.at(total, places, slopes)
    return total


def _traced_vertices(
    _: Array, surfaces: Array, bodies: Integers, vertices: Integers, weights: Array
) -> Callable[[Array], Array]:
    def pull_back(upstream: Array) -> Array:
        slopes = weights[..., None] * upstream[..., None, :]
        return _add_at(surfaces, (bodies, vertices), slopes)

    return pull_back


defvjp(weighted_vertices, _traced_vertices, argnums=(0,))


@primitive
def _crossings(
    surfaces: Array,
    origins: Array,
    normals: Array,
    heights: Array,
    bodies: Integers,
    edges: Integers,
) -> Array:
    """Return where planes cross edges, between vertices at these heights above the planes."""
    (a, b), (above, below) = edges, heights
    start, t = surfaces[bodies, a], (above / (above - below))[:, None]
    crossings: Array = start + t * (surfaces[bodies, b] - start)
    return crossings


def _slopes_of_crossings(
    upstream: Array, steps: Array, from_origins: Array, normals: Array, heights: Array
) -> tuple[Array, Array, Array]:
    """Return derivatives by the ends of edges, (2, k, 3), by origins and by normals, (k, 3)."""
    above, below = heights
    shares = onp.stack([-below, above]) / (above - below)
    across = (onp.sum(upstream * steps, axis=1) / (above - below))[:, None]
    pull = across * normals
    return shares[..., None] * (upstream + pull), -pull, across * from_origins


def _traced_crossings(
    argnums: Sequence[int],
    points: Array,
    arguments: tuple[Array, Array, Array, Array, Integers, Integers],
    _: object,
) -> Callable[[Array], tuple[Array, ...]]:
    surfaces, origins, normals, heights, bodies, edges = arguments
    planes = surfaces, origins, normals
    places: tuple[Places, ...] = (bodies, edges), bodies, bodies

    def pull_back(upstream: Array) -> tuple[Array, ...]:
        starts, ends = surfaces[bodies, edges]
        plane = points - origins[bodies], normals[bodies]
        slopes = _slopes_of_crossings(upstream, ends - starts, *plane, heights)
        return tuple(_add_at(planes[k], places[k], slopes[k]) for k in argnums)

    return pull_back


defvjp_argnums(_crossings, _traced_crossings)


def _circular(numbers: Integers) -> Integers:
    return onp.append(numbers, numbers[:1])


def straight_lines(
    a: Array, b: Array, axes: Array | None = None, pulls: tuple[Pull, Pull, Pull] = (fixed,) * 3
) -> Lines:
    """Return lines between points, shape (n, 3).

    With unit vectors `axes`, lines run along these, from the first points as far as to the level of
    the second ones.
    """
    step, end = b - a, b
    if axes is not None:
        end = a + np.sum(step * axes, axis=-1, keepdims=True) * axes
    points = np.reshape(np.concatenate([a, end], axis=1), (-1, 3))

    def pull(upstream: Array, numbers: Integers, slopes: VertexSlopes) -> None:
        of_a, of_end = _add_at(points, numbers, upstream).reshape(-1, 2, 3).swapaxes(0, 1)
        of_b = of_end
        if axes is not None:
            along = onp.sum(of_end * axes, axis=-1, keepdims=True)
            of_a, of_b = of_a + of_end - along * axes, along * axes
            lengths = onp.sum(step * axes, axis=-1, keepdims=True)
            pulls[2](along * step + lengths * of_end, slopes)
        pulls[0](of_a, slopes)
        pulls[1](of_b, slopes)

    return Lines(points, onp.repeat(onp.arange(len(a)), 2), onp.zeros(len(a), int), pull)


def section(
    surfaces: Array,
    origins: Array,
    normals: Array,
    cutter: Cutter,
    pulls: tuple[Pull, Pull] = (fixed, fixed),
) -> Lines:
    """Return the section of each surface by a plane that is nearest to the plane's origin."""
    f, o, n = (
        onp.require(values_of(array), onp.float64, ["C", "W"])
        for array in (surfaces, origins, normals)
    )
    size = len(cutter[0])
    buffers = onp.empty((size, 2), onp.int64), onp.empty((size, 2)), onp.empty(size, bool)
    statuses, parts = onp.zeros(len(f), int), []
    for k in range(len(f)):
        n_crossed = _trace(f[k], o[k], n[k], cutter, *buffers)
        statuses[k] = min(n_crossed, 0)
        parts.append([buffer[: max(n_crossed, 0)].copy() for buffer in buffers[:2]])
    bodies = onp.repeat(onp.arange(len(f)), [len(edges) for edges, _ in parts])
    edges, heights = (onp.concatenate([part[k] for part in parts]).T for k in range(2))
    points = _crossings(surfaces, origins, normals, heights, bodies, edges)

    def pull(upstream: Array, numbers: Integers, slopes: VertexSlopes) -> None:
        cut, of_bodies = edges[:, numbers], bodies[numbers]
        starts, ends = f[of_bodies, cut]
        plane = points[numbers] - o[of_bodies], n[of_bodies]
        of_ends, of_origins, of_normals = _slopes_of_crossings(
            upstream, ends - starts, *plane, heights[:, numbers]
        )
        slopes.add(of_bodies, cut, of_ends)
        pulls[0](_add_at(o, of_bodies, of_origins), slopes)
        pulls[1](_add_at(n, of_bodies, of_normals), slopes)

    return Lines(points, bodies, statuses, pull)


def neighbours_of(faces: Triangles) -> Integers:
    """Return the triangle beyond the edge from corner k to k + 1; -1 if none or more than one."""
    edges = onp.sort(onp.stack([faces, onp.roll(faces, -1, axis=1)], axis=-1), axis=-1)
    _, numbers, counts = distinct_pairs(edges.reshape(-1, 2))
    order = onp.argsort(numbers, kind="stable")
    starts = onp.concatenate([[0], onp.cumsum(counts)[:-1]])[counts == 2]
    first, second = order[starts], order[starts + 1]
    beyond = onp.full(faces.size, -1)
    beyond[first], beyond[second] = second // 3, first // 3
    return beyond.reshape(-1, 3)


@compiled
def _height(f: Array, vertex: int, o: Array, n: Array) -> float:
    """Return how high a vertex lies above a plane."""
    height: float = (
        (f[vertex, 0] - o[0]) * n[0] + (f[vertex, 1] - o[1]) * n[1] + (f[vertex, 2] - o[2]) * n[2]
    )
    return height


@compiled
def _trace(
    f: Array,
    o: Array,
    n: Array,
    mesh: Cutter,
    edges: Integers,
    heights: Array,
    is_measured: Booleans,
) -> int:
    """Find edges that the section nearest to o crosses, and how high their ends lie above it.

    Return their number, or why there is no section.
    """
    faces, neighbours, roles, candidates = mesh
    least = onp.inf
    first, start, count = -1, 0, 0
    for candidate in candidates:
        for k in range(3):
            a, b = faces[candidate, k], faces[candidate, (k + 1) % 3]
            above, below = _height(f, a, o, n), _height(f, b, o, n)
            if not above >= 0.0 > below:
                continue
            t = above / (above - below)
            squared = 0.0
            for x in range(3):
                squared += (f[a, x] + t * (f[b, x] - f[a, x]) - o[x]) ** 2
            if squared < least:
                least = squared
                first, start = candidate, k
    if first < 0:
        return MISSES
    face, corner = first, start
    while count == 0 or face != first:
        # The loop enters the triangle by the edge that runs from above the plane to below it.
        for k in range(2):
            edges[count, k] = faces[face, (corner + k) % 3]
            heights[count, k] = _height(f, edges[count, k], o, n)
        is_measured[count] = roles[face] == MEASURED
        count += 1
        # It leaves by the edge from below to above, which runs the other way in the next triangle.
        out = (corner + 1) % 3
        if _height(f, faces[face, (out + 1) % 3], o, n) < 0.0:
            out = (out + 1) % 3
        beyond = neighbours[face, out]
        a, b = faces[face, out], faces[face, (out + 1) % 3]
        corner = -1
        for k in range(3):
            if beyond >= 0 and faces[beyond, k] == b and faces[beyond, (k + 1) % 3] == a:
                corner = k
        if roles[face] == FOREIGN:
            return MEETS_OTHER_PART
        if beyond != first and (corner < 0 or count == len(edges)):
            return OPEN
        face = beyond
    # Crossings at either end of a measured triangle remain.
    n_crossings = 0
    for k in range(count):
        if is_measured[k] or is_measured[(k - 1) % count]:
            for end in range(2):
                edges[n_crossings, end] = edges[k, end]
                heights[n_crossings, end] = heights[k, end]
            n_crossings += 1
    return n_crossings


@compiled
def side(a: complex, b: complex, c: complex) -> float:
    """Return twice the signed area of the triangle a, b, c: positive where c lies left of a, b."""
    return (b.real - a.real) * (c.imag - a.imag) - (b.imag - a.imag) * (c.real - a.real)


@compiled
def _hull(points: NDArray[onp.complex128], hull: Integers) -> int:
    """Write the numbers of points on their convex hull, by wrapping a line; return how many."""
    here, size = 0, 0
    for k in range(len(points)):
        if (points[k].real, points[k].imag) < (points[here].real, points[here].imag):
            here = k
    while size < len(points):
        hull[size], goal = here, here
        size += 1
        for k in range(len(points)):
            turn, away = side(points[here], points[goal], points[k]), points[k] - points[here]
            if turn < 0.0 or (turn == 0.0 and abs(away) > abs(points[goal] - points[here])):
                goal = k
        for k in range(size):  # rounding may pass over the first point on a straight side
            if points[hull[k]] == points[goal]:
                return size
        here = goal
    return size
