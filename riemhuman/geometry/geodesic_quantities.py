"""Exponentials, logarithms, geodesics and transport, for metrics without closed forms."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import autograd.numpy as np
from numpy import ndarray

from riemhuman.checks import real_array
from riemhuman.errors import ArgumentError, NotDefinedError
from riemhuman.geometry.solved_exponential import solved_geodesic
from riemhuman.geometry.space import Space
from riemhuman.protocols import (
    ExpSolver,
    GeodesicSolver,
    LogSolver,
    TransportSolver,
    uninterrupted,
)


class GeodesicQuantities:
    """Exponential, logarithm, geodesics and parallel transport, by the metric's solvers.

    A part of `RiemannianMetric`. Subclasses with a closed form override its methods.
    """

    space: Space
    geodesic_solver: GeodesicSolver | None
    exp_solver: ExpSolver | None
    log_solver: LogSolver | None
    transport_solver: TransportSolver | None

    def exp(self, tangent_vec: ndarray, base_point: ndarray) -> ndarray:
        r"""Return the end point of the geodesic with this initial velocity after unit time.

        Where the class has no closed form, `exp_solver` computes the geodesics one by one; autograd
        differentiates through a `DifferentiableExpSolver`.

        Parameters
        ----------
        tangent_vec : array, shape (..., \*shape)
            Initial velocities.
        base_point : array, shape (..., \*shape)
            Initial points.

        Returns
        -------
        array, shape (..., \*shape)

        Raises
        ------
        NotDefinedError
            If there is neither a closed form nor a solver.
        OutsideManifoldError
            If the solver stops where the geodesic leaves the manifold.
        """
        metric: Any = self
        solver = self.exp_solver
        if solver is None:
            raise self._not_defined("exp")

        base_point = self.space.check_point(base_point, "base_point")
        tangent_vec = real_array(tangent_vec, "tangent_vec", self.space.shape)
        return self._one_by_one(
            lambda point, velocity: solved_geodesic(velocity, point, metric, solver)[-1],
            base_point,
            tangent_vec,
        )

    def log(self, point: ndarray, base_point: ndarray) -> ndarray:
        r"""Return the initial velocity of the minimal geodesic from `base_point` to `point`.

        Where the class has no closed form, `log_solver` computes the logarithms one by one.

        Parameters
        ----------
        point : array, shape (..., \*shape)
            End points.
        base_point : array, shape (..., \*shape)
            Initial points.

        Returns
        -------
        array, shape (..., \*shape)

        Raises
        ------
        NotDefinedError
            If there is neither a closed form nor a solver.
        OutsideManifoldError
            If no unique minimal geodesic inside the manifold exists.
        """
        metric: Any = self
        solver = self.log_solver
        if solver is None:
            raise self._not_defined("log")
        base_point = self.space.check_point(base_point, "base_point")
        point = self.space.check_point(point, "point")
        return self._one_by_one(
            lambda start, end: uninterrupted(solver.solve(metric, end, start)).tangent_vec,
            base_point,
            point,
        )

    def parallel_transport(
        self,
        tangent_vec: ndarray,
        base_point: ndarray,
        direction: ndarray | None = None,
        end_point: ndarray | None = None,
    ) -> ndarray:
        r"""Transport tangent vectors in parallel along geodesics.

        Where the class has no closed form, `transport_solver` transports the vectors one by one.

        Parameters
        ----------
        tangent_vec : array, shape (..., \*shape)
            Tangent vectors at `base_point`.
        base_point : array, shape (..., \*shape)
            Points.
        direction : array, shape (..., \*shape), optional
            Initial velocity of the geodesic, followed for unit time.
        end_point : array, shape (..., \*shape), optional
            End point of the geodesic; exactly one of the two is given.

        Returns
        -------
        array, shape (..., \*shape)

        Raises
        ------
        NotDefinedError
            If there is neither a closed form nor a solver.
        """
        metric: Any = self
        solver = self.transport_solver
        if solver is None:
            raise self._not_defined("parallel_transport")
        _check_way(direction, end_point)
        name = "end_point" if direction is None else "direction"
        given = end_point if direction is None else direction
        way = real_array(given, name, self.space.shape)
        tangent_vec = real_array(tangent_vec, "tangent_vec", self.space.shape)
        base_point = self.space.check_point(base_point, "base_point")

        def carry(vector: ndarray, start: ndarray, goal: ndarray) -> ndarray:
            return solver.solve(metric, vector, start, **{name: goal}).tangent_vec

        return self._one_by_one(carry, tangent_vec, base_point, way)

    def _velocity(
        self, base_point: ndarray, direction: ndarray | None, end_point: ndarray | None
    ) -> ndarray:
        """Return the initial velocity of the geodesic that vectors are transported along."""
        _check_way(direction, end_point)
        if end_point is not None:
            return self.log(end_point, base_point)
        return real_array(direction, "direction", self.space.shape)

    def geodesic(
        self,
        initial_point: ndarray,
        end_point: ndarray | None = None,
        initial_tangent_vec: ndarray | None = None,
    ) -> Callable[[Any], ndarray]:
        r"""Return the geodesic between two points, or with an initial velocity.

        Between two points it is the path that `geodesic_solver` finds, interpolated linearly
        between its times; with an initial velocity it is exp(t v).

        Parameters
        ----------
        initial_point : array, shape (..., \*shape)
            Initial point.
        end_point : array, shape (..., \*shape), optional
            End point.
        initial_tangent_vec : array, shape (..., \*shape), optional
            Initial velocity; exactly one of the two is given.

        Returns
        -------
        callable
            Maps times in [0, 1], shape (n_times,) or a number, to points, shape (..., n_times,
            \*shape).

        Raises
        ------
        NotDefinedError
            If there is neither a closed form nor a solver.
        """
        initial_point = self.space.check_point(initial_point, "initial_point")
        if (end_point is None) == (initial_tangent_vec is None):
            raise ArgumentError("geodesic needs end_point or initial_tangent_vec, and not both")
        if end_point is not None:
            end_point = self.space.check_point(end_point, "end_point")
            return self._geodesic_between(initial_point, end_point)
        velocity = real_array(initial_tangent_vec, "initial_tangent_vec", self.space.shape)

        def follow(t: Any) -> ndarray:
            times = self._times(t)
            return self.exp(
                times * self._with_time_axis(velocity), self._with_time_axis(initial_point)
            )

        return follow

    def _geodesic_between(self, start: ndarray, end: ndarray) -> Callable[[Any], ndarray]:
        path = np.asarray(self._solve("geodesic", start, end).path)

        def follow(t: Any) -> ndarray:
            position = self._times(t).ravel() * (len(path) - 1)
            index = np.clip(position.astype(int), 0, len(path) - 2)
            weight = np.expand_dims(position - index, self.space._point_axes)
            return (1 - weight) * path[index] + weight * path[index + 1]

        return follow

    def _solve(self, name: str, start: ndarray, end: ndarray) -> Any:
        metric: Any = self
        if self.geodesic_solver is None:
            raise self._not_defined(name)
        start, end = (
            real_array(point, "point", self.space.shape, rows=True) for point in (start, end)
        )
        if np.shape(start) != self.space.shape or np.shape(end) != self.space.shape:
            raise ArgumentError(
                f"{name} by a solver takes one pair of points of shape {self.space.shape}; "
                f"found {np.shape(start)} and {np.shape(end)}"
            )
        # Whoever interrupts one of many distances wants an end of them all.
        return uninterrupted(self.geodesic_solver.solve(metric, start, end))

    def _not_defined(self, name: str) -> NotDefinedError:
        return NotDefinedError(
            f"{type(self).__name__} has no closed form for {name}; for geodesics pass a strategy "
            "such as geodesic_solver=riemhuman.solvers.BasisPath(basis), for exp and log "
            "exp_solver=riemhuman.solvers.DiscreteExponential(basis) and "
            "log_solver=riemhuman.solvers.DiscreteLogarithm(basis), for parallel transport "
            "transport_solver=riemhuman.solvers.PoleLadder(basis=basis)"
        )

    def _one_by_one(self, solve: Callable[..., ndarray], *arrays: ndarray) -> ndarray:
        """Return the results for broadcast arrays of points or vectors."""
        shape = np.broadcast_shapes(*(np.shape(array) for array in arrays))
        # autograd's `broadcast_to` adds no axes.
        arrays = tuple(array + np.zeros(shape) for array in arrays)
        leading = shape[: len(shape) - len(self.space.shape)]
        results = [solve(*(array[index] for array in arrays)) for index in np.ndindex(leading)]
        return np.reshape(np.array(results), shape)

    def _with_time_axis(self, point: ndarray) -> ndarray:
        return np.expand_dims(point, -len(self.space.shape) - 1)

    def _times(self, t: Any) -> ndarray:
        """Return times with the axes of a point behind them."""
        times = np.atleast_1d(real_array(t, "t"))
        if times.ndim != 1:
            raise ArgumentError(f"t must be a number or have shape (n_times,); found {times.shape}")
        return np.expand_dims(times, self.space._point_axes)


def _check_way(direction: ndarray | None, end_point: ndarray | None) -> None:
    if (direction is None) == (end_point is None):
        raise ArgumentError("parallel_transport needs direction or end_point, and not both")
