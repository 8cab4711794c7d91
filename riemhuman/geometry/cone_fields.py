"""Fields of metrics and normals together, with the general elastic metric."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import autograd.numpy as np
from numpy import ndarray

from riemhuman.checks import values_of
from riemhuman.errors import OutsideManifoldError
from riemhuman.geometry.metric import RiemannianMetric
from riemhuman.geometry.pairwise import Bulk
from riemhuman.geometry.product import ProductManifold
from riemhuman.kernels import sphere
from riemhuman.kernels.surface import dot, refuse_triangles
from riemhuman.terms import ConeTerm
from riemhuman.terms import _cone_geodesics as cones
from riemhuman.terms._sum import SumOfTerms

if TYPE_CHECKING:
    from riemhuman.surfaces.template import Template


class GeneralElasticFieldMetric(RiemannianMetric):
    r"""The general elastic metric on pairs of a metric field and a normal field.

    .. math:: ((\delta g, \delta n), (\delta g, \delta n)) = \int_T \left(
              a \operatorname{tr}(A_0^2) + b \operatorname{tr}(A)^2 + c\, |\delta n|^2\right) \mu_g,
              \qquad A = g^{-1} \delta g

    At every point it is a cone over H² × S²; geodesics have a closed form. `GeneralElasticMetric`
    is its pull-back to surfaces.

    Parameters
    ----------
    space : ProductManifold
        `MetricFields` times `NormalFields` over one template.
    a : float
        Weight of stretching without change of area, at least 0.
    b : float
        Weight of the change of area, above 0.
    c : float
        Weight of the rotation of normals, above 0.

    Raises
    ------
    ArgumentError
        If a weight is out of range.

    Examples
    --------
    >>> import riemhuman as rh
    >>> bodies = rh.datasets.load_open_bodies("coarse")
    >>> space = rh.AlignedSurfaces(bodies.template)
    >>> fields = rh.GeneralElasticMetric(space, a=1.0, b=1.0, c=0.1).target_metric
    >>> start, end = fields.space.random_point(2, rng=0)
    >>> velocity = fields.log(end, start)
    >>> float(fields.norm(velocity, start) / fields.dist(start, end)).__round__(6)
    1.0
    """

    space: ProductManifold

    def __init__(
        self,
        space: ProductManifold,
        a: float = 1.0,
        b: float = 1.0,
        c: float = 1.0,
    ) -> None:
        super().__init__(space)
        self._term = ConeTerm(1.0, a, b, c)
        metrics: Any = space.factors[0]
        self._template: Template = metrics.template

    def inner_product(
        self, tangent_vec_a: ndarray, tangent_vec_b: ndarray, base_point: ndarray | None = None
    ) -> ndarray:
        g, _ = self._fields(base_point, "base_point")
        (delta_g, delta_n), (other_g, other_n) = map(self._changes, (tangent_vec_a, tangent_vec_b))
        first, second = cones.whiten(delta_g, g), cones.whiten(other_g, g)
        shears = np.sum(cones.traceless(first) * cones.traceless(second), axis=(-2, -1))
        traces = cones.trace(first) * cones.trace(second)
        term = self._term
        values = term.a * shears + term.b * traces + term.c * dot(delta_n, other_n)
        return self._integral(values * np.sqrt(cones.determinants(g)))

    def squared_dist(self, point_a: ndarray, point_b: ndarray) -> ndarray:
        first, second = (
            self._coordinates(point, name)
            for point, name in ((point_a, "point_a"), (point_b, "point_b"))
        )
        return self._integral(self._term.squared_dist(first, second))

    @property
    def bulk(self) -> Bulk:
        return SumOfTerms(
            [self._term], self._template, lambda points: self._coordinates(points, "points")
        )

    def exp(self, tangent_vec: ndarray, base_point: ndarray) -> ndarray:
        """Return the end point of the geodesic with this initial velocity.

        Raises
        ------
        OutsideManifoldError
            If the geodesic has met the apex g = 0 on some triangle.
        """
        g, n = self._fields(base_point, "base_point")
        with np.errstate(over="ignore", invalid="ignore"):
            *end, met_apex = cones.exp_with_normals(*self._changes(tangent_vec), g, n, self._term)
            lost = values_of(met_apex) | cones.has_lost_its_shape(values_of(end[0]))
        refuse_triangles(
            lost,
            "tangent_vec must be the velocity of a geodesic that stays clear of g = 0, with an end "
            "that double precision can hold",
            OutsideManifoldError,
        )
        return self.space.embed_to_product(end)

    def log(self, point: ndarray, base_point: ndarray) -> ndarray:
        """Return the initial velocity of the minimal geodesic.

        Raises
        ------
        OutsideManifoldError
            If ψ ≥ π on some triangle, where the minimal path runs through g = 0, or two normals are
            antipodal.
        """
        (g, n), (other_g, other_n) = (
            self._fields(point, "point"),
            self._fields(base_point, "base_point"),
        )
        *velocity, psi = cones.log_with_normals(other_g, other_n, g, n, self._term)
        antipodal = values_of(sphere.angle(n, other_n)) >= sphere.ANTIPODAL
        refuse_triangles(
            antipodal | (values_of(psi) >= np.pi),
            "point must be within an angle ψ < π of base_point, with no normal antipodal to its "
            "own, or there is no unique logarithm",
            OutsideManifoldError,
        )
        return self.space.embed_to_product(velocity)

    def injectivity_radius(self, base_point: ndarray | None = None) -> ndarray:
        """Return the distance to the nearest fields that are 0 or antipodal on a triangle."""
        g, _ = self._fields(base_point, "base_point")
        radii = 4.0 * np.sqrt(self._term.b * np.sqrt(cones.determinants(g)))
        # The angle on the cone to the antipodal normal; from ½π on the apex is nearer.
        reach = np.sin(min(np.pi * self._term.angle_per_turn, 0.5 * np.pi))
        return np.min(np.sqrt(self._template.face_areas) * reach * radii, axis=-1)

    def curvature_form(
        self, tangent_vec_a: ndarray, tangent_vec_b: ndarray, base_point: ndarray
    ) -> ndarray:
        r"""Return ⟨R(a, b) b, a⟩ of a product of cones over H² × S².

        With κ = ψ/ℓ and ρ = ψ/φ, the link has curvature −1/κ² across hyperbolic planes and 1/ρ²
        across spheres; the cone of radius r has that of the link less 1, over r².
        """
        g, _ = self._fields(base_point, "base_point")
        (delta_g, delta_n), (other_g, other_n) = map(self._changes, (tangent_vec_a, tangent_vec_b))
        first, second = (cones.traceless(cones.whiten(h, g)) for h in (delta_g, other_g))
        kappa, rho = self._term.angle_per_length**2, self._term.angle_per_turn**2

        def products(a: tuple[ndarray, ndarray], b: tuple[ndarray, ndarray]) -> list[ndarray]:
            return [0.5 * kappa * cones.trace(a[0] @ b[0]), rho * dot(a[1], b[1])]

        own, other = (first, delta_n), (second, other_n)
        aa, bb, ab = products(own, own), products(other, other), products(own, other)
        hyperbolic, sphere_area, whole = (
            x * y - z**2
            for x, y, z in zip((*aa, sum(aa)), (*bb, sum(bb)), (*ab, sum(ab)), strict=True)
        )
        curvature = sphere_area / rho - hyperbolic / kappa if kappa else sphere_area / rho
        squared_radii = 16.0 * self._term.b * np.sqrt(cones.determinants(g))
        return self._integral(squared_radii * (curvature - whole))

    def parallel_transport(
        self,
        tangent_vec: ndarray,
        base_point: ndarray,
        direction: ndarray | None = None,
        end_point: ndarray | None = None,
    ) -> ndarray:
        """Transport tangent vectors in parallel along geodesics, in closed form."""
        direction = self._velocity(base_point, direction, end_point)
        self.exp(direction, base_point)
        g, n = self._fields(base_point, "base_point")
        return self.space.embed_to_product(
            cones.transport_with_normals(
                *self._changes(tangent_vec), g, n, *self._changes(direction), self._term
            )
        )

    def _geodesic_between(self, start: ndarray, end: ndarray) -> Callable[[Any], ndarray]:
        (g1, n1), (g2, n2) = self._fields(start, "start"), self._fields(end, "end")
        refuse_triangles(
            (values_of(sphere.angle(n1, n2)) >= sphere.ANTIPODAL)
            & ~values_of(cones.runs_through_apex(g1, n1, g2, n2, self._term)),
            "end_point must hold no normal antipodal to that of initial_point where ψ < π, or "
            "there is no unique geodesic",
            OutsideManifoldError,
        )

        def follow(t: Any) -> ndarray:
            path = cones.geodesic_with_normals(
                np.expand_dims(g1, -4),
                np.expand_dims(n1, -3),
                np.expand_dims(g2, -4),
                np.expand_dims(n2, -3),
                self._times(t),
                self._term,
            )
            return self.space.embed_to_product(path)

        return follow

    def _fields(self, point: Any, name: str) -> tuple[ndarray, ndarray]:
        factors, parts = self.space.factors, self.space.project_from_product(point)
        g, n = (factor.check_point(part, name) for factor, part in zip(factors, parts, strict=True))
        return g, n

    def _changes(self, tangent_vec: ndarray) -> tuple[ndarray, ndarray]:
        delta_g, delta_n = self.space.project_from_product(tangent_vec)
        return delta_g, delta_n

    def _coordinates(self, point: Any, name: str) -> tuple[ndarray, ...]:
        g, n = self._fields(point, name)
        return *cones.coordinates(g), n

    def _integral(self, values: ndarray) -> ndarray:
        return np.sum(values * self._template.face_areas, axis=-1)
