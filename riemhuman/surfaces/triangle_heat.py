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
from scipy.sparse.linalg import LinearOperator, SuperLU, splu

from riemhuman.kernels.threads import single_threaded_libraries

# Pivots stay on the diagonal: the system is symmetric and positive definite.
_SYMMETRIC: dict[str, Any] = {"SymmetricMode": True, "DiagPivotThresh": 0.0}


class TriangleHeat:
    """Heat flow on one mesh; its factorisations are computed once.

    Parameters
    ----------
    vertices : array, shape (V, 3)
        Vertices.
    faces : array of int, shape (F, 3)
        Triangles.
    face_areas : array, shape (F,)
        Their areas.
    """

    def __init__(self, vertices: ndarray, faces: ndarray, face_areas: ndarray) -> None:
        self.face_areas = face_areas
        pairs, edges = adjacent_triangles(faces)
        squared_lengths = np.sum((vertices[edges[:, 0]] - vertices[edges[:, 1]]) ** 2, axis=1)
        flows = 1.5 * squared_lengths / face_areas[pairs].sum(axis=1)
        self._pairs, self._flows = pairs, flows
        self.laplacian = self._laplacian(flows)
        self._steps: dict[float, HeatStep] = {}

    def step(self, time: float) -> HeatStep:
        """Return one implicit step of the flow.

        Parameters
        ----------
        time : float
            Duration of the flow, in squared units of the vertices. In the plane, heat spreads by
            the root mean square distance √(4 time).

        Returns
        -------
        step : HeatStep
            Maps values on triangles, shape (F, n), to their values after the step.
        """
        if time not in self._steps:
            self._steps[time] = self._step(time, self.laplacian)
        return self._steps[time]

    def step_through(self, conductances: ndarray, time: float) -> HeatStep:
        """Return one implicit step of the flow with different conductivities of the triangles.

        Parameters
        ----------
        conductances : array, shape (F,)
            Positive factor of each triangle, 1 for `step`; the flow between two triangles is
            multiplied by the harmonic mean of theirs.
        time : float
            Duration of the flow.

        Returns
        -------
        step : HeatStep
            Unlike that of `step`, it is computed in every call.
        """
        both = conductances[self._pairs]
        means = 2.0 * both[:, 0] * both[:, 1] / both.sum(axis=1)
        return self._step(time, self._laplacian(means * self._flows))

    def _laplacian(self, flows: ndarray) -> Any:
        n_faces = len(self.face_areas)
        links = sparse.coo_array((flows, tuple(self._pairs.T)), shape=(n_faces, n_faces))
        links = (links + links.T).tocsr()
        return sparse.diags_array(links.sum(axis=1)) - links

    def _step(self, time: float, laplacian: Any) -> HeatStep:
        system = sparse.diags_array(self.face_areas) + time * laplacian
        factor = splu(system.tocsc(), permc_spec="MMD_AT_PLUS_A", options=_SYMMETRIC)
        return HeatStep(factor, self.face_areas)


class HeatStep(LinearOperator):
    """The linear map (A + time L)⁻¹ A, or its transpose.

    The map keeps constants and ∫ X dx.

    Parameters
    ----------
    factor : SuperLU
        Factors of A + time L.
    face_areas : array, shape (F,)
        The diagonal of A.
    transposed : bool
        Whether this is the transpose, A (A + time L)⁻¹.
    """

    def __init__(self, factor: SuperLU, face_areas: ndarray, transposed: bool = False) -> None:
        super().__init__(np.float64, 2 * face_areas.shape)
        self._factor, self._areas, self._transposed = factor, face_areas, transposed

    def _matmat(self, values: ndarray) -> ndarray:
        areas = self._areas[:, None]
        with single_threaded_libraries():
            if self._transposed:
                return areas * self._factor.solve(np.ascontiguousarray(values))
            return self._factor.solve(areas * values)

    def _transpose(self) -> HeatStep:
        return HeatStep(self._factor, self._areas, not self._transposed)

    _adjoint = _transpose


def adjacent_triangles(faces: ndarray) -> tuple[ndarray, ndarray]:
    """Return pairs of triangles that share an edge; more than two at an edge form a chain.

    Parameters
    ----------
    faces : array of int, shape (F, 3)
        Triangles.

    Returns
    -------
    pairs : array of int, shape (P, 2)
        Triangles.
    edges : array of int, shape (P, 2)
        The vertices of the edge they share.
    """
    edges = np.sort(np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]]), axis=1)
    owners = np.tile(np.arange(len(faces)), 3)
    order = np.lexsort(edges.T)
    owners, edges = owners[order], edges[order]
    same = np.all(edges[1:] == edges[:-1], axis=1)
    return np.stack([owners[:-1][same], owners[1:][same]], axis=1), edges[1:][same]
