r"""Plane sections of triangulated surfaces: sizes and their derivatives, in compiled loops.

The plane through o with normal n crosses the edge from a to b at c = a + t (b − a), with
t = d_a/(d_a − d_b) and d_x = n·(x − o). The section starts at the crossing nearest to o and runs
from triangle to triangle until it closes. Its length, the length of its convex hull and its extent
along a direction are functions of the points c, piecewise smooth in the vertices and in the plane.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from autograd.extend import defvjp_argnums, primitive
from numpy import ndarray
from scipy.spatial import ConvexHull

from riemhuman.kernels.compilation import compiled

LENGTH, HULL, EXTENT = 0, 1, 2
"""Sizes of a section: its length, the length of its convex hull, its extent."""

FOREIGN, WANTED, LEFT_OUT = 0, 1, 2
"""Roles of triangles: the line must not meet them, is measured on them, or passes over them."""

MISSES, MEETS_OTHER_PART, OPEN = -1, -2, -3
"""Why there is no section: the plane misses the part, or the line leaves it or meets a boundary."""


@dataclass(frozen=True, eq=False)
class Cutter:
    """The triangles that a plane may cut, with their neighbours and roles, shape (F,)."""

    faces: ndarray
    neighbours: ndarray
    roles: ndarray

    @cached_property
    def mesh(self) -> tuple[ndarray, ndarray, ndarray, ndarray]:
        """Arrays for the loops: the attributes, and the triangles where a section may start."""
        return self.faces, self.neighbours, self.roles, np.flatnonzero(self.roles == WANTED)

    def section(self, surface: ndarray, origin: ndarray, normal: ndarray) -> tuple[ndarray, int]:
        """Return the crossings with the edges of wanted triangles, shape (k, 3), and a status.

        The status is 0, or why there is no section: `MISSES`, `MEETS_OTHER_PART` or `OPEN`.
        """
        f, *plane = _plain(surface, origin, normal)
        status, _, _, points, wanted = _trace(f, self.mesh, *plane)
        return points[wanted | np.roll(wanted, 1)], int(status)


def neighbours_of(faces: ndarray) -> ndarray:
    """Return the triangle beyond the edge from corner k to k + 1; -1 if none or more than one."""
    edges = np.sort(np.stack([faces, np.roll(faces, -1, axis=1)], axis=-1), axis=-1).reshape(-1, 2)
    _, numbers, counts = np.unique(edges, axis=0, return_inverse=True, return_counts=True)
    order = np.argsort(numbers.reshape(-1), kind="stable")
    starts = np.concatenate([[0], np.cumsum(counts)[:-1]])[counts == 2]
    first, second = order[starts], order[starts + 1]
    beyond = np.full(len(edges), -1)
    beyond[first], beyond[second] = second // 3, first // 3
    return beyond.reshape(-1, 3)


def closed_line(points: ndarray, hull: bool) -> ndarray:
    """Return a section or its convex hull as a closed line, whose last point is the first."""
    if hull and len(points) > 2:
        middle = points.mean(axis=0)
        _, _, axes = np.linalg.svd(points - middle, full_matrices=False)
        points = points[ConvexHull((points - middle) @ axes[:2].T).vertices]
    return np.concatenate([points, points[:1]])


@primitive
def section_sizes(
    surfaces: ndarray,
    origins: ndarray,
    normals: ndarray,
    directions: ndarray,
    cutter: Cutter,
    kind: int,
) -> ndarray:
    """Return the sizes of one section of every surface, shape (n,); NaN where there is none.

    Planes are given by points and normals, shape (n, 3); extents are measured along unit vectors
    `directions`; `kind` is `LENGTH`, `HULL` or `EXTENT`. Autograd can differentiate by the first
    four arguments.
    """
    sizes = np.empty(len(surfaces))
    f, *planes = _plain(surfaces, origins, normals, directions)
    _measure(f, cutter.mesh, tuple(planes), kind, sizes)
    return sizes


def _make_pull_back(argnums: tuple[int, ...], sizes: ndarray, arguments: Any, _: Any) -> Any:
    *arrays, cutter, kind = arguments

    def pull_back(upstream: ndarray) -> tuple[ndarray, ...]:
        slopes = [np.zeros(array.shape) for array in arrays]
        for i in np.flatnonzero(upstream):
            _add_slopes(
                [array[i] for array in arrays], cutter, kind, upstream[i], [s[i] for s in slopes]
            )
        return tuple(slopes[number] for number in argnums)

    return pull_back


defvjp_argnums(section_sizes, _make_pull_back)


def _add_slopes(
    arrays: list[ndarray], cutter: Cutter, kind: int, scale: float, slopes: list[ndarray]
) -> None:
    """Add the derivatives of one size by the surface, the plane and the direction."""
    f, o, n, direction = _plain(*arrays)
    of_surface, of_origin, of_normal, of_direction = slopes
    status, ends, places, points, wanted = _trace(f, cutter.mesh, o, n)
    if status < 0:
        of_surface[:] = np.nan
        return
    a, b, t = f[ends[:, 0]], f[ends[:, 1]], places[:, np.newaxis]
    p, q = _segments(points, wanted, n, direction, kind).T
    steps = scale * (points[q] - points[p])
    if kind == EXTENT:
        of_direction += steps.sum(axis=0)
        pull = np.broadcast_to(scale * direction, steps.shape)
    else:
        lengths = np.linalg.norm(points[q] - points[p], axis=1, keepdims=True)
        pull = np.divide(steps, lengths, out=np.zeros_like(steps), where=lengths > 0.0)
    pulls = np.zeros_like(points)
    np.add.at(pulls, q, pull)
    np.subtract.at(pulls, p, pull)
    above, below = (a - o) @ n, (b - o) @ n
    along = np.sum(pulls * (b - a), axis=1) / (above - below) ** 2
    by_above, by_below = -along * below, along * above
    np.add.at(of_surface, ends[:, 0], (1.0 - t) * pulls + by_above[:, np.newaxis] * n)
    np.add.at(of_surface, ends[:, 1], t * pulls + by_below[:, np.newaxis] * n)
    of_origin -= (by_above + by_below).sum() * n
    of_normal += by_above @ (a - o) + by_below @ (b - o)


def _plain(*arrays: ndarray) -> list[ndarray]:
    """Return arrays in one memory layout: loops are compiled anew for each other layout."""
    return [np.require(array, np.float64, ["C", "W"]) for array in arrays]


@compiled
def _height(f: Any, vertex: int, o: Any, n: Any) -> float:
    return (
        n[0] * (f[vertex, 0] - o[0]) + n[1] * (f[vertex, 1] - o[1]) + n[2] * (f[vertex, 2] - o[2])
    )


@compiled
def _trace(f: Any, mesh: Any, o: Any, n: Any) -> Any:
    """Follow the section nearest to o.

    Returned are 0, or why there is none, the edges of its points, their places on the edges, the
    points, and whether the line is measured up to the next one.
    """
    faces, neighbours, roles, candidates = mesh
    most = len(faces)
    ends, places = np.empty((most, 2), np.int64), np.empty(most)
    points, wanted = np.empty((most, 3)), np.empty(most, np.bool_)
    least, face, corner, status, count = np.inf, -1, -1, 0, 0
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
                least, face, corner = squared, candidate, k
    first = face
    if face < 0:
        status = MISSES
    while status == 0:
        # The loop enters the triangle by the edge that runs from above the plane to below it.
        a, b = faces[face, corner], faces[face, (corner + 1) % 3]
        above, below = _height(f, a, o, n), _height(f, b, o, n)
        ends[count, 0], ends[count, 1] = a, b
        places[count] = above / (above - below)
        for x in range(3):
            points[count, x] = f[a, x] + places[count] * (f[b, x] - f[a, x])
        wanted[count] = roles[face] == WANTED
        count += 1
        # It leaves by the edge from below to above, which runs the other way in the next triangle.
        out = (corner + 1) % 3
        if _height(f, faces[face, (out + 1) % 3], o, n) < 0.0:
            out = (out + 1) % 3
        beyond = neighbours[face, out]
        a, b, corner = faces[face, out], faces[face, (out + 1) % 3], -1
        for k in range(3):
            if beyond >= 0 and faces[beyond, k] == b and faces[beyond, (k + 1) % 3] == a:
                corner = k
        if roles[face] == FOREIGN:
            status = MEETS_OTHER_PART
        elif beyond == first:
            break
        elif corner < 0 or count == most:
            status = OPEN
        face = beyond
    count = count if status == 0 else 0
    return status, ends[:count], places[:count], points[:count], wanted[:count]


@compiled
def _hull(points: Any, numbers: Any, normal: Any) -> Any:
    """Return the numbers of the points on the convex hull, in order, by wrapping a line around."""
    first = numbers[0]
    for k in numbers:
        if points[k, 0] < points[first, 0] or (
            points[k, 0] == points[first, 0]
            and (points[k, 1], points[k, 2]) < (points[first, 1], points[first, 2])
        ):
            first = k
    hull = np.empty(len(numbers), np.int64)
    size, here = 0, first
    while size < len(numbers):
        hull[size] = here
        size += 1
        goal = -1
        for k in numbers:
            squared = _squared(points, here, k)
            if squared == 0.0:
                continue
            if goal >= 0:
                # Above zero where point k lies left of the line to the goal, seen along the normal.
                side = 0.0
                for x in range(3):
                    y, z = (x + 1) % 3, (x + 2) % 3
                    a, b = points[goal, y] - points[here, y], points[goal, z] - points[here, z]
                    c, d = points[k, y] - points[here, y], points[k, z] - points[here, z]
                    side += normal[x] * (a * d - b * c)
                if side < 0.0 or (side == 0.0 and squared <= _squared(points, here, goal)):
                    continue
            goal = k
        if goal < 0:
            break
        for k in hull[:size]:  # rounding may pass over the first point on a straight side
            if _squared(points, goal, k) == 0.0:
                return hull[:size]
        here = goal
    return hull[:size]


@compiled
def _squared(points: Any, a: int, b: int) -> float:
    total = 0.0
    for x in range(3):
        total += (points[a, x] - points[b, x]) ** 2
    return total


@compiled
def _segments(points: Any, wanted: Any, normal: Any, direction: Any, kind: int) -> Any:
    """Return pairs of points whose distances add up to the size."""
    count = len(points)
    if kind == LENGTH:
        firsts = np.flatnonzero(wanted)
        pairs = np.empty((len(firsts), 2), np.int64)
        for k in range(len(firsts)):
            pairs[k, 0], pairs[k, 1] = firsts[k], (firsts[k] + 1) % count
        return pairs
    numbers = np.empty(count, np.int64)
    kept = 0
    for k in range(count):
        if wanted[k] or wanted[(k - 1) % count]:
            numbers[kept] = k
            kept += 1
    numbers = numbers[:kept]
    if kind == HULL:
        hull = _hull(points, numbers, normal)
        pairs = np.empty((len(hull), 2), np.int64)
        for k in range(len(hull)):
            pairs[k, 0], pairs[k, 1] = hull[k], hull[(k + 1) % len(hull)]
        return pairs
    pairs = np.empty((1, 2), np.int64)
    low, high = np.inf, -np.inf
    for number in numbers:
        place = 0.0
        for x in range(3):
            place += points[number, x] * direction[x]
        if place < low:
            low, pairs[0, 0] = place, number
        if place > high:
            high, pairs[0, 1] = place, number
    return pairs


@compiled
def _measure(surfaces: Any, mesh: Any, planes: Any, kind: int, sizes: Any) -> None:
    origins, normals, directions = planes
    for i in range(len(surfaces)):
        status, _, _, points, wanted = _trace(surfaces[i], mesh, origins[i], normals[i])
        if status < 0:
            sizes[i] = np.nan
            continue
        size = 0.0
        for p, q in _segments(points, wanted, normals[i], directions[i], kind):
            squared, along = 0.0, 0.0
            for x in range(3):
                step = points[q, x] - points[p, x]
                squared += step * step
                along += step * directions[i, x]
            size += along if kind == EXTENT else np.sqrt(squared)
        sizes[i] = size
