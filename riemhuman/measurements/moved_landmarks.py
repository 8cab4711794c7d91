"""Landmarks as weighted vertices, and their transfer to another template."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy import ndarray
from scipy import sparse
from scipy.spatial import cKDTree

from riemhuman.errors import ArgumentError
from riemhuman.surfaces.template import Template

Landmark = tuple[ndarray, ndarray]
"""Numbers of vertices, and weights that sum to one."""


def checked_landmark(name: str, mark: Any) -> Landmark:
    """Return a landmark whose weights sum to one.

    Parameters
    ----------
    name : str
        Its name, for messages.
    mark : pair of array_like, shape (n,)
        Numbers of vertices, and weights.

    Returns
    -------
    pair of array, shape (n,)

    Raises
    ------
    ArgumentError
        If there is not one weight for each vertex, or the weights do not sum to one.
    """
    vertices, weights = np.asarray(mark[0], dtype=np.int64), np.asarray(mark[1], dtype=np.float64)
    if vertices.shape != weights.shape or abs(weights.sum() - 1.0) > 1e-3:
        raise ArgumentError(
            f"landmark {name!r} must have one weight for each vertex, with sum 1; found vertices "
            f"of shape {vertices.shape} and weights with sum {weights.sum():g}"
        )
    return vertices, weights / weights.sum()


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
