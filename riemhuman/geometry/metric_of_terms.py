"""The base of metrics on aligned surfaces that are sums of terms."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import cached_property
from typing import Any

import numpy as np
from autograd.tracer import isbox
from numpy import ndarray
from scipy import sparse

from riemhuman.errors import ArgumentError
from riemhuman.geometry.metric import RiemannianMetric
from riemhuman.geometry.template_surfaces import TemplateSurfaces
from riemhuman.kernels.known_gradient import with_known_gradient
from riemhuman.kernels.threads import quadratic_form
from riemhuman.protocols import ExpSolver, GeodesicSolver, LogSolver, TransportSolver
from riemhuman.terms.quadratic import SumOfQuadraticTerms
from riemhuman.terms.sum import SumOfTerms
from riemhuman.terms.term_checks import checked_terms


class MetricOfTerms(RiemannianMetric):
    r"""A metric on aligned surfaces that is a sum of terms.

    Its `driver` runs them: by definition, as a sparse matrix, and in compiled path energies.

    Parameters
    ----------
    space : AlignedSurfaces
        Surfaces over a template.
    terms : sequence of Term or QuadraticTerm
        The terms, at least one; see `riemhuman.terms`.
    geodesic_solver : object, optional
        Strategy for geodesics, which have no closed form.
    exp_solver, log_solver, transport_solver : object, optional
        Strategies for `exp`, `log` and `parallel_transport`, which have none either.

    Raises
    ------
    ArgumentError
        If there is no term, or the fields of one do not have the shape that `Term` says, or those
        of a triangle depend on other triangles.
    ArgumentTypeError
        If something else is found in place of a term.
    """

    space: TemplateSurfaces
    driver: type[SumOfTerms] | type[SumOfQuadraticTerms]
    _sum: SumOfTerms | SumOfQuadraticTerms

    def __init__(
        self,
        space: TemplateSurfaces,
        terms: Sequence[Any],
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
        self.terms = checked_terms(terms, self.driver.term_class)
        self._sum = self.driver(self.terms, space.template)

    def inner_product(
        self, tangent_vec_a: ndarray, tangent_vec_b: ndarray, base_point: ndarray | None = None
    ) -> ndarray:
        """Return the inner product of deformations h and k at surfaces.

        Raises
        ------
        DegenerateSurfaceError
            If a triangle of a surface has no area.
        """
        base_point = self.space.check_tangent_vec(base_point, "base_point")
        h = self.space.check_tangent_vec(tangent_vec_a, "tangent_vec_a")
        k = h
        if tangent_vec_b is not tangent_vec_a:
            k = self.space.check_tangent_vec(tangent_vec_b, "tangent_vec_b")
        return self._sum.inner_product(h, k, base_point)

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
        ArgumentError
            If there is no surface.
        DegenerateSurfaceError
            If a triangle of a surface has no area.
        """
        surfaces = self.space.check_tangent_vec(base_point, "base_point")
        if surfaces.size == 0:
            raise ArgumentError("base_point must hold at least one surface; found none")
        return self._sum.matrix(surfaces.reshape(-1, *self.space.shape))

    def energy(self, path: ndarray) -> ndarray:
        """Return the energy of paths.

        The energy of one path is computed in compiled loops, with a gradient for autograd; that of
        several paths by the definition.

        Raises
        ------
        DegenerateSurfaceError
            If a term needs the area of a triangle that has none.
        """
        path = self._check_path(path)
        if path.ndim == 3:
            energy: Any
            if isbox(path):
                energy = self._compiled_energy(path)
            else:
                energy, _ = self._sum.path_energy(path, gradient=False)
            if np.isfinite(energy):
                return energy
        return super().energy(path)

    @cached_property
    def _compiled_energy(self) -> Callable[[Any], Any]:
        # Once: autograd keeps every primitive for good.
        return with_known_gradient(self._sum.path_energy, super().energy)

    def __getstate__(self) -> dict[str, Any]:
        # The primitive is made anew by whoever gets the copy: it knows the metric it was made of.
        return {key: value for key, value in vars(self).items() if key != "_compiled_energy"}

    def energy_and_gradient(self, path: ndarray) -> tuple[float, ndarray]:
        """Return the energy of one path and its gradient, in compiled loops.

        Returns
        -------
        energy : float
            Infinite where a term needs the area of a triangle that has none.
        gradient : array, shape (n_times, V, 3)
            Derivatives with respect to all vertices.
        """
        return self._sum.path_energy(self._check_path(path, batched=False))

    def covector(self, tangent_vec: ndarray, base_point: ndarray) -> ndarray:
        """Lower the index of tangent vectors."""
        vectors = self.space.check_tangent_vec(tangent_vec)
        surfaces = self.space.check_tangent_vec(base_point, "base_point")
        if surfaces.ndim == 2:
            columns = vectors.reshape(-1, self.space.dim).T
            return (self.metric_matrix(surfaces) @ columns).T.reshape(vectors.shape)
        return self._one_by_one(lambda f, h: self.covector(h, f), surfaces, vectors)

    def gram_matrix(self, vectors: ndarray, base_point: ndarray) -> ndarray:
        """Return the inner products of all pairs of deformations, averaged over surfaces."""
        flat = self.check_points(vectors, "vectors").reshape(len(vectors), self.space.dim)
        gram = quadratic_form(self.metric_matrix(base_point), flat)
        return 0.5 * (gram + gram.T)
