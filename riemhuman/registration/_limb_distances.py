"""The part of a scan that lies on a limb, its distances from the limb, and which are smaller."""

from __future__ import annotations

import numpy as np
from scipy.spatial import cKDTree

from riemhuman.arrays import Array, Integers, Triangles
from riemhuman.registration._constants import (
    LEAST_GAIN,
    N_STANDARD_ERRORS,
)
from riemhuman.surfaces.nearest_points import nearest_points

# Points of a scan that are farther from all vertices belong to no part, metres: a point near the
# surface (5 cm) has a vertex within this, even of a coarse mesh with edges of 15 cm.
_FARTHEST_VERTEX = 0.1


def points_on(points: Array, surface: Array, vertices: Integers) -> Array:
    """Return the points of a scan that lie near some vertices of a surface."""
    # V where no vertex is near.
    nearest = cKDTree(surface).query(points, distance_upper_bound=_FARTHEST_VERTEX)[1]
    near: Array = points[np.isin(nearest, vertices)]
    return near


def faces_among(faces: Triangles, vertices: Integers) -> Triangles:
    """Return the triangles of some vertices, in ascending order, numbered among these."""
    inside = np.isin(faces, vertices).all(axis=1)
    return np.searchsorted(vertices, faces[inside])


def limited_distances(points: Array, surface: Array, faces: Triangles, farthest: float) -> Array:
    """Return the distances of points from a surface, metres, with an upper limit."""
    return np.minimum(nearest_points(points, surface, faces)[1], farthest)


def are_less(some: Array, others: Array) -> bool:
    """Return whether distances of the same points are smaller by more than chance."""
    gains = others - some
    chance = N_STANDARD_ERRORS * np.sqrt(np.mean(gains**2) / len(gains))
    return bool(gains.mean() > max(LEAST_GAIN * others.mean(), chance))
