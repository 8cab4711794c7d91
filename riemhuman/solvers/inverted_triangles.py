"""Inverted triangles: those whose normals contradict the deformation of their neighbourhood."""

from __future__ import annotations

import numpy as np
from numpy import ndarray

from riemhuman.checks import real_array
from riemhuman.errors import DegenerateSurfaceError


def inverted_triangles(points: ndarray, reference: ndarray, faces: ndarray) -> ndarray:
    r"""Tell which triangles of a surface are inverted with respect to a reference.

    A deformation gradient takes each triangle and its normal from the reference to the surface. Let
    A be the mean of these over all triangles that share a corner with a given one, weighted by
    their areas in the reference. A should take the normal n of the triangle to the direction of
    :math:`\det(A)\, A^{-\top} n`; the triangle is inverted if its normal points the other way.

    Parameters
    ----------
    points : array, shape (..., V, 3)
        Surfaces.
    reference : array, shape (V, 3)
        A surface without inverted triangles, such as a mean.
    faces : array of int, shape (F, 3)
        Triangles.

    Returns
    -------
    array of bool, shape (..., F)

    Raises
    ------
    DegenerateSurfaceError
        If a triangle of the reference has no area.

    Examples
    --------
    >>> import riemhuman as rh
    >>> bodies = rh.datasets.load_open_bodies("coarse")
    >>> rh.statistics.inverted_triangles(bodies[0], bodies[1], bodies.template.faces).shape
    (2400,)
    """
    reference = real_array(reference, "reference", ("n_vertices", 3), batched=False)
    points = real_array(points, "points", reference.shape)
    frames, unit = _frames(points, faces), _frames(reference, faces)
    areas = np.linalg.det(unit)
    if not np.all(areas > 0):
        triangle = int(np.argmin(areas > 0))
        raise DegenerateSurfaceError(
            f"every triangle of reference must have an area; found otherwise at triangle {triangle}"
        )
    gradients = areas[:, None, None] * (frames @ np.linalg.inv(unit))
    # The mean's length does not matter, only the direction it gives to the normal.
    around = np.zeros((*points.shape, 3))
    for corner in faces.T:
        for vertex_sums, terms in zip(
            around.reshape(-1, len(reference), 3, 3),
            gradients.reshape(-1, len(faces), 3, 3),
            strict=True,
        ):
            np.add.at(vertex_sums, corner, terms)
    means = around[..., faces, :, :].sum(axis=-3)
    # det(A) A⁻ᵀ n as the cross product of images, which singular A have, too.
    first, normals = unit[..., 0], unit[..., 2]
    across = np.cross(normals, first)
    images = [np.einsum("...ij,...j->...i", means, vector) for vector in (first, across)]
    expected = np.cross(*images)
    return np.sum(expected * frames[..., 2], axis=-1) <= 0


def _frames(points: ndarray, faces: ndarray) -> ndarray:
    """Return two edges and the unit normal of every triangle as columns, shape (..., F, 3, 3)."""
    one, two, three = (points[..., corner, :] for corner in faces.T)
    normals = np.cross(two - one, three - one)
    lengths = np.linalg.norm(normals, axis=-1, keepdims=True)
    normals = normals / np.where(lengths > 0, lengths, 1.0)
    return np.stack([two - one, three - one, normals], axis=-1)
