"""Checks of the two arrays of a triangle mesh, and differences between triangulations."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from riemhuman.checks import integer_array, real_array
from riemhuman.errors import ArgumentError

# Areas are square roots of fourth powers of coordinates, which must not overflow.
_LARGEST = 1e50


def check_mesh(
    vertices: ArrayLike, faces: ArrayLike, *, names: tuple[str, str] = ("vertices", "faces")
) -> tuple[np.ndarray, np.ndarray]:
    """Return vertices and faces after checking that they form a triangle mesh.

    Open and non-manifold meshes, triangles without area and vertices that no triangle uses are
    accepted.

    Parameters
    ----------
    vertices : array_like, shape (V, 3)
        Vertex positions, in metres.
    faces : array_like, shape (F, 3)
        Vertex indices of each triangle, counted from 0.
    names : tuple of str
        Names of the two arguments, for messages.

    Returns
    -------
    vertices : array, shape (V, 3), float64
    faces : array, shape (F, 3), int64

    Raises
    ------
    ArgumentTypeError
        If an array does not hold numbers of the right kind.
    ArgumentError
        If a shape is wrong, a position is not finite or beyond 1e50, there is no triangle, or a
        triangle refers to a vertex that does not exist.
    """
    vertices_name, faces_name = names
    points = np.asarray(
        real_array(vertices, vertices_name, ("n_vertices", 3), batched=False), dtype=np.float64
    )
    if points.size and np.abs(points).max() > _LARGEST:
        raise ArgumentError(
            f"{vertices_name} holds coordinates beyond {_LARGEST:g}, with which areas cannot be "
            f"computed; found {np.abs(points).max():g}"
        )
    triangles = integer_array(faces, faces_name, ("n_faces", 3))
    if len(triangles) == 0:
        raise ArgumentError(f"{faces_name} is empty; a mesh needs at least one triangle")
    check_faces(
        np.any((triangles < 0) | (triangles >= len(points)), axis=1),
        triangles,
        faces_name,
        f"refers to a vertex out of range; {vertices_name} holds {len(points)}, counted from 0",
    )
    return points, triangles


def face_difference(found: np.ndarray, expected: np.ndarray) -> str | None:
    """Describe where a triangulation differs from the expected one.

    Parameters
    ----------
    found, expected : array of int, shape (F, 3)
        Vertex indices of each triangle.

    Returns
    -------
    difference : str or None
        The kind of the difference and its first place; None if there is none.
    """
    if found.shape != expected.shape:
        return f"{len(found)} triangles found, {len(expected)} expected"
    differs = (found != expected).any(axis=1)
    if not differs.any():
        return None
    count = "all" if differs.all() else f"{int(differs.sum())} of {len(expected)}"
    first = int(differs.argmax())
    example = (
        f"the first at index {first}: {tuple(found[first].tolist())} found, "
        f"{tuple(expected[first].tolist())} expected"
    )
    turned, wanted = _from_smallest(found), _from_smallest(expected)
    if np.array_equal(turned, wanted):
        return f"the corners of {count} triangles begin at another vertex, {example}"
    if np.array_equal(_from_smallest(found[differs, ::-1]), wanted[differs]):
        return f"{count} triangles are flipped, inside out, {example}"
    if np.array_equal(_sorted_rows(turned), _sorted_rows(wanted)):
        return f"the triangles are the same in another order, {example}"
    return f"{count} triangles differ, {example}"


def _from_smallest(faces: np.ndarray) -> np.ndarray:
    """Return triangles with their corners rotated so that the smallest index comes first."""
    turns = (np.argmin(faces, axis=1)[:, None] + np.arange(3)) % 3
    return np.take_along_axis(faces, turns, axis=1)


def _sorted_rows(faces: np.ndarray) -> np.ndarray:
    return faces[np.lexsort(faces.T[::-1])]


def read_only(array: np.ndarray) -> np.ndarray:
    """Return the same array, which can no longer be written to.

    Parameters
    ----------
    array : array, shape (...)
        The array.
    """
    array.setflags(write=False)
    return array


def check_faces(bad: np.ndarray, faces: np.ndarray, name: str, reason: str) -> None:
    """Raise an error that names the first of some triangles and counts them.

    Parameters
    ----------
    bad : array of bool, shape (F,)
        Which triangles to refuse.
    faces : array of int, shape (F, 3)
        Vertex indices of each triangle.
    name : str
        Name of the triangles, for the message.
    reason : str
        What is wrong with the triangles.

    Raises
    ------
    ArgumentError
        If any triangle is bad.
    """
    if bad.any():
        first = int(bad.argmax())
        others = int(bad.sum()) - 1
        more = f" (and {others} more)" if others else ""
        raise ArgumentError(f"{name}[{first}] = {tuple(faces[first].tolist())}{more} {reason}")


def split_polygons(corners: np.ndarray, lengths: np.ndarray) -> np.ndarray:
    """Return the triangles of polygons, each split from its first corner.

    The split (1, 2, 3), (1, 3, 4), … depends only on the order of the corners, so that surfaces
    with the same polygons get the same triangles.

    Parameters
    ----------
    corners : array of int, shape (n,)
        Vertex indices, polygon after polygon.
    lengths : array of int, shape (F,)
        Number of corners of each polygon.

    Returns
    -------
    array of int, shape (n - 2 F, 3)

    Raises
    ------
    ArgumentError
        If a polygon has fewer than three corners.
    """
    few = np.flatnonzero(lengths < 3)
    if len(few):
        raise ArgumentError(
            f"a face must have at least 3 corners; {len(few)} of {len(lengths)} have fewer, the "
            f"first at index {few[0]} with {lengths[few[0]]}"
        )
    counts = lengths - 2
    place = np.arange(counts.sum()) - np.repeat(np.cumsum(counts) - counts, counts)
    first = np.repeat(np.cumsum(lengths) - lengths, counts)
    return np.stack([corners[first], corners[first + place + 1], corners[first + place + 2]], 1)
