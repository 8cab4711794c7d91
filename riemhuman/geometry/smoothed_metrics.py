"""Metrics on aligned surfaces by fields smoothed with heat: rotations and areas."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Callable
from typing import Unpack

import autograd.numpy as np
import numpy as onp

from riemhuman.arrays import Array, Booleans, Fields, Points, TangentVectors
from riemhuman.checks import checked, real, values_of
from riemhuman.errors import DegenerateSurfaceError
from riemhuman.geometry.fields import RotationFields
from riemhuman.geometry.manifold import SurfaceSpace, surface_space
from riemhuman.geometry.metric import POINTS, RiemannianMetric
from riemhuman.geometry.pairwise import Bulk, Factor, SumOfFactors
from riemhuman.geometry.product import PullbackMetric
from riemhuman.geometry.strategies import Solvers
from riemhuman.geometry.vector_space import FlatMetric, VectorSpace
from riemhuman.kernels import surface
from riemhuman.kernels.projections import field_coordinates
from riemhuman.kernels.rotations import fill_quaternions, nearest_rotations, transpose
from riemhuman.kernels.threads import of_one_kind
from riemhuman.terms._sums import SumOfFields, area_ratios
from riemhuman.terms.normals import RotationTerm

# The area of an adult's skin, m², from which the default times of other templates follow.
_SKIN = 1.8
# Number of deformations whose images are computed together, which bounds memory.
_AT_A_TIME = 8


class SmoothedMetric(PullbackMetric):
    """The pull-back of a metric by a field of surfaces, smoothed by heat for a time."""

    space: SurfaceSpace
    _adult_time: float
    is_translation_invariant = True

    @checked(time=real(minimum=0.0))
    def __init__(
        self,
        space: SurfaceSpace,
        target_metric: RiemannianMetric,
        map: Callable[[Points], Array],
        time: float | None = None,
        **solvers: Unpack[Solvers],
    ) -> None:
        if time is None:
            time = self._adult_time / _SKIN * float(space.template.face_areas.sum())
        self.time = time
        super().__init__(space, target_metric, map, **solvers)

    @abstractmethod
    def _undefined(self, f: Points) -> bool:
        """Return whether a surface, or one of several, has no field."""

    @checked(path=POINTS)
    def energy_and_gradient(self, path: Points) -> tuple[float, Array]:
        if self._undefined(path):
            return np.inf, np.zeros(path.shape)
        return super().energy_and_gradient(path)

    def gram_matrix(self, vectors: TangentVectors, base_point: Points) -> Array:
        vectors = self.check_points(vectors, "vectors")
        surfaces = self._base_points(base_point)
        gram = np.zeros((len(vectors), len(vectors)))
        if not len(vectors):
            return gram
        for f in surfaces:
            # Coordinates preserve the lengths of curves, and so inner products.
            images = []
            for first in range(0, len(vectors), _AT_A_TIME):
                batch = vectors[first : first + _AT_A_TIME]
                base_points = np.broadcast_to(f, batch.shape)
                coordinates = self.lower_bound_coordinates
                images.append(surface.differential(coordinates, batch, base_points))
            changes = onp.concatenate(images)
            gram += changes @ changes.T
        return gram / len(surfaces)


class RotationMetric(SmoothedMetric):
    r"""The pull-back of `RotationFieldMetric` by the smoothed rotations of triangles.

    The differential of a surface f on a triangle is :math:`df = R \sqrt g` (polar decomposition),
    where the rotation R takes the template's plane and normal to those of the surface. The
    rotations of all triangles are smoothed, as matrices, by a heat flow of duration `time`, and the
    nearest rotations are compared. Like normals, the metric distinguishes poses, but more reliably:
    smoothing averages over the thickness of a limb, within which differences in body shape rotate
    triangles in opposite directions. Translation and scale of one surface leave the distance
    unchanged.

    Parameters
    ----------
    space : AlignedSurfaces
    time : float, optional
        Duration of the heat flow, in squared units of the template, such as m²: heat spreads by √(4
        time). By default it is 1/720 of the template's area, which for an adult corresponds to the
        thickness of a limb.
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

    _adult_time = 0.0025  # m²: heat spreads by 10 cm, the thickness of a limb
    is_stretch_invariant = True

    def __init__(
        self,
        space: SurfaceSpace,
        time: float | None = None,
        **solvers: Unpack[Solvers],
    ) -> None:
        space = surface_space(space)
        template = space.template
        axes = surface.polar_frames(*space.partial_derivatives(template.vertices))
        self._axes = of_one_kind(axes)
        super().__init__(space, RotationFields(template).metric, self.rotations, time, **solvers)

    def rotations(self, f: Points) -> Array:
        """Return the smoothed rotations of all triangles from the template, shape (..., F, 3, 3).

        Parameters
        ----------
        f : array, shape (..., V, 3)
        """
        f_u, f_v = self.space.partial_derivatives(f)
        surface.refuse_degenerate(surface.is_degenerate(values_of(f_u), values_of(f_v)))
        return self._diffused(np.matmul(surface.polar_frames(f_u, f_v), transpose(self._axes)))

    def _diffused(self, rotations: Array) -> Array:
        if self.time == 0:
            return rotations
        flat = np.reshape(rotations, (*np.shape(rotations)[:-2], 9))
        diffused = surface.apply_operator(self.space.template.heat.step(self.time), flat)
        return nearest_rotations(np.reshape(diffused, np.shape(rotations)))

    @property
    def bulk(self) -> Bulk:
        def fields(points: Points) -> Fields:
            return (self._quaternions(points),)

        return SumOfFields(RotationTerm(), self.space.template.face_areas, fields)

    def _quaternions(self, points: Points) -> Array:
        """Return the smoothed rotations of surfaces as quaternions, shape (n, F, 4)."""
        surfaces = self.space.check_point(points, "points")
        n_faces = self.space.template.n_faces
        components, rotations = np.empty((len(surfaces), n_faces, 4)), np.empty((n_faces, 3, 3))
        for f, quaternions in zip(surfaces, components, strict=True):
            f_u, f_v = (of_one_kind(part) for part in self.space.partial_derivatives(f))
            if surface.fill_rotations(f_u, f_v, self._axes, rotations):
                fill_quaternions(of_one_kind(self._diffused(rotations)), quaternions)
            else:  # the definition names the triangle without area
                fill_quaternions(of_one_kind(self.rotations(f)), quaternions)
        return components

    def lower_bound_coordinates(self, points: Points) -> Array:
        rotations = self.rotations(points)
        flat = np.sqrt(0.5) * np.reshape(rotations, (*np.shape(rotations)[:-2], 9))
        return field_coordinates(flat, self.space.template.face_areas)

    def _undefined(self, f: Points) -> bool:
        return bool(surface.is_degenerate(*self.space.partial_derivatives(f)).any())


