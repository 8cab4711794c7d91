r"""Interpolation of deformation gradients, joined to surfaces by a Poisson equation.

Every triangle turns from f₀ to f₁ by a rotation R and stretches. Interpolating both,

.. math:: J(t) = R^t \left((1-t) J_0 + t R^T J_1\right),

with J = (f_u, f_v), bends limbs where a straight path would shrink them. The surface whose
derivatives are closest to J(t) in the least squares sense solves a Poisson equation on the template
(Xu, Zhang, Wang and Bao, "Poisson shape interpolation", SPM 2005).
"""

from __future__ import annotations

from copy import copy

import numpy as np
from numpy import ndarray
from scipy import sparse
from scipy.sparse.csgraph import connected_components
from scipy.sparse.linalg import splu

from riemhuman.kernels.threads import single_threaded_libraries
from riemhuman.surfaces.triangle_heat import adjacent_triangles


class PoissonInterpolator:
    """Interpolates surfaces over one mesh, whose matrix is factorised once.

    Parameters
    ----------
    faces : array of int, shape (F, 3)
        Triangles.
    frame_coefficients : array, shape (F, 3)
        Template frames: 1/u₂, 1/v₃, u₃/(v₃u₂).
    differential_operator : csr_array, shape (2F, V)
        Maps vertices to f_u of every triangle, then f_v.
    face_areas : array, shape (F,)
        Areas of the template's triangles.
    """

    def __init__(
        self,
        faces: ndarray,
        frame_coefficients: ndarray,
        differential_operator: sparse.csr_array,
        face_areas: ndarray,
    ) -> None:
        n_vertices = differential_operator.shape[1]
        self._faces, self._frames, self._areas = faces, frame_coefficients, face_areas
        self._operator = differential_operator
        # Derivatives do not determine translations: one vertex of each component is fixed.
        corner_pairs = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]]])
        links = sparse.coo_array(
            (np.ones(len(corner_pairs)), tuple(corner_pairs.T)), shape=(n_vertices, n_vertices)
        )
        _, component = connected_components(links, directed=False)
        _, anchors, sizes = np.unique(component, return_index=True, return_counts=True)
        self._neighbours = adjacent_triangles(faces)[0]
        both_ways = np.concatenate([self._neighbours, self._neighbours[:, ::-1]])
        both_ways = both_ways[np.lexsort(both_ways.T[::-1])]
        self._neighbours_of = np.ascontiguousarray(both_ways[:, 1])
        counts = np.bincount(both_ways[:, 0], minlength=len(faces))
        self._neighbour_ends = np.concatenate([[0], np.cumsum(counts)])
        self._free = np.setdiff1d(np.arange(n_vertices), anchors)
        self._weigh(face_areas)
        self._component = component
        self._average = sparse.csr_array(
            (1.0 / sizes[component], (component, np.arange(n_vertices)))
        )

    def _weigh(self, weights: ndarray) -> None:
        self._divergence = self._operator.T @ sparse.diags_array(np.tile(weights, 2))
        laplacian = (self._divergence @ self._operator).tocsc()
        self._factor = splu(laplacian[self._free][:, self._free])

    def weighted(self, weights: ndarray) -> PoissonInterpolator:
        """Return an interpolator with other weights of the triangles.

        Parameters
        ----------
        weights : array, shape (F,)
            Positive weight of every triangle, which multiplies its area.
        """
        other = copy(self)
        other._weigh(self._areas * weights)
        return other

    def turns(self, start: ndarray, end: ndarray) -> ndarray:
        """Return the shortest rotation of every triangle between two surfaces.

        Parameters
        ----------
        start, end : array, shape (V, 3)
            Surfaces with triangles of positive area.

        Returns
        -------
        array, shape (F, 3)
            Rotation vectors, unit axes times angles in [0, π].
        """
        # Imported here because loading numba takes long.
        from riemhuman.kernels.turns import triangle_turns

        return triangle_turns(start, end, self._faces)

    def is_torn(self, turns: ndarray) -> bool:
        """Tell whether rotation vectors of some neighbouring triangles differ by more than π.

        Parameters
        ----------
        turns : array, shape (F, 3)
            Rotation vectors.
        """
        one, other = self._neighbours.T
        gaps = turns[one] - turns[other]
        return bool(np.any(np.sum(gaps * gaps, axis=1) > np.pi**2))

    def mended(self, turns: ndarray) -> ndarray:
        """Return the same rotations with full turns added so that neighbours turn alike.

        From the triangle that turns least, across the edges where rotations differ least, each
        triangle gets the rotation vector closest to its neighbour's. Limbs may then turn by up to
        a full turn.

        Parameters
        ----------
        turns : array, shape (F, 3)
            Rotation vectors.

        Returns
        -------
        array, shape (F, 3)
            Rotation vectors.
        """
        from riemhuman.kernels.turns import unwrap_turns

        angles = np.linalg.norm(turns, axis=1)
        # sin(angle / 2) / angle, also where the angle is 0.
        shares = 0.5 * np.sinc(angles / (2.0 * np.pi))
        quaternions = np.column_stack([np.cos(0.5 * angles), shares[:, None] * turns])
        mended = turns.copy()
        roots = np.argsort(angles, kind="stable")
        unwrap_turns(mended, quaternions, roots, self._neighbour_ends, self._neighbours_of)
        return mended

    def parts(self, chosen: ndarray) -> list[ndarray]:
        """Return the connected parts of a set of triangles, the largest first.

        Parameters
        ----------
        chosen : array of bool, shape (F,)
            Triangles.

        Returns
        -------
        list of array of int
            Triangles of each part; chosen triangles that share an edge belong to the same part.
        """
        one, other = self._neighbours[chosen[self._neighbours].all(axis=1)].T
        shape = (len(chosen), len(chosen))
        links = sparse.coo_array((np.ones(len(one)), (one, other)), shape=shape)
        _, labels = connected_components(links, directed=False)
        triangles = np.flatnonzero(chosen)
        _, part, sizes = np.unique(labels[triangles], return_inverse=True, return_counts=True)
        areas = np.bincount(part, self._areas[triangles], minlength=len(sizes))
        return [triangles[part == k] for k in np.argsort(-areas, kind="stable")]

    def interpolate(
        self, start: ndarray, end: ndarray, times: ndarray, turns: ndarray | None = None
    ) -> ndarray:
        """Return the surfaces between two surfaces at some times.

        Parameters
        ----------
        start, end : array, shape (V, 3)
            Surfaces f₀ and f₁, with triangles of positive area.
        times : array, shape (n_times,)
            Times in [0, 1].
        turns : array, shape (F, 3), optional
            Rotation vectors of the triangles, by default the shortest.

        Returns
        -------
        array, shape (n_times, V, 3)
            Each connected component has the centroid of the straight path.
        """
        if len(times) == 0:
            return np.empty((0, *start.shape))
        from riemhuman.kernels.turns import turned_sources

        turns = self.turns(start, end) if turns is None else turns
        source = turned_sources(start, end, turns, times, self._faces, self._frames, self._areas)
        first, last = (self._average @ f for f in (start, end))
        weights = times[:, None]
        return self._solve(source, (1.0 - weights) * first[:, None] + weights * last[:, None])

    def surface_of(self, derivatives: ndarray, placed_as: ndarray) -> ndarray:
        """Return the surface whose first derivatives are closest to given ones.

        Parameters
        ----------
        derivatives : array, shape (2F, 3)
            f_u of all triangles, then f_v; they need not be those of a surface.
        placed_as : array, shape (V, 3)
            Surface from which each connected component takes its centroid.

        Returns
        -------
        array, shape (V, 3)
        """
        source = self._divergence @ derivatives
        return self._solve(source[:, None], (self._average @ placed_as)[:, None])[0]

    def _solve(self, source: ndarray, centroids: ndarray) -> ndarray:
        """Return the surfaces, shape (n, V, 3), with divergences (V, n, 3) and given centroids."""
        points = np.zeros((len(source), source[0].size))
        with single_threaded_libraries():
            points[self._free] = self._factor.solve(source.reshape(points.shape)[self._free])
        averages = self._average @ points
        points += (centroids.reshape(averages.shape) - averages)[self._component]
        return np.ascontiguousarray(np.swapaxes(points.reshape(source.shape), 0, 1))
