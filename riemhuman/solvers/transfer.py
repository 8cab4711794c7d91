"""Bodies with the shape of one body and the pose of another."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy import ndarray

from riemhuman.checks import one_of, real_number, whole_number
from riemhuman.errors import ArgumentError
from riemhuman.kernels.rotations import nearest_rotations
from riemhuman.kernels.surface import (
    deformation_gradients,
    stacked_derivatives,
    triangle_frames,
)
from riemhuman.kernels.threads import single_threaded_libraries
from riemhuman.solvers._preconditioners import CholeskyFactor, SparseCholeskyFactor
from riemhuman.solvers.minimization import Minimum
from riemhuman.solvers.paths import rounded
from riemhuman.solvers.quasi_newton import Operator, descend_in_rounds
from riemhuman.solvers.results import Result, finish
from riemhuman.surfaces.deformation_basis import DeformationBasis
from riemhuman.surfaces.measures import triangle_areas

if TYPE_CHECKING:
    from scipy.sparse.linalg import LinearOperator

    from riemhuman.geometry import AlignedSurfaces, SurfaceMetric

# Time of the flow, as a share of the area of a body. Of a variation of wavelength ℓ there remains
# about exp(−4π²t/ℓ²): of 1.8 m², a half where ℓ = 0.41 m, an arm's girth and more; a quarter of
# what goes around an arm, 0.3 m, and nine tenths of what changes from a thigh to its shin, 1 m.
SMOOTHING = 1.0 / 600.0

# Relative errors of vertices that count as rounding.
_ROUNDING = 1e-12

# Share of its area, on A and at the start, below which no triangle shrinks: past the point where a
# triangle has no area its normal, and the sum with it, jumps.
_LEAST_AREA = 1e-6


@dataclass(frozen=True, repr=False)
class DisentanglingResult(Result):
    """A surface near one body in shape and near another in pose, and how it was found.

    Attributes
    ----------
    surface : array, shape (V, 3)
        The surface.
    turned : array, shape (V, 3)
        Body A, turned into the pose of B.
    value : float
        The weighted sum of the squared distances from A and from `turned`.
    values : array, shape (n_iterations + 1,)
        The same at the start and after each iteration, before any basis.
    shape_dist, pose_dist : float
        Distances from the two bodies in the respective metric.
    n_iterations, n_evaluations : int
        Iterations, and evaluations of the sum and its gradient.

    Examples
    --------
    >>> import riemhuman as rh
    >>> bodies = rh.datasets.load_open_bodies("coarse")
    >>> space = rh.AlignedSurfaces(bodies.template)
    >>> build = rh.ElasticMetric(space, a=1.0, lam=1.0, c=0.0)
    >>> pose = rh.ElasticMetric(space, a=0.0, lam=0.0, c=1.0)
    >>> result = rh.solvers.Disentangling().solve(build, pose, bodies[0], bodies[13])
    >>> result.surface.shape
    (1202, 3)
    """

    surface: ndarray
    turned: ndarray
    value: float
    values: ndarray
    shape_dist: float
    pose_dist: float


@dataclass(frozen=True)
class Disentangling:
    r"""A body A in the pose of a body B, with all details of A.

    .. math:: \arg\min_f\; w_s\, d_{shape}(f, A)^2 + w_p\, d_{pose}(f, A_B)^2

    A_B is A, turned into the pose of B by a smooth field of rotations, see `SmoothTurn`: the
    normals of B itself show its build, such as face and chest, as well as its pose. The search
    starts from A_B and shares the strain of the joints with their neighbours. The result stands
    where B does and holds the pose as B holds it. Its error against A's own performance of the pose
    is therefore measured bone by bone, each moved rigidly; that of the whole body mostly shows how
    differently B holds the pose.

    For the shape metric λ must be large enough for distances not to saturate: (1, 1, 0), and not
    the (1, 1e-4, 0) of the paper's retrieval, whose gradient vanishes almost everywhere.

    Parameters
    ----------
    basis : DeformationBasis, optional
        Deformations of bodies in motion. With a basis, the result differs from A by these alone: it
        is the nearest such surface to the minimiser, in least squares.
    shape_weight, pose_weight : float
        w_s and w_p.
    smoothing : float
        Time of the heat flow of the rotations, as a share of the template's area. The longer, the
        less of B's build is carried over, and the rounder joints bend.
    tolerance : float
        Stop when a Newton step would gain at most this share of the value, as far as the
        preconditioned gradient tells.
    max_iter : int
        Most iterations.
    callback : callable, optional
        Called with (iteration, value, surface) after each iteration.
    progress : bool
        Whether to show a progress bar.

    Examples
    --------
    >>> import riemhuman as rh
    >>> bodies = rh.datasets.load_open_bodies("coarse")
    >>> space = rh.AlignedSurfaces(bodies.template)
    >>> build = rh.ElasticMetric(space, a=1.0, lam=1.0, c=0.0)
    >>> pose = rh.ElasticMetric(space, a=0.0, lam=0.0, c=1.0)
    >>> result = rh.solvers.Disentangling().solve(build, pose, bodies[0], bodies[13])
    >>> result.surface.shape
    (1202, 3)
    """

    basis: DeformationBasis | None = None
    shape_weight: float = 1.0
    pose_weight: float = 1000.0
    smoothing: float = SMOOTHING
    tolerance: float = 1e-3
    max_iter: int = 300
    callback: Callable[[int, float, ndarray], Any] | None = None
    progress: bool = False

    def __post_init__(self) -> None:
        real_number(self.shape_weight, "shape_weight", minimum=0.0, strict=True)
        real_number(self.pose_weight, "pose_weight", minimum=0.0, strict=True)
        real_number(self.smoothing, "smoothing", minimum=0.0, strict=True)
        real_number(self.tolerance, "tolerance", minimum=0.0, strict=True)
        whole_number(self.max_iter, "max_iter", minimum=1)

    def solve(
        self,
        shape_metric: SurfaceMetric,
        pose_metric: SurfaceMetric,
        shape: ndarray,
        pose: ndarray,
        initial: ndarray | None = None,
    ) -> DisentanglingResult:
        """Find the surface.

        Parameters
        ----------
        shape_metric, pose_metric : SurfaceMetric
            Metrics on surfaces over one template.
        shape : array, shape (V, 3)
            Body A, which gives the shape.
        pose : array, shape (V, 3)
            Body B, which gives the pose.
        initial : array, shape (V, 3), optional
            Surface to start from.

        Returns
        -------
        DisentanglingResult

        Raises
        ------
        ArgumentError
            If the surfaces, the metrics or the basis do not fit each other.
        DegenerateSurfaceError
            If a triangle of a body has no area.

        Warns
        -----
        ConvergenceWarning
            If the stopping test was not met.
        """
        space = _common_space(shape_metric, pose_metric)
        shape = _body(space, shape, "shape")
        pose = _body(space, pose, "pose")
        turned = SmoothTurn(space, self.smoothing).solve(shape, pose)
        start = turned if initial is None else _body(space, initial, "initial")
        if self.basis is not None:
            self.basis.check_fits(len(start))
        sum_ = _WeightedSum(
            (shape_metric, pose_metric), (self.shape_weight, self.pose_weight), (shape, turned)
        )
        areas = [triangle_areas(body, space.template.faces) for body in (shape, start)]
        minimum = self._minimize(sum_, start, _LEAST_AREA * np.minimum(*areas))
        surface, value = minimum.x.reshape(start.shape), minimum.value
        if self.basis is not None:
            # The metrics see no translations.
            difference = surface - shape
            difference -= difference.mean(axis=0)
            surface = shape + self.basis.project(difference)
            value = sum_.value_and_gradient(surface)[0]
        surface = surface + np.mean(pose - surface, axis=0)
        result = DisentanglingResult(
            surface,
            turned,
            value,
            minimum.values,
            float(shape_metric.dist(shape, surface)),
            float(pose_metric.dist(pose, surface)),
            **minimum.outcome,
        )
        finish(self, result)
        return result

    def _minimize(self, sum_: _WeightedSum, start: ndarray, least_areas: ndarray) -> Minimum:
        """Return the surface of least value, as a vector."""
        value, rounding = sum_.value_and_gradient(start)[0], sum_.rounding(start)
        if value <= rounding:
            message = "the start is at no distance from either"
            return Minimum(start, value, np.array([value]), n_evaluations=1, message=message)

        def objective(x: ndarray) -> tuple[float, ndarray]:
            surface = x.reshape(start.shape)
            if np.any(triangle_areas(surface, sum_.faces) < least_areas):
                return np.inf, np.zeros_like(x)
            value, gradient = sum_.value_and_gradient(surface)
            return value, gradient.ravel()

        def inverse_hessian_at(x: ndarray) -> Operator:
            factor = sum_.factor(x.reshape(start.shape))
            return lambda gradient: factor.inverse(gradient[:, None])[:, 0]

        def report(iteration: int, value: float, x: ndarray) -> None:
            if self.callback is not None:
                self.callback(iteration, value, x.reshape(start.shape))

        with single_threaded_libraries():
            return descend_in_rounds(
                objective,
                start.ravel(),
                inverse_hessian_at,
                max_iter=self.max_iter,
                expected_decrease=self.tolerance,
                callback=report,
                progress=self.progress,
                description="disentangling",
            )


class _WeightedSum:
    """Σ w d(x, f)² over a few metrics, each with its weight and its point x."""

    def __init__(
        self,
        metrics: tuple[SurfaceMetric, ...],
        weights: tuple[float, ...],
        points: tuple[ndarray, ...],
    ) -> None:
        self.faces = metrics[0].space.template.faces
        self._terms = list(zip(metrics, weights, points, strict=True))

    def value_and_gradient(self, surface: ndarray) -> tuple[float, ndarray]:
        value, gradient = 0.0, np.zeros_like(surface)
        for metric, weight, point in self._terms:
            squared, slopes = metric.energy_and_gradient(np.stack([point, surface]))
            value += weight * squared
            gradient += weight * slopes[1]
        return value, gradient

    def rounding(self, surface: ndarray) -> float:
        """Return the value between surfaces that are the same to rounding errors."""
        pair = np.stack([surface, rounded(surface, _ROUNDING)])
        return sum(weight * float(metric.energy(pair)) for metric, weight, _ in self._terms)

    def factor(self, surface: ndarray) -> CholeskyFactor:
        """Return the factor of the sum's Hessian, near both points."""
        matrix: Any = sum(w * m.metric_matrix(surface) for m, w, _ in self._terms)
        return SparseCholeskyFactor(2.0 * matrix)


