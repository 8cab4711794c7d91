r"""Motions, changes of shape and poses of one body, transferred to another.

The page "Geodesics and statistics" of the documentation says when to use which.

For `MotionTransfer` and `ShapeTransfer` a triangle of body A and its normal move from frame P₀ to
frame P; the matrix S = P P₀⁻¹ of this change is applied to the same triangle of body B, and the
surface whose derivatives come closest to the results solves a Poisson equation (Sumner and Popović,
"Deformation transfer for triangle meshes", SIGGRAPH 2004; `riemhuman.surfaces._poisson`). B thus
keeps its own metric field, changed by as much as A's, and its triangles rotate as those of A. Poses
are transferred by `PoseTransfer`, from which `Disentangling` starts.

What is transferred includes how A holds a pose. Compared with B's own performance, whole bodies of
real people are therefore little nearer than simple baselines, patches of 10 cm much nearer; the
page has figures for simulated people and for FAUST.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from itertools import chain
from typing import NamedTuple

import numpy as np
from scipy.sparse.linalg import LinearOperator

from riemhuman.arrays import Array, ArrayLike, Points
from riemhuman.checks import (
    a_basis,
    check_methods,
    checked,
    choice,
    flag,
    positive,
    whole,
)
from riemhuman.errors import ArgumentError
from riemhuman.geometry import SurfaceMetric
from riemhuman.geometry.manifold import SurfaceSpace
from riemhuman.geometry.metric import check_metric
from riemhuman.kernels.rotations import nearest_rotations
from riemhuman.kernels.surface import deformation_gradients, stacked_derivatives, triangle_frames
from riemhuman.solvers._lbfgs import minimize_from
from riemhuman.solvers._preconditioners import CholeskyFactor, SparseCholeskyFactor
from riemhuman.solvers.paths import rounding_energy
from riemhuman.solvers.results import Result, finish
from riemhuman.surfaces.deformation_basis import DeformationBasis
from riemhuman.surfaces.measures import triangle_areas

TRANSFERS = ("change", "pose")

# Vertices that have moved by less, in metres, are at rest, as planted feet are.
_AT_REST = 0.01

# Relative errors of vertices that count as rounding.
_ROUNDING = 1e-12

# Share of its area, on A and at the start, below which no triangle shrinks: past the point where a
# triangle has no area its normal, and the sum with it, jumps.
_LEAST_AREA = 1e-6

# Time of the flow, as a share of the area of a body. Of a variation of wavelength ℓ there remains
# about exp(−4π²t/ℓ²): a quarter of what goes around an arm, 0.3 m, and nine tenths of what changes
# from a thigh to its shin, 1 m.
SMOOTHING = 1.0 / 600.0

# How much longer heat flows along bones: see `Disentangling`.
_BONE_SMOOTHING = 10.0

# A limb of radius r that bends by κ radians a metre strains its skin by rκ. Least squares weigh
# with the inverse of the variance, σ² + (rκ)²; r/σ is 0.05 m over 0.1, as a share of √area.
_STRAIN_OF_BENDS = 0.37


@checked(transfer=choice(*TRANSFERS))
@dataclass(frozen=True)
class MotionTransfer:
    """A motion of one body replayed on another.

    The target moves as the source does, rather than as the target would. On FAUST, compared with
    people's own performances, the error is 0.96 of that of adding the source's vertex offsets for
    whole bodies, and 0.58 for patches of 10 cm. On simulated people, compared with the same motion
    performed by the body model that generated them, it is 0.65 (tests/benchmarks/test_transfer.py).

    Parameters
    ----------
    transfer : str
        "change": the target repeats the changes of the source since the reference, about the same
        axes in space. "pose": the target takes the pose of the source in every frame, whatever its
        own initial pose.

    Examples
    --------
    >>> bodies = rh.datasets.load_open_bodies("coarse")
    >>> space = rh.AlignedSurfaces(bodies.template)
    >>> motion = rh.datasets.load_open_motions("coarse", sequences="knees")[0][:30:10]
    >>> rh.solvers.MotionTransfer().solve(space, motion, bodies[0]).shape
    (3, 1202, 3)
    """

    transfer: str = "change"

    def solve(
        self,
        space: SurfaceSpace,
        motion: Iterable[ArrayLike],
        target: Array,
        reference: Array | None = None,
    ) -> Array:
        """Return the target's motion; parts that rest in the source, such as feet, stay at rest.

        Parameters
        ----------
        space : AlignedSurfaces
        motion : array, shape (n_frames, V, 3), or iterable of arrays (V, 3)
            Motion of the source.
        target : array, shape (V, 3)
            Body to be moved.
        reference : array, shape (V, 3), optional
            The source in the target's pose, by default the first frame; not used if poses are
            transferred.
        """
        if reference is not None and self.transfer == "pose":
            raise ArgumentError(
                'reference must be left out if transfer="pose": poses are transferred '
                "unchanged, whatever the pose of the target"
            )
        frames = (_one_surface(space, frame, f"motion[{k}]") for k, frame in enumerate(motion))
        first_frame = next(frames, None)
        if first_frame is None:
            raise ArgumentError("motion must have at least one frame; found none")
        target = _one_surface(space, target, "target")
        source = first_frame
        if reference is not None:
            source = _one_surface(space, reference, "reference")
        if self.transfer == "pose":
            poses = PoseTransfer(space)
            start = poses.solve(target, source)

            def replay(frame: Array) -> Array:
                return poses.solve(target, frame)

        else:
            changes = _ChangeTransfer(space, source, target)
            start = target

            def replay(frame: Array) -> Array:
                return changes.solve(frame, target + (frame - source))

        moved = []
        for frame in chain([first_frame], frames):
            # Mean displacements agree, above all those of vertices at rest.
            surface, change = replay(frame), frame - source
            weights = space.template.vertex_areas / (_AT_REST**2 + np.sum(change**2, axis=1))
            moved.append(surface + np.average(start + change - surface, axis=0, weights=weights))
        return np.stack(moved)


@dataclass(frozen=True)
class ShapeTransfer:
    """A change of shape, transferred to another pose.

    The difference between two bodies in one pose is applied to the first body in another pose: its
    triangles undergo the same stretches, along axes that rotate with them. This difference includes
    how differently the two hold the pose. On FAUST, compared with the second person's own
    performance, the result is therefore worse than the unchanged target for whole bodies (87
    against 72 mm), and better for patches of 10 cm (5.0 against 8.1 mm;
    tests/benchmarks/test_transfer.py).

    Examples
    --------
    >>> bodies = rh.datasets.load_open_bodies("coarse")
    >>> space = rh.AlignedSurfaces(bodies.template)
    >>> rh.solvers.ShapeTransfer().solve(space, bodies[0], bodies[10], bodies[3]).shape
    (1202, 3)
    """

    def solve(self, space: SurfaceSpace, before: Array, after: Array, target: Array) -> Array:
        """Return the second body in the target's pose, with the centroids of its components.

        Parameters
        ----------
        space : AlignedSurfaces
        before, after : array, shape (V, 3)
            The first and the second body in one pose.
        target : array, shape (V, 3)
            The first body in another pose.
        """
        before = _one_surface(space, before, "before")
        after = _one_surface(space, after, "after")
        target = _one_surface(space, target, "target")
        return _ChangeTransfer(space, before, target, turned=True).solve(after, target)


@dataclass(frozen=True, repr=False)
class DisentanglingResult(Result):
    """A surface near one body in shape and near another in pose, and how it was found.

    Attributes
    ----------
    surface : array, shape (V, 3)
    posed : array, shape (V, 3)
        Body A in the pose of B, from which the search starts.
    value : float
        The weighted sum of the squared distances from A and from `posed`.
    values : array, shape (n_iterations + 1,)
        This value at the start and after each iteration, before a basis is applied.
    shape_dist, pose_dist : float
        Distances from the two bodies in the respective metric.
    n_iterations, n_evaluations, status, message
        See `Result`.

    Examples
    --------
    >>> bodies = rh.datasets.load_open_bodies("coarse")
    >>> space = rh.AlignedSurfaces(bodies.template)
    >>> build, pose = rh.ElasticMetric(space, 1.0, 1.0, 0.0), rh.ElasticMetric(space, 0.0, 0.0, 1.0)
    >>> rh.solvers.Disentangling().solve(build, pose, bodies[0], bodies[13]).converged
    True
    """

    surface: Points
    posed: Array
    value: float
    values: Array
    shape_dist: float
    pose_dist: float

    def points_to_draw(self) -> Points:
        return self.surface


@checked(
    basis=a_basis,
    pose_weight=positive,
    bone_smoothing=positive,
    tolerance=positive,
    max_iter=whole(minimum=1),
    progress=flag,
)
@dataclass(frozen=True)
class Disentangling:
    r"""A body A in the pose of a body B, with all details of A.

    .. math:: \arg\min_f\; d_{shape}(f, A)^2 + w\, d_{pose}(f, A_B)^2

    A_B is A, brought into the pose of B by a smooth field of rotations. It is used because the
    normals of B show not only its pose but also its body shape, such as face and chest. The search
    starts from A_B and spreads the strain at the joints to their surroundings. The result is where
    B is and holds the pose as B does, which A might not. On FAUST, compared with A's own
    performance, the error is 0.86 of that of the better input for whole bodies, and 0.76 for
    patches of 10 cm. On simulated people, compared with A's body posed by the model that generated
    them, it is less than half (tests/benchmarks/test_transfer.py).

    In the shape metric, λ must be large enough for distances not to saturate: use (1, 1, 0) rather
    than the (1, 1e-4, 0) of the paper's retrieval, whose gradient vanishes almost everywhere.

    Parameters
    ----------
    basis : DeformationBasis, optional
        Deformations of bodies in motion. With a basis, the result differs from A only by these
        deformations: it is the surface of this kind nearest to the minimiser, in least squares.
    pose_weight : float
        w.
    bone_smoothing : float
        How much longer heat flows along bones, once the joints are known. The larger it is, the
        less of B's body shape is transferred, above all to the torso, and the farther the limbs end
        from where B holds them. The default adds at most 3 % to the distance from A's own
        performance of the pose (tests/benchmarks/test_transfer.py).
    tolerance, max_iter, progress
        See `NearestSurface`.

    Examples
    --------
    >>> bodies = rh.datasets.load_open_bodies("coarse")
    >>> space = rh.AlignedSurfaces(bodies.template)
    >>> build, pose = rh.ElasticMetric(space, 1.0, 1.0, 0.0), rh.ElasticMetric(space, 0.0, 0.0, 1.0)
    >>> rh.solvers.Disentangling().solve(build, pose, bodies[0], bodies[13]).surface.shape
    (1202, 3)
    """

    basis: DeformationBasis | None = None
    pose_weight: float = 1000.0
    bone_smoothing: float = _BONE_SMOOTHING
    tolerance: float = 1e-3
    max_iter: int = 300
    progress: bool = False

    def solve(
        self, shape_metric: SurfaceMetric, pose_metric: SurfaceMetric, shape: Array, pose: Array
    ) -> DisentanglingResult:
        """Find the surface.

        Parameters
        ----------
        shape_metric, pose_metric : SurfaceMetric
            Metrics on surfaces over the same template.
        shape : array, shape (V, 3)
            Body A, which gives the shape.
        pose : array, shape (V, 3)
            Body B, which gives the pose.
        """
        check_metric(shape_metric, "shape_metric")
        check_metric(pose_metric, "pose_metric")
        space = shape_metric.space
        if not space.is_surface_space or space.shape != pose_metric.space.shape:
            raise ArgumentError(
                "shape_metric and pose_metric must be metrics on surfaces over the same "
                f"template; found points of shape {space.shape} and {pose_metric.space.shape}"
            )
        shape = _one_surface(space, shape, "shape")
        pose = _one_surface(space, pose, "pose")
        if self.basis is not None:
            self.basis.check_fits(len(shape))
        posed = PoseTransfer(space, self.bone_smoothing).solve(shape, pose)
        return finish(self, self._search(shape_metric, pose_metric, shape, pose, posed))

    def _search(
        self,
        shape_metric: SurfaceMetric,
        pose_metric: SurfaceMetric,
        shape: Array,
        pose: Array,
        posed: Array,
    ) -> DisentanglingResult:
        """Return the surface found from A in the pose of B."""
        goals = _Goals(
            [_Goal(shape_metric, 1.0, shape), _Goal(pose_metric, self.pose_weight, posed)]
        )
        faces = shape_metric.space.template.faces
        least_areas = _LEAST_AREA * np.minimum(
            triangle_areas(shape, faces), triangle_areas(posed, faces)
        )

        def objective(surface: Points) -> tuple[float, Array]:
            if np.any(triangle_areas(surface, faces) < least_areas):
                return np.inf, np.zeros_like(surface)
            return goals.value_and_gradient(surface)

        minimum = minimize_from(
            posed,
            shape_metric.space,
            None,
            objective,
            goals.factor,
            tolerance=self.tolerance,
            max_iter=self.max_iter,
            floor=goals.rounding(posed),
            progress="disentangling" if self.progress else "",
        )
        surface, value = minimum.x, minimum.value
        if self.basis is not None:
            surface = _in_span(self.basis, shape, surface)
            value, _ = goals.value_and_gradient(surface)
        surface = surface + np.mean(pose - surface, axis=0)
        return DisentanglingResult(
            surface,
            posed,
            value,
            minimum.values,
            float(shape_metric.dist(shape, surface)),
            float(pose_metric.dist(pose, surface)),
            **minimum.outcome,
        )


class _Goal(NamedTuple):
    """A surface to be near to by a metric, and the weight of the squared distance."""

    metric: SurfaceMetric
    weight: float
    surface: Points


class _Goals(NamedTuple):
    """The weighted sum of the squared distances from some surfaces, each by its metric."""

    goals: list[_Goal]

    def value_and_gradient(self, surface: Points) -> tuple[float, Array]:
        value, gradient = 0.0, np.zeros_like(surface)
        for metric, weight, point in self.goals:
            squared, slopes = metric.energy_and_gradient(np.stack([point, surface]))
            value += weight * squared
            gradient += weight * slopes[1]
        return value, gradient

    def factor(self, surface: Points) -> CholeskyFactor:
        """Return a factor of about the second derivatives at a surface."""
        matrix = sum(goal.weight * goal.metric.metric_matrix(surface) for goal in self.goals)
        return SparseCholeskyFactor(2.0 * matrix)

    def rounding(self, surface: Points) -> float:
        """Return the part of the value at a surface that is due to rounding errors."""
        return sum(
            goal.weight * rounding_energy(goal.metric, surface, size=_ROUNDING)
            for goal in self.goals
        )


def _in_span(basis: DeformationBasis, origin: Points, surface: Points) -> Points:
    """Return the surface in the span of a basis about another one, up to a translation."""
    # Translations change neither metric.
    difference = surface - origin
    difference -= difference.mean(axis=0)
    return origin + basis.project(difference)


class _ChangeTransfer:
    """Deformations of a reference, transferred to a target.

    Their axes are those of the world or, for a target in another pose, turn from the triangles of
    the reference to those of the target.
    """

    def __init__(
        self, space: SurfaceSpace, reference: Array, target: Array, *, turned: bool = False
    ) -> None:
        self._operator = space.template.differential_operator
        self._interpolator = space.template.interpolator
        self._frames = triangle_frames(reference, self._operator)
        self._target_frames = triangle_frames(target, self._operator)
        self._axes = None
        if turned:
            gradients = deformation_gradients(self._frames, self._target_frames)
            self._axes = nearest_rotations(gradients)

    def solve(self, surface: Points, placed_as: Array) -> Array:
        """Return the target, deformed as the reference is deformed into this surface."""
        frames = triangle_frames(surface, self._operator)
        gradients = deformation_gradients(self._frames, frames)
        if self._axes is not None:
            gradients = self._axes @ gradients @ np.swapaxes(self._axes, -1, -2)
        derivatives = stacked_derivatives(gradients @ self._target_frames)
        return self._interpolator.surface_of(derivatives, placed_as)


class PoseTransfer:
    """Brings one body into the pose of another, whatever the build of the other.

    The polar rotations R of the triangles, from body A to body B, contain the pose of B, which
    varies from bone to bone, and its build, which varies around a limb and within a face. The heat
    flow of R over the template keeps the first. Where the smoothed field bends, there are joints;
    heat then flows anew from R, `bone_smoothing` times as long, and slowly across them (after
    Perona and Malik, "Scale-space and edge detection using anisotropic diffusion", IEEE PAMI 12,
    1990). A's triangles, rotated by the smooth field, are put together by a Poisson equation. A
    second round adds the smoothed remainder of the rotations, which restores the bends of joints.
    """

    def __init__(self, space: SurfaceSpace, bone_smoothing: float = _BONE_SMOOTHING) -> None:
        self._template = template = space.template
        self._bone_smoothing = bone_smoothing
        self._area = float(template.face_areas.sum())
        self._time = self._area * SMOOTHING

    def solve(self, shape: Array, pose: Array) -> Array:
        """Return a body in the pose of another, with its centroid, shape (V, 3)."""
        frames = triangle_frames(shape, self._template.differential_operator)
        rotations, heat = self._rotations(frames, pose), self._template.heat
        # A single implicit step would damp short waves too little, so each flow has two.
        trust = self._trust(heat_flow(heat.step(0.5 * self._time), rotations))
        along_bones = heat.step_through(trust, 0.5 * self._bone_smoothing * self._time)
        # By the trust of the second field, which bends sharply, few triangles would take all strain
        # of a joint and nearly lose their area.
        assemble = self._template.interpolator.with_weights(trust)
        field = heat_flow(along_bones, rotations)
        posed = assemble.surface_of(stacked_derivatives(field @ frames), pose)
        # The bends of joints, which the flow has smoothed.
        missing = self._rotations(self._frames(posed), pose)
        field = heat_flow(along_bones, missing) @ field
        return assemble.surface_of(stacked_derivatives(field @ frames), pose)

    def _frames(self, surface: Points) -> Array:
        return triangle_frames(surface, self._template.differential_operator)

    def _rotations(self, frames: Array, surface: Points) -> Array:
        """Return the polar rotations of triangles from their frames to those of a surface."""
        return nearest_rotations(deformation_gradients(frames, self._frames(surface)))

    def _trust(self, field: Array) -> Array:
        """Return how far triangles can be trusted to keep their metric, less in joints; (F,)."""
        entries, laplacian = field.reshape(-1, 9), self._template.heat.laplacian
        # |∇X|² = X LX − ½ L X² over the area, for the Laplacian L of finite volumes.
        slopes = 2.0 * entries * (laplacian @ entries) - laplacian @ entries**2
        # A rotation by a small angle changes its matrix by √2 times the angle.
        squared_bends = 0.25 * slopes.sum(axis=1) / self._template.face_areas
        weights: Array = 1.0 / (
            1.0 + _STRAIN_OF_BENDS**2 * self._area * np.maximum(squared_bends, 0.0)
        )
        return weights


def heat_flow(half_step: LinearOperator, rotations: Array) -> Array:
    """Return rotations after heat has flowed between them, as between matrices."""
    for _ in range(2):
        heat = half_step @ rotations.reshape(-1, 9)
        rotations = nearest_rotations(heat.reshape(-1, 3, 3))
    return rotations


def _one_surface(space: SurfaceSpace, surface: ArrayLike, name: str) -> Array:
    check_methods(
        space, "space", "a space of surfaces, AlignedSurfaces(template)", "check_immersed"
    )
    checked = np.asarray(space.check_immersed(surface, name))
    if checked.ndim != len(space.shape):
        raise ArgumentError(
            f"{name} must be one surface of shape {space.shape}; found {checked.shape}"
        )
    space.check_scale(checked, name)
    return checked
