"""The flow of heat over a template, between its triangles or between its vertices."""

from __future__ import annotations

import numpy as np
from scipy import sparse
from scipy.sparse.linalg import LinearOperator

from riemhuman.arrays import Array, Integers, Triangles
from riemhuman.kernels.elimination import SymmetricSolver
from riemhuman.surfaces.measures import adjacent_triangles


class HeatFlow:
    """The flow of heat M dX/dt = −L X by a Laplacian L; its factorisations are computed once.

    The masses M are areas, of triangles or around vertices. Where a mass is 0, as at a vertex
    that no triangle uses, the flow ends at 0.
    """

    def __init__(self, masses: Array, laplacian: sparse.csr_array) -> None:
        self.masses, self.laplacian = masses, laplacian
        self._steps: dict[float, LinearOperator] = {}

    def step(self, time: float) -> LinearOperator:
        """Return one implicit step of the flow."""
        if time not in self._steps:
            self._steps[time] = self._step(time, self.laplacian)
        return self._steps[time]

    def _step(self, time: float, laplacian: sparse.csr_array) -> LinearOperator:
        """Return (M + time L)⁻¹ M, which keeps constants and ∫ X dx, with its transpose."""
        masses = self.masses
        diagonal = np.where(masses > 0.0, masses, 1.0)
        solver = SymmetricSolver(sparse.diags_array(diagonal) + time * laplacian)

        def flow(values: Array) -> Array:
            return solver.solve((masses * values.T).T)

        def transposed(values: Array) -> Array:
            return (masses * solver.solve(values).T).T

        size = (len(masses), len(masses))
        return LinearOperator(size, flow, transposed, flow, np.float64, transposed)


class TriangleHeat(HeatFlow):
    """The flow of heat between triangles."""

    # The Laplacian is that of finite volumes: between triangles s and t that share an edge of
    # length ℓ, the conductance is ℓ/d, where d = 2(w_s + w_t)/(3ℓ) is the sum of the distances of
    # both centroids from the edge.

    def __init__(self, vertices: Array, faces: Triangles, face_areas: Array) -> None:
        pairs, edges = adjacent_triangles(faces)
        squared_lengths = np.sum((vertices[edges[:, 0]] - vertices[edges[:, 1]]) ** 2, axis=1)
        flows = 1.5 * squared_lengths / face_areas[pairs].sum(axis=1)
        self._pairs, self._flows = pairs, flows
        super().__init__(face_areas, _laplacian(pairs, flows, len(face_areas)))

    def step_through(self, conductances: Array, time: float) -> LinearOperator:
        """Return one implicit step of the flow with different conductivities of the triangles."""
        # Harmonic means: resistances in series add up.
        pairs = conductances[self._pairs]
        means = 2.0 * pairs[:, 0] * pairs[:, 1] / pairs.sum(axis=1)
        laplacian = _laplacian(self._pairs, means * self._flows, len(self.masses))
        return self._step(time, laplacian)


def _laplacian(pairs: Integers, flows: Array, n: int) -> sparse.csr_array:
    links = sparse.coo_array((flows, tuple(pairs.T)), shape=(n, n))
    links = (links + links.T).tocsr()
    return sparse.diags_array(links.sum(axis=1)) - links
