"""Sobolev metrics of first and second order on surfaces."""

from __future__ import annotations

import numpy as np

from riemhuman.checks import metric_weight
from riemhuman.errors import ArgumentError
from riemhuman.geometry.midpoint_metric import MidpointMetric
from riemhuman.geometry.template_surfaces import TemplateSurfaces
from riemhuman.protocols import ExpSolver, GeodesicSolver, LogSolver, TransportSolver
from riemhuman.terms.first_order import FirstOrderTerm, FirstOrderWeights
from riemhuman.terms.quadratic import QuadraticTerm
from riemhuman.terms.second_order import SecondOrderTerm
from riemhuman.terms.zeroth_order import ZerothOrderTerm

_KEPT = {"a1": "keep all angles", "b1": "keep all areas", "c1": "keep all normals"}


class SobolevMetric(MidpointMetric):
    r"""The six-parameter family of H² metrics, with areas of the moving surface.

    .. math:: G_f(h, h) = \int a_0 |h|^2 + a_1 |dh_m|^2 + b_1 |dh_+|^2 + c_1 |dh_\perp|^2
              + d_1 |dh_0|^2 + a_2 |\Delta h|^2 \, dA

    The first-order parts are the change of angles, of area, of the normal, and the turn within the
    tangent plane, see `riemhuman.terms.first_order`; Δ is the cotangent Laplacian, see
    `riemhuman.terms.second_order`. The weights are those of Hartman, Sukurdeep, Klassen, Charon and
    Bauer, "Elastic shape analysis of surfaces with second-order Sobolev metrics", International
    Journal of Computer Vision 131, 2023. There is no closed-form distance: squared distances are
    energies of the paths that `geodesic_solver` finds.

    Parameters
    ----------
    space : AlignedSurfaces
        Surfaces over a template. Their triangles must have an area.
    a0, a1, b1, c1, d1, a2 : float
        Weights, at least 0. Where a body and its deformation grow s times larger, the cost by a0
        grows s⁴ times, that of the first order s² times, that of a2 not at all.

    Raises
    ------
    ArgumentError
        If a weight is negative, or the metric would be degenerate; or a2 > 0 and more than two
        triangles share an edge.

    Notes
    -----
    Only a0 sees translations: with a0 = 0 they cost nothing. The metric must not be blind to any
    other family of deformations: a0 > 0, or two of a1, b1 and c1, or a2 > 0 on a mesh without
    border. On an open mesh the Laplacian is computed at interior vertices only, so that a2 does not
    see harmonic deformations.

    The midpoint of two surfaces is thinner where triangles turn. The steps of a path should
    therefore turn them only a little, and its energy is neither an upper nor a lower bound of a
    distance.

    With a0 = d1 = a2 = 0 the metric is that of `GeneralElasticMetric` with a = a1/4, b = b1/8 and
    c = c1.

    Examples
    --------
    >>> import riemhuman as rh
    >>> bodies = rh.datasets.load_open_bodies("coarse")
    >>> space = rh.AlignedSurfaces(bodies.template)
    >>> metric = rh.SobolevMetric(space, a1=1.0, b1=1.0, c1=1.0, a2=1e-4)
    >>> path = rh.solvers.LinearPath(n_nodes=3).solve(metric, bodies[0], bodies[2]).path
    >>> bool(metric.energy(path) > 0)
    True
    """

    def __init__(
        self,
        space: TemplateSurfaces,
        a0: float = 0.0,
        a1: float = 1.0,
        b1: float = 1.0,
        c1: float = 1.0,
        d1: float = 0.0,
        a2: float = 0.0,
        geodesic_solver: GeodesicSolver | None = None,
        *,
        exp_solver: ExpSolver | None = None,
        log_solver: LogSolver | None = None,
        transport_solver: TransportSolver | None = None,
    ) -> None:
        given = {"a0": a0, "a1": a1, "b1": b1, "c1": c1, "d1": d1, "a2": a2}
        self._weights = {name: metric_weight(value, name) for name, value in given.items()}
        first = FirstOrderWeights(self.a1, self.b1, self.c1, self.d1)
        terms: list[QuadraticTerm] = []
        if any(first):
            terms.append(FirstOrderTerm(space.template, first))
        if self.a0 > 0:
            terms.append(ZerothOrderTerm(space.template, self.a0))
        closed = False
        if self.a2 > 0:
            second = SecondOrderTerm(space.template, self.a2)
            used = np.unique(space.template.faces)
            closed = bool(second.surrounded[used].all())
            terms.append(second)
        seen = [name for name in _KEPT if self._weights[name] > 0]
        if self.a0 == 0 and len(seen) < 2 and not closed:
            raise ArgumentError(self._degenerate(seen))
        super().__init__(
            space,
            terms,
            geodesic_solver,
            exp_solver=exp_solver,
            log_solver=log_solver,
            transport_solver=transport_solver,
        )

    def _degenerate(self, seen: list[str]) -> str:
        """Return why the metric would be degenerate, with what it would not see."""
        kept = [_KEPT[name] for name in seen]
        kept += ["do not turn within the tangent plane"] if self.d1 > 0 else []
        kept += ["are harmonic inside"] if self.a2 > 0 else []
        blind = f"deformations that {' and '.join(kept)}" if kept else "all deformations"
        found = ", ".join(f"{name} = {value:g}" for name, value in self._weights.items())
        return (
            f"the metric would be degenerate: {blind} would cost nothing (found {found}); let a0, "
            "or two of a1, b1 and c1, or on a mesh without border a2, be above 0"
        )

    @property
    def a0(self) -> float:
        """The weight of ‖h‖²."""
        return self._weights["a0"]

    @property
    def a1(self) -> float:
        """The weight of changes of angles."""
        return self._weights["a1"]

    @property
    def b1(self) -> float:
        """The weight of changes of area."""
        return self._weights["b1"]

    @property
    def c1(self) -> float:
        """The weight of changes of the normals."""
        return self._weights["c1"]

    @property
    def d1(self) -> float:
        """The weight of turns within the tangent plane."""
        return self._weights["d1"]

    @property
    def a2(self) -> float:
        """The weight of ‖Δh‖²."""
        return self._weights["a2"]