def _common_space(shape_metric: SurfaceMetric, pose_metric: SurfaceMetric) -> Any:
    space = shape_metric.space
    if not space.is_surface_space or space.shape != pose_metric.space.shape:
        raise ArgumentError(
            "shape_metric and pose_metric must be metrics on surfaces over one template; found "
            f"points of shape {space.shape} and {pose_metric.space.shape}"
        )
    return space


def _body(space: AlignedSurfaces, body: ndarray, name: str) -> ndarray:
    body = np.asarray(space.check_immersed(body, name))
    if body.ndim != len(space.shape):
        raise ArgumentError(
            f"{name} must be one surface of shape {space.shape}; found {body.shape}"
        )
    return body


AXES = ("world", "body")
TRANSFERS = ("change", "pose")

# Vertices that have moved by less, in metres, are still, as planted feet are.
_STILL = 0.01


@dataclass(frozen=True)
class MotionTransfer:
    """A motion of one body replayed on another.

    Parameters
    ----------
    axes : str
        "world": triangles of both bodies turn about the same axes in space, right where the target
        stands as the source does; "body": axes are carried from the source's triangles to the
        target's by the rotation between them, for a target in another pose.
    transfer : str
        "change": the target repeats the changes of the source since the reference; if its initial
        pose differs a little, its later poses differ as much, so that hands may end beside the head
        instead of on it. "pose": the target takes the pose of the source in every frame, whatever
        its own initial pose.

    Raises
    ------
    ArgumentError
        If an option is unknown, or poses are to be transferred about the axes of the body.

    Examples
    --------
    >>> import riemhuman as rh
    >>> bodies = rh.datasets.load_open_bodies("coarse")
    >>> space = rh.AlignedSurfaces(bodies.template)
    >>> motion = rh.datasets.load_open_motions("coarse", sequences="knees")[0][:30:10]
    >>> moved = rh.solvers.MotionTransfer().solve(space, motion, bodies[0])
    >>> moved.shape
    (3, 1202, 3)
    """

    axes: str = "world"
    transfer: str = "change"

    def __post_init__(self) -> None:
        one_of(self.axes, "axes", AXES)
        if one_of(self.transfer, "transfer", TRANSFERS) == "pose" and self.axes == "body":
            raise ArgumentError(
                'axes must be "world" where transfer="pose"; found "body", which is about the axes '
                "of changes"
            )

    def solve(
        self,
        space: AlignedSurfaces,
        motion: Any,
        target: ndarray,
        reference: ndarray | None = None,
    ) -> ndarray:
        """Return the target's motion.

        Parameters
        ----------
        space : AlignedSurfaces
            Space of the surfaces.
        motion : array, shape (n_frames, V, 3), or iterable of arrays (V, 3)
            Motion of the source.
        target : array, shape (V, 3)
            Body to be moved.
        reference : array, shape (V, 3), optional
            The source in the target's pose, by default the first frame: for a frame equal to the
            reference, the result is the target. Not used for poses.

        Returns
        -------
        array, shape (n_frames, V, 3)
            It is placed so that parts which rest on the source also rest on the target, above all
            planted feet: mean displacements of vertices agree, with weights 1/(d² + 1 cm²) of the
            displacement d. For poses, the first frame has the centroid of the source.

        Raises
        ------
        ArgumentError
            If the motion is empty, a surface does not fit the space, or there is a reference where
            poses are transferred.
        DegenerateSurfaceError
            If a triangle has no area.
        """
        if reference is not None and self.transfer == "pose":
            raise ArgumentError(
                'reference must be left out where transfer="pose": poses are transferred as they '
                "are, whatever the pose of the target"
            )
        transfer: _Transfer | _PoseTransfer | None = None
        frames: list[ndarray] = []
        for k, frame in enumerate(motion):
            frame = _one_surface(space, frame, f"motion[{k}]")
            if transfer is None:
                target = _one_surface(space, target, "target")
                if self.transfer == "pose":
                    transfer = _PoseTransfer(space, frame, target)
                else:
                    start = _one_surface(
                        space, frame if reference is None else reference, "reference"
                    )
                    transfer = _Transfer(space, start, target, self.axes)
            frames.append(transfer.moved(frame))
        if not frames:
            raise ArgumentError("motion must have at least one frame; found none")
        return np.stack(frames)


