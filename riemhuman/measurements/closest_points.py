"""The points of a triangulated surface that are closest to given points."""

from __future__ import annotations

import numpy as np
from numpy import ndarray
from scipy.spatial import cKDTree

from riemhuman.kernels.surface import dot

# Triangles are looked at whose centroid is among so many nearest; then those around the best.
_NEAREST = 24


def closest_points(points: ndarray, vertices: ndarray, faces: ndarray) -> tuple[ndarray, ndarray]:
    """Return where the closest points lie.

    Parameters
    ----------
    points : array, shape (n, 3)
        Points in space.
    vertices : array, shape (V, 3)
        Vertices of the surface.
    faces : array of int, shape (F, 3)
        Its triangles.

    Returns
    -------
    triangles : array of int, shape (n,)
        Numbers of triangles.
    coordinates : array, shape (n, 3)
        Barycentric coordinates.
    """
    corners = vertices[faces]
    tree = cKDTree(corners.mean(axis=1))
    _, near = tree.query(points, k=min(_NEAREST, len(faces)))
    near = near.reshape(len(points), -1)
    coordinates = closest_in_triangles(points[:, np.newaxis], corners[near])
    places = np.einsum("nkc,nkcx->nkx", coordinates, corners[near])
    best = np.linalg.norm(places - points[:, np.newaxis], axis=-1).argmin(axis=1)
    rows = np.arange(len(points))
    return near[rows, best], coordinates[rows, best]


def closest_in_triangles(points: ndarray, corners: ndarray) -> ndarray:
    """Return barycentric coordinates of the closest points in triangles.

    Parameters
    ----------
    points : array, shape (..., 3)
        Points in space.
    corners : array, shape (..., 3, 3)
        Corners of one triangle for each.

    Returns
    -------
    array, shape (..., 3)
    """
    a, b, c = (corners[..., k, :] for k in range(3))
    u, v, w = b - a, c - a, points - a
    uu, uv, vv, uw, vw = dot(u, u), dot(u, v), dot(v, v), dot(u, w), dot(v, w)
    area = np.maximum(uu * vv - uv**2, np.finfo(float).tiny)
    s, t = (vv * uw - uv * vw) / area, (uu * vw - uv * uw) / area
    inside = np.stack([1.0 - s - t, s, t], axis=-1)
    choices = [np.where(np.all(inside >= 0, axis=-1, keepdims=True), inside, np.nan)]
    for k in range(3):
        one, other = corners[..., k, :], corners[..., (k + 1) % 3, :]
        edge = other - one
        squared = np.maximum(dot(edge, edge), np.finfo(float).tiny)
        along = np.clip(dot(points - one, edge) / squared, 0.0, 1.0)
        on_edge = np.zeros(inside.shape)
        on_edge[..., k], on_edge[..., (k + 1) % 3] = 1.0 - along, along
        choices.append(on_edge)
    found = np.stack(np.broadcast_arrays(*choices), axis=-2)
    gaps = np.linalg.norm(
        np.einsum("...mc,...cx->...mx", found, corners) - points[..., np.newaxis, :], axis=-1
    )
    best = np.nanargmin(gaps, axis=-1)
    return np.take_along_axis(found, best[..., np.newaxis, np.newaxis], axis=-2)[..., 0, :]
