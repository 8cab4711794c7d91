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
from scipy.spatial.transform import Rotation


class PoissonInterpolator:
    """Interpolates surfaces over one mesh; what depends on the mesh alone is computed once.

    Parameters
    ----------
    faces : array of int, shape (F, 3)
        Triangles.
    differential_operator : csr_array, shape (2F, V)
        Takes vertices to f_u, then f_v, of every triangle.
    face_areas : array, shape (F,)
        Areas of the template's triangles.
    """

    def __init__(
        self, faces: ndarray, differential_operator: sparse.csr_array, face_areas: ndarray
    ) -> None:
        n_vertices = differential_operator.shape[1]
        self._operator = differential_operator
        self._divergence = differential_operator.T @ sparse.diags_array(np.tile(face_areas, 2))
        laplacian = (self._divergence @ differential_operator).tocsc()
        # One vertex of every connected component stays put: derivatives do not know where it is.
        corner_pairs = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]]])
        links = sparse.coo_array(
            (np.ones(len(corner_pairs)), tuple(corner_pairs.T)), shape=(n_vertices, n_vertices)
        )
        _, self._component = connected_components(links, directed=False)
        _, anchors = np.unique(self._component, return_index=True)
        self._free = np.setdiff1d(np.arange(n_vertices), anchors)
        self._factor = splu(laplacian[self._free][:, self._free])

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
        first, last = self._derivatives(start), self._derivatives(end)
        rotations = _rotations(first, last)
        turns = Rotation.from_matrix(rotations).as_rotvec()
        back = np.swapaxes(rotations, 1, 2) @ last
        path = np.zeros((len(times), *start.shape))
        for i, t in enumerate(times):
            turn = Rotation.from_rotvec(t * turns).as_matrix()
            wanted = turn @ ((1.0 - t) * first + t * back)
            source = self._divergence @ np.concatenate([wanted[:, :, 0], wanted[:, :, 1]])
            path[i, self._free] = self._factor.solve(source[self._free])
            path[i] += self._centroids((1.0 - t) * start + t * end - path[i])
        return path

    def _derivatives(self, f: ndarray) -> ndarray:
        """Return J = (f_u, f_v), shape (F, 3, 2)."""
        derivatives = self._operator @ f
        n_faces = len(derivatives) // 2
        return np.stack([derivatives[:n_faces], derivatives[n_faces:]], axis=-1)

    def _centroids(self, values: ndarray) -> ndarray:
        """Return at each vertex the average of values over its connected component."""
        counts = np.bincount(self._component)
        sums = [np.bincount(self._component, column) for column in values.T]
        return (np.stack(sums, axis=1) / counts[:, None])[self._component]


def _rotations(first: ndarray, last: ndarray) -> ndarray:
    """Return the rotational part of the maps that take derivatives and normals to each other.

    In orthonormal frames of the two triangles the map is a 2 × 2 matrix, whose polar decomposition
    has the rotation by the angle atan2(m₂₁ − m₁₂, m₁₁ + m₂₂).
    """
    (first_frame, first_upper), (last_frame, last_upper) = _frames(first), _frames(last)
    # Inverse of the upper triangular matrix [[p, q], [0, r]], times p r > 0.
    p, q, r = first_upper
    u, v, w = last_upper
    m11, m12, m22 = u * r, v * p - u * q, w * p
    angle = np.arctan2(-m12, m11 + m22)
    cosine, sine = np.cos(angle), np.sin(angle)
    turned = last_frame.copy()
    turned[:, :, 0] = cosine[:, None] * last_frame[:, :, 0] + sine[:, None] * last_frame[:, :, 1]
    turned[:, :, 1] = cosine[:, None] * last_frame[:, :, 1] - sine[:, None] * last_frame[:, :, 0]
    return turned @ np.swapaxes(first_frame, 1, 2)


def _frames(derivatives: ndarray) -> tuple[ndarray, tuple[ndarray, ndarray, ndarray]]:
    """Return frames e₁ ∥ f_u, e₂, n and the entries of J in them, [[p, q], [0, r]]."""
    f_u, f_v = derivatives[:, :, 0], derivatives[:, :, 1]
    p = np.linalg.norm(f_u, axis=1)
    e1 = f_u / p[:, None]
    q = np.sum(e1 * f_v, axis=1)
    across = f_v - q[:, None] * e1
    r = np.linalg.norm(across, axis=1)
    e2 = across / r[:, None]
    return np.stack([e1, e2, np.cross(e1, e2)], axis=2), (p, q, r)