@dataclass(frozen=True)
class ShapeTransfer:
    """A change of shape, transferred to another pose.

    The difference between two bodies in one pose is applied to the first body in another pose: its
    triangles undergo the same stretches, along axes that turn with them.

    Examples
    --------
    >>> import riemhuman as rh
    >>> bodies = rh.datasets.load_open_bodies("coarse")
    >>> space = rh.AlignedSurfaces(bodies.template)
    >>> result = rh.solvers.ShapeTransfer().solve(space, bodies[0], bodies[10], bodies[3])
    >>> result.shape
    (1202, 3)
    """

    def solve(
        self, space: AlignedSurfaces, before: ndarray, after: ndarray, target: ndarray
    ) -> ndarray:
        """Return the second body in the target's pose.

        Parameters
        ----------
        space : AlignedSurfaces
            Space of the surfaces.
        before, after : array, shape (V, 3)
            The first and the second body in one pose.
        target : array, shape (V, 3)
            The first body in another pose.

        Returns
        -------
        array, shape (V, 3)
            The centroid of each connected component is that of the target.

        Raises
        ------
        ArgumentError
            If a surface does not fit the space.
        DegenerateSurfaceError
            If a triangle has no area.
        """
        before, after, target = (
            _one_surface(space, body, name)
            for body, name in ((before, "before"), (after, "after"), (target, "target"))
        )
        transfer = _Transfer(space, before, target, "body")
        return transfer.moved(after, placed_as=target)


