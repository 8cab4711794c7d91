r"""Coordinates whose Euclidean distances bound distances of surfaces from below.

Each triangle is mapped to a Euclidean space so that distances do not grow: unit normals lie there
already (a chord is at most its arc), matrices are wrapped around circles; see the `chart` of terms.
Orthogonal projections, such as means over patches of triangles, keep the bound and take less room.
"""

from __future__ import annotations

import numpy as np
from numpy import ndarray


def patch_coordinates(values: ndarray, areas: ndarray, patches: ndarray | None = None) -> ndarray:
    r"""Return coordinates whose distances are at most those of fields, :math:`L^2(T)`.

    A field on a patch P is its mean and a rest, orthogonal to each other. With w_P the area of P,
    ‖u − v‖² ≥ Σ_P (w_P |ū_P − v̄_P|² + (‖rest of u‖_P − ‖rest of v‖_P)²): Jensen's inequality, and
    the triangle inequality for the rest.

    Parameters
    ----------
    values : array, shape (..., F, d)
        Fields.
    areas : array, shape (F,)
        Template areas w_t.
    patches : array of int, shape (F,), optional
        Patch of each triangle, see `triangle_patches`; by default every triangle is one, and the
        distances are those of the fields.

    Returns
    -------
    array, shape (..., m)
        m is d times the number of triangles, or d + 1 times that of patches.
    """
    leading = values.shape[:-2]
    if patches is None:
        return (np.sqrt(areas)[:, None] * values).reshape(*leading, -1)
    order = np.argsort(patches, kind="stable")
    starts = np.flatnonzero(np.diff(patches[order], prepend=-1))
    weighted = (areas[:, None] * values)[..., order, :]
    patch_areas = np.add.reduceat(areas[order], starts)[:, None]
    means = np.add.reduceat(weighted, starts, axis=-2) / patch_areas
    rest = values[..., order, :] - np.repeat(means, np.diff(starts, append=len(order)), axis=-2)
    squares = np.sum(areas[order, None] * rest**2, axis=-1)
    rests = np.sqrt(np.add.reduceat(squares, starts, axis=-1))[..., None]
    coordinates = np.concatenate([np.sqrt(patch_areas) * means, rests], axis=-1)
    return coordinates.reshape(*leading, -1)


def triangle_patches(vertices: ndarray, faces: ndarray, n_patches: int) -> ndarray:
    """Group triangles into patches, halving the largest along its longest side again and again.

    Parameters
    ----------
    vertices : array, shape (V, 3)
        Vertices of the template.
    faces : array of int, shape (F, 3)
        Triangles.
    n_patches : int
        Number of patches, at least 1; no more than F are made.

    Returns
    -------
    array of int, shape (F,)
        Patch of each triangle, all of 0, ..., n_patches − 1.
    """
    centers = vertices[faces].mean(axis=1)
    groups = [np.arange(len(centers))]
    while len(groups) < min(n_patches, len(centers)):
        largest = max(range(len(groups)), key=lambda k: len(groups[k]))
        members = groups.pop(largest)
        axis = np.argmax(np.ptp(centers[members], axis=0))
        ranked = members[np.argsort(centers[members, axis], kind="stable")]
        half = len(ranked) // 2
        groups += [ranked[:half], ranked[half:]]
    patches = np.empty(len(centers), dtype=np.int64)
    for number, members in enumerate(groups):
        patches[members] = number
    return patches
