"""Fields of rotations on a template, with the metric of a product of rotation groups."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import autograd.numpy as np
from numpy import ndarray

from riemhuman.checks import Rng, generator, real_array, values_of
from riemhuman.errors import ArgumentError, OutsideManifoldError
from riemhuman.geometry.bulk import Bulk
from riemhuman.geometry.manifold import Manifold
from riemhuman.geometry.metric import RiemannianMetric
from riemhuman.geometry.samples import sample_count, stack_samples
from riemhuman.kernels import special_orthogonal
from riemhuman.kernels.rotations import cross_product_matrix
from riemhuman.kernels.special_orthogonal import axial, nearest_rotations, quaternions, transpose
from riemhuman.kernels.surface import dot, refuse_triangles
from riemhuman.terms.rotations import RotationTerm
from riemhuman.terms.sum import TermOfFields

if TYPE_CHECKING:
    from riemhuman.surfaces.template import Template


class RotationFields(Manifold):
    """C^∞(T, SO(3)): a rotation on every triangle of a template.

    Tangent vectors at R are fields of matrices R A with A skew.

    Parameters
    ----------
    template : Template
        The template T.

    Examples
    --------
    >>> import riemhuman as rh
    >>> bodies = rh.datasets.load_open_bodies("coarse")
    >>> fields = rh.RotationFields(bodies.template)
    >>> fields.shape, fields.dim
    ((2400, 3, 3), 7200)
    """

    def __init__(self, template: Template, equip: bool = True) -> None:
        self.template = template
        super().__init__(3 * template.n_faces, (template.n_faces, 3, 3), equip)

    def default_metric(self) -> type[RiemannianMetric]:
        """Return `RotationFieldMetric`."""
        return RotationFieldMetric

    def belongs(self, point: ndarray, atol: float = 1e-9) -> ndarray:
        """Tell whether all matrices are rotations.

        Parameters
        ----------
        atol : float
            Absolute tolerance for the entries of RᵀR − I.
        """
        point, finite = self._candidates(point, "point")
        return finite & np.all(_is_rotation(point, atol), axis=-1)

    def to_tangent(self, vector: ndarray, base_point: ndarray | None = None) -> ndarray:
        """Keep the skew part of Rᵀ V."""
        base_point = self.needed_base_point(base_point)
        return _tangent_vec(_angular_velocity(vector, base_point), base_point)

    def projection(self, point: ndarray) -> ndarray:
        """Return the nearest rotations, by polar decomposition."""
        return nearest_rotations(point)

    def random_point(self, n_samples: int = 1, bound: float = 1.0, rng: Rng = None) -> ndarray:
        """Draw independent uniform rotations.

        Parameters
        ----------
        bound : float
            Not used: the rotations are compact.
        """
        noise = generator(rng).standard_normal((sample_count(n_samples), *self.shape))
        return stack_samples(self.projection(noise), n_samples)

    def check_point(self, point: Any, name: str = "point") -> ndarray:
        """Return fields of rotations as float64 arrays after checking them.

        Raises
        ------
        ArgumentError
            If the shape is wrong, or an entry is not finite, or a matrix is no rotation to 1e-6.
        """
        point = real_array(point, name, self.shape, rows=True)
        refuse_triangles(
            ~_is_rotation(values_of(point), 2e-6), f"{name} must hold rotations", ArgumentError
        )
        return point


class RotationFieldMetric(RiemannianMetric):
    r"""The metric :math:`\tfrac12 \int_T \mathrm{tr}(\delta R^T \delta R)\, dx`.

    On every triangle the distance is the angle θ of the rotation R₁ᵀ R₂, in [0, π], and
    exponential, logarithm, geodesics and parallel transport are those of the rotation group with
    its two-sided invariant metric. The cut locus of a rotation is that of half turns from it,
    θ = π: there are two shortest geodesics to them, and no logarithm.

    Examples
    --------
    >>> import riemhuman as rh
    >>> bodies = rh.datasets.load_open_bodies("coarse")
    >>> fields = rh.RotationFields(bodies.template)
    >>> metric = rh.RotationFieldMetric(fields)
    >>> R = fields.random_point(2, rng=0)
    >>> velocity = metric.log(R[1], R[0])
    >>> round(float(metric.norm(velocity, R[0]) / metric.dist(R[0], R[1])), 6)
    1.0
    """

    space: RotationFields

    def inner_product(
        self, tangent_vec_a: ndarray, tangent_vec_b: ndarray, base_point: ndarray | None = None
    ) -> ndarray:
        """Return the inner product of tangent vectors.

        Parameters
        ----------
        tangent_vec_a, tangent_vec_b : array, shape (..., F, 3, 3)
            Tangent fields.
        base_point : array, shape (..., F, 3, 3)
            Field of rotations; the inner product is the same at all of them.
        """
        tangent_vec_a = real_array(tangent_vec_a, "tangent_vec_a", self.space.shape)
        tangent_vec_b = real_array(tangent_vec_b, "tangent_vec_b", self.space.shape)
        base_point = self.space.check_point(base_point, "base_point")
        values = 0.5 * np.sum(tangent_vec_a * tangent_vec_b, axis=(-2, -1))
        product = np.sum(values * self.space.template.face_areas, axis=-1)
        return product + np.zeros(base_point.shape[:-3])

    def squared_dist(self, point_a: ndarray, point_b: ndarray) -> ndarray:
        """Return Σ_t w_t θ_t², θ_t the angle of the rotation between the two."""
        point_a = self.space.check_point(point_a, "point_a")
        point_b = self.space.check_point(point_b, "point_b")
        values = RotationTerm().squared_dist((quaternions(point_a),), (quaternions(point_b),))
        return np.sum(values * self.space.template.face_areas, axis=-1)

    @property
    def bulk(self) -> Bulk:
        """Features are the components of quaternions, in compiled loops."""
        return TermOfFields(
            RotationTerm(),
            self.space.template,
            lambda points: (quaternions(self.space.check_point(points, "points")),),
        )

    def exp(self, tangent_vec: ndarray, base_point: ndarray) -> ndarray:
        """Turn about constant axes for unit time."""
        base_point = self.space.check_point(base_point, "base_point")
        tangent_vec = real_array(tangent_vec, "tangent_vec", self.space.shape)
        return special_orthogonal.exp(_angular_velocity(tangent_vec, base_point), base_point)

    def log(self, point: ndarray, base_point: ndarray) -> ndarray:
        """Return the initial velocity of the shortest rotations.

        Raises
        ------
        OutsideManifoldError
            If two rotations differ by a half turn: there is no unique shortest path.
        """
        point = self.space.check_point(point, "point")
        base_point = self.space.check_point(base_point, "base_point")
        omega = special_orthogonal.log(base_point, point)
        values = values_of(omega)
        refuse_triangles(
            np.sqrt(dot(values, values)) >= special_orthogonal.HALF_TURN,
            "point must hold no rotation half a turn from that of base_point, or there is no "
            "unique logarithm",
            OutsideManifoldError,
        )
        return _tangent_vec(omega, base_point)

    def injectivity_radius(self, base_point: ndarray | None = None) -> ndarray:
        r"""Return the length of a half turn of the smallest triangle, :math:`\pi\sqrt{\min_t w_t}`.

        Parameters
        ----------
        base_point : array, shape (..., F, 3, 3), optional
            Fields of rotations; it is the same at all of them.
        """
        leading = np.shape(base_point)[:-3] if base_point is not None else ()
        return np.full(leading, np.pi * np.sqrt(self.space.template.face_areas.min()))

    def curvature_form(
        self, tangent_vec_a: ndarray, tangent_vec_b: ndarray, base_point: ndarray
    ) -> ndarray:
        r"""Return :math:`\tfrac14 \sum_t w_t |a_t \times b_t|^2`, of the angular velocities.

        On a group with a two-sided invariant metric ⟨R(a, b) b, a⟩ is a quarter of the squared
        length of [a, b]: every plane of the rotations of a triangle has curvature ¼ / w_t.

        Parameters
        ----------
        tangent_vec_a, tangent_vec_b : array, shape (..., F, 3, 3)
            Tangent fields a and b.
        base_point : array, shape (..., F, 3, 3)
            Field of rotations.
        """
        base_point = self.space.check_point(base_point, "base_point")
        a, b = (
            _angular_velocity(real_array(vector, name, self.space.shape), base_point)
            for vector, name in ((tangent_vec_a, "tangent_vec_a"), (tangent_vec_b, "tangent_vec_b"))
        )
        bracket = np.cross(a, b)
        return 0.25 * np.sum(self.space.template.face_areas * dot(bracket, bracket), axis=-1)

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
        omega = _angular_velocity(direction, base_point)
        moved = special_orthogonal.parallel_transport(
            _angular_velocity(tangent_vec, base_point), omega
        )
        return _tangent_vec(moved, special_orthogonal.exp(omega, base_point))

    def _geodesic_between(self, start: ndarray, end: ndarray) -> Callable[[Any], ndarray]:
        return self.geodesic(start, initial_tangent_vec=self.log(end, start))


def _angular_velocity(tangent_vec: ndarray, base_point: ndarray) -> ndarray:
    """Return v of tangent vectors R [v]×, in the axes that R turns."""
    return axial(np.matmul(transpose(base_point), tangent_vec))


def _tangent_vec(angular_velocity: ndarray, base_point: ndarray) -> ndarray:
    return np.matmul(base_point, cross_product_matrix(angular_velocity))


def _is_rotation(matrices: ndarray, atol: float) -> ndarray:
    gaps = transpose(matrices) @ matrices - np.eye(3)
    return np.all(np.abs(gaps) <= atol, axis=(-2, -1)) & (np.linalg.det(matrices) > 0)
