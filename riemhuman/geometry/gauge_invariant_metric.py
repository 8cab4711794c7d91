"""Metrics of the normal part of deformations, which do not see a surface slide along itself."""

from __future__ import annotations

import numpy as np

from riemhuman.errors import ArgumentTypeError
from riemhuman.geometry.midpoint_metric import MidpointMetric
from riemhuman.geometry.sobolev_metric import SobolevMetric
from riemhuman.geometry.surface_metric import SurfaceMetric
from riemhuman.kernels.surface import derivatives
from riemhuman.protocols import ExpSolver, GeodesicSolver, LogSolver, TransportSolver
from riemhuman.terms.first_order import FirstOrderTerm, FirstOrderWeights
from riemhuman.terms.normal_projection import NormalPartTerm


class GaugeInvariantMetric(MidpointMetric):
    r"""A first-order metric, applied to the normal part of deformations.

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
        `SobolevMetric` with a0 = a2 = 0, or any sum of isotropic terms.

    Raises
    ------
    ArgumentError
        If the triangles of the template are not consistently oriented.
    ArgumentTypeError
        If the metric is not a first-order metric on surfaces.

    Notes
    -----
    Motions along the surface cost nothing: there is no closed-form distance, the Gram matrix is
    semidefinite, and the surfaces of a path of least energy are free to slide along themselves.
    Unlike G, the metric sees translations.

    Search for paths over smooth deformations, as in the example, and compare energies found over
    the same ones only: the more of them, the lower the energy. Over all vertices a mesh crumples,
    because creases that slide cost little, the energy falls on and on, and a warning says so.

    A motion without stretching, even a translation, costs φ² times the squared curvatures, and
    fingers that move far cost most: the path of least energy swells them as they travel. The metric
    is for surfaces that are near each other, such as bodies in one pose.

    Examples
    --------
    >>> import riemhuman as rh
    >>> bodies = rh.datasets.load_open_bodies("coarse")
    >>> space = rh.AlignedSurfaces(bodies.template)
    >>> metric = rh.GaugeInvariantMetric(rh.ElasticMetric(space, a=1.0, lam=1.0, c=1.0))
    >>> velocity = bodies[10] - bodies[0]
    >>> bool(metric.norm(velocity, bodies[0]) > 0)
    True
    >>> harmonics = rh.DeformationBasis.from_laplacian(bodies.template, n_components=20)
    >>> solver = rh.solvers.BasisPath(harmonics, n_nodes=4)
    >>> solver.solve(metric, bodies[0], bodies[10]).converged
    True
    """

    def __init__(
        self,
        metric: SurfaceMetric | SobolevMetric,
        geodesic_solver: GeodesicSolver | None = None,
        *,
        exp_solver: ExpSolver | None = None,
        log_solver: LogSolver | None = None,
        transport_solver: TransportSolver | None = None,
    ) -> None:
        weights = _first_order_weights(metric)
        if weights is None:
            raise ArgumentTypeError(
                "metric must be a first-order metric on surfaces: ElasticMetric, SRNFMetric, "
                "GeneralElasticMetric, SobolevMetric with a0 = a2 = 0, or a sum of isotropic "
                f"terms; found {type(metric).__name__}"
            )
        template = metric.space.template
        super().__init__(
            metric.space,
            [NormalPartTerm(template, FirstOrderTerm(template, weights))],
            geodesic_solver,
            exp_solver=exp_solver,
            log_solver=log_solver,
            transport_solver=transport_solver,
        )
        self._metric = metric

    @property
    def metric(self) -> SurfaceMetric | SobolevMetric:
        """The metric G of the normal parts."""
        return self._metric


def _first_order_weights(metric: object) -> FirstOrderWeights | None:
    """Return the weights of a metric's first-order parts, or None if it has others."""
    if isinstance(metric, SobolevMetric):
        first, *others = metric.terms
        return first.weights if isinstance(first, FirstOrderTerm) and not others else None
    if not isinstance(metric, SurfaceMetric):
        return None
    template = metric.space.template
    at_rest = derivatives(template.vertices, template.differential_operator)
    forms = {1.0: np.zeros((6, 6)), 0.0: np.zeros((6, 6))}
    for term in metric.terms:
        form = term.form(at_rest)
        if form.ndim > 2 or term.area_power not in forms:
            return None
        forms[term.area_power] += term.weight * form
    return FirstOrderWeights.from_forms(forms[1.0], forms[0.0])
