"""Transfer of surfaces between two templates in correspondence."""

from __future__ import annotations

import numpy as np
from scipy import sparse
from scipy.spatial import cKDTree

from riemhuman.arrays import Array, ArrayLike, Integers
from riemhuman.bodies import correspondence_matrix
from riemhuman.errors import ArgumentError
from riemhuman.kernels.surface import deformation_gradients, stacked_derivatives, triangle_frames
from riemhuman.surfaces import Template
from riemhuman.surfaces.measures import triangle_areas

# Largest distance of matching vertices, relative to the size of the template: files round.
_SAME = 1e-5

# Number of vertices that a triangle follows, and the weight of their normals in metres, which keeps
# the two sides of a hand apart.
_CARRIERS, _NORMALS = 6, 0.05

# Triangles of less than this share of their own area have collapsed, and less than this share of
# the body's area is too little to recognise the body by.
_COLLAPSED, _TOO_LITTLE = 1e-3, 0.2


class Correspondence:
    """The transfer of surfaces from a template to the template of a network, and back."""

    # Back, every triangle takes the mean deformation gradient of the network's near it, and a
    # Poisson equation gives the surface. `usable` (F,) says which of these have not collapsed.

    def __init__(
        self,
        home: Template,
        template: Template,
        correspondence: ArrayLike | sparse.csr_array | None = None,
    ) -> None:
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
        areas = triangle_areas(start, home.faces)
        self.usable = areas > _COLLAPSED * home.face_areas * (areas.sum() / home.face_areas.sum())
        share = home.face_areas[self.usable].sum() / home.face_areas.sum()
        if share < _TOO_LITTLE:
            raise ArgumentError(
                "correspondence must keep most triangles of the network's template; those that "
                f"have an area on the other template cover only {share:.0%} of the body"
            )
        # Collapsed triangles stay where they are: nothing follows them.
        self._start = np.tile(np.eye(3), (home.n_faces, 1, 1))
        self._start[self.usable] = self._home_frames(start)
        frames = triangle_frames(template.vertices, template.differential_operator)
        self._frames = frames
        average = _vertex_average(np.where(self.usable, areas, 0.0), home)
        # Vertices all of whose triangles have collapsed carry nothing.
        alive = np.unique(home.faces[self.usable])
        average = average[alive]
        normals = average @ self._start[..., 2]
        places = template.vertices[template.faces].mean(axis=1)
        carriers = _neighbors(start[alive], normals, places, frames[..., 2])
        self._carriers = carriers @ average
        # Corrections are small: they need not distinguish the sides of a hand.
        nothing = np.zeros_like(template.vertices)
        self._spread = _neighbors(start, np.zeros_like(start), template.vertices, nothing)

    def forth(self, points: Array) -> Array:
        """Return surfaces (n, V, 3) over the network's template of surfaces (n, V', 3)."""
        n_bodies, n_vertices, _ = points.shape
        flat = points.transpose(1, 0, 2).reshape(n_vertices, -1)
        over_home: Array = (self._forth @ flat).reshape(-1, n_bodies, 3).transpose(1, 0, 2)
        return over_home

    def back(self, points: Array) -> Array:
        """Return surfaces (n, V', 3) over the other template of surfaces (n, V, 3)."""
        origin = np.zeros((self.template.n_vertices, 3))
        surfaces = np.empty((len(points), *origin.shape))
        for number, surface in enumerate(points):
            moved = np.zeros((self.home.n_faces, 3, 3))
            after = self._home_frames(surface)
            moved[self.usable] = deformation_gradients(self._start[self.usable], after)
            moved = (self._carriers @ moved.reshape(-1, 9)).reshape(-1, 3, 3)
            surfaces[number] = self.template.interpolator.surface_of(
                stacked_derivatives(moved @ self._frames), origin
            )
            surfaces[number] += self._spread @ (surface - self._forth @ surfaces[number])
        return surfaces

    def _home_frames(self, surface: Array) -> Array:
        with np.errstate(invalid="ignore", divide="ignore"):
            frames = triangle_frames(surface, self.home.differential_operator)
            usable: Array = frames[self.usable]
            return usable


def _same_vertices(home: Template, template: Template) -> Integers:
    gaps, numbers = cKDTree(template.vertices).query(home.vertices)
    allowed = _SAME * np.ptp(home.vertices, axis=0).max()
    if gaps.max() > allowed:
        raise ArgumentError(
            "correspondence is missing: the template is neither the network's template nor a "
            f"refinement of it, and a vertex of the network's template is {gaps.max():.3g} from "
            "the nearest. Give numbers of vertices, triangles with barycentric coordinates, or "
            "a matrix"
        )
    return np.asarray(numbers)


def _vertex_average(areas: Array, mesh: Template) -> sparse.csr_array:
    """Return the matrix from values at triangles to their means around vertices, (V, F)."""
    entries = (np.repeat(areas, 3), (mesh.faces.ravel(), np.repeat(np.arange(mesh.n_faces), 3)))
    around = sparse.csr_array(entries, shape=(mesh.n_vertices, mesh.n_faces))
    totals = np.maximum(around @ np.ones(mesh.n_faces), np.finfo(float).tiny)
    return sparse.csr_array(sparse.diags_array(1.0 / totals) @ around)


def _neighbors(
    vertices: Array, normals: Array, places: Array, directions: Array
) -> sparse.csr_array:
    """Return continuous weights of the vertices near some places (Franke and Little)."""
    tree = cKDTree(np.concatenate([vertices, _NORMALS * normals], axis=1))
    gaps, near = tree.query(np.concatenate([places, _NORMALS * directions], axis=1), _CARRIERS)
    # Several vertices may lie at one place; where all do, they share the weight.
    reach = np.maximum(gaps[:, -1:], np.finfo(float).tiny)
    weights = ((reach - gaps) / np.maximum(gaps, 1e-9 * reach)) ** 2
    totals = weights.sum(axis=1, keepdims=True)
    weights = np.where(totals > 0, weights / np.where(totals > 0, totals, 1.0), 1.0 / _CARRIERS)
    rows = np.repeat(np.arange(len(places)), _CARRIERS)
    return sparse.csr_array(
        (weights.ravel(), (rows, near.ravel())), shape=(len(places), len(vertices))
    )
