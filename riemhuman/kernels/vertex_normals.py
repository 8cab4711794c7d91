"""Unit normals at the vertices of a surface."""

from __future__ import annotations

import numpy as np
from numpy import ndarray


def vertex_normals(points: ndarray, faces: ndarray) -> ndarray:
    """Return unit normals of the vertices, averaged over their triangles with areas as weights.

    Parameters
    ----------
    points : array, shape (V, 3)
        Vertices.
    faces : array of int, shape (F, 3)
        Triangles.

    Returns
    -------
    array, shape (V, 3)
        Zero where the triangles at a vertex have no area.
    """
    one, two, three = (points[corners] for corners in faces.T)
    areas = np.repeat(np.cross(two - one, three - one), 3, axis=0)
    sums = [np.bincount(faces.ravel(), column, len(points)) for column in areas.T]
    return unit_vectors(np.stack(sums, axis=1))


def unit_vectors(vectors: ndarray) -> ndarray:
    """Return vectors at unit length; zero vectors stay zero.

    Parameters
    ----------
    vectors : array, shape (..., 3)
        Vectors.

    Returns
    -------
    array, shape (..., 3)
    """
    lengths = np.linalg.norm(vectors, axis=-1, keepdims=True)
    return np.divide(vectors, lengths, out=np.zeros_like(vectors), where=lengths > 0)