class AreaMetric(SmoothedMetric):
    r"""The L² distance of smoothed logarithms of area ratios, for identifying scanned people.

    Let :math:`m_v` be a third of the area of the triangles around a vertex v of the template. The
    area ratio of a surface at v is the average of the area ratios of these triangles t, weighted by
    their areas in the template. The logarithms are smoothed by a heat flow of duration `time`, in
    one implicit step with the template's cotangent Laplacian L, where M is the diagonal matrix of
    the areas m:

    .. math:: \begin{split} d(f_1, f_2)^2 &= \sum_v m_v (x_1(v) - x_2(v))^2, \qquad
              (M + \mathrm{time}\, L)\, x = M b, \\
              b(v) &= \log\Big(\frac{1}{3 m_v} \sum_{t \ni v} w_t A_t\Big) \end{split}

    A metric that compares single triangles mainly compares the noise of the scanner. Averages over
    body parts preserve the sizes of these parts; they remove the noise, and the local stretching
    and compression of the skin in a pose. Translation and rotation of one surface leave the
    distance unchanged; if one surface is scaled by s, its logarithms increase by 2 log s.

    Parameters
    ----------
    space : AlignedSurfaces
    time : float, optional
        Duration of the heat flow, in squared units of the template, such as m²: heat spreads by √(4
        time). By default it is 1/36 of the template's area; for an adult of 1.8 m², this is 0.05
        m².
    **solvers : strategies, see `RiemannianMetric`

    Notes
    -----
    Fields are vectors in a flat space: exponentials and logarithms of fields, means and principal
    components have closed forms there, and distances between `lower_bound_coordinates` equal those
    of the metric. Deformations of a surface that preserve areas cost nothing, so geodesics and
    means of surfaces need another metric. Triangles of zero area are allowed, unless all triangles
    at a vertex have zero area.

    Examples
    --------
    >>> bodies = rh.datasets.load_open_bodies("coarse")
    >>> noise = 0.001 * np.random.default_rng(0).standard_normal(bodies.points.shape)
    >>> metric = rh.AreaMetric(rh.AlignedSurfaces(bodies.template))
    >>> print(rh.retrieval.scores(metric.dist_pairwise(bodies.points + noise), bodies.subject).nn)
    100.0
    """

    _adult_time = 0.05  # m²: heat spreads by 45 cm
    is_rotation_invariant = True

    def __init__(
        self,
        space: SurfaceSpace,
        time: float | None = None,
        **solvers: Unpack[Solvers],
    ) -> None:
        space = surface_space(space)
        areas = space.template.vertex_heat.masses
        fields = VectorSpace((len(areas),)).equip_with_metric(FlatMetric, weights=areas)
        super().__init__(space, fields.metric, self.log_areas, time, **solvers)

    def log_areas(self, f: Points) -> Array:
        """Return the logarithms of the area ratios at vertices, smoothed, shape (..., V).

        Parameters
        ----------
        f : array, shape (..., V, 3)
        """
        return self._smoothed(self._averages(self._ratios(f)))

    @property
    def bulk(self) -> Bulk:
        return SumOfFactors([Factor(self.compiled_log_areas, 1.0, self.target_metric.bulk)])

    def compiled_log_areas(self, points: Points) -> Array:
        """Return `log_areas` of several surfaces, faster but without derivatives, shape (n, V).

        Parameters
        ----------
        points : array, shape (n, V, 3)
        """
        surfaces, template = self.space.check_point(points, "points"), self.space.template
        averages = np.empty((len(surfaces), template.n_vertices))
        for row, ratios in zip(averages, area_ratios(surfaces, template), strict=True):
            row[:] = self._averages(ratios)
        return self._smoothed(averages)

    def lower_bound_coordinates(self, points: Points) -> Array:
        return np.sqrt(self.space.template.vertex_heat.masses) * self.log_areas(points)

    def _ratios(self, f: Points) -> Array:
        """Return the area ratios of triangles, shape (..., F)."""
        first = surface.follow_up(*self.space.partial_derivatives(f))
        return np.where(first.degenerate, 0.0, first.areas)

    def _averages(self, ratios: Array) -> Array:
        """Return area ratios at vertices, 1 where no triangle counts, shape (..., V)."""
        template = self.space.template
        averages = surface.apply_operator(template.averaging_operator, ratios[..., None])[..., 0]
        unused: Booleans = template.vertex_heat.masses == 0.0
        return averages + unused

    def _smoothed(self, averages: Array) -> Array:
        surface.refuse_triangles(
            values_of(averages) == 0.0,
            "every vertex of the surface must be a corner of a triangle with an area, for its area "
            "ratio to have a logarithm",
            DegenerateSurfaceError,
            ("vertex", "vertices"),
        )
        logarithms, template = np.log(averages), self.space.template
        if self.time > 0:
            step = template.vertex_heat.step(self.time)
            logarithms = surface.apply_operator(step, logarithms[..., None])[..., 0]
        return logarithms[..., template.seams.first_copies] if template.seams else logarithms

    def _undefined(self, f: Points) -> bool:
        return bool(np.any(self._averages(self._ratios(f)) == 0.0))
