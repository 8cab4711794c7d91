r"""Interpolation of surfaces by their deformation gradients, put together by a Poisson equation.

Every triangle turns from f₀ to f₁ by a rotation R and stretches. Interpolating both,

.. math:: J(t) = R^t \left((1-t) J_0 + t R^T J_1\right),

with J = (f_u, f_v), bends limbs where a straight path would shrink them. The
surface whose derivatives come closest to J(t) in the least squares sense solves a Poisson equation
on the template (Xu, Zhang, Wang and Bao, "Poisson shape interpolation", SPM 2005). Triangles turn
along the shortest rotation, by less than half a turn.
"""

from __future__ import annotations

import numpy as np
from numpy import ndarray
from scipy import sparse
from scipy.sparse.csgraph import connected_components
from scipy.sparse.linalg import splu

from riemhuman.kernels.threads import single_threaded_blas


class PoissonInterpolator:
    """Interpolates surfaces over one mesh; what depends on the mesh alone is computed once.

    Parameters
    ----------
    faces : array of int, shape (F, 3)
        Triangles.
    frame_coefficients : array, shape (F, 3)
        Template frames: 1/u₂, 1/v₃, u₃/(v₃u₂).
    differential_operator : csr_array, shape (2F, V)
        Takes vertices to f_u, then f_v, of every triangle.
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
        divergence = differential_operator.T @ sparse.diags_array(np.tile(face_areas, 2))
        laplacian = (divergence @ differential_operator).tocsc()
        # One vertex of every connected component stays put: derivatives do not know where it is.
        corner_pairs = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]]])
        links = sparse.coo_array(
            (np.ones(len(corner_pairs)), tuple(corner_pairs.T)), shape=(n_vertices, n_vertices)
        )
        _, component = connected_components(links, directed=False)
        _, anchors, sizes = np.unique(component, return_index=True, return_counts=True)
        self._free = np.setdiff1d(np.arange(n_vertices), anchors)
        self._factor = splu(laplacian[self._free][:, self._free])
        self._component = component
        self._average = sparse.csr_array(
            (1.0 / sizes[component], (component, np.arange(n_vertices)))
        )

    def interpolate(self, start: ndarray, end: ndarray, times: ndarray) -> ndarray:
        """Return the surfaces between two surfaces at some times.

        Parameters
        ----------
        start, end : array, shape (V, 3)
            Surfaces f₀ and f₁, whose triangles have an area.
        times : array, shape (n_times,)
            Times in [0, 1].

        Returns
        -------
        array, shape (n_times, V, 3)
            Each connected component has the centroid of the straight path.
        """
        if len(times) == 0:
            return np.empty((0, *start.shape))
        # Loading numba takes a while, so that only those who interpolate wait for it.
        from riemhuman.kernels.compiled_surfaces import turned_sources

        source = turned_sources(start, end, times, self._faces, self._frames, self._areas)
        points = np.zeros((len(start), source[0].size))
        with single_threaded_blas():
            points[self._free] = self._factor.solve(source.reshape(points.shape)[self._free])
        first, last = (self._average @ f for f in (start, end))
        weights = times[:, None]
        centroids = (1.0 - weights) * first[:, None] + weights * last[:, None]
        averages = self._average @ points
        points += (centroids.reshape(averages.shape) - averages)[self._component]
        return np.ascontiguousarray(np.swapaxes(points.reshape(source.shape), 0, 1))
