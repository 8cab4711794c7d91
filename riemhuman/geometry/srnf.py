"""The metric of square root normal fields, which the paper compares with."""

from __future__ import annotations

from typing import TYPE_CHECKING

from riemhuman.geometry.surface_metric import SurfaceMetric
from riemhuman.protocols import ExpSolver, GeodesicSolver, LogSolver, TransportSolver
from riemhuman.terms.root_normals import RootNormalTerm

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
    exp_solver, log_solver, transport_solver : object, optional
        Strategies for `exp`, `log` and `parallel_transport`, which have none either.

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
        space: AlignedSurfaces,
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
