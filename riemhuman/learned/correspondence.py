"""Transfer of surfaces between two templates in correspondence."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy import ndarray
from scipy import sparse
from scipy.spatial import cKDTree

from riemhuman.bodies import correspondence_matrix
from riemhuman.errors import ArgumentError
from riemhuman.geometry import AlignedSurfaces
from riemhuman.kernels.triangle_frames import (
    deformation_gradients,
    stacked_derivatives,
    triangle_frames,
)
from riemhuman.surfaces.template import Template

# Largest distance of matching vertices, relative to the size of the template: files round.
_SAME = 1e-5
# Number of vertices that a triangle follows, and the weight of their normals in metres, which keeps
# the two sides of a hand apart.
_CARRIERS, _NORMALS = 6, 0.05


class Correspondence:
    """The transfer of surfaces from a template to the template of a network, and back.

    Forth, the network's vertices are combinations of the template's. Back, every triangle of the
    template takes the mean deformation gradient of the nearby triangles of the network, and a
    Poisson equation gives the surface; the remaining errors at the network's vertices are then
    corrected by moving the vertices near them.

    Parameters
    ----------
    home : Template
        Template of the network, with V vertices.
    template : Template
        The other template, with V' vertices: any mesh, of any person in any pose.
    correspondence : array_like of int, pair, or sparse matrix, optional
        Where the vertices of `home` lie on `template`: numbers of vertices, shape (V,); a pair of
        numbers of triangles, shape (V,), and barycentric coordinates, shape (V, 3); or a matrix
        whose rows sum to one. By default the vertices of `template` at the same places.

    Raises
    ------
    ArgumentError
        If the correspondence does not fit the templates, or is missing and `template` lacks a
        vertex of `home`.
    DegenerateSurfaceError
        If a triangle of `home` has no area on `template`.
    """

    def __init__(self, home: Template, template: Template, correspondence: Any = None) -> None:
        self.home, self.template = home, template
        if correspondence is None:
            correspondence = _same_vertices(home, template)
        self._forth = correspondence_matrix(template, correspondence)
        if self._forth.shape[0] != home.n_vertices:
            raise ArgumentError(
                f"correspondence must have a row for each of the {home.n_vertices} vertices of the "
                f"network's template; found {self._forth.shape[0]}"
            )
        start = self._forth @ template.vertices
        AlignedSurfaces(home, equip=False).check_immersed(start, "correspondence")
        self._start = triangle_frames(start, home.differential_operator)
        frames = triangle_frames(template.vertices, template.differential_operator)
        self._frames = frames
        average = _vertex_average(start, home)
        normals = average @ self._start[..., 2]
        places = template.vertices[template.faces].mean(axis=1)
        self._carriers = _neighbors(start, normals, places, frames[..., 2]) @ average
        # Corrections are small: they need not distinguish the sides of a hand.
        nothing = np.zeros_like(template.vertices)
        self._spread = _neighbors(start, np.zeros_like(start), template.vertices, nothing)

    def forth(self, points: ndarray) -> ndarray:
        """Return surfaces over the network's template.

        Parameters
        ----------
        points : array, shape (n, V', 3)
            Surfaces over the other template, metres.

        Returns
        -------
        array, shape (n, V, 3)
        """
        n_bodies, n_vertices, _ = points.shape
        flat = points.transpose(1, 0, 2).reshape(n_vertices, -1)
        return (self._forth @ flat).reshape(-1, n_bodies, 3).transpose(1, 0, 2)

    def back(self, points: ndarray) -> ndarray:
        """Return surfaces over the other template.

        Parameters
        ----------
        points : array, shape (n, V, 3)
            Surfaces over the network's template, metres.

        Returns
        -------
        array, shape (n, V', 3)
        """
        nowhere = np.zeros((self.template.n_vertices, 3))
        found = np.empty((len(points), *nowhere.shape))
        for number, surface in enumerate(points):
            after = triangle_frames(surface, self.home.differential_operator)
            moved = deformation_gradients(self._start, after).reshape(self.home.n_faces, 9)
            carried = (self._carriers @ moved).reshape(-1, 3, 3) @ self._frames
            found[number] = self.template.interpolator.surface_of(
                stacked_derivatives(carried), nowhere
            )
            found[number] += self._spread @ (surface - self._forth @ found[number])
        return found


def _same_vertices(home: Template, template: Template) -> ndarray:
    gaps, numbers = cKDTree(template.vertices).query(home.vertices)
    allowed = _SAME * np.ptp(home.vertices, axis=0).max()
    if gaps.max() > allowed:
        raise ArgumentError(
            "correspondence is missing: the template is neither the network's own nor a refinement "
            f"of it, and a vertex of the network's is {gaps.max():.3g} from the nearest. Give "
            "numbers of vertices, triangles with barycentric coordinates, or a matrix"
        )
    return np.asarray(numbers)


def _vertex_average(points: ndarray, mesh: Template) -> sparse.csr_array:
    """Return the matrix from values at triangles to their means around vertices, (V, F)."""
    edges = points[mesh.faces[:, 1:]] - points[mesh.faces[:, :1]]
    areas = np.linalg.norm(np.cross(edges[:, 0], edges[:, 1]), axis=1)
    entries = (np.repeat(areas, 3), (mesh.faces.ravel(), np.repeat(np.arange(mesh.n_faces), 3)))
    around = sparse.csr_array(entries, shape=(mesh.n_vertices, mesh.n_faces))
    totals = np.maximum(around @ np.ones(mesh.n_faces), np.finfo(float).tiny)
    return sparse.csr_array(sparse.diags_array(1.0 / totals) @ around)


def _neighbors(
    vertices: ndarray, normals: ndarray, places: ndarray, directions: ndarray
) -> sparse.csr_array:
    """Return continuous weights of the vertices near some places (Franke and Little).

    A vertex at the same place has all the weight.
    """
    tree = cKDTree(np.concatenate([vertices, _NORMALS * normals], axis=1))
    gaps, near = tree.query(np.concatenate([places, _NORMALS * directions], axis=1), _CARRIERS)
    reach = gaps[:, -1:]
    weights = ((reach - gaps) / np.maximum(gaps, 1e-9 * reach)) ** 2
    weights /= weights.sum(axis=1, keepdims=True)
    rows = np.repeat(np.arange(len(places)), _CARRIERS)
    return sparse.csr_array(
        (weights.ravel(), (rows, near.ravel())), shape=(len(places), len(vertices))
    )
