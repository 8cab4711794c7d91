"""Metrics given by their inner product alone: Sobolev metrics and gauge-invariant ones."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Unpack

import numpy as np

from riemhuman.checks import checked, metric_weight
from riemhuman.errors import ArgumentError, ArgumentTypeError
from riemhuman.geometry.manifold import SurfaceSpace, surface_space
from riemhuman.geometry.strategies import Solvers
from riemhuman.geometry.surface_metric import MetricOfTerms, SurfaceMetric
from riemhuman.kernels.surface import derivatives
from riemhuman.terms._quadratic import (
    FirstOrderTerm,
    FirstOrderWeights,
    NormalPartTerm,
    QuadraticTerm,
    SecondOrderTerm,
    ZerothOrderTerm,
)
from riemhuman.terms._sums import SumOfQuadraticTerms
from riemhuman.terms._term_checks import checked_terms


class MidpointMetric(MetricOfTerms):
    r"""A sum of terms given by their inner products, without a closed-form distance.

    The energy of a path is :math:`n \sum_i G_{(f_i + f_{i+1})/2}(f_{i+1} - f_i, f_{i+1} - f_i)`, of
    second order in the time step.
    """

    terms: tuple[QuadraticTerm, ...]
    _sum: SumOfQuadraticTerms

    def __init__(
        self, space: SurfaceSpace, terms: Sequence[QuadraticTerm], **solvers: Unpack[Solvers]
    ) -> None:
        super().__init__(space, **solvers)
        self.terms = checked_terms(terms, QuadraticTerm)
        self._sum = SumOfQuadraticTerms(self.terms, space.template)

    # Properties, which attributes of subclasses replace, as those of the base class.

    @property
    def is_translation_invariant(self) -> bool:  # type: ignore[override]  # read only
        return all(term.is_translation_invariant for term in self.terms)

    @property
    def is_reparametrization_invariant(self) -> bool:  # type: ignore[override]  # read only
        return all(term.is_reparametrization_invariant for term in self.terms)


class SobolevMetric(MidpointMetric):
    r"""The six-parameter family of H² metrics, integrated over the moving surface.

    .. math:: \begin{split} G_f(h, h) = \int & a_0 |h|^2 + a_1 |dh_m|^2 + b_1 |dh_+|^2 \\
              & + c_1 |dh_\perp|^2 + d_1 |dh_0|^2 + a_2 |\Delta h|^2 \, dA \end{split}

    The first-order parts are the change of angles, of area, of the normal, and the rotation within
    the tangent plane; Δ is the cotangent Laplacian. The weights are those of Hartman, Sukurdeep,
    Klassen, Charon and Bauer, "Elastic shape analysis of surfaces with second-order Sobolev
    metrics", International Journal of Computer Vision 131, 2023.

    Parameters
    ----------
    space : AlignedSurfaces
    a0, a1, b1, c1, d1, a2 : float
        Weights, at least 0. If a body and its deformation are scaled by s, the term of a0 grows by
        s⁴, the first-order terms grow by s², and the term of a2 does not change.
    **solvers : strategies, see `RiemannianMetric`

    Notes
    -----
    With a0 = 0, translations cost nothing. All other deformations must cost something: this needs
    a0 > 0, or two of a1, b1 and c1 above 0, or a2 > 0 on a mesh without boundary. Δ is computed at
    interior vertices. The steps of a path should rotate triangles only a little. With a0 = d1 = a2
    = 0 the metric is that of `GeneralElasticMetric` with a = a1/4, b = b1/8 and c = c1.

    Examples
    --------
    >>> bodies = rh.datasets.load_open_bodies("coarse")
    >>> space = rh.AlignedSurfaces(bodies.template)
    >>> metric = rh.SobolevMetric(space, a1=1.0, b1=1.0, c1=1.0, a2=1e-4)
    >>> bool(metric.energy(bodies[:3]) > 0)
    True
    """

    @checked(
        a0=metric_weight,
        a1=metric_weight,
        b1=metric_weight,
        c1=metric_weight,
        d1=metric_weight,
        a2=metric_weight,
    )
    def __init__(
        self,
        space: SurfaceSpace,
        a0: float = 0.0,
        a1: float = 1.0,
        b1: float = 1.0,
        c1: float = 1.0,
        d1: float = 0.0,
        a2: float = 0.0,
        **solvers: Unpack[Solvers],
    ) -> None:
        space = surface_space(space)
        self.a0, self.a1, self.b1, self.c1, self.d1, self.a2 = a0, a1, b1, c1, d1, a2
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
        if self.a0 == 0 and sum(weight > 0 for weight in first[:3]) < 2 and not closed:
            raise ArgumentError(
                "a0 must be above 0, or two of a1, b1 and c1, or (on a mesh without boundary) "
                "a2; otherwise some deformations would cost nothing; found "
                f"a0 = {a0:g}, a1 = {a1:g}, b1 = {b1:g}, c1 = {c1:g}, d1 = {d1:g}, a2 = {a2:g}"
            )
        super().__init__(space, terms, **solvers)


class GaugeInvariantMetric(MidpointMetric):
    r"""A first-order metric, applied to the normal part of deformations.

    .. math:: ((h, k))_f = G_f(P_f h, P_f k), \qquad P_f = n n^\top

    with normals at the vertices. For φ = ⟨h, n⟩ and the principal curvatures κ, the metric
    :math:`\int a\operatorname{tr}A_0^2 + b(\operatorname{tr}A)^2 + c|\delta n|^2\, dA` becomes

    .. math:: \begin{split} \int & 2a\varphi^2(\kappa_1 - \kappa_2)^2 \\
              & + 4b\varphi^2(\kappa_1 + \kappa_2)^2 + c|\nabla\varphi|^2\, dA \end{split}

    (Tumpach, Drira, Daoudi, Srivastava, "Gauge invariant framework for shape analysis of surfaces",
    IEEE Transactions on Pattern Analysis and Machine Intelligence 38(1), 2016), with no estimate of
    curvatures.

    Parameters
    ----------
    metric : RiemannianMetric
        A first-order metric G on surfaces: `ElasticMetric`, `SRNFMetric`, `GeneralElasticMetric`,
        `SobolevMetric` with a0 = a2 = 0, or any sum of isotropic terms.
    **solvers : strategies, see `RiemannianMetric`

    Notes
    -----
    Motions along the surface cost nothing, up to discretisation, and the Gram matrix is
    semidefinite. Motions without stretching, even translations, cost φ² times squared curvatures,
    so the metric is for surfaces near each other, such as bodies in the same pose. Search for paths
    over smooth deformations, as in the example; if all vertices are free, meshes crumple.

    Examples
    --------
    >>> bodies = rh.datasets.load_open_bodies("coarse")
    >>> space = rh.AlignedSurfaces(bodies.template)
    >>> metric = rh.GaugeInvariantMetric(rh.ElasticMetric(space, a=1.0, lam=1.0, c=1.0))
    >>> harmonics = rh.DeformationBasis.from_laplacian(bodies.template, n_components=20)
    >>> solver = rh.solvers.BasisPath(harmonics, n_nodes=4)
    >>> solver.solve(metric, bodies[0], bodies[10]).converged
    True
    """

    def __init__(
        self,
        metric: SurfaceMetric | SobolevMetric,
        **solvers: Unpack[Solvers],
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
            metric.space, [NormalPartTerm(template, FirstOrderTerm(template, weights))], **solvers
        )
        self.metric = metric


def _first_order_weights(metric: object) -> FirstOrderWeights | None:
    """Return the weights of a metric's first-order parts, or None if it has others."""
    if isinstance(metric, SobolevMetric):
        first = metric.terms[0]
        is_alone = len(metric.terms) == 1
        return first.weights if is_alone and isinstance(first, FirstOrderTerm) else None
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
