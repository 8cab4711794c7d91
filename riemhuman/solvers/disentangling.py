"""Bodies with the shape of one body and the pose of another."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy import ndarray

from riemhuman.checks import real_number, whole_number
from riemhuman.errors import ArgumentError
from riemhuman.kernels.threads import single_threaded_libraries
from riemhuman.protocols import SurfaceSpace
from riemhuman.solvers.minimization import Minimum
from riemhuman.solvers.preconditioner import CholeskyFactor
from riemhuman.solvers.quasi_newton import Operator, descend_in_rounds
from riemhuman.solvers.results import Result, warn_unless_converged
from riemhuman.solvers.rounding import rounded
from riemhuman.solvers.smooth_turn import SMOOTHING, SmoothTurn
from riemhuman.solvers.spatial_factors import SparseCholeskyFactor
from riemhuman.surfaces.deformation_basis import DeformationBasis
from riemhuman.surfaces.distortion import triangle_areas

if TYPE_CHECKING:
    from riemhuman.geometry.aligned_surfaces import AlignedSurfaces
    from riemhuman.geometry.surface_metric import SurfaceMetric

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
        warn_unless_converged(self, result)
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
    if not isinstance(space, SurfaceSpace) or space.shape != pose_metric.space.shape:
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
