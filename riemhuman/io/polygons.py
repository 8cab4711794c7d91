"""Polygons of mesh files, split into triangles that cover the same area.

A polygon that is convex is split from its first corner, (1, 2, 3), (1, 3, 4), …; others, and bent
ones of more than four corners, are split by cutting off ears, whichever corner comes first.
Registered files may show the same polygon in shapes that are split differently, see `is_split`.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from riemhuman.arrays import Array, Booleans, Integers, Triangles
from riemhuman.errors import ArgumentError

# Sines of angles that count as straight, and heights over a plane as a share of a polygon's size.
_STRAIGHT, _FLAT = 1e-7, 1e-4


class Polygons(NamedTuple):
    """Polygons with `lengths` (P,) corners each, of which `corners` lists the vertices."""

    corners: Integers
    lengths: Integers

    @classmethod
    def of_triangles(cls, faces: Triangles) -> Polygons:
        """Return triangles as polygons."""
        return cls(faces.reshape(-1), np.full(len(faces), 3))


def split_polygons(vertices: Array, polygons: Polygons) -> Triangles:
    """Return the triangles of polygons, polygon by polygon.

    A corner that the next one repeats is left out if three remain. Vertices that do not exist
    are left to `check_mesh`.
    """
    corners, lengths = _without_repetitions(polygons)
    if (lengths == 3).all():
        return corners.reshape(-1, 3)
    counts = lengths - 2
    place = np.arange(counts.sum()) - np.repeat(np.cumsum(counts) - counts, counts)
    starts = np.cumsum(lengths) - lengths
    first = np.repeat(starts, counts)
    faces = np.stack([corners[first], corners[first + place + 1], corners[first + place + 2]], 1)
    if corners.min() < 0 or corners.max() >= len(vertices):
        return faces
    ends = np.cumsum(counts)
    for length in np.unique(lengths[lengths > 3]):
        numbers = np.flatnonzero(lengths == length)
        rings = corners[starts[numbers, np.newaxis] + np.arange(length)]
        with np.errstate(invalid="ignore", over="ignore"):  # of numbers that are refused later
            places, is_plain = _on_planes(np.asarray(vertices, dtype=np.float64)[rings])
            others = np.flatnonzero(~is_plain)
            rows = ends[numbers[others], np.newaxis] + np.arange(2 - length, 0)
            if length == 4:
                faces[rows] = _quad_splits(places[others], rings[others])
            else:
                for row, k in zip(rows, others, strict=True):
                    faces[row] = _ears(places[k], rings[k])
    return faces


def is_split(faces: Triangles, polygons: Polygons) -> bool:
    """Return whether polygons can be split into some triangles, polygon by polygon."""
    corners, lengths = _without_repetitions(polygons)
    if len(faces) != (lengths - 2).sum():
        return False
    is_triangle = np.repeat(lengths == 3, lengths - 2)
    if not np.array_equal(faces[is_triangle].ravel(), corners[np.repeat(lengths == 3, lengths)]):
        return False
    if is_triangle.all():
        return True
    sides = faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2)
    numbers = np.repeat(np.arange(len(lengths)), 3 * (lengths - 2))
    # Diagonals are passed in both directions, the sides of a polygon in its own.
    borders = np.stack([corners, corners[_following(lengths)]], axis=1)
    pairs = np.concatenate([sides, borders])
    of_polygon = np.concatenate([numbers, np.repeat(np.arange(len(lengths)), lengths)])
    direction = np.sign(pairs[:, 1] - pairs[:, 0])
    direction[len(sides) :] *= -1
    keys = np.column_stack([of_polygon, np.sort(pairs, axis=1)])
    _, place = np.unique(keys, axis=0, return_inverse=True)
    return not np.bincount(place.reshape(-1), weights=direction).any()


def _following(lengths: Integers) -> Integers:
    """Return the index of the next corner of each corner's polygon."""
    ends = np.cumsum(lengths)
    following: Integers = np.arange(1, lengths.sum() + 1)
    following[ends - 1] = ends - lengths
    return following


def _without_repetitions(polygons: Polygons) -> Polygons:
    """Return polygons without corners that the next one repeats, if three corners remain."""
    corners, lengths = polygons
    short = np.flatnonzero(lengths < 3)
    if len(short):
        raise ArgumentError(
            f"a face must have at least 3 corners; {len(short)} of {len(lengths)} have fewer, the "
            f"first at index {short[0]} with {lengths[short[0]]}"
        )
    if (lengths == 3).all():
        return polygons
    is_repeated = corners == corners[_following(lengths)]
    number = np.repeat(np.arange(len(lengths)), lengths)
    n_left = lengths - np.bincount(number[is_repeated], minlength=len(lengths))
    is_repeated &= (n_left >= 3)[number]
    return Polygons(corners[~is_repeated], np.where(n_left >= 3, n_left, lengths))


