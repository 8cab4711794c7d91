"""Fields of metrics on a template, with the Ebin metric."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import autograd.numpy as np
from numpy import ndarray

from riemhuman.checks import Rng, generator, real_array, values_of
from riemhuman.errors import ArgumentError, DegenerateSurfaceError, OutsideManifoldError
from riemhuman.geometry.manifold import Manifold, sample_bound, sample_count, stack_samples
from riemhuman.geometry.metric import RiemannianMetric
from riemhuman.geometry.pairwise import Bulk
from riemhuman.kernels.surface import refuse_triangles
from riemhuman.terms import EbinTerm
from riemhuman.terms import _cone_geodesics as cones
from riemhuman.terms._sum import SumOfTerms

if TYPE_CHECKING:
    from riemhuman.surfaces.template import Template


class MetricFields(Manifold):
    """Met(T): a symmetric positive definite 2 × 2 matrix on every triangle of a template.

    Parameters
    ----------
    template : Template
        The template T.
    equip : bool
        Whether to equip the manifold with `EbinMetric`.

    Examples
    --------
    >>> import riemhuman as rh
    >>> bodies = rh.datasets.load_open_bodies("coarse")
    >>> fields = rh.MetricFields(bodies.template)
    >>> fields.shape
    (2400, 2, 2)
    >>> bool(fields.belongs(fields.random_point(rng=0)))
    True
    """

    def __init__(self, template: Template, equip: bool = True) -> None:
        self.template = template
        super().__init__(3 * template.n_faces, (template.n_faces, 2, 2), equip)

    def default_metric(self) -> type[RiemannianMetric]:
        return EbinMetric

    def belongs(self, point: ndarray, atol: float = 1e-9) -> ndarray:
        """Return whether fields are symmetric and positive definite."""
        point, finite = self._candidates(point, "point")
        symmetric = np.abs(point[..., 0, 1] - point[..., 1, 0]) <= atol
        positive = (point[..., 0, 0] > 0) & ~cones.is_degenerate(point)
        return finite & np.all(symmetric & positive, axis=-1)

    def to_tangent(self, vector: ndarray, base_point: ndarray | None = None) -> ndarray:
        """Return the symmetric part."""
        return cones.symmetric_part(vector)

    def projection(self, point: ndarray) -> ndarray:
        """Return the symmetric part."""
        return cones.symmetric_part(point)

    def random_point(self, n_samples: int = 1, bound: float = 1.0, rng: Rng = None) -> ndarray:
        """Draw fields exp(S) of symmetric normal matrices S, independent between triangles."""
        noise = generator(rng).standard_normal((sample_count(n_samples), *self.shape))
        logarithm = 0.5 * sample_bound(bound) * cones.symmetric_part(noise)
        size = np.exp(0.5 * cones.trace(logarithm))[..., None, None]
        shear = cones.traceless(logarithm)
        points = size * cones.traceless_exp(shear, np.array(1.0))
        return stack_samples(points, n_samples)

    def check_point(self, point: Any, name: str = "point", *, completion: bool = False) -> ndarray:
        """Return metric fields as float64 arrays after checking them.

        With `completion`, degenerate matrices are legal, as in the completion of Met(T).

        Raises
        ------
        ArgumentError
            If the shape is wrong, or an entry is not finite, or a matrix is not symmetric and
            positive semidefinite.
        DegenerateSurfaceError
            If a matrix is singular and `completion` is false.
        """
        point = real_array(point, name, self.shape, rows=True)
        g = values_of(point)
        size = np.abs(g[..., 0, 0]) + np.abs(g[..., 1, 1])
        crooked = np.abs(g[..., 0, 1] - g[..., 1, 0]) > 1e-9 * size
        determinant = cones.determinants(g)
        degenerate = cones.is_rounding_error(determinant, g)
        rounding = 1e-9 * size**2
        negative = (g[..., 0, 0] < 0) | (g[..., 1, 1] < 0) | (determinant < -rounding)
        refuse_triangles(crooked, f"{name} must hold symmetric matrices", ArgumentError)
        refuse_triangles(
            negative, f"{name} must hold positive semidefinite matrices", ArgumentError
        )
        if not completion:
            refuse_triangles(
                degenerate, f"{name} must hold invertible matrices", DegenerateSurfaceError
            )
        return point


class EbinMetric(RiemannianMetric):
    r"""The Ebin (DeWitt) metric on Met(T).

    .. math:: ((\delta g,\delta g))_g = \int_T \left(\operatorname{tr}((g^{-1}\delta g_0)^2)
              + \lambda\operatorname{tr}(g^{-1}\delta g)^2\right) \mu_g

    Equation 2 of the paper, corrected: both terms are under the integral.

    Parameters
    ----------
    space : MetricFields
        The manifold.
    lam : float
        λ > 0. The default ½ is the metric :math:`\int\operatorname{tr}((g^{-1}\delta g)^2)\mu_g`.

    Raises
    ------
    ArgumentError
        If λ is not positive: the metric would be degenerate.

    Examples
    --------
    >>> import riemhuman as rh
    >>> bodies = rh.datasets.load_open_bodies("coarse")
    >>> fields = rh.MetricFields(bodies.template)
    >>> ebin = rh.EbinMetric(fields, lam=0.5)
    >>> g = fields.random_point(2, rng=0)
    >>> velocity = ebin.log(g[1], g[0])
    >>> float(ebin.norm(velocity, g[0]) / ebin.dist(g[0], g[1])).__round__(6)
    1.0
    """

    def __init__(self, space: MetricFields, lam: float = 0.5) -> None:
        super().__init__(space)
        self._term = EbinTerm(lam=lam)

    @property
    def lam(self) -> float:
        """The weight λ of the change of area."""
        return self._term.lam

    def inner_product(
        self, tangent_vec_a: ndarray, tangent_vec_b: ndarray, base_point: ndarray | None = None
    ) -> ndarray:
        """Return the inner product of tangent vectors (equation 2, corrected)."""
        base_point = self.space.check_point(base_point, "base_point")
        tangent_vec_a = real_array(tangent_vec_a, "tangent_vec_a", self.space.shape)
        tangent_vec_b = real_array(tangent_vec_b, "tangent_vec_b", self.space.shape)
        values = cones.inner_product(tangent_vec_a, tangent_vec_b, base_point, self.lam)
        return np.sum(values * self.space.template.face_areas, axis=-1)

    def squared_dist(self, point_a: ndarray, point_b: ndarray) -> ndarray:
        """Return the squared distance in the completion of Met(T) (Theorem 1, corrected)."""
        point_a = self.space.check_point(point_a, "point_a", completion=True)
        point_b = self.space.check_point(point_b, "point_b", completion=True)
        values = self._term.squared_dist(cones.coordinates(point_a), cones.coordinates(point_b))
        return np.sum(values * self.space.template.face_areas, axis=-1)

    @property
    def bulk(self) -> Bulk:
        """Features x, y and s of the cones, in compiled loops."""
        return SumOfTerms(
            [self._term],
            self.space.template,
            lambda points: cones.coordinates(
                self.space.check_point(points, "points", completion=True)
            ),
        )

    def exp(self, tangent_vec: ndarray, base_point: ndarray) -> ndarray:
        """Return the end point of the geodesic with this initial velocity.

        Raises
        ------
        OutsideManifoldError
            If the geodesic has met the apex g = 0 on some triangle, or ends so far away that double
            precision does not hold the matrix.
        """
        base_point = self.space.check_point(base_point, "base_point")
        tangent_vec = real_array(tangent_vec, "tangent_vec", self.space.shape)
        with np.errstate(over="ignore", invalid="ignore"):
            end, met_apex = cones.exp(tangent_vec, base_point, self.lam)
            lost = cones.has_lost_its_shape(values_of(end))
        refuse_triangles(
            values_of(met_apex),
            "tangent_vec must be the velocity of a geodesic that stays clear of g = 0",
            OutsideManifoldError,
        )
        refuse_triangles(
            lost,
            "tangent_vec must be the velocity of a geodesic whose end double precision can hold",
            OutsideManifoldError,
        )
        return end

    def log(self, point: ndarray, base_point: ndarray) -> ndarray:
        """Return the initial velocity of the minimal geodesic.

        Raises
        ------
        OutsideManifoldError
            If the minimal path runs through g = 0 on some triangle (θ ≥ π), so that it is no
            geodesic of Met(T).
        """
        point = self.space.check_point(point, "point")
        base_point = self.space.check_point(base_point, "base_point")
        refuse_triangles(
            values_of(cones.angle(base_point, point, self.lam)) >= np.pi,
            "point must be within an angle θ < π of base_point, or the minimal path runs through "
            "g = 0 and there is no logarithm",
            OutsideManifoldError,
        )
        return cones.log(base_point, point, self.lam)

    def injectivity_radius(self, base_point: ndarray | None = None) -> ndarray:
        """Return the distance to the nearest field that is 0 on a triangle, the apex of its cone.

        Every triangle's matrices are a cone over a hyperbolic plane, without positive curvature.
        """
        g = self.space.check_point(base_point, "base_point")
        radii = 4.0 * np.sqrt(self.lam * np.sqrt(cones.determinants(g)))
        return np.min(np.sqrt(self.space.template.face_areas) * radii, axis=-1)

    def curvature_form(
        self, tangent_vec_a: ndarray, tangent_vec_b: ndarray, base_point: ndarray
    ) -> ndarray:
        r"""Return ⟨R(a, b) b, a⟩ of a product of cones over hyperbolic planes.

        .. math:: -\sum_t w_t \frac{8\lambda + 1}{16\lambda} \sqrt{\det g}\,
            \left(\mathrm{tr} A_0^2\, \mathrm{tr} B_0^2 - (\mathrm{tr} A_0 B_0)^2\right)

        A₀ and B₀ are the parts of g⁻¹a and g⁻¹b without trace. The cone of a triangle has radius
        :math:`r = 4\sqrt{\lambda\sqrt{\det g}}` over the matrices of determinant 1, which with
        the metric tr A₀²/(16λ) are a hyperbolic plane of curvature −8λ: planes across the radius
        have curvature −(8λ + 1)/r², those along it 0.
        """
        g = self.space.check_point(base_point, "base_point")
        first, second = (
            cones.traceless(cones.whiten(real_array(vector, name, self.space.shape), g))
            for vector, name in ((tangent_vec_a, "tangent_vec_a"), (tangent_vec_b, "tangent_vec_b"))
        )
        squares = cones.trace(first @ first) * cones.trace(second @ second)
        areas = squares - cones.trace(first @ second) ** 2
        factor = (8.0 * self.lam + 1.0) / (16.0 * self.lam) * np.sqrt(cones.determinants(g))
        return -np.sum(self.space.template.face_areas * factor * areas, axis=-1)

    def parallel_transport(
        self,
        tangent_vec: ndarray,
        base_point: ndarray,
        direction: ndarray | None = None,
        end_point: ndarray | None = None,
    ) -> ndarray:
        """Transport tangent vectors in parallel along geodesics, in closed form.

        Raises
        ------
        OutsideManifoldError
            If the geodesic meets the apex g = 0 on some triangle, or none leads to the end point.
        """
        base_point = self.space.check_point(base_point, "base_point")
        tangent_vec = real_array(tangent_vec, "tangent_vec", self.space.shape)
        direction = self._velocity(base_point, direction, end_point)
        self.exp(direction, base_point)
        return cones.parallel_transport(tangent_vec, base_point, direction, self.lam)

    def _geodesic_between(self, start: ndarray, end: ndarray) -> Callable[[Any], ndarray]:
        def follow(t: Any) -> ndarray:
            times = self._times(t)[..., 0, 0]
            return cones.geodesic(
                self._with_time_axis(start), self._with_time_axis(end), times, self.lam
            )

        return follow

    def geodesic(
        self,
        initial_point: ndarray,
        end_point: ndarray | None = None,
        initial_tangent_vec: ndarray | None = None,
    ) -> Callable[[Any], ndarray]:
        """Return the geodesic; between two points, the minimal path of the completion.

        If θ ≥ π, or an end point is degenerate, that path runs straight through g = 0.
        """
        if end_point is None or initial_tangent_vec is not None:
            return super().geodesic(initial_point, end_point, initial_tangent_vec)
        return self._geodesic_between(
            self.space.check_point(initial_point, "initial_point", completion=True),
            self.space.check_point(end_point, "end_point", completion=True),
        )
