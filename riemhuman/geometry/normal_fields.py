"""Fields of unit normals on a template, with the metric of a product of spheres."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import autograd.numpy as np
from numpy import ndarray

from riemhuman.checks import Rng, generator, real_array, values_of
from riemhuman.errors import ArgumentError, OutsideManifoldError
from riemhuman.geometry.manifold import Manifold, sample_count, stack_samples
from riemhuman.geometry.metric import RiemannianMetric
from riemhuman.geometry.pairwise import Bulk
from riemhuman.kernels import sphere
from riemhuman.kernels.surface import dot, refuse_triangles
from riemhuman.terms._sum import SumOfTerms
from riemhuman.terms.normals import NormalTerm

if TYPE_CHECKING:
    from riemhuman.surfaces.template import Template


class NormalFields(Manifold):
    """C^∞(T, S²): a unit vector on every triangle of a template.

    Parameters
    ----------
    template : Template
        The template T.
    equip : bool
        Whether to equip the manifold with `NormalFieldMetric`.

    Examples
    --------
    >>> import riemhuman as rh
    >>> bodies = rh.datasets.load_open_bodies("coarse")
    >>> fields = rh.NormalFields(bodies.template)
    >>> fields.shape, fields.dim
    ((2400, 3), 4800)
    """

    def __init__(self, template: Template, equip: bool = True) -> None:
        self.template = template
        super().__init__(2 * template.n_faces, (template.n_faces, 3), equip)

    def default_metric(self) -> type[RiemannianMetric]:
        return NormalFieldMetric

    def belongs(self, point: ndarray, atol: float = 1e-9) -> ndarray:
        """Return whether all vectors have unit length."""
        point, finite = self._candidates(point, "point")
        return finite & np.all(np.abs(np.sqrt(dot(point, point)) - 1.0) <= atol, axis=-1)

    def to_tangent(self, vector: ndarray, base_point: ndarray | None = None) -> ndarray:
        """Remove the components along the normals."""
        return sphere.to_tangent(vector, self._needed_base_point(base_point))

    def projection(self, point: ndarray) -> ndarray:
        """Scale all vectors to unit length."""
        return point / np.sqrt(dot(point, point))[..., None]

    def random_point(self, n_samples: int = 1, bound: float = 1.0, rng: Rng = None) -> ndarray:
        """Draw independent uniform unit vectors."""
        noise = generator(rng).standard_normal((sample_count(n_samples), *self.shape))
        return stack_samples(self.projection(noise), n_samples)

    def check_point(self, point: Any, name: str = "point") -> ndarray:
        """Return normal fields as float64 arrays after checking them.

        Raises
        ------
        ArgumentError
            If the shape is wrong, or an entry is not finite, or a vector is not of unit length
            to 1e-6.
        """
        point = real_array(point, name, self.shape, rows=True)
        values = values_of(point)
        refuse_triangles(
            np.abs(dot(values, values) - 1.0) > 2e-6,
            f"{name} must hold unit vectors",
            ArgumentError,
        )
        return point


class NormalFieldMetric(RiemannianMetric):
    r"""The metric :math:`\int_T \langle\delta n, \delta n\rangle\, dx` of a product of spheres.

    The second term of equation 3 of the paper. Exponential, logarithm, geodesics and parallel
    transport are those of the sphere on every triangle.

    Parameters
    ----------
    space : NormalFields
        The manifold.
    geodesic_solver, exp_solver, log_solver, transport_solver : optional
        Not needed: all have closed forms.

    Examples
    --------
    >>> import riemhuman as rh
    >>> bodies = rh.datasets.load_open_bodies("coarse")
    >>> fields = rh.NormalFields(bodies.template)
    >>> metric = rh.NormalFieldMetric(fields)
    >>> n = fields.random_point(2, rng=0)
    >>> half = metric.geodesic(n[0], n[1])(0.5)[0]
    >>> float(metric.dist(n[0], half) / metric.dist(n[0], n[1])).__round__(6)
    0.5
    """

    def inner_product(
        self, tangent_vec_a: ndarray, tangent_vec_b: ndarray, base_point: ndarray | None = None
    ) -> ndarray:
        """Return the inner product of tangent vectors."""
        tangent_vec_a = real_array(tangent_vec_a, "tangent_vec_a", self.space.shape)
        tangent_vec_b = real_array(tangent_vec_b, "tangent_vec_b", self.space.shape)
        base_point = self.space.check_point(base_point, "base_point")
        values = NormalTerm().inner_product((tangent_vec_a,), (tangent_vec_b,), (base_point,))
        product = np.sum(values * self.space.template.face_areas, axis=-1)
        return product + np.zeros(base_point.shape[:-2])

    def squared_dist(self, point_a: ndarray, point_b: ndarray) -> ndarray:
        """Return Σ_t w_t θ_t², θ_t the angle of the two normals (Theorem 2)."""
        point_a = self.space.check_point(point_a, "point_a")
        point_b = self.space.check_point(point_b, "point_b")
        values = NormalTerm().squared_dist((point_a,), (point_b,))
        return np.sum(values * self.space.template.face_areas, axis=-1)

    @property
    def bulk(self) -> Bulk:
        """Features are the components of the normals, in compiled loops."""
        return SumOfTerms(
            [NormalTerm()],
            self.space.template,
            lambda points: (self.space.check_point(points, "points"),),
        )

    def exp(self, tangent_vec: ndarray, base_point: ndarray) -> ndarray:
        """Follow great circles for unit time."""
        base_point = self.space.check_point(base_point, "base_point")
        tangent_vec = real_array(tangent_vec, "tangent_vec", self.space.shape)
        return sphere.exp(tangent_vec, base_point)

    def log(self, point: ndarray, base_point: ndarray) -> ndarray:
        """Return the initial velocity of the shortest great circles.

        Raises
        ------
        OutsideManifoldError
            If two normals are antipodal: there is no unique shortest path.
        """
        point = self.space.check_point(point, "point")
        base_point = self.space.check_point(base_point, "base_point")
        refuse_triangles(
            values_of(sphere.angle(base_point, point)) >= sphere.ANTIPODAL,
            "point must hold no normal antipodal to that of base_point, or there is no unique "
            "logarithm",
            OutsideManifoldError,
        )
        return sphere.log(base_point, point)

    def injectivity_radius(self, base_point: ndarray | None = None) -> ndarray:
        r"""Return half the shortest great circle, :math:`\pi\sqrt{\min_t w_t}`."""
        leading = np.shape(base_point)[:-2] if base_point is not None else ()
        return np.full(leading, np.pi * np.sqrt(self.space.template.face_areas.min()))

    def curvature_form(
        self, tangent_vec_a: ndarray, tangent_vec_b: ndarray, base_point: ndarray
    ) -> ndarray:
        r"""Return :math:`\sum_t w_t (|a_t|^2 |b_t|^2 - \langle a_t, b_t\rangle^2)`.

        Spheres of radius 1 have curvature 1.
        """
        base_point = self.space.check_point(base_point, "base_point")
        a = real_array(tangent_vec_a, "tangent_vec_a", self.space.shape)
        b = real_array(tangent_vec_b, "tangent_vec_b", self.space.shape)
        values = dot(a, a) * dot(b, b) - dot(a, b) ** 2
        form = np.sum(self.space.template.face_areas * values, axis=-1)
        return form + np.zeros(base_point.shape[:-2])

    def parallel_transport(
        self,
        tangent_vec: ndarray,
        base_point: ndarray,
        direction: ndarray | None = None,
        end_point: ndarray | None = None,
    ) -> ndarray:
        """Transport tangent vectors in parallel along geodesics."""
        base_point = self.space.check_point(base_point, "base_point")
        tangent_vec = real_array(tangent_vec, "tangent_vec", self.space.shape)
        direction = self._velocity(base_point, direction, end_point)
        return sphere.parallel_transport(tangent_vec, base_point, direction)

    def _geodesic_between(self, start: ndarray, end: ndarray) -> Callable[[Any], ndarray]:
        return self.geodesic(start, initial_tangent_vec=self.log(end, start))
