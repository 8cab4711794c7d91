"""Fields on a template, of metrics, normals or rotations, and the metrics on them."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Callable, Sequence

import autograd.numpy as np

from riemhuman.arrays import Array, ArrayLike, Booleans, Fields, Points, TangentVectors
from riemhuman.checks import (
    Rng,
    checked,
    generator,
    instance,
    joint_shape,
    real_array,
    real_number,
    refuse_type,
    values_of,
)
from riemhuman.errors import ArgumentError, DegenerateSurfaceError, OutsideManifoldError
from riemhuman.geometry.manifold import Manifold, sample_count, stack_samples
from riemhuman.geometry.metric import RiemannianMetric
from riemhuman.geometry.pairwise import Bulk
from riemhuman.geometry.product import ProductManifold
from riemhuman.kernels import rotations, sphere
from riemhuman.kernels.rotations import axial, cross_product_matrix, transpose
from riemhuman.kernels.surface import dot, refuse_triangles
from riemhuman.surfaces.template import Template
from riemhuman.terms import ConeTerm, EbinTerm
from riemhuman.terms import _cone_geodesics as cones
from riemhuman.terms._sums import SumOfFields
from riemhuman.terms.normals import NormalTerm, RotationTerm
from riemhuman.terms.term import Term


class TriangleFields(Manifold):
    """Fields with a value of one kind on every triangle of a template."""

    template: Template
    value_dim: int
    value_shape: tuple[int, ...]
    value_name: str

    @checked(template=instance(Template))
    def __init__(self, template: Template, equip: bool = True) -> None:
        self.template, n_faces = template, template.n_faces
        super().__init__(self.value_dim * n_faces, (n_faces, *self.value_shape), equip)

    @abstractmethod
    def _are_values(self, values: Array, atol: float) -> Booleans:
        """Return which triangles have a valid value, shape (..., F)."""

    def belongs(self, point: Points, atol: float = 1e-9) -> Booleans:
        point, finite = self._candidates(point, "point")
        return finite & np.all(self._are_values(point, atol), axis=-1)

    def check_point(self, point: object, name: str = "point") -> Array:
        point = real_array(point, name, self.shape, rows=True)
        wrong = ~self._are_values(values_of(point), 1e-6)
        refuse_triangles(wrong, f"{name} must hold {self.value_name}", ArgumentError)
        return point

    def random_point(self, n_samples: int = 1, bound: float = 1.0, rng: Rng = None) -> Array:
        count = sample_count(n_samples)
        noise = generator(rng).standard_normal((count, *self.shape))
        return stack_samples(self.projection(noise), n_samples)

    def _at_point(self, vector: object, base_point: Points | None) -> tuple[Array, Array]:
        """Return vectors and their base points after checking them."""
        vectors = real_array(vector, "vector", self.shape)
        base_point = self._needed_base_point(base_point)
        points = real_array(base_point, "base_point", self.shape, rows=True)
        joint_shape(vector=vectors, base_point=points)
        return vectors, points


class FieldMetric(RiemannianMetric):
    """An integral over the triangles of a template, with closed forms on each."""

    has_closed_form_geodesic = True
    has_closed_form_transport = True

    space: Manifold
    _term: Term

    def __init__(self, space: Manifold) -> None:
        super().__init__(space)

    def inner_product(
        self,
        tangent_vec_a: TangentVectors,
        tangent_vec_b: TangentVectors,
        base_point: Points | None = None,
    ) -> Array:
        point = self.space.check_point(base_point, "base_point")
        a = self._vectors(tangent_vec_a, "tangent_vec_a")
        b = self._vectors(tangent_vec_b, "tangent_vec_b")
        joint_shape(tangent_vec_a=a, tangent_vec_b=b, base_point=point)
        values = self._integral(self._products(a, b, point))
        return values + np.zeros(point.shape[: -self.space.point_ndim])

    def squared_dist(self, point_a: Points, point_b: Points) -> Array:
        first, second = self._fields(point_a, "point_a"), self._fields(point_b, "point_b")
        joint_shape(point_a=first[0], point_b=second[0])
        return self._integral(self._term.squared_dist(first, second))

    @property
    def bulk(self) -> Bulk:
        def fields(points: Points) -> Fields:
            return self._fields(points, "points")

        return SumOfFields(self._term, self._areas, fields)

    @abstractmethod
    def _fields(self, point: Points, name: str) -> Fields:
        """Return the fields of the term that points are, after checking them."""

    @abstractmethod
    def _products(self, a: Array, b: Array, point: Points) -> Array:
        """Return the inner products of tangent vectors on every triangle."""

    @property
    def _areas(self) -> Array:
        """The areas of the triangles that fields are integrated over."""
        space = self.space.factors[0] if self.space.factors else self.space
        if space.template is None:
            refuse_type(space, "space", "fields on a template")
        return space.template.face_areas

    def _integral(self, values: Array) -> Array:
        return np.sum(values * self._areas, axis=-1)


class MetricFields(TriangleFields):
    """Met(T): a symmetric positive definite 2 × 2 matrix on every triangle of a template.

    Parameters
    ----------
    template : Template
    equip : bool
        Whether to equip the manifold with `EbinMetric`.

    Examples
    --------
    >>> bodies = rh.datasets.load_open_bodies("coarse")
    >>> fields = rh.MetricFields(bodies.template)
    >>> fields.shape, fields.dim
    ((2400, 2, 2), 7200)
    """

    value_dim, value_shape = 3, (2, 2)

    def default_metric(self) -> type[RiemannianMetric]:
        return EbinMetric

    def _are_values(self, values: Array, atol: float) -> Booleans:
        symmetric = np.abs(values[..., 0, 1] - values[..., 1, 0]) <= atol
        degenerate: Booleans = cones.is_degenerate(values)
        return symmetric & (values[..., 0, 0] > 0) & ~degenerate

    def to_tangent(self, vector: TangentVectors, base_point: Points | None = None) -> Array:
        return cones.symmetric_part(real_array(vector, "vector", self.shape))

    def projection(self, point: Points) -> Array:
        return cones.symmetric_part(real_array(point, "point", self.shape))

    def random_point(self, n_samples: int = 1, bound: float = 1.0, rng: Rng = None) -> Array:
        count = sample_count(n_samples)
        noise = generator(rng).standard_normal((count, *self.shape))
        logarithm = 0.5 * real_number(bound, "bound", minimum=0.0) * cones.symmetric_part(noise)
        size = np.exp(0.5 * cones.trace(logarithm))[..., None, None]
        shear = cones.traceless(logarithm)
        points = size * cones.traceless_exp(shear, np.array(1.0))
        return stack_samples(points, n_samples)

    def check_point(self, point: object, name: str = "point", *, completion: bool = False) -> Array:
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


class ConeMetric(FieldMetric):
    """A metric whose triangles are cones, over points g or pairs of g and n."""

    _term: ConeTerm
    space: MetricFields | ProductManifold

    def _split(self, points: Points) -> tuple[Array, ...]:
        """Return g, or g and n, of points or tangent vectors."""
        if isinstance(self.space, ProductManifold):
            return self.space.project_from_product(points)
        return (points,)

    def _join(self, parts: Sequence[Array]) -> Array:
        if isinstance(self.space, ProductManifold):
            return self.space.embed_to_product(parts)
        return parts[0]

    def _checked(self, point: Points, name: str) -> tuple[Array, ...]:
        if not isinstance(self.space, ProductManifold):
            return (self.space.check_point(point, name, completion=True),)
        parts = zip(self.space.factors, self._split(point), strict=True)
        return tuple(factor.check_point(part, name) for factor, part in parts)

    def _fields(self, point: Points, name: str) -> Fields:
        g, *n = self._checked(point, name)
        return *cones.coordinates(g), *n

    def _products(self, a: Array, b: Array, point: Points) -> Array:
        return cones.inner_product(self._split(a), self._split(b), self._split(point), self._term)

    def _exp(self, velocity: TangentVectors, point: Points) -> Array:
        end, met_apex = cones.exp(self._split(velocity), self._split(point), self._term)
        refuse_triangles(
            values_of(met_apex),
            "tangent_vec must be the velocity of a geodesic that stays clear of g = 0",
            OutsideManifoldError,
        )
        return self._join(end)

    def _log(self, point: Points, start: Points) -> Array:
        ends = self._split(start), self._split(point)
        self._refuse_antipodal(*ends, "point must hold no normal antipodal to that of base_point")
        velocity, psi = cones.log(*ends, self._term)
        refuse_triangles(
            values_of(psi) >= np.pi,
            "point must be within an angle θ < π of base_point, or the minimal path runs through "
            "g = 0 and there is no logarithm",
            OutsideManifoldError,
        )
        return self._join(velocity)

    def _transport(self, vector: TangentVectors, point: Points, velocity: TangentVectors) -> Array:
        self._exp(velocity, point)  # where the geodesic exists
        carried = cones.parallel_transport(
            self._split(vector), self._split(point), self._split(velocity), self._term
        )
        return self._join(carried)

    def _geodesic_between(self, start: Points, end: Points) -> Callable[[ArrayLike], Points]:
        ends = self._checked(start, "initial_point"), self._checked(end, "end_point")
        through_apex = values_of(cones.runs_through_apex(*ends, self._term))
        message = "end_point must hold no normal antipodal to that of initial_point where ψ < π"
        self._refuse_antipodal(*ends, message, unless=through_apex)
        first, last = self._with_time_axis(ends[0]), self._with_time_axis(ends[1])

        def follow(t: ArrayLike) -> Points:
            times = np.reshape(self._times(t), (-1, 1))
            return self._join(cones.geodesic(first, last, times, self._term))

        return follow

    @staticmethod
    def _with_time_axis(parts: Fields) -> tuple[Array, ...]:
        """Return g, or g and n, with an axis of times before that of the triangles."""
        g, *normals = parts
        return np.expand_dims(g, -4), *(np.expand_dims(n, -3) for n in normals)

    def _refuse_antipodal(
        self, start: Fields, end: Fields, message: str, unless: Booleans | bool = False
    ) -> None:
        for n1, n2 in zip(start[1:], end[1:], strict=True):
            refuse_triangles(
                (values_of(sphere.angle(n1, n2)) >= sphere.ANTIPODAL) & ~np.asarray(unless),
                f"{message}, or there is no unique geodesic",
                OutsideManifoldError,
            )


class EbinMetric(ConeMetric):
    r"""The Ebin (DeWitt) metric on Met(T).

    .. math:: ((\delta g,\delta g))_g = \int_T \left(\operatorname{tr}((g^{-1}\delta g_0)^2)
              + \lambda\operatorname{tr}(g^{-1}\delta g)^2\right) \mu_g

    Equation 2 of the paper, corrected: both terms are under the integral.

    Parameters
    ----------
    space : MetricFields
    lam : float
        λ > 0. The default ½ is the metric :math:`\int\operatorname{tr}((g^{-1}\delta g)^2)\mu_g`.

    Examples
    --------
    >>> bodies = rh.datasets.load_open_bodies("coarse")
    >>> fields = rh.MetricFields(bodies.template)
    >>> ebin = rh.EbinMetric(fields, lam=0.5)
    >>> ebin.geodesic(*fields.random_point(2, rng=0))([0.0, 0.5, 1.0]).shape
    (3, 2400, 2, 2)
    """

    def __init__(self, space: MetricFields, lam: float = 0.5) -> None:
        super().__init__(space)
        self._term = EbinTerm(lam=lam)
        self.lam = self._term.lam


class GeneralElasticFieldMetric(ConeMetric):
    """The metric that `GeneralElasticMetric` pulls back, on pairs of metric and normal fields."""

    def __init__(
        self, space: ProductManifold, a: float = 1.0, b: float = 1.0, c: float = 1.0
    ) -> None:
        super().__init__(space)
        self._term = ConeTerm(1.0, a, b, c)


class NormalFields(TriangleFields):
    """C^∞(T, S²): a unit vector on every triangle of a template.

    Parameters
    ----------
    template : Template
    equip : bool
        Whether to equip the manifold with `NormalFieldMetric`.

    Examples
    --------
    >>> bodies = rh.datasets.load_open_bodies("coarse")
    >>> fields = rh.NormalFields(bodies.template)
    >>> fields.shape, fields.dim
    ((2400, 3), 4800)
    """

    value_dim, value_shape, value_name = 2, (3,), "unit vectors"

    def default_metric(self) -> type[RiemannianMetric]:
        return NormalFieldMetric

    def _are_values(self, values: Array, atol: float) -> Booleans:
        return np.abs(np.sqrt(dot(values, values)) - 1.0) <= atol

    def to_tangent(self, vector: TangentVectors, base_point: Points | None = None) -> Array:
        vector, base_point = self._at_point(vector, base_point)
        return sphere.to_tangent(vector, base_point)

    def projection(self, point: Points) -> Array:
        point = real_array(point, "point", self.shape)
        squares = dot(point, point)
        # Where a vector is 0, no unit vector is nearest, and it stays 0, off the manifold.
        return point / np.sqrt(np.where(squares > 0.0, squares, 1.0))[..., None]


class NormalFieldMetric(FieldMetric):
    r"""The metric :math:`\int_T \langle\delta n, \delta n\rangle\, dx` of a product of spheres.

    The second term of equation 3 of the paper. Exponential, logarithm, geodesics and parallel
    transport are those of the sphere on every triangle.

    Parameters
    ----------
    space : NormalFields

    Examples
    --------
    >>> bodies = rh.datasets.load_open_bodies("coarse")
    >>> fields = rh.NormalFields(bodies.template)
    >>> metric = rh.NormalFieldMetric(fields)
    >>> metric.geodesic(*fields.random_point(2, rng=0))([0.0, 0.5, 1.0]).shape
    (3, 2400, 3)
    """

    _term = NormalTerm()

    def _fields(self, point: Points, name: str) -> Fields:
        return (self.space.check_point(point, name),)

    def _products(self, a: Array, b: Array, point: Points) -> Array:
        return dot(a, b)

    def _exp(self, velocity: TangentVectors, point: Points) -> Array:
        return sphere.exp(velocity, point)

    def _log(self, point: Points, start: Points) -> Array:
        refuse_triangles(
            values_of(sphere.angle(start, point)) >= sphere.ANTIPODAL,
            "point must hold no normal antipodal to that of base_point, or there is no unique "
            "logarithm",
            OutsideManifoldError,
        )
        return sphere.log(start, point)

    def _transport(self, vector: TangentVectors, point: Points, velocity: TangentVectors) -> Array:
        return sphere.parallel_transport(vector, point, velocity)


class RotationFields(TriangleFields):
    """C^∞(T, SO(3)): a rotation on every triangle of a template.

    Tangent vectors at R are fields of matrices R A with A skew.

    Parameters
    ----------
    template : Template
    equip : bool
        Whether to equip the manifold with `RotationFieldMetric`.

    Examples
    --------
    >>> bodies = rh.datasets.load_open_bodies("coarse")
    >>> fields = rh.RotationFields(bodies.template)
    >>> fields.shape, fields.dim
    ((2400, 3, 3), 7200)
    """

    value_dim, value_shape, value_name = 3, (3, 3), "rotations"

    def default_metric(self) -> type[RiemannianMetric]:
        return RotationFieldMetric

    def _are_values(self, values: Array, atol: float) -> Booleans:
        # Gaps are twice as large as those of lengths from 1.
        gaps = transpose(values) @ values - np.eye(3)
        return np.all(np.abs(gaps) <= 2.0 * atol, axis=(-2, -1)) & (np.linalg.det(values) > 0)

    def to_tangent(self, vector: TangentVectors, base_point: Points | None = None) -> Array:
        vector, base_point = self._at_point(vector, base_point)
        return _tangent_vec(_angular_velocity(vector, base_point), base_point)

    def projection(self, point: Points) -> Array:
        return rotations.nearest_rotations(real_array(point, "point", self.shape))


class RotationFieldMetric(FieldMetric):
    r"""The metric :math:`\tfrac12 \int_T \mathrm{tr}(\delta R^T \delta R)\, dx`.

    On every triangle it is the two-sided invariant metric of the rotation group, whose distance is
    the angle θ of R₁ᵀ R₂, in [0, π]. There is no logarithm of rotations at the angle π.

    Parameters
    ----------
    space : RotationFields

    Examples
    --------
    >>> bodies = rh.datasets.load_open_bodies("coarse")
    >>> fields = rh.RotationFields(bodies.template)
    >>> metric = rh.RotationFieldMetric(fields)
    >>> metric.geodesic(*fields.random_point(2, rng=0))([0.0, 0.5, 1.0]).shape
    (3, 2400, 3, 3)
    """

    _term = RotationTerm()

    def _fields(self, point: Points, name: str) -> Fields:
        return (rotations.quaternions(self.space.check_point(point, name)),)

    def _products(self, a: Array, b: Array, point: Points) -> Array:
        return 0.5 * np.sum(a * b, axis=(-2, -1))

    def _exp(self, velocity: TangentVectors, point: Points) -> Array:
        return rotations.exp(_angular_velocity(velocity, point), point)

    def _log(self, point: Points, start: Points) -> Array:
        omega = rotations.log(start, point)
        values = values_of(omega)
        refuse_triangles(
            np.sqrt(dot(values, values)) >= sphere.ANTIPODAL,
            "point must hold no rotation by the angle π from that of base_point, or there is no "
            "unique logarithm",
            OutsideManifoldError,
        )
        return _tangent_vec(omega, start)

    def _transport(self, vector: TangentVectors, point: Points, velocity: TangentVectors) -> Array:
        omega = _angular_velocity(velocity, point)
        moved = rotations.parallel_transport(_angular_velocity(vector, point), omega)
        return _tangent_vec(moved, rotations.exp(omega, point))


def _angular_velocity(tangent_vec: TangentVectors, base_point: Points) -> Array:
    """Return the angular velocity v of tangent vectors R [v]×, in the axes before R."""
    return axial(np.matmul(transpose(base_point), tangent_vec))


def _tangent_vec(angular_velocity: Array, base_point: Points) -> Array:
    return np.matmul(base_point, cross_product_matrix(angular_velocity))
