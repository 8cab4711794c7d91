"""Fields of rotations on a template with their metric, and its pull-back to surfaces."""

from __future__ import annotations

from typing import Any, Unpack

import autograd.numpy as np
from numpy import ndarray

from riemhuman.checks import real_array, real_number, values_of
from riemhuman.errors import ArgumentError, OutsideManifoldError
from riemhuman.geometry.fields import FieldMetric, TriangleFields
from riemhuman.geometry.manifold import Manifold
from riemhuman.geometry.metric import RiemannianMetric
from riemhuman.geometry.pairwise import Bulk
from riemhuman.geometry.pullback import PullbackMetric
from riemhuman.geometry.strategies import Solvers
from riemhuman.kernels import rotations
from riemhuman.kernels.drift import still_path
from riemhuman.kernels.projections import field_coordinates
from riemhuman.kernels.rotations import (
    axial,
    cross_product_matrix,
    nearest_rotations,
    quaternions,
    transpose,
)
from riemhuman.kernels.sphere import ANTIPODAL
from riemhuman.kernels.surface import (
    apply_operator,
    dot,
    is_degenerate,
    polar_frames,
    refuse_degenerate,
    refuse_triangles,
)
from riemhuman.terms._sum import SumOfTerms
from riemhuman.terms.normals import RotationTerm
from riemhuman.terms.term import Fields

# √(4 time) is then 10 cm on an adult body, whose skin has 1.8 m²: the thickness of a limb.
_SHARE_OF_AREA = 0.0025 / 1.8
# Deformations whose images are computed together, for the sake of memory.
_AT_A_TIME = 8


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

    value_dim, value_shape = 3, (3, 3)

    def default_metric(self) -> type[RiemannianMetric]:
        return RotationFieldMetric

    def belongs(self, point: ndarray, atol: float = 1e-9) -> ndarray:
        point, finite = self._candidates(point, "point")
        return finite & np.all(_is_rotation(point, atol), axis=-1)

    def to_tangent(self, vector: ndarray, base_point: ndarray | None = None) -> ndarray:
        base_point = self._needed_base_point(base_point)
        return _tangent_vec(_angular_velocity(vector, base_point), base_point)

    def projection(self, point: ndarray) -> ndarray:
        return nearest_rotations(point)

    def check_point(self, point: Any, name: str = "point") -> ndarray:
        point = real_array(point, name, self.shape, rows=True)
        refuse_triangles(
            ~_is_rotation(values_of(point), 2e-6), f"{name} must hold rotations", ArgumentError
        )
        return point


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

    def _fields(self, point: Any, name: str) -> Fields:
        return (quaternions(self.space.check_point(point, name)),)

    def _products(self, a: ndarray, b: ndarray, point: ndarray) -> ndarray:
        return 0.5 * np.sum(a * b, axis=(-2, -1))

    def _exp(self, velocity: ndarray, point: ndarray) -> ndarray:
        return rotations.exp(_angular_velocity(velocity, point), point)

    def _log(self, point: ndarray, start: ndarray) -> ndarray:
        omega = rotations.log(start, point)
        values = values_of(omega)
        refuse_triangles(
            np.sqrt(dot(values, values)) >= ANTIPODAL,
            "point must hold no rotation by the angle π from that of base_point, or there is no "
            "unique logarithm",
            OutsideManifoldError,
        )
        return _tangent_vec(omega, start)

    def _transport(self, vector: ndarray, point: ndarray, velocity: ndarray) -> ndarray:
        omega = _angular_velocity(velocity, point)
        moved = rotations.parallel_transport(_angular_velocity(vector, point), omega)
        return _tangent_vec(moved, rotations.exp(omega, point))

    def _curvatures(self, a: ndarray, b: ndarray, point: ndarray) -> ndarray:
        # On a group with a two-sided invariant metric ⟨R(a, b) b, a⟩ is a quarter of the squared
        # length of [a, b]: every plane of the rotations of a triangle has curvature ¼ / w_t.
        bracket = np.cross(_angular_velocity(a, point), _angular_velocity(b, point))
        return 0.25 * dot(bracket, bracket)


