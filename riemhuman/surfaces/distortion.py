"""Changes of the triangle areas, edge lengths and volume of a surface along a path of surfaces."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy import ndarray

from riemhuman.checks import real_array


class Distortion(NamedTuple):
    """A summary of the distortions of all triangles or edges.

    Attributes
    ----------
    largest : float
        The largest distortion.
    quantile_99 : float
        The 99 % quantile.
    mean : float
        The weighted mean.
    """

    largest: float
    quantile_99: float
    mean: float


def triangle_areas(points: ndarray, faces: ndarray) -> ndarray:
    """Return the areas of triangles.

    Parameters
    ----------
    points : array, shape (..., V, 3)
        Surfaces, metres.
    faces : array of int, shape (F, 3)
        Triangles.

    Returns
    -------
    array, shape (..., F)
        Square metres.
    """
    points = real_array(points, "points", ("n_vertices", 3))
    one, two, three = (points[..., corner, :] for corner in faces.T)
    return 0.5 * np.linalg.norm(np.cross(two - one, three - one), axis=-1)


def edge_lengths(points: ndarray, edges: ndarray) -> ndarray:
    """Return the lengths of edges.

    Parameters
    ----------
    points : array, shape (..., V, 3)
        Surfaces, metres.
    edges : array of int, shape (E, 2)
        Edges, such as `Template.edges`.

    Returns
    -------
    array, shape (..., E)
        Metres.
    """
    points = real_array(points, "points", ("n_vertices", 3))
    return np.linalg.norm(points[..., edges[:, 1], :] - points[..., edges[:, 0], :], axis=-1)


def signed_volume(points: ndarray, faces: ndarray) -> ndarray:
    """Return the volumes that closed surfaces enclose, Σ_t det(q₁, q₂, q₃)/6.

    Parameters
    ----------
    points : array, shape (..., V, 3)
        Surfaces, metres.
    faces : array of int, shape (F, 3)
        Triangles.

    Returns
    -------
    array, shape (...)
        Cubic metres, positive if normals point outward; NaN if the mesh is not closed.
    """
    points = real_array(points, "points", ("n_vertices", 3))
    if not is_closed(faces):
        return np.full(points.shape[:-2], np.nan)
    # Relative to the first vertex, to keep precision for bodies far from the origin.
    points = points - points[..., :1, :]
    one, two, three = (points[..., corner, :] for corner in faces.T)
    return np.sum(one * np.cross(two, three), axis=(-2, -1)) / 6.0


def is_closed(faces: ndarray) -> bool:
    """Tell whether every edge belongs to two triangles, which pass it in opposite directions.

    Parameters
    ----------
    faces : array of int, shape (F, 3)
        Triangles.
    """
    sides = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]])
    n_vertices = int(faces.max()) + 1
    keys = sides[:, 0] * n_vertices + sides[:, 1]
    reversed_keys = sides[:, 1] * n_vertices + sides[:, 0]
    return bool(len(np.unique(keys)) == len(keys) and np.isin(reversed_keys, keys).all())


def change_along_path(sizes: ndarray) -> ndarray:
    """Return the largest relative change of sizes along a path beyond the sizes at its ends.

    For sizes A(τ) with ends A₀, A₁ it is the maximum over τ of A(τ)/max(A₀, A₁) − 1,
    min(A₀, A₁)/A(τ) − 1 and 0, so that doubling and halving count the same.

    Parameters
    ----------
    sizes : array, shape (n_times, ...)
        Areas, lengths or volumes along a path, all of one sign.

    Returns
    -------
    array, shape (...)
        Infinite where a size vanishes only between the ends, or only at both ends.
    """
    sizes = np.abs(real_array(sizes, "sizes", finite=False))
    largest, smallest = np.maximum(sizes[0], sizes[-1]), np.minimum(sizes[0], sizes[-1])
    growth = _ratio(sizes.max(axis=0), largest)
    shrinkage = _ratio(smallest, sizes.min(axis=0))
    return np.maximum(np.maximum(growth, shrinkage) - 1.0, 0.0)


def summarize(distortions: ndarray, weights: ndarray) -> Distortion:
    """Return the largest, the 99 % quantile and the weighted mean of distortions.

    Parameters
    ----------
    distortions : array, shape (m,)
        Distortions of triangles or edges.
    weights : array, shape (m,)
        Their areas or lengths.
    """
    return Distortion(
        float(distortions.max()),
        float(np.quantile(distortions, 0.99)),
        float(np.average(distortions, weights=weights)),
    )


def _ratio(a: ndarray, b: ndarray) -> ndarray:
    """Return a/b, or 1 where both are 0."""
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.where((a == 0) & (b == 0), 1.0, a / b)
