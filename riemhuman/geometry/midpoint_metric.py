"""Metrics on surfaces by their inner product alone, with path energies in compiled loops."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
from autograd.tracer import isbox
from numpy import ndarray
from scipy import sparse

from riemhuman.geometry.metric import RiemannianMetric
from riemhuman.kernels.drift import still_path
from riemhuman.kernels.known_gradient import with_known_gradient
from riemhuman.kernels.moving_frames import by_vertex
from riemhuman.kernels.threads import quadratic_form
from riemhuman.protocols import ExpSolver, GeodesicSolver, LogSolver, TransportSolver
from riemhuman.terms.quadratic import QuadraticTerm

if TYPE_CHECKING:
    from riemhuman.geometry.aligned_surfaces import AlignedSurfaces


class MidpointMetric(RiemannianMetric):
    r"""A sum of terms given by their inner products, without a closed-form distance.

    The energy of a path is :math:`n \sum_i G_{(f_i + f_{i+1})/2}(f_{i+1} - f_i, f_{i+1} - f_i)`, of
    second order in the time step.

    Parameters
    ----------
    space : AlignedSurfaces
        Surfaces over a template.
    terms : sequence of QuadraticTerm
        The terms, see `riemhuman.terms.quadratic`.
    geodesic_solver : object, optional
        Strategy for geodesics.
    exp_solver, log_solver, transport_solver : object, optional
        Strategies for `exp`, `log` and `parallel_transport`.
    """

    space: AlignedSurfaces

    def __init__(
        self,
        space: AlignedSurfaces,
        terms: Sequence[QuadraticTerm],
        geodesic_solver: GeodesicSolver | None = None,
        *,
        exp_solver: ExpSolver | None = None,
        log_solver: LogSolver | None = None,
        transport_solver: TransportSolver | None = None,
    ) -> None:
        super().__init__(
            space,
            geodesic_solver,
            exp_solver=exp_solver,
            log_solver=log_solver,
            transport_solver=transport_solver,
        )
        self.terms = tuple(terms)

    def inner_product(
        self, tangent_vec_a: ndarray, tangent_vec_b: ndarray, base_point: ndarray | None = None
    ) -> ndarray:
        f = self.space.check_immersed(base_point, "base_point")
        h = self.space.check_tangent_vec(tangent_vec_a, "tangent_vec_a")
        k = h
        if tangent_vec_b is not tangent_vec_a:
            k = self.space.check_tangent_vec(tangent_vec_b, "tangent_vec_b")
        total: Any = 0.0
        for term in self.terms:
            total = total + term.inner_product(h, k, f)
        return total

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
        surfaces = self.space.check_immersed(base_point, "base_point")
        surfaces = surfaces.reshape(-1, *self.space.shape)
        total = sparse.csr_array((self.space.dim, self.space.dim))
        for f in surfaces:
            for term in self.terms:
                total = total + term.matrix(f)
        return total / len(surfaces)

    def energy(self, path: ndarray) -> ndarray:
        """Return the energy of paths.

        One path runs in compiled loops, which autograd knows with their gradient; several run by
        the definition.

        Raises
        ------
        DegenerateSurfaceError
            If a triangle halfway between two surfaces has no area.
        """
        path = self._check_path(path)
        if path.ndim == 3:
            traced = isbox(path)
            energy: Any = self._compiled_energy(path) if traced else self._energy(path)[0]
            if np.isfinite(energy):
                return energy
        return super().energy(path)

    @cached_property
    def _compiled_energy(self) -> Callable[[Any], Any]:
        # Once: autograd keeps every primitive for good.
        return with_known_gradient(self._energy, super().energy)

    def __getstate__(self) -> dict[str, Any]:
        # The primitive is made anew by whoever gets the copy: it knows the metric it was made of.
        return {key: value for key, value in vars(self).items() if key != "_compiled_energy"}

    def energy_and_gradient(self, path: ndarray) -> tuple[float, ndarray]:
        """Return the energy of one path and its gradient, in compiled loops.

        Returns
        -------
        energy : float
            Infinite where a triangle halfway between two surfaces has no area.
        gradient : array, shape (n_times, V, 3)
            Derivatives with respect to all vertices.
        """
        return self._energy(self._check_path(path, batched=False))

    def _energy(self, path: ndarray) -> tuple[float, ndarray]:
        n_segments = len(path) - 1
        surfaces, steps = by_vertex(0.5 * (path[:-1] + path[1:])), by_vertex(np.diff(path, axis=0))
        parts = [term.squared_norms_and_slopes(steps, surfaces) for term in self.terms]
        values, in_steps, in_surfaces = (sum(part) for part in zip(*parts, strict=True))
        gradient = np.zeros(path.shape)
        gradient[:-1] = by_vertex(0.5 * in_surfaces - in_steps)
        gradient[1:] += by_vertex(0.5 * in_surfaces + in_steps)
        return n_segments * float(values), n_segments * gradient

    def remove_drift(self, path: ndarray) -> ndarray:
        """Take translations out of a path, where no term sees them.

        Returns
        -------
        array, shape (n_times, V, 3)
            A path of the same energy with the same ends.
        """
        path = self.check_points(path, "path")
        if any(term.sees_translations for term in self.terms):
            return path
        return still_path(path, self.space.template.vertex_areas, rotations=False)

    def covector(self, tangent_vec: ndarray, base_point: ndarray) -> ndarray:
        vectors = self.space.check_tangent_vec(tangent_vec)
        surfaces = self.space.check_point(base_point, "base_point")
        if surfaces.ndim == 2:
            columns = vectors.reshape(-1, self.space.dim).T
            return (self.metric_matrix(surfaces) @ columns).T.reshape(vectors.shape)
        return self._one_by_one(lambda f, h: self.covector(h, f), surfaces, vectors)

    def gram_matrix(self, vectors: ndarray, base_point: ndarray) -> ndarray:
        flat = self.check_points(vectors, "vectors").reshape(len(vectors), self.space.dim)
        gram = quadratic_form(self.metric_matrix(base_point), flat)
        return 0.5 * (gram + gram.T)