class _Transfer:
    """What takes deformations of a reference to a target."""

    def __init__(
        self, space: AlignedSurfaces, reference: ndarray, target: ndarray, axes: str
    ) -> None:
        self._operator = space.template.differential_operator
        self._interpolator = space.template.interpolator
        self._areas = space.template.vertex_areas
        self._reference, self._target = reference, target
        self._frames = triangle_frames(reference, self._operator)
        self._target_frames = triangle_frames(target, self._operator)
        self._axes = None
        if axes == "body":
            gradients = deformation_gradients(self._frames, self._target_frames)
            self._axes = nearest_rotations(gradients)

    def moved(self, surface: ndarray, placed_as: ndarray | None = None) -> ndarray:
        """Return the target, deformed as the reference is deformed into this surface."""
        frames = triangle_frames(surface, self._operator)
        gradients = deformation_gradients(self._frames, frames)
        if self._axes is not None:
            gradients = self._axes @ gradients @ np.swapaxes(self._axes, -1, -2)
        derivatives = stacked_derivatives(gradients @ self._target_frames)
        if placed_as is not None:
            return self._interpolator.surface_of(derivatives, placed_as)
        displacement = surface - self._reference
        moved = self._interpolator.surface_of(derivatives, self._target + displacement)
        return _placed(moved, self._target, displacement, self._areas)


