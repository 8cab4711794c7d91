"""Metrics on surfaces by their inner product alone, with path energies in compiled loops."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Callable
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy import ndarray
from scipy import sparse

from riemhuman.geometry.metric import RiemannianMetric
from riemhuman.kernels.known_gradient import with_known_gradient
from riemhuman.kernels.moving_frames import by_vertex
from riemhuman.kernels.threads import quadratic_form
from riemhuman.terms.zeroth_order import corner_averages

if TYPE_CHECKING:
    from riemhuman.geometry.aligned_surfaces import AlignedSurfaces


class MidpointMetric(RiemannianMetric):
    r"""A metric on surfaces without closed-form distance.

    The energy of a path is :math:`n \sum_i G_{(f_i + f_{i+1})/2}(f_{i+1} - f_i, f_{i+1} - f_i)`, of
    second order in the time step. Subclasses define `inner_product`, and in compiled form
    `metric_matrix` and `squared_norms_and_slopes`.
    """

    space: AlignedSurfaces

    @abstractmethod
    def metric_matrix(self, base_point: ndarray) -> sparse.csr_array:
        """Return the sparse matrix M of the metric: ⟨h, k⟩_f = h·(M k), vertices flattened.

        Parameters
        ----------
        base_point : array, shape (V, 3) or (n, V, 3)
            One surface f, or several to average over.

        Returns
        -------
        csr_array, shape (3V, 3V)

        Raises
        ------
        DegenerateSurfaceError
            If a triangle of a surface has no area.
        """

    @abstractmethod
    def squared_norms_and_slopes(
        self, vectors: ndarray, surfaces: ndarray
    ) -> tuple[float, ndarray, ndarray]:
        """Return the sum of the squared norms of deformations, each at its surface, and its slopes.

        Parameters
        ----------
        vectors, surfaces : array, shape (V, n, 3)
            Deformations and surfaces, vertex by vertex.

        Returns
        -------
        value : float
            Infinite where a triangle has no area.
        vector_slopes, surface_slopes : array, shape (V, n, 3)
            Slopes in the deformations and in the surfaces.
        """

    def energy(self, path: ndarray) -> ndarray:
        """Return the energy of paths.

        One path runs in compiled loops, which autograd knows with their gradient; several run by
        the definition.

        Parameters
        ----------
        path : array, shape (..., n_times, V, 3)
            Paths.

        Returns
        -------
        array, shape (...)

        Raises
        ------
        DegenerateSurfaceError
            If a triangle halfway between two surfaces has no area.
        """
        if np.ndim(path) == 3:
            energy = self._compiled_energy(path)
            if np.isfinite(energy):
                return energy
        return super().energy(path)

    @cached_property
    def _compiled_energy(self) -> Callable[[Any], Any]:
        return with_known_gradient(self.energy_and_gradient, super().energy)

    def energy_and_gradient(self, path: ndarray) -> tuple[float, ndarray]:
        """Return the energy of one path and its gradient, in compiled loops.

        Parameters
        ----------
        path : array, shape (n_times, V, 3)
            Path.

        Returns
        -------
        energy : float
            Infinite where a triangle halfway between two surfaces has no area.
        gradient : array, shape (n_times, V, 3)
            Derivatives with respect to all vertices.
        """
        path = self._check_path(self.check_points(path, "path"))
        n_segments = len(path) - 1
        surfaces, steps = by_vertex(0.5 * (path[:-1] + path[1:])), by_vertex(np.diff(path, axis=0))
        value, in_steps, in_surfaces = self.squared_norms_and_slopes(steps, surfaces)
        gradient = np.zeros(path.shape)
        gradient[:-1] = by_vertex(0.5 * in_surfaces - in_steps)
        gradient[1:] += by_vertex(0.5 * in_surfaces + in_steps)
        return n_segments * value, n_segments * gradient

    def covector(self, tangent_vec: ndarray, base_point: ndarray) -> ndarray:
        """Lower the index of tangent vectors, by the sparse matrix where there is one surface.

        Parameters
        ----------
        tangent_vec : array, shape (..., V, 3)
            Deformations.
        base_point : array, shape (..., V, 3)
            Surfaces.

        Returns
        -------
        array, shape (..., V, 3)
        """
        base_point = self.space.check_point(base_point, "base_point")
        if base_point.ndim > 2:
            return super().covector(tangent_vec, base_point)
        vectors = self.space.check_point(tangent_vec, "tangent_vec")
        columns = vectors.reshape(-1, self.space.dim).T
        return (self.metric_matrix(base_point) @ columns).T.reshape(vectors.shape)

    def gram_matrix(self, vectors: ndarray, base_point: ndarray) -> ndarray:
        """Return the inner products of all pairs of deformations, averaged over surfaces.

        Parameters
        ----------
        vectors : array, shape (K, V, 3)
            Deformations.
        base_point : array, shape (V, 3) or (n, V, 3)
            One surface, or several to average over.

        Returns
        -------
        array, shape (K, K)
        """
        flat = self.check_points(vectors, "vectors").reshape(len(vectors), self.space.dim)
        gram = quadratic_form(self.metric_matrix(base_point), flat)
        return 0.5 * (gram + gram.T)

    @cached_property
    def _averages(self) -> sparse.csr_array:
        return corner_averages(self.space.template.faces, self.space.template.n_vertices)
