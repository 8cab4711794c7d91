"""The metric of square root normal fields, which the paper compares with."""

from __future__ import annotations

from riemhuman.geometry.surface_metric import SurfaceMetric
from riemhuman.geometry.template_surfaces import TemplateSurfaces
from riemhuman.protocols import ExpSolver, GeodesicSolver, LogSolver, TransportSolver
from riemhuman.terms.root_normals import RootNormalTerm


class SRNFMetric(SurfaceMetric):
    r"""The pull-back of the L² metric by the square root normal field :math:`q = \sqrt{A}\,n`.

    Section 5.2 of the paper; distances do not depend on the template.

    Examples
    --------
    >>> import riemhuman as rh
    >>> bodies = rh.datasets.load_open_bodies("coarse")
    >>> space = rh.AlignedSurfaces(bodies.template)
    >>> metric = rh.SRNFMetric(space)
    >>> bool(metric.dist(bodies[3], bodies[13]) < metric.dist(bodies[3], bodies[4]))
    True
    """

    def __init__(
        self,
        space: TemplateSurfaces,
        geodesic_solver: GeodesicSolver | None = None,
        *,
        exp_solver: ExpSolver | None = None,
        log_solver: LogSolver | None = None,
        transport_solver: TransportSolver | None = None,
    ) -> None:
        super().__init__(
            space,
            [RootNormalTerm()],
            geodesic_solver,
            exp_solver=exp_solver,
            log_solver=log_solver,
            transport_solver=transport_solver,
        )
