"""Metrics that see what moves a surface out of itself, and not how it slides along itself."""

from __future__ import annotations

from typing import Protocol, runtime_checkable

import numpy as np
from numpy import ndarray
from scipy import sparse

from riemhuman.errors import ArgumentTypeError
from riemhuman.geometry.aligned_surfaces import AlignedSurfaces
from riemhuman.geometry.midpoint_metric import MidpointMetric
from riemhuman.protocols import ExpSolver, GeodesicSolver, LogSolver
from riemhuman.terms import first_order, normal_projection
from riemhuman.terms.first_order import FirstOrderWeights
from riemhuman.terms.normal_projection import NormalProjections


@runtime_checkable
class FirstOrderMetric(Protocol):
    """A metric on surfaces that is a weighted sum of the parts of `riemhuman.terms.first_order`."""

    space: AlignedSurfaces

    @property
    def first_order_weights(self) -> FirstOrderWeights | None:
        """Weights of the parts; None where the metric has others besides."""


class GaugeInvariantMetric(MidpointMetric):
    r"""A first-order metric of the part of a deformation along the normals.

    .. math:: ((h, k))_f = G_f(P_f h, P_f k), \qquad P_f = n n^\top

    with normals at the vertices, see `riemhuman.terms.normal_projection`. For φ = ⟨h, n⟩ and the
    principal curvatures κ, the metric :math:`\int a\operatorname{tr}A_0^2
    + b(\operatorname{tr}A)^2 + c|\delta n|^2\, dA` becomes

    .. math:: \int 2a\varphi^2(\kappa_1 - \kappa_2)^2 + 4b\varphi^2(\kappa_1 + \kappa_2)^2
              + c|\nabla\varphi|^2\, dA

    (Tumpach, Drira, Daoudi, Srivastava, "Gauge invariant framework for shape analysis of surfaces",
    IEEE Transactions on Pattern Analysis and Machine Intelligence 38(1), 2016), with no estimate of
    curvatures. The energy of a path stays the same, up to discretisation, when its surfaces are
    registered anew along themselves.

    Parameters
    ----------
    metric : RiemannianMetric
        A first-order metric G on surfaces: `ElasticMetric`, `SRNFMetric`, `GeneralElasticMetric`,
        or `SobolevMetric` with a0 = a2 = 0.
    geodesic_solver : object, optional
        Strategy for geodesics.
    exp_solver, log_solver : object, optional
        Strategies for `exp` and `log`.

    Raises
    ------
    ArgumentTypeError
        If the metric is no first-order metric on surfaces.

    Notes
    -----
    Motions along the surface cost nothing: there is no closed-form distance, the Gram matrix is
    semidefinite, and the surfaces of a path of least energy are free to slide along themselves.
    Unlike G, the metric sees translations. Triangles of the template must be oriented alike.
    """

    def __init__(
        self,
        metric: FirstOrderMetric,
        geodesic_solver: GeodesicSolver | None = None,
        *,
        exp_solver: ExpSolver | None = None,
        log_solver: LogSolver | None = None,
    ) -> None:
        weights = metric.first_order_weights if isinstance(metric, FirstOrderMetric) else None
        if weights is None:
            raise ArgumentTypeError(
                "metric must be a first-order metric on surfaces: ElasticMetric, SRNFMetric, "
                "GeneralElasticMetric, or SobolevMetric with a0 = a2 = 0; found "
                f"{type(metric).__name__}"
                + (" with other terms" if isinstance(metric, FirstOrderMetric) else "")
            )
        space = metric.space
        super().__init__(space, geodesic_solver, exp_solver=exp_solver, log_solver=log_solver)
        self._metric, self._weights = metric, weights

    @property
    def metric(self) -> FirstOrderMetric:
        """The metric G of the normal parts."""
        return self._metric

    def inner_product(
        self, tangent_vec_a: ndarray, tangent_vec_b: ndarray, base_point: ndarray
    ) -> ndarray:
        """Return the inner product of the normal parts of deformations.

        Parameters
        ----------
        tangent_vec_a, tangent_vec_b : array, shape (..., V, 3)
            Deformations h and k.
        base_point : array, shape (..., V, 3)
            Surfaces f.

        Returns
        -------
        array, shape (...)

        Raises
        ------
        DegenerateSurfaceError
            If a triangle of a surface has no area, or the normals around a vertex cancel.
        """
        f = self.space.check_immersed(base_point, "base_point")
        h = self.space.check_point(tangent_vec_a, "tangent_vec_a")
        over = self.space.template.differential_operator, self.space.template.face_areas
        normal_h = normal_projection.project(h, f, *over, self._averages)
        normal_k = normal_h
        if tangent_vec_b is not tangent_vec_a:
            k = self.space.check_point(tangent_vec_b, "tangent_vec_b")
            normal_k = normal_projection.project(k, f, *over, self._averages)
        return first_order.inner_product(normal_h, normal_k, f, self._weights, *over)

    def metric_matrix(self, base_point: ndarray) -> sparse.csr_array:
        """Return the sparse matrix P M P of the metric, vertices flattened.

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
            If a triangle of a surface has no area, or the normals around a vertex cancel.
        """
        surfaces = self.space.check_point(base_point, "base_point").reshape(-1, *self.space.shape)
        template = self.space.template
        over = template.differential_operator, template.face_areas
        total = sparse.csr_array((self.space.dim, self.space.dim))
        for f in surfaces:
            self.space.check_immersed(f, "base_point")
            blocks = np.zeros((template.n_faces, 9, 9))
            first_order.add_blocks(blocks, f, template.faces, template.face_areas, self._weights)
            normals = normal_projection.vertex_normals(f, *over, self._averages)
            projection = normal_projection.matrix(normals)
            total = total + projection @ template.assembler.assemble(blocks) @ projection
        return total / len(surfaces)

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
            Infinite where a triangle has no area, or the normals around a vertex cancel.
        vector_slopes, surface_slopes : array, shape (V, n, 3)
            Slopes in the deformations and in the surfaces.
        """
        template = self.space.template
        projections = NormalProjections(surfaces, template.faces)
        value, in_normal_parts, in_surfaces = first_order.squared_norms_and_slopes(
            projections.project(vectors),
            surfaces,
            template.faces,
            template.face_areas,
            self._weights,
        )
        in_vectors, through_normals = projections.slopes(vectors, in_normal_parts)
        return value if projections.exist else np.inf, in_vectors, in_surfaces + through_normals
