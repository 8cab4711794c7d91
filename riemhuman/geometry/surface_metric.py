"""Metrics on aligned surfaces that are sums of terms, first of all the paper's family."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property
from typing import Unpack, cast

import autograd.numpy as np
from autograd.tracer import isbox
from scipy import sparse

from riemhuman.arrays import Array, Fields, Points, TangentVectors
from riemhuman.checks import (
    checked,
    joint_shape,
    metric_weight,
    path_array,
    positive,
)
from riemhuman.errors import ArgumentError
from riemhuman.geometry.fields import (
    EbinMetric,
    GeneralElasticFieldMetric,
    MetricFields,
    NormalFields,
)
from riemhuman.geometry.manifold import Manifold, SurfaceSpace
from riemhuman.geometry.metric import POINT, POINTS, RiemannianMetric
from riemhuman.geometry.pairwise import Bulk
from riemhuman.geometry.product import ProductManifold, ProductMetric
from riemhuman.geometry.strategies import Solvers
from riemhuman.geometry.vector_space import FlatMetric, VectorSpace
from riemhuman.kernels import surface
from riemhuman.kernels.projections import field_coordinates
from riemhuman.kernels.threads import quadratic_form
from riemhuman.surfaces.template import Template
from riemhuman.terms._quadratic import QuadraticTerm
from riemhuman.terms._sums import SumOfTerms, SumOnSurfaces
from riemhuman.terms._term_checks import checked_terms
from riemhuman.terms.cone import ConeTerm, EbinTerm
from riemhuman.terms.flat import RootNormalTerm
from riemhuman.terms.normals import NormalTerm
from riemhuman.terms.term import Term


class MetricOfTerms(RiemannianMetric):
    """A metric on aligned surfaces that is a sum of terms.

    Subclasses set the terms, their sum, and which motions of surfaces it ignores.
    """

    space: SurfaceSpace
    terms: tuple[Term, ...] | tuple[QuadraticTerm, ...]
    _sum: SumOnSurfaces

    @property
    def is_stretch_invariant(self) -> bool:  # type: ignore[override]  # read only
        return all(term.is_stretch_invariant for term in self.terms)

    def inner_product(
        self,
        tangent_vec_a: TangentVectors,
        tangent_vec_b: TangentVectors,
        base_point: Points | None = None,
    ) -> Array:
        # Surfaces of any scale and resolution, whose areas are within double precision.
        base_point = self.space.check_tangent_vec(base_point, "base_point")
        h = self.space.check_tangent_vec(tangent_vec_a, "tangent_vec_a")
        k = h
        if tangent_vec_b is not tangent_vec_a:
            k = self.space.check_tangent_vec(tangent_vec_b, "tangent_vec_b")
        joint_shape(tangent_vec_a=h, tangent_vec_b=k, base_point=base_point)
        return self._sum.inner_product(h, k, base_point)

    def metric_matrix(self, base_point: Points) -> sparse.csr_array:
        surfaces = self.space.check_tangent_vec(base_point, "base_point")
        if surfaces.size == 0:
            raise ArgumentError("base_point must hold at least one surface; found none")
        return self._sum.matrix(surfaces.reshape(-1, *self.space.shape))

    def energy(self, path: Points) -> Array:
        path = path_array(path, self.space)
        if path.ndim == 3 and not isbox(path):
            energy, _ = self._sum.path_energy(path, gradient=False)
            if np.isfinite(energy):
                return energy  # type: ignore[return-value]  # one number
        # The definition also takes several paths and autograd's, and says which triangle has none.
        return super().energy(path)

    def energy_and_gradient(self, path: Points) -> tuple[float, Array]:
        return self._sum.path_energy(path_array(path, self.space, batched=False))

    def covector(self, tangent_vec: TangentVectors, base_point: Points) -> Array:
        vectors = self.space.check_tangent_vec(tangent_vec)
        surfaces = self.space.check_tangent_vec(base_point, "base_point")
        if surfaces.ndim == 2:
            columns = vectors.reshape(-1, self.space.dim).T
            covectors: Array = self.metric_matrix(surfaces) @ columns
            return covectors.T.reshape(vectors.shape)
        return self._one_by_one(lambda f, h: self.covector(h, f), surfaces, vectors)

    def gram_matrix(self, vectors: TangentVectors, base_point: Points) -> Array:
        flat = self.check_points(vectors, "vectors").reshape(len(vectors), self.space.dim)
        gram: Array = quadratic_form(self.metric_matrix(base_point), flat)
        return 0.5 * (gram + gram.T)


class SurfaceMetric(MetricOfTerms):
    r"""A weighted sum of terms, each of which pulls back a metric on fields of a surface.

    .. math:: d(f_1, f_2)^2 = \sum_k w_k \int_T d_k(\varphi_k(f_1), \varphi_k(f_2))^2\, dx

    `dist` is the distance between the images (equation 4 of the paper). It is a lower bound of the
    length of every path between two surfaces; `length` and `energy` are for paths.

    Parameters
    ----------
    space : AlignedSurfaces
    terms : sequence of Term
        The terms, at least one; see `riemhuman.terms`.
    **solvers : strategies, see `RiemannianMetric`

    Examples
    --------
    >>> bodies = rh.datasets.load_open_bodies("coarse")
    >>> space = rh.AlignedSurfaces(bodies.template)
    >>> terms = [rh.terms.EbinTerm(1.0, lam=1.0), rh.terms.NormalTerm(0.1)]
    >>> bool(rh.SurfaceMetric(space, terms).dist(bodies[0], bodies[1]) > 0)
    True
    """

    is_translation_invariant = True
    terms: tuple[Term, ...]
    _sum: SumOfTerms

    def __init__(
        self, space: SurfaceSpace, terms: Sequence[Term], **solvers: Unpack[Solvers]
    ) -> None:
        super().__init__(space, **solvers)
        self.terms = checked_terms(terms, Term)
        self._sum = SumOfTerms(self.terms, space.template)

    # Properties, which attributes of subclasses replace, as those of the base class.

    @property
    def is_rotation_invariant(self) -> bool:  # type: ignore[override]  # read only
        return all(term.is_rotation_invariant for term in self.terms)

    @property
    def has_target_metric(self) -> bool:  # type: ignore[override]  # read only
        return all(term.has_target_space for term in self.terms)

    @checked(point_a=POINT, point_b=POINT)
    def squared_dist(self, point_a: Points, point_b: Points) -> Array:
        """Return the sum of the squared distances of fields (equation 5)."""
        if point_a.shape != point_b.shape:
            joint_shape(point_a=point_a, point_b=point_b)
        first_a, first_b = self._derivatives(point_a), self._derivatives(point_b)
        total = np.zeros(())
        for term in self.terms:
            total = total + self._integral(term, term.fields(first_a), term.fields(first_b))
        return total

    @checked(others=POINTS)
    def squared_dists_and_gradient(
        self, point: Points, others: Points, weights: Array
    ) -> tuple[Array, Array]:
        point = self.check_points(point[None], "point")[0]
        return self._sum.squared_dists(point, others, weights)

    @cached_property
    def bulk(self) -> Bulk:
        return self._sum

    @checked(points=POINT)
    def lower_bound_coordinates(self, points: Points) -> Array:
        first = self._derivatives(points)
        sketches = [np.zeros((*points.shape[:-2], 0))]
        for term in self.terms:
            chart = term.chart(term.fields(first))
            if chart is not None:
                chart = np.sqrt(term.weight) * chart
                sketches.append(field_coordinates(chart, self.space.template.face_areas))
        return np.concatenate(sketches, axis=-1)

    @cached_property
    def target_metric(self) -> RiemannianMetric:
        spaces = SpacesOverTemplate(self.space.template)
        # The product checks that all are manifolds with a metric.
        factors = [cast("Manifold", term.target_space(spaces)) for term in self.terms]
        weights = [term.weight for term in self.terms]
        product = ProductManifold(factors).equip_with_metric(ProductMetric, weights=weights)
        if weights == [1.0] and isinstance(factors[0].metric, FlatMetric):
            return factors[0].metric  # a vector space needs no product around it
        return product.metric

    @checked(point=POINT)
    def map(self, point: Points) -> Array:
        first = self._derivatives(point)
        is_flat = isinstance(self.target_metric, FlatMetric)
        points = [term.target_point(first) for term in self.terms]
        if is_flat:
            return points[0]
        # Points of products of products are joined in the same way.
        n_leading = len(np.shape(first.areas)) - 1
        flat = [surface.joined_axes(p, len(np.shape(p)) - n_leading) for p in points]
        return np.concatenate(flat, axis=-1)

    def _derivatives(self, f: Points) -> surface.Derivatives:
        operator = self.space.template.differential_operator
        first = surface.follow_up(*surface.partial_derivatives(f, operator))
        if self._sum.needs_area and first.degenerate.any():
            surface.refuse_degenerate(first.degenerate)
        return first

    def _squared_segments(self, path: Points) -> Array:
        first, batches = self._derivatives(path), (slice(None),) * (path.ndim - 3)
        before, after = (*batches, slice(None, -1)), (*batches, slice(1, None))
        total = np.zeros(())
        for term in self.terms:
            fields = term.fields(first)
            starts = tuple(field[before] for field in fields)
            ends = tuple(field[after] for field in fields)
            total = total + self._integral(term, starts, ends)
        return total

    def _integral(self, term: Term, fields_a: Fields, fields_b: Fields) -> Array:
        """Return w ∫ d² dx of one term."""
        values = term.squared_dist(fields_a, fields_b) * self._sum.areas
        return term.weight * np.sum(values, axis=-1)


class SpacesOverTemplate:
    """The spaces that a term may choose from in `Term.target_space`, over one template."""

    def __init__(self, template: Template) -> None:
        self.template = template

    def metric_fields(self, lam: float) -> Manifold:
        return MetricFields(self.template).equip_with_metric(EbinMetric, lam=lam)

    def normal_fields(self) -> Manifold:
        return NormalFields(self.template)

    def metric_and_normal_fields(self, a: float, b: float, c: float) -> Manifold:
        product = ProductManifold([MetricFields(self.template), NormalFields(self.template)])
        return product.equip_with_metric(GeneralElasticFieldMetric, a=a, b=b, c=c)

    def vector_fields(self, n_features: int) -> Manifold:
        space = VectorSpace((self.template.n_faces, n_features))
        return space.equip_with_metric(FlatMetric, weights=self.template.face_areas)


class ElasticMetric(SurfaceMetric):
    r"""The pull-back by Φ of a · (Ebin metric) + c · (metric of normal fields).

    .. math:: d(f_1, f_2)^2 = a\, d^\lambda(g_1, g_2)^2 + c\int_T d_{S^2}(n_1, n_2)^2\, dx

    Equations 3 to 5 of the paper. (a, λ, c) = (1, 1e-4, 0) distinguishes people, (0, 0, 1) poses.
    At λ = 1e-4 the distance between metric fields saturates: a triangle counts in full once it is
    stretched 9 % more in one direction than in the perpendicular one. The metric then measures
    roughly the share of the surface that changed, which is smaller between poses of one person than
    between people. Distances at λ = 1 measure how strongly it has changed.

    Parameters
    ----------
    space : AlignedSurfaces
    a : float
        Weight of the change of the first fundamental form, at least 0.
    lam : float
        λ, the weight of changes of area within it; above 0 unless a = 0, where it has no effect.
    c : float
        Weight of the change of the normals, at least 0.
    **solvers : strategies, see `RiemannianMetric`

    Notes
    -----
    Let κ be the largest coordinate divided by the smallest height of a triangle, including those of
    the template. Rounding changes a distance by at most 4κ · 2.2e-16 times the distance that a
    surface covers if all its triangles change by their own size.

    Examples
    --------
    >>> bodies = rh.datasets.load_open_bodies("coarse")
    >>> space = rh.AlignedSurfaces(bodies.template)
    >>> pose = rh.ElasticMetric(space, a=0.0, lam=0.0, c=1.0)
    >>> same_pose, same_person = bodies[13], bodies[4]
    >>> bool(pose.dist(bodies[3], same_pose) < pose.dist(bodies[3], same_person))
    True
    """

    @checked(a=metric_weight, lam=metric_weight, c=metric_weight)
    def __init__(
        self,
        space: SurfaceSpace,
        a: float = 1.0,
        lam: float = 1e-4,
        c: float = 0.0,
        **solvers: Unpack[Solvers],
    ) -> None:
        self.a, self.lam, self.c = a, lam, c
        if self.a == self.c == 0:
            raise ArgumentError("a and c must not both be 0: every distance would be 0")
        if self.a > 0 and self.lam == 0:
            raise ArgumentError(
                "lam must be above 0 if a > 0 (found lam = 0), because the Ebin metric would be "
                "degenerate; for normals alone, use (a, lam, c) = (0, 0, 1)"
            )
        terms: list[Term] = []
        if self.a > 0:
            terms.append(EbinTerm(self.a, self.lam))
        if self.c > 0:
            terms.append(NormalTerm(self.c))
        super().__init__(space, terms, **solvers)

    @property
    def complementary_metric(self) -> ElasticMetric | None:
        if self.a > 0 and self.c > 0:
            return None
        if self.a == 0:
            return ElasticMetric(self.space, a=1.0, lam=1.0, c=0.0)
        return ElasticMetric(self.space, a=0.0, lam=0.0, c=1.0)

    def with_stretching(self, weight: float) -> ElasticMetric:
        if self.a > 0:
            return self
        return ElasticMetric(self.space, a=weight * self.c, lam=1.0, c=self.c)


class GeneralElasticMetric(SurfaceMetric):
    r"""The elastic metric of stretching, growth and bending, weighted by the moving surface.

    .. math:: \begin{split} &\langle h, h\rangle_f = \int_{f(T)} \left(a \operatorname{tr}(A_0^2)
              + b \operatorname{tr}(A)^2 + c\, |\delta n|^2\right) dA_f, \\
              &A = g^{-1}\delta g \end{split}

    with A₀ the traceless part of A (Jermyn, Kurtek, Klassen and Srivastava, "Elastic shape
    matching of parameterized surfaces using square root normal fields", ECCV 2012). On fields
    (g, n) it is the metric of a cone, whose geodesic distance has a closed form:

    .. math:: \begin{split}
              d^2 &= 16 b \int_T \left(s_1^2 + s_2^2 - 2 s_1 s_2 \cos\min(\pi, \psi)\right) dx, \\
              \psi &= \frac{\sqrt{a \operatorname{tr} L_0^2 + c\, \varphi^2}}{4 \sqrt b} \end{split}

    with s the square root of the area ratio, L₀ the traceless part of log(g₁⁻¹g₂) and φ the angle
    of the normals.

    Parameters
    ----------
    space : AlignedSurfaces
    a : float
        Weight of stretching without change of area, at least 0.
    b : float
        Weight of the change of area, above 0.
    c : float
        Weight of bending, the rotation of normals; at least 0.
    **solvers : strategies, see `RiemannianMetric`

    Notes
    -----
    `ElasticMetric` weights the rotation of normals by the area of the template, this metric by that
    of the moving surface. Distances do not depend on the template, and triangles of zero area, at
    the apex of the cone, are allowed. (1, λ, 0) is ElasticMetric(1, λ, 0), and (0, 1/16, 1) is
    `SRNFMetric`. For retrieval, ElasticMetric with (1, 1e-4, 0) or (0, 0, 1) is better.

    Examples
    --------
    >>> bodies = rh.datasets.load_open_bodies("coarse")
    >>> space = rh.AlignedSurfaces(bodies.template)
    >>> metric = rh.GeneralElasticMetric(space, a=1.0, b=1.0, c=0.1)
    >>> bool(metric.dist(bodies[0], bodies[1]) > 0)
    True
    """

    @checked(a=metric_weight, b=positive, c=metric_weight)
    def __init__(
        self,
        space: SurfaceSpace,
        a: float = 1.0,
        b: float = 1.0,
        c: float = 1.0,
        **solvers: Unpack[Solvers],
    ) -> None:
        self.a, self.b, self.c = a, b, c
        # Without normals, fields have their own space, see `MetricFields`.
        ebin = self.a > 0 and self.c == 0
        term = EbinTerm(self.a, self.b / self.a) if ebin else ConeTerm(1.0, a, b, c)
        super().__init__(space, [term], **solvers)


class SRNFMetric(SurfaceMetric):
    r"""The pull-back of the L² metric by the square root normal field :math:`q = \sqrt{A}\,n`.

    Section 5.2 of the paper; distances do not depend on the template.

    Parameters
    ----------
    space : AlignedSurfaces
    **solvers : strategies, see `RiemannianMetric`

    Examples
    --------
    >>> bodies = rh.datasets.load_open_bodies("coarse")
    >>> space = rh.AlignedSurfaces(bodies.template)
    >>> metric = rh.SRNFMetric(space)
    >>> bool(metric.dist(bodies[3], bodies[13]) < metric.dist(bodies[3], bodies[4]))
    True
    """

    def __init__(
        self,
        space: SurfaceSpace,
        **solvers: Unpack[Solvers],
    ) -> None:
        super().__init__(space, [RootNormalTerm()], **solvers)
