"""Landmarks as weighted vertices, their places on triangles, and other templates."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy import ndarray
from scipy import sparse
from scipy.spatial import cKDTree

from riemhuman.errors import ArgumentError
from riemhuman.measurements.geodesics import SurfacePoint
from riemhuman.surfaces.nearest_places import nearest_places
from riemhuman.surfaces.template import Template

Landmark = tuple[ndarray, ndarray]
"""Numbers of vertices, and weights that sum to one."""


def checked_landmark(name: str, mark: Any, n_vertices: int) -> Landmark:
    """Return a landmark whose weights sum to one.

    Parameters
    ----------
    name : str
        Its name, for messages.
    mark : pair of array_like, shape (n,)
        Numbers of vertices, and weights.
    n_vertices : int
        Number of vertices of the template.

    Returns
    -------
    pair of array, shape (n,)

    Raises
    ------
    ArgumentError
        If there is not one weight for each vertex, the weights do not sum to one, or a number is
        out of range.
    """
    vertices, weights = np.asarray(mark[0], dtype=np.int64), np.asarray(mark[1], dtype=np.float64)
    if vertices.shape != weights.shape or abs(weights.sum() - 1.0) > 1e-3:
        raise ArgumentError(
            f"landmark {name!r} must have one weight for each vertex, with sum 1; found vertices "
            f"of shape {vertices.shape} and weights with sum {weights.sum():g}"
        )
    check_numbers(f"landmark {name!r} is at vertex", vertices, n_vertices)
    return vertices, weights / weights.sum()


def check_numbers(what: str, numbers: ndarray, count: int) -> None:
    """Refuse numbers of vertices or triangles that are out of range.

    Parameters
    ----------
    what : str
        Beginning of the message.
    numbers : array of int, shape (n,)
        The numbers.
    count : int
        Number of vertices or triangles.

    Raises
    ------
    ArgumentError
        If a number is out of range.
    """
    wrong = numbers[(numbers < 0) | (numbers >= count)]
    if wrong.size:
        raise ArgumentError(f"{what} {wrong[0]}; there are {count}")


def on_triangle(mark: Landmark, template: Template) -> SurfacePoint:
    """Return the triangle that a landmark lies in, with barycentric coordinates.

    Parameters
    ----------
    mark : pair of array, shape (n,)
        The landmark. If it lies off the surface, the nearest point replaces it.
    template : Template
        Its template.

    Returns
    -------
    pair of int and array, shape (3,)
    """
    vertices, weights = mark
    around = np.flatnonzero(np.isin(template.faces, vertices[weights != 0]).sum(axis=1))
    for face in around:
        shares = [weights[vertices == corner].sum() for corner in template.faces[face]]
        if abs(sum(shares) - 1.0) < 1e-9 and min(shares) >= 0:
            return int(face), np.array(shares)
    point = weights @ template.vertices[vertices]
    places, _ = nearest_places(point[np.newaxis], template.vertices, template.faces)
    return int(places.triangles[0]), places.barycentric[0]


def moved_landmarks(
    landmarks: Mapping[str, Landmark], matrix: sparse.csr_array
) -> dict[str, Landmark]:
    """Transfer landmarks to another template.

    Parameters
    ----------
    landmarks : mapping of str to pair
        Landmarks of the first template.
    matrix : csr_array, shape (V, V')
        Position of each vertex on the other template, as weights of its V' vertices.

    Returns
    -------
    dict of str to pair
    """
    rows = {
        name: sparse.csr_array(weights @ matrix[vertices])
        for name, (vertices, weights) in landmarks.items()
    }
    return {name: (row.indices.astype(np.int64), row.data) for name, row in rows.items()}


def nearest_triangles(places: ndarray, faces: ndarray, other: Template) -> ndarray:
    """Return, for each triangle of another template, the triangle with the nearest centroid.

    Parameters
    ----------
    places : array, shape (V, 3)
        Positions of the vertices of the first template on the other.
    faces : array of int, shape (F, 3)
        Triangles of the first template.
    other : Template
        The other template.

    Returns
    -------
    array of int, shape (other.n_faces,)
        Numbers of triangles of the first template.
    """
    tree = cKDTree(places[faces].mean(axis=1))
    return tree.query(other.vertices[other.faces].mean(axis=1))[1]