class _PoseTransfer:
    """What makes a target stand as a source does."""

    def __init__(self, space: AlignedSurfaces, first: ndarray, target: ndarray) -> None:
        self._turn = SmoothTurn(space)
        self._areas = space.template.vertex_areas
        self._first, self._target = first, target
        self._start = self._turn.solve(target, first)

    def moved(self, surface: ndarray) -> ndarray:
        """Return the target in the pose of a surface."""
        moved = self._turn.solve(self._target, surface)
        return _placed(moved, self._start, surface - self._first, self._areas)


def _placed(moved: ndarray, start: ndarray, displacement: ndarray, areas: ndarray) -> ndarray:
    """Return a surface shifted so that it has left its start as far as what is still has."""
    weights = areas / (_STILL**2 + np.sum(displacement**2, axis=1))
    return moved + np.average(start + displacement - moved, axis=0, weights=weights)


def _one_surface(space: AlignedSurfaces, surface: Any, name: str) -> ndarray:
    surface = np.asarray(space.check_immersed(surface, name))
    if surface.ndim != len(space.shape):
        raise ArgumentError(
            f"{name} must be one surface of shape {space.shape}; found {surface.shape}"
        )
    space.check_scale(surface, name)
    return surface


# How much longer heat flows along bones, once it is known where joints are: the more, the less of
# B's build, and the farther limbs end from where B holds them. Compared on coarse natural bodies of
# the seeds 21, 51, 61 and 71.
_ALONG_BONES = 3.0

