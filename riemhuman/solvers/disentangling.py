"""Bodies with one body's shape and another's pose: the paper's metrics as a generative pair."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy import ndarray

from riemhuman.checks import real_number, whole_number
from riemhuman.errors import ArgumentError
from riemhuman.kernels.threads import single_threaded_libraries
from riemhuman.kernels.triangle_frames import (
    deformation_gradients,
    nearest_rotations,
    stacked_derivatives,
    triangle_frames,
)
from riemhuman.solvers.minimization import LocalProblem, Minimum, minimize_in_rounds
from riemhuman.solvers.preconditioner import CholeskyFactor
from riemhuman.solvers.results import Result, warn_unless_converged
from riemhuman.solvers.spatial_factors import SparseCholeskyFactor
from riemhuman.surfaces.deformation_basis import DeformationBasis

if TYPE_CHECKING:
    from riemhuman.geometry.aligned_surfaces import AlignedSurfaces
    from riemhuman.geometry.surface_metric import SurfaceMetric

# Value, in units of the first, of surfaces without finite distance from the two bodies.
_WALL = 2.0

# Relative errors of vertices that count as rounding.
_ROUNDING = 1e-12


@dataclass(frozen=True, repr=False)
class DisentanglingResult(Result):
    """A surface near one body in shape and near another in pose, and how it was found.

    Attributes
    ----------
    surface : array, shape (V, 3)
        The surface.
    value : float
        The weighted sum of the two squared distances.
    values : array, shape (n_iterations + 1,)
        The same at the start and after each iteration, before any basis.
    shape_dist, pose_dist : float
        Distances from the two bodies in the respective metric.
    n_iterations, n_evaluations : int
        Iterations, and evaluations of the sum and its gradient.
    converged : bool
        Whether the stopping test was met.
    message : str
        Why it stopped.
    """

    surface: ndarray
    value: float
    values: ndarray
    shape_dist: float
    pose_dist: float


@dataclass(frozen=True)
class Disentangling:
    r"""The surface nearest to a body A in one metric and to a body B in another.

    .. math:: \arg\min_f\; w_s\, d_{shape}(f, A)^2 + w_p\, d_{pose}(f, B)^2

    It starts from A with every triangle turned as on B, put together by a Poisson equation
    (`surfaces.poisson`), and stands where B does. For the shape metric λ must be large enough for
    distances not to saturate: (1, 1, 0), and not the (1, 1e-4, 0) of the paper's retrieval, whose
    gradient vanishes almost everywhere. Normals tell the build of B a little too; the pose
    weight of 50 was the best for the open bodies under (1, 1, 0) and (0, 0, 1).

    Parameters
    ----------
    basis : DeformationBasis, optional
        Deformations that bodies make as they move. With it the result is the surface nearest to
        the minimiser, by the sum of squares, that differs from A by these alone: what normals
        tell of the build of B, and a motion does not change, so stays A's.
    shape_weight, pose_weight : float
        w_s and w_p.
    tolerance : float
        Stop when a Newton step would gain at most this share of the value, as far as the
        preconditioned gradient tells.
    max_iter : int
        Most iterations.
    callback : callable, optional
        Called with (iteration, value, surface) after each iteration.
    progress : bool
        Whether to show a progress bar.
    """

    basis: DeformationBasis | None = None
    shape_weight: float = 1.0
    pose_weight: float = 50.0
    tolerance: float = 1e-3
    max_iter: int = 300
    callback: Callable[[int, float, ndarray], Any] | None = None
    progress: bool = False

    def __post_init__(self) -> None:
        real_number(self.shape_weight, "shape_weight", minimum=0.0, strict=True)
        real_number(self.pose_weight, "pose_weight", minimum=0.0, strict=True)
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
            Body A, whose shape is wanted.
        pose : array, shape (V, 3)
            Body B, whose pose is wanted.
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
        start = turned_as(space, shape, pose) if initial is None else initial
        start = _body(space, start, "initial")
        if self.basis is not None:
            self.basis.check_fits(len(start))
        sum_ = _WeightedSum(
            (shape_metric, pose_metric), (self.shape_weight, self.pose_weight), (shape, pose)
        )
        minimum = self._minimize(sum_, start)
        surface, value = start + minimum.x, minimum.value
        if self.basis is not None:
            # The metrics see no translations.
            difference = surface - shape
            difference -= difference.mean(axis=0)
            surface = shape + self.basis.project(difference)
            value = sum_.value_and_gradient(surface)[0]
        surface = surface + np.mean(pose - surface, axis=0)
        result = DisentanglingResult(
            surface,
            value,
            minimum.values,
            float(shape_metric.dist(shape, surface)),
            float(pose_metric.dist(pose, surface)),
            **minimum.outcome,
        )
        warn_unless_converged(self, result)
        return result

    def _minimize(self, sum_: _WeightedSum, start: ndarray) -> Minimum:
        """Return the shift of the start of least value."""
        shift = np.zeros_like(start)
        value, rounding = sum_.value_and_gradient(start)[0], sum_.rounding(start)
        if value <= rounding:
            message = "the start is at no distance from either"
            return Minimum(shift, value, np.array([value]), n_evaluations=1, message=message)
        with single_threaded_libraries():
            return minimize_in_rounds(
                lambda shift: self._local_problem(sum_, start, shift),
                shift,
                max_iter=self.max_iter,
                expected_decrease=self.tolerance,
                callback=lambda *state: self._report(start, *state),
                progress=self.progress,
                description="disentangling",
            )

    def _report(self, start: ndarray, iteration: int, value: float, shift: ndarray) -> None:
        if self.callback is not None:
            self.callback(iteration, value, start + shift)

    def _local_problem(self, sum_: _WeightedSum, start: ndarray, shift: ndarray) -> LocalProblem:
        """Return the problem in variables preconditioned at one surface."""
        surface = start + shift
        unit = sum_.value_and_gradient(surface)[0] or 1.0
        factor = sum_.factor(surface, unit)

        def position(variables: ndarray) -> ndarray:
            return shift + factor.solve_transposed(variables[:, None]).reshape(shift.shape)

        def objective(variables: ndarray) -> tuple[float, ndarray]:
            value, gradient = sum_.value_and_gradient(start + position(variables))
            if not np.isfinite(value):
                return _WALL, np.zeros_like(variables)
            return value / unit, factor.solve(gradient.ravel()[:, None]).ravel() / unit

        return LocalProblem(objective, position, unit)


class _WeightedSum:
    """Σ w d(x, f)² over a few metrics, each with its weight and its point x."""

    def __init__(
        self,
        metrics: tuple[SurfaceMetric, ...],
        weights: tuple[float, ...],
        points: tuple[ndarray, ...],
    ) -> None:
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
        noise = np.random.default_rng(0).uniform(-_ROUNDING, _ROUNDING, surface.shape)
        pair = np.stack([surface, surface * (1.0 + noise)])
        return sum(weight * float(metric.energy(pair)) for metric, weight, _ in self._terms)

    def factor(self, surface: ndarray, unit: float) -> CholeskyFactor:
        """Return the factor of the sum's Hessian, near both points, in units of the value."""
        matrix: Any = sum(w * m.metric_matrix(surface) for m, w, _ in self._terms)
        return SparseCholeskyFactor(2.0 * matrix / unit)


def turned_as(space: AlignedSurfaces, shape: ndarray, pose: ndarray) -> ndarray:
    """Return a body with every triangle turned as on another body.

    Triangles keep their metric and take the rotation R of the polar decomposition of the map from
    one body's triangle to the other's; the surface that comes closest to R J solves a Poisson
    equation.

    Parameters
    ----------
    space : AlignedSurfaces
        Space of the surfaces.
    shape : array, shape (V, 3)
        Body that says how large triangles are.
    pose : array, shape (V, 3)
        Body that says how they are turned, and where the result stands.

    Returns
    -------
    array, shape (V, 3)
    """
    template = space.template
    frames, turned = (
        triangle_frames(body, template.differential_operator) for body in (shape, pose)
    )
    rotations = nearest_rotations(deformation_gradients(frames, turned))
    return template.interpolator.surface_of(stacked_derivatives(rotations @ frames), pose)


def _common_space(shape_metric: SurfaceMetric, pose_metric: SurfaceMetric) -> Any:
    space = shape_metric.space
    if not hasattr(space, "template") or space.shape != pose_metric.space.shape:
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