def _on_planes(rings: Array) -> tuple[Array, Booleans]:
    """Return places of polygons (P, n, 3) on their mean planes, and which to split from a corner.

    These are convex. On its plane, each polygon runs anticlockwise.
    """
    around = rings - rings.mean(axis=1, keepdims=True)
    # Twice the mean area of the polygon, in the direction of its normal.
    normals = np.cross(around, np.roll(around, -1, axis=1)).sum(axis=1)
    areas = np.linalg.norm(normals, axis=1, keepdims=True)
    normals = normals / np.where(areas == 0.0, 1.0, areas)
    least = np.eye(3)[np.argmin(np.abs(normals), axis=1)]
    across = np.cross(normals, least)
    across /= np.maximum(np.linalg.norm(across, axis=1, keepdims=True), np.finfo(float).tiny)
    up = np.cross(normals, across)
    places = np.stack([np.einsum("pni,pi->pn", around, axis) for axis in (across, up)], axis=-1)
    sines = _sines(places)
    turns = np.arctan2(sines, _cosines(places)).sum(axis=1)
    # A star turns to the left at each corner, but twice around.
    is_convex = (sines > _STRAIGHT).all(axis=1) & (turns < 3.0 * np.pi)
    heights = np.abs(np.einsum("pni,pi->pn", around, normals)).max(axis=1)
    is_flat = heights <= _FLAT * np.sqrt(areas[:, 0])
    if rings.shape[1] == 4:  # both diagonals of a bent one are as good
        is_flat[:] = True
    return places, (is_convex & is_flat) | (areas[:, 0] == 0.0)


def _sides(places: Array) -> tuple[Array, Array]:
    """Return the unit directions of the sides before and after each corner."""
    after = np.roll(places, -1, axis=-2) - places
    after = after / np.maximum(np.linalg.norm(after, axis=-1, keepdims=True), np.finfo(float).tiny)
    return np.roll(after, 1, axis=-2), after


def _sines(places: Array) -> Array:
    before, after = _sides(places)
    return before[..., 0] * after[..., 1] - before[..., 1] * after[..., 0]


def _cosines(places: Array) -> Array:
    before, after = _sides(places)
    cosines: Array = (before * after).sum(axis=-1)
    return cosines


def _quad_splits(places: Array, rings: Integers) -> Integers:
    """Return the two triangles along the diagonal whose smaller triangle is the larger."""
    # From the vertex of the lowest number, whichever corner comes first.
    order = (rings.argmin(axis=1)[:, np.newaxis] + np.arange(4)) % 4
    places = np.take_along_axis(places, order[..., np.newaxis], axis=1)
    rings = np.take_along_axis(rings, order, axis=1)
    diagonals = np.array([[[0, 1, 2], [0, 2, 3]], [[1, 2, 3], [1, 3, 0]]])
    a, b, c = np.moveaxis(places[:, diagonals], 3, 0)
    smaller = _doubled_area(a, b, c).min(axis=2)
    numbers = np.arange(len(rings))[:, np.newaxis, np.newaxis]
    triangles: Integers = rings[numbers, diagonals[smaller.argmax(axis=1)]]
    return triangles


def _doubled_area(a: Array, b: Array, c: Array) -> Array:
    """Return twice the area of triangles, negative where they run clockwise."""
    ab, ac = b - a, c - a
    doubled: Array = ab[..., 0] * ac[..., 1] - ab[..., 1] * ac[..., 0]
    return doubled


def _ears(places: Array, ring: Integers) -> Triangles:
    """Return triangles that are cut off a polygon, the best-shaped first."""
    # From the vertex of the lowest number, whichever corner comes first.
    start = int(ring.argmin())
    places, ring = np.roll(places, -start, axis=0), np.roll(ring, -start)
    left = np.arange(len(ring))
    quality = _quality(places, left)
    is_blocked = np.zeros(len(ring), dtype=bool)
    triangles = []
    while len(left) > 3:
        open_quality = np.where(is_blocked, -np.inf, quality)
        tip = int(open_quality.argmax())
        if open_quality[tip] <= 0.0 and is_blocked.any():
            # What blocked an ear may be gone. If not, the polygon crosses itself.
            tips = np.flatnonzero(is_blocked).tolist()
            free = [k for k in tips if quality[k] > 0.0 and _is_ear(places, left, k)]
            tip = max(free, key=lambda k: quality[k]) if free else int(quality.argmax())
        elif not _is_ear(places, left, tip):
            is_blocked[tip] = True
            continue
        triangles.append(left[[tip - 1, tip, (tip + 1) % len(left)]])
        left, is_blocked = np.delete(left, tip), np.delete(is_blocked, tip)
        quality = np.delete(quality, tip)
        for neighbour in ((tip - 1) % len(left), tip % len(left)):
            around = np.array([neighbour - 1, neighbour, (neighbour + 1) % len(left)])
            quality[neighbour] = _quality(places, left[around])[1]
            is_blocked[neighbour] = False
    cut: Triangles = ring[np.array([*triangles, left])]
    return cut


def _quality(places: Array, left: Integers) -> Array:
    """Return for each corner twice the area of its ear over the squares of its sides.

    A spike, which ends where it began, is the first to go.
    """
    a, b, c = places[np.roll(left, 1)], places[left], places[np.roll(left, -1)]
    squares = ((b - a) ** 2 + (c - b) ** 2 + (a - c) ** 2).sum(axis=-1)
    quality: Array = _doubled_area(a, b, c) / np.maximum(squares, np.finfo(float).tiny)
    quality = np.where(quality > _STRAIGHT, quality, np.minimum(quality, 0.0))
    return np.where((a == c).all(axis=-1), np.inf, quality)


def _is_ear(places: Array, left: Integers, tip: int) -> bool:
    """Return whether the triangle at a corner contains no other corner."""
    a, b, c = places[left[[tip - 1, tip, (tip + 1) % len(left)]]]
    if (a == c).all():
        return True
    others = places[left]
    is_inside = (
        (_doubled_area(a, b, others) >= 0.0)
        & (_doubled_area(b, c, others) >= 0.0)
        & (_doubled_area(c, a, others) >= 0.0)
    )
    for corner in (a, b, c):  # and others at the same place
        is_inside &= (others != corner).any(axis=1)
    return not is_inside.any()