class RotationMetric(PullbackMetric):
    r"""The pull-back of `RotationFieldMetric` by the rotations of triangles, diffused.

    The differential of a surface f on a triangle is :math:`df = R \sqrt g` (polar decomposition),
    where R takes the template's plane and normal to the surface's and so is a rotation. Heat flows
    between the rotations of all triangles for `time`, as between matrices, and the nearest
    rotations are compared. Like normals, the metric distinguishes poses, and more reliably:
    diffusion averages over the thickness of a limb, within which a person's build rotates triangles
    back and forth. Translation and scale of one surface leave the distance unchanged.

    Parameters
    ----------
    space : AlignedSurfaces
    time : float, optional
        Duration of the heat flow, in squared units of the template, such as m²: heat spreads by √(4
        time). By default a 720th of the template's area, on an adult the thickness of a limb.
    **solvers : strategies, see `RiemannianMetric`

    Examples
    --------
    >>> bodies = rh.datasets.load_open_bodies("coarse")
    >>> space = rh.AlignedSurfaces(bodies.template)
    >>> pose = rh.RotationMetric(space)
    >>> same_pose, same_person = bodies[13], bodies[4]
    >>> bool(pose.dist(bodies[3], same_pose) < pose.dist(bodies[3], same_person))
    True
    """

    is_translation_invariant = True
    is_stretch_invariant = True

    def __init__(
        self,
        space: Manifold,
        time: float | None = None,
        **solvers: Unpack[Solvers],
    ) -> None:
        surfaces: Any = space
        template = space.template
        if time is None:
            time = _SHARE_OF_AREA * template.face_areas.sum()
        self.time = real_number(time, "time", minimum=0.0)
        self._axes = polar_frames(*surfaces.partial_derivatives(template.vertices))
        super().__init__(space, RotationFields(template).metric, self.rotations, **solvers)

    def rotations(self, f: ndarray) -> ndarray:
        """Return the rotations of all triangles from the template, diffused, shape (..., F, 3, 3).

        Parameters
        ----------
        f : array, shape (..., V, 3)
        """
        f_u, f_v = self.space.partial_derivatives(f)
        refuse_degenerate(is_degenerate(values_of(f_u), values_of(f_v)))
        rotations = np.matmul(polar_frames(f_u, f_v), transpose(self._axes))
        if self.time == 0:
            return rotations
        flat = np.reshape(rotations, (*np.shape(rotations)[:-2], 9))
        diffused = apply_operator(self.space.template.heat.step(self.time), flat)
        return nearest_rotations(np.reshape(diffused, np.shape(rotations)))

    @property
    def bulk(self) -> Bulk:

        def fields(points: ndarray) -> tuple[ndarray]:
            surfaces = self.space.check_point(points, "points")
            components = np.empty((len(surfaces), self.space.template.n_faces, 4))
            for i, f in enumerate(surfaces):
                components[i] = quaternions(self.rotations(f))
            return (components,)

        return SumOfTerms([RotationTerm()], self.space.template, fields)

    def lower_bound_coordinates(self, points: ndarray) -> ndarray:
        rotations = self.rotations(points)
        flat = np.sqrt(0.5) * np.reshape(rotations, (*np.shape(rotations)[:-2], 9))
        return field_coordinates(flat, self.space.template.face_areas)

    def energy_and_gradient(self, path: ndarray) -> tuple[float, ndarray]:
        path = self.check_points(path, "path")
        if is_degenerate(*self.space.partial_derivatives(path)).any():
            return np.inf, np.zeros(path.shape)
        return super().energy_and_gradient(path)

    def gram_matrix(self, vectors: ndarray, base_point: ndarray) -> ndarray:
        vectors = self.check_points(vectors, "vectors")
        surfaces = self.space.check_point(base_point, "base_point").reshape(-1, *self.space.shape)
        roots = np.sqrt(0.5 * self.space.template.face_areas)[:, None, None]
        images = np.empty((len(vectors), roots.size * 9))
        gram = np.zeros((len(vectors), len(vectors)))
        for f in surfaces:
            for first in range(0, len(vectors), _AT_A_TIME):
                some = slice(first, first + _AT_A_TIME)
                changes = roots * self.differential(vectors[some], f)
                images[some] = changes.reshape(len(changes), -1)
            gram += images @ images.T
        return gram / len(surfaces)

    def remove_drift(self, path: ndarray) -> ndarray:
        path = self.check_points(path, "path")
        return still_path(path, self.space.template.vertex_areas, rotations=False)


def _angular_velocity(tangent_vec: ndarray, base_point: ndarray) -> ndarray:
    """Return the angular velocity v of tangent vectors R [v]×, in the axes before R."""
    return axial(np.matmul(transpose(base_point), tangent_vec))


def _tangent_vec(angular_velocity: ndarray, base_point: ndarray) -> ndarray:
    return np.matmul(base_point, cross_product_matrix(angular_velocity))


def _is_rotation(matrices: ndarray, atol: float) -> ndarray:
    gaps = transpose(matrices) @ matrices - np.eye(3)
    return np.all(np.abs(gaps) <= atol, axis=(-2, -1)) & (np.linalg.det(matrices) > 0)
