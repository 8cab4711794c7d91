"""The metric of square root normal fields, which the paper compares with."""

from __future__ import annotations

from typing import TYPE_CHECKING

from riemhuman.geometry.metric import GeodesicSolver
from riemhuman.geometry.surface_metric import SurfaceMetric
from riemhuman.geometry.vector_space import FlatMetric, VectorSpace

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
    """

    space: AlignedSurfaces

    def __init__(
        self, space: AlignedSurfaces, geodesic_solver: GeodesicSolver | None = None
    ) -> None:
        template = space.template
        fields = VectorSpace((template.n_faces, 3))
        fields.equip_with_metric(FlatMetric, weights=template.face_areas)
        super().__init__(space, fields.metric, space.square_root_normals, geodesic_solver)

    @property
    def _weights(self) -> dict[str, float]:
        return {"b": 1.0}