# A limb of radius r that bends by κ radians a metre strains its skin by rκ. Least squares weigh
# with the inverse of the variance, σ² + (rκ)²; r/σ is 0.05 m over 0.1, as a share of √area.
_STRAIN_OF_BENDS = 0.37


class SmoothTurn:
    """Brings one body into the pose of another, whatever the build of the other.

    Parameters
    ----------
    space : AlignedSurfaces
        Space of the surfaces.
    smoothing : float
        Time of the first heat flow as a share of the template's area, above 0; the second, along
        bones, takes 3 times as long. The longer, the less of the other's build is carried over, and
        the rounder joints bend.
    n_rounds : int
        Number of rounds, each of which adds the smoothed remainder of the rotations: they restore
        the bends of joints, long waves sooner than short ones.
    """

    def __init__(
        self, space: AlignedSurfaces, smoothing: float = SMOOTHING, n_rounds: int = 1
    ) -> None:
        self._template = template = space.template
        self._n_rounds = whole_number(n_rounds, "n_rounds", minimum=0)
        self._area = float(template.face_areas.sum())
        self._time = self._area * real_number(smoothing, "smoothing", minimum=0.0, strict=True)

    def solve(self, shape: ndarray, pose: ndarray) -> ndarray:
        """Return one body in the pose of another.

        Parameters
        ----------
        shape : array, shape (V, 3)
            Body to bring into the pose; its triangles have an area.
        pose : array, shape (V, 3)
            Body that gives the pose and the position.

        Returns
        -------
        array, shape (V, 3)
            The centroid of each connected component is that of `pose`.
        """
        frames = triangle_frames(shape, self._template.differential_operator)
        rotations, heat = self._rotations(frames, pose), self._template.heat
        # Of one implicit step alone, short waves fade too little: each flow has two.
        trust = self._trust(_flow(heat.step(0.5 * self._time), rotations))
        along_bones = heat.step_through(trust, 0.5 * _ALONG_BONES * self._time)
        # By the trust of the second field, which bends sharply, few triangles would take all strain
        # of a joint and nearly lose their area.
        assemble = self._template.interpolator.with_weights(trust)
        field = _flow(along_bones, rotations)
        turned = assemble.surface_of(stacked_derivatives(field @ frames), pose)
        for _ in range(self._n_rounds):
            missing = self._rotations(self._frames(turned), pose)
            field = _flow(along_bones, missing) @ field
            turned = assemble.surface_of(stacked_derivatives(field @ frames), pose)
        return turned

    def _frames(self, surface: ndarray) -> ndarray:
        return triangle_frames(surface, self._template.differential_operator)

    def _rotations(self, frames: ndarray, surface: ndarray) -> ndarray:
        """Return the polar rotations of triangles from their frames to those of a surface."""
        return nearest_rotations(deformation_gradients(frames, self._frames(surface)))

    def _trust(self, field: ndarray) -> ndarray:
        """Return how far triangles can be trusted to keep their metric, less in joints; (F,)."""
        entries, laplacian = field.reshape(-1, 9), self._template.heat.laplacian
        # |∇X|² = X LX − ½ L X² over the area, for the Laplacian L of finite volumes.
        slopes = 2.0 * entries * (laplacian @ entries) - laplacian @ entries**2
        # A rotation by a small angle changes its matrix by √2 times the angle.
        squared_bends = 0.25 * slopes.sum(axis=1) / self._template.face_areas
        return 1.0 / (1.0 + _STRAIN_OF_BENDS**2 * self._area * np.maximum(squared_bends, 0.0))


def _flow(half: LinearOperator, rotations: ndarray) -> ndarray:
    """Return rotations after heat has flowed between them, as between matrices."""
    for _ in range(2):
        heat = half @ rotations.reshape(-1, 9)
        rotations = nearest_rotations(heat.reshape(-1, 3, 3))
    return rotations
