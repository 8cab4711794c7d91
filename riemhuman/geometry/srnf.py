"""The metric of square root normal fields, which the paper compares with."""

from __future__ import annotations

from typing import TYPE_CHECKING

from numpy import ndarray

from riemhuman.geometry.surface_metric import SurfaceMetric
from riemhuman.geometry.vector_space import FlatMetric, VectorSpace
from riemhuman.kernels.sketches import patch_coordinates, triangle_patches
from riemhuman.protocols import ExpSolver, GeodesicSolver, LogSolver

if TYPE_CHECKING:
    from riemhuman.geometry.aligned_surfaces import AlignedSurfaces


class SRNFMetric(SurfaceMetric):
    r"""The pull-back of the L² metric by the square root normal field :math:`q = \sqrt{A}\,n`.

    Section 5.2 of the paper; distances do not depend on the template.

    Parameters
    ----------
    space : AlignedSurfaces
        Surfaces over a template.
    geodesic_solver : object, optional
        Strategy for geodesics, which have no closed form.
    exp_solver, log_solver : object, optional
        Strategies for `exp` and `log`, which have none either.
    """

    space: AlignedSurfaces

    def __init__(
        self,
        space: AlignedSurfaces,
        geodesic_solver: GeodesicSolver | None = None,
        *,
        exp_solver: ExpSolver | None = None,
        log_solver: LogSolver | None = None,
    ) -> None:
        template = space.template
        fields = VectorSpace((template.n_faces, 3))
        fields.equip_with_metric(FlatMetric, weights=template.face_areas)
        super().__init__(
            space,
            fields.metric,
            space.square_root_normals,
            geodesic_solver,
            exp_solver=exp_solver,
            log_solver=log_solver,
        )

    def lower_bound_coordinates(self, points: ndarray, n_patches: int | None = None) -> ndarray:
        """Return coordinates whose Euclidean distances are at most those of the metric.

        See `riemhuman.kernels.sketches`.

        Parameters
        ----------
        points : array, shape (..., V, 3)
            Surfaces.
        n_patches : int, optional
            Number of patches of triangles to average over; by default there is no averaging, and
            the distances are those of the metric.

        Returns
        -------
        array, shape (..., m)
        """
        template, patches = self.space.template, None
        if n_patches is not None:
            patches = triangle_patches(template.vertices, template.faces, n_patches)
        fields = self.space.square_root_normals(points)
        return patch_coordinates(fields, template.face_areas, patches)

    @property
    def _weights(self) -> dict[str, float]:
        return {"b": 1.0}
