r"""The flow of heat between the triangles of a template.

A function X that is constant on triangles evolves by :math:`A\,\dot X = -L X`, with the triangle
areas A and the finite-volume Laplacian L. Between triangles s and t that share an edge of length ℓ,
the conductance is ℓ/d, where d = 2(w_s + w_t)/(3ℓ) is the sum of the distances of both centroids
from the edge.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy import ndarray
from scipy import sparse
from scipy.sparse.linalg import LinearOperator, splu

from riemhuman.kernels.threads import single_threaded_libraries
from riemhuman.surfaces.measures import adjacent_triangles

# Pivots stay on the diagonal: the system is symmetric and positive definite.
_SYMMETRIC: dict[str, Any] = {"SymmetricMode": True, "DiagPivotThresh": 0.0}


class TriangleHeat:
    """Heat flow on one mesh; its factorisations are computed once."""

    def __init__(self, vertices: ndarray, faces: ndarray, face_areas: ndarray) -> None:
        self.face_areas = face_areas
        pairs, edges = adjacent_triangles(faces)
        squared_lengths = np.sum((vertices[edges[:, 0]] - vertices[edges[:, 1]]) ** 2, axis=1)
        flows = 1.5 * squared_lengths / face_areas[pairs].sum(axis=1)
        self._pairs, self._flows = pairs, flows
        self.laplacian = self._laplacian(flows)
        self._steps: dict[float, LinearOperator] = {}

    def step(self, time: float) -> LinearOperator:
        """Return one implicit step of the flow."""
        if time not in self._steps:
            self._steps[time] = self._step(time, self.laplacian)
        return self._steps[time]

    def step_through(self, conductances: ndarray, time: float) -> LinearOperator:
        """Return one implicit step of the flow with different conductivities of the triangles."""
        both = conductances[self._pairs]
        means = 2.0 * both[:, 0] * both[:, 1] / both.sum(axis=1)
        return self._step(time, self._laplacian(means * self._flows))

    def _laplacian(self, flows: ndarray) -> Any:
        n_faces = len(self.face_areas)
        links = sparse.coo_array((flows, tuple(self._pairs.T)), shape=(n_faces, n_faces))
        links = (links + links.T).tocsr()
        return sparse.diags_array(links.sum(axis=1)) - links

    def _step(self, time: float, laplacian: Any) -> LinearOperator:
        """Return (A + time L)⁻¹ A, which keeps constants and ∫ X dx, with its transpose."""
        areas = self.face_areas
        system = sparse.diags_array(areas) + time * laplacian
        factor = splu(system.tocsc(), permc_spec="MMD_AT_PLUS_A", options=_SYMMETRIC)

        def solve(values: ndarray) -> ndarray:
            with single_threaded_libraries():
                return factor.solve(np.ascontiguousarray(values))

        def flow(values: ndarray) -> ndarray:
            return solve((areas * values.T).T)

        def transposed(values: ndarray) -> ndarray:
            return (areas * solve(values).T).T

        size = (len(areas), len(areas))
        return LinearOperator(size, flow, transposed, flow, np.float64, transposed)
