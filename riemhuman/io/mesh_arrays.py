"""Checks of the two arrays of a triangle mesh, and differences between triangulations."""

from __future__ import annotations

from typing import TypeVar

import numpy as np

from riemhuman.arrays import Array, Booleans, Integers, Triangles, Values
from riemhuman.checks import integer_array, real_array
from riemhuman.errors import ArgumentError

Kept = TypeVar("Kept", bound=Values)


def check_mesh(vertices: object, faces: object) -> tuple[Array, Triangles]:
    """Return vertices (V, 3), float64, and faces (F, 3), int64; raise unless they form a mesh."""
    shape = ("n_vertices", 3)
    points = np.asarray(real_array(vertices, "vertices", shape, batched=False))
    triangles = check_triangles(faces, len(points), "vertices")
    if len(triangles) == 0:
        raise ArgumentError("faces is empty; a mesh needs at least one triangle")
    return points, triangles


def check_triangles(
    faces: object, n_vertices: int | None = None, name_of_vertices: str = "points"
) -> Triangles:
    """Return faces (F, 3), int64; raise if they refer to other than so many vertices, if known."""
    return _vertex_numbers(faces, "faces", 3, n_vertices, name_of_vertices)


def check_edges(edges: object, n_vertices: int) -> Integers:
    """Return edges (E, 2), int64; raise if they refer to other than so many points."""
    return _vertex_numbers(edges, "edges", 2, n_vertices, "points")


def _vertex_numbers(
    array: object, name: str, n_corners: int, n_vertices: int | None, name_of_vertices: str
) -> Integers:
    numbers = integer_array(array, name, (f"n_{name}", n_corners))
    end = np.iinfo(np.int64).max if n_vertices is None else n_vertices
    if numbers.size and (numbers.min() < 0 or numbers.max() >= end):
        held = "" if n_vertices is None else f"{name_of_vertices} holds {n_vertices}, "
        _refuse_rows(
            np.any((numbers < 0) | (numbers >= end), axis=1),
            numbers,
            name,
            f"refers to a vertex out of range; {held}counted from 0",
        )
    return numbers


def check_faces(is_bad: Booleans, faces: Triangles, reason: str) -> None:
    """Raise an error that names the first bad triangle and counts the others."""
    _refuse_rows(is_bad, faces, "faces", reason)


def _refuse_rows(is_bad: Booleans, rows: Integers, name: str, reason: str) -> None:
    if is_bad.any():
        first = int(is_bad.argmax())
        n_more = int(is_bad.sum()) - 1
        more = f" (and {n_more} more)" if n_more else ""
        raise ArgumentError(f"{name}[{first}] = {tuple(rows[first].tolist())}{more} {reason}")


def face_difference(faces: Triangles, expected: Triangles) -> str | None:
    """Return a sentence on where a triangulation differs from the expected one; None if nowhere."""
    if faces.shape != expected.shape:
        return f"{len(faces)} triangles found, {len(expected)} expected"
    differs = (faces != expected).any(axis=1)
    if not differs.any():
        return None
    count = "all" if differs.all() else f"{int(differs.sum())} of {len(expected)}"
    difference = f"{count} triangles differ"
    if np.array_equal(_in_order(faces), _in_order(expected)):
        difference = f"{count} triangles or their corners are listed in another order"
    first = int(differs.argmax())
    return (
        f"{difference}, the first at index {first}: "
        f"{tuple(faces[first].tolist())} found, {tuple(expected[first].tolist())} expected"
    )


def _in_order(faces: Triangles) -> Triangles:
    corners = np.sort(faces, axis=1)
    return corners[np.lexsort(corners.T)]


def distinct_pairs(pairs: Integers) -> tuple[Integers, Integers, Integers]:
    """Return the distinct rows of `pairs`, sorted; the number of each row among them; and counts.

    The numbers must not be negative: each pair is sorted as one number, because `numpy.unique`
    takes ten times as long for rows.
    """
    size = int(pairs.max(initial=0)) + 1
    keys = pairs[:, 0] * size + pairs[:, 1]
    keys, places, counts = np.unique(keys, return_inverse=True, return_counts=True)
    return np.stack(np.divmod(keys, size), axis=1), places.reshape(-1), counts


def triangle_sides(faces: Triangles) -> Integers:
    """Return the sides of triangles in their direction, three of each in turn, shape (3F, 2)."""
    sides: Integers = faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2)
    return sides


def place_numbers(points: Array) -> Integers:
    """Return a number for each point, from 0 on, the same where all coordinates are equal."""
    order = np.lexsort(points.T)
    is_new = np.any(np.diff(points[order], axis=0) != 0.0, axis=1)
    numbers = np.empty(len(points), dtype=np.int64)
    numbers[order] = np.concatenate([np.zeros(min(1, len(points)), np.int64), np.cumsum(is_new)])
    return numbers


def read_only(array: Kept) -> Kept:
    """Return the same array, which can no longer be written to."""
    array.setflags(write=False)
    return array
