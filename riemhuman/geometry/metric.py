"""The Riemannian metric with its geodesics.

`riemhuman.geometry.metric_tensor` has what metrics measure without geodesics.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import cast

import autograd.numpy as np

from riemhuman.arrays import Array, ArrayLike, Points, TangentVectors
from riemhuman.checks import a_solver, checked, joint_shape, real_array, refuse_type
from riemhuman.errors import (
    ArgumentError,
    ArgumentTypeError,
    NotDefinedError,
    OutsideManifoldError,
)
from riemhuman.geometry.metric_tensor import POINT, VECTOR, MetricTensor
from riemhuman.geometry.point_space import PointSpace
from riemhuman.geometry.strategies import (
    DefaultSolvers,
    ExpSolver,
    GeodesicSolver,
    LogSolver,
    SolvedPath,
    TransportSolver,
)
from riemhuman.kernels.surface import differential
from riemhuman.provided import default_solvers
from riemhuman.representation import constructor_text


class RiemannianMetric(MetricTensor):
    r"""A Riemannian metric on a manifold.

    A subclass defines `inner_product`, or `squared_dist` if it has a closed form, or both. Norm,
    distance, energy, length and their gradients by autograd are derived from these. If only
    `squared_dist` is defined, the inner product is half its second derivative on the diagonal.
    Operations that cannot be derived raise NotDefinedError. The parameters of a metric never
    change.

    Properties say what a metric can do and what leaves its distances unchanged; solvers read them.
    By default a metric has what its class defines; `exp` and `log` together count as geodesics in
    closed form. If this is not right, for example because it depends on a parameter, a subclass
    overrides the property: `has_closed_form_dist`, `has_closed_form_geodesic`,
    `has_closed_form_transport`, `has_inner_product`, `has_metric_matrix` or
    `has_lower_bound_coordinates`.

    Parameters
    ----------
    space : Manifold
    geodesic_solver, exp_solver, log_solver, transport_solver : object, optional
        Solvers for operations without a closed form, see `riemhuman.solvers` and
        `riemhuman.geometry.strategies`. Distances without a closed form need a `geodesic_solver`;
        the others have defaults.

    Examples
    --------
    >>> import autograd.numpy as np
    >>> class Weighted(rh.RiemannianMetric):
    ...     def inner_product(self, tangent_vec_a, tangent_vec_b, base_point):
    ...         return 4.0 * np.sum(tangent_vec_a * tangent_vec_b, axis=-1)
    >>> metric = Weighted(rh.VectorSpace((2,)))
    >>> float(metric.norm(np.array([3.0, 4.0]), np.zeros(2)))
    10.0
    """

    has_target_metric: bool = False
    """Whether it is pulled back by `map` from a space where geodesics have a closed form."""

    @checked(
        geodesic_solver=a_solver,
        exp_solver=a_solver,
        log_solver=a_solver,
        transport_solver=a_solver,
    )
    def __init__(
        self,
        space: PointSpace,
        geodesic_solver: GeodesicSolver | None = None,
        *,
        exp_solver: ExpSolver | None = None,
        log_solver: LogSolver | None = None,
        transport_solver: TransportSolver | None = None,
    ) -> None:
        if not callable(getattr(space, "check_point", None)):
            raise ArgumentTypeError(
                f"{type(self).__name__} takes a space of points, such as "
                f"AlignedSurfaces(template); found {type(space).__name__}"
            )
        super().__init__(space)
        self.geodesic_solver = geodesic_solver
        self.exp_solver = exp_solver
        self.log_solver = log_solver
        self.transport_solver = transport_solver

    def __repr__(self) -> str:
        return constructor_text(self, leave_out=("space",))

    # What a metric has.

    @property
    def has_closed_form_dist(self) -> bool:
        """Whether distances have a closed form; by default if the class defines `squared_dist`."""
        return type(self).squared_dist is not RiemannianMetric.squared_dist

    @property
    def has_closed_form_transport(self) -> bool:
        """Whether parallel transport needs no solver; by default if the class defines it."""
        return type(self).parallel_transport is not RiemannianMetric.parallel_transport

    @property
    def has_closed_form_geodesic(self) -> bool:
        """Whether geodesics need no solver; by default if the class defines `exp` and `log`."""
        cls = type(self)
        return cls.exp is not RiemannianMetric.exp and cls.log is not RiemannianMetric.log

    @property
    def target_metric(self) -> RiemannianMetric:
        """The metric on the image of `map`, for metrics that are pulled back."""
        raise self._not_defined("target_metric")

    def map(self, point: Points) -> Array:
        r"""Return the images of points in the space of `target_metric`.

        Parameters
        ----------
        point : array, shape (..., \*shape)
        """
        raise self._not_defined("map")

    @checked(tangent_vec=VECTOR, base_point=VECTOR)
    def differential(self, tangent_vec: TangentVectors, base_point: Points) -> Array:
        r"""Apply the differential of `map` to tangent vectors.

        Parameters
        ----------
        tangent_vec, base_point : array, shape (..., \*shape)
        """
        shape = joint_shape(tangent_vec=tangent_vec, base_point=base_point)
        # Adding zeros broadcasts and keeps the tape; autograd has no rule for broadcast_to.
        tangent_vec, base_point = tangent_vec + np.zeros(shape), base_point + np.zeros(shape)
        return differential(self.map, tangent_vec, base_point)

    @property
    def complementary_metric(self) -> RiemannianMetric | None:
        """A metric that measures what this one does not, or None."""
        return None

    def with_stretching(self, weight: float) -> RiemannianMetric:
        """Return a metric that measures lengths as well; by default the metric itself.

        Parameters
        ----------
        weight : float
            Weight of the metric of lengths, above 0, in units of the weights of this metric.
        """
        return self

    # Distances and geodesics. Where there is neither a closed form nor a strategy given, the
    # default strategies of `riemhuman.solvers` find geodesics.

    def squared_dist(self, point_a: Points, point_b: Points) -> Array:
        r"""Return the squared distance of points, shape (...).

        Without a closed form, it is the energy of the path that `geodesic_solver` finds, and takes
        a single pair of points.

        Parameters
        ----------
        point_a, point_b : array, shape (..., \*shape)
        """
        if self.geodesic_solver is None:
            raise NotDefinedError(
                f"{type(self).__name__} has no closed form for squared_dist; pass the solver "
                "whose paths it should measure, such as "
                "geodesic_solver=riemhuman.solvers.BasisPath(basis)"
            )
        return self._solve(self.geodesic_solver, "squared_dist", point_a, point_b).energy  # type: ignore[return-value]  # one number

    @checked(tangent_vec=VECTOR, base_point=POINT)
    def exp(self, tangent_vec: TangentVectors, base_point: Points) -> Array:
        r"""Return the end of the geodesic with this initial velocity after unit time.

        If the geodesic leaves the manifold, OutsideManifoldError says where. Without a closed form,
        `exp_solver` computes it, by default in ten steps over 60 harmonics of the template.

        Parameters
        ----------
        tangent_vec, base_point : array, shape (..., \*shape)
        """
        joint_shape(tangent_vec=tangent_vec, base_point=base_point)
        return self._exp(tangent_vec, base_point)

    def _exp(self, velocity: TangentVectors, point: Points) -> Array:
        solver: ExpSolver | None = self.exp_solver
        if solver is None:
            solver = _default_solvers().exp_solver(self)

        def follow(vector: TangentVectors, start: Points) -> Points:
            result = solver.solve(self, vector, start)
            if not getattr(result, "complete", True):
                where = getattr(result, "message", "a point on the way")
                raise OutsideManifoldError(
                    f"tangent_vec must be the velocity of a geodesic that {type(solver).__name__} "
                    f"can follow for unit time; it stopped at {where}"
                )
            return result.end

        return self._one_by_one(follow, velocity, point)

    @checked(point=POINT, base_point=POINT)
    def log(self, point: Points, base_point: Points) -> Array:
        r"""Return the initial velocity of the minimal geodesic from `base_point` to `point`.

        If there is no minimal geodesic, or more than one, OutsideManifoldError says where. Without
        a closed form, `log_solver` computes it, by default in the same number of steps as `exp`,
        which inverts it.

        Parameters
        ----------
        point, base_point : array, shape (..., \*shape)
        """
        joint_shape(point=point, base_point=base_point)
        return self._log(point, base_point)

    def _log(self, point: Points, start: Points) -> Array:
        solver: LogSolver | None = self.log_solver
        if solver is None:
            solver = _default_solvers().log_solver(self)
        return self._one_by_one(lambda x, y: solver.solve(self, y, x).tangent_vec, start, point)

    @checked(tangent_vec=VECTOR, base_point=POINT)
    def parallel_transport(
        self,
        tangent_vec: TangentVectors,
        base_point: Points,
        direction: TangentVectors | None = None,
        end_point: Points | None = None,
    ) -> Array:
        r"""Transport tangent vectors in parallel along geodesics, shape (..., \*shape).

        Without a closed form, `transport_solver` transports them, by default with pole ladders
        along paths over 60 harmonics of the template.

        Parameters
        ----------
        tangent_vec, base_point : array, shape (..., \*shape)
        direction : array, shape (..., \*shape), optional
            Initial velocity of the geodesic, followed for unit time.
        end_point : array, shape (..., \*shape), optional
            End point of the geodesic; exactly one of the two is given.
        """
        if (direction is None) == (end_point is None):
            raise ArgumentError("parallel_transport needs direction or end_point, and not both")
        if self.has_closed_form_transport and end_point is not None:
            direction = self.log(end_point, base_point)
        name = "end_point" if direction is None else "direction"
        goals = self._vectors(end_point if direction is None else direction, name)
        joint_shape(tangent_vec=tangent_vec, base_point=base_point, **{name: goals})
        if self.has_closed_form_transport:
            return self._transport(tangent_vec, base_point, goals)
        solver: TransportSolver | None = self.transport_solver
        if solver is None:
            solver = _default_solvers().transport_solver(self)

        def carry(vector: TangentVectors, start: Points, goal: Array) -> Array:
            return solver.solve(self, vector, start, **{name: goal}).tangent_vec

        return self._one_by_one(carry, tangent_vec, base_point, goals)

    def _transport(self, vector: TangentVectors, point: Points, velocity: TangentVectors) -> Array:
        """Return vectors at the ends of geodesics with initial velocities, in closed form."""
        raise self._not_defined("parallel_transport")

    @checked(initial_tangent_vec=VECTOR)
    def geodesic(
        self,
        initial_point: Points,
        end_point: Points | None = None,
        initial_tangent_vec: Array | None = None,
    ) -> Callable[[ArrayLike], Points]:
        r"""Return a geodesic as a function of times in [0, 1], shape (n_times,).

        With an initial velocity v, it is exp(t v). Between two points, without a closed form, it is
        the path that `geodesic_solver` finds, by default over 60 harmonics of the template, with
        linear interpolation between its times and extrapolation beyond them.

        Parameters
        ----------
        initial_point : array, shape (..., \*shape)
        end_point : array, shape (..., \*shape), optional
        initial_tangent_vec : array, shape (..., \*shape), optional
            Initial velocity; exactly one of the two is given.
        """
        if end_point is not None and initial_tangent_vec is None:
            return self._geodesic_between(initial_point, end_point)
        if end_point is not None or initial_tangent_vec is None:
            raise ArgumentError("geodesic needs end_point or initial_tangent_vec, and not both")
        initial_point = self.space.check_point(initial_point, "initial_point")
        point, velocity = (
            np.expand_dims(array, -self.space.point_ndim - 1)
            for array in (initial_point, initial_tangent_vec)
        )
        return lambda t: self.exp(self._times(t) * velocity, point)

    def _geodesic_between(self, start: Points, end: Points) -> Callable[[ArrayLike], Points]:
        start = self.space.check_point(start, "initial_point")
        end = self.space.check_point(end, "end_point")
        if self.has_closed_form_geodesic:
            return self.geodesic(start, initial_tangent_vec=self.log(end, start))
        solver: GeodesicSolver | None = self.geodesic_solver
        if solver is None:
            solver = _default_solvers().geodesic_solver(self)
        path = np.asarray(self._solve(solver, "geodesic", start, end).path)

        def follow(t: ArrayLike) -> Points:
            position = self._times(t).ravel() * (len(path) - 1)
            index = np.clip(position.astype(int), 0, len(path) - 2)
            weight = np.expand_dims(position - index, self.space._point_axes)
            between: Points = (1 - weight) * path[index] + weight * path[index + 1]
            return between

        return follow

    def _solve(self, solver: GeodesicSolver, name: str, start: Points, end: Points) -> SolvedPath:
        """Return the result of a solver for one pair of points."""
        shape = self.space.shape
        start, end = (real_array(point, "point", shape, rows=True) for point in (start, end))
        if np.shape(start) != shape or np.shape(end) != shape:
            raise ArgumentError(
                f"{name} with a solver takes one pair of points of shape {shape}; found "
                f"{np.shape(start)} and {np.shape(end)}"
            )
        return solver.solve(self, start, end)

    def _one_by_one(  # type: ignore[explicit-any]  # a function of as many arrays
        self, solve: Callable[..., Array], *arrays: Array
    ) -> Array:
        """Return the results for broadcast arrays of points or vectors."""
        shape = np.broadcast_shapes(*(np.shape(array) for array in arrays))
        # autograd's `broadcast_to` adds no axes.
        arrays = tuple(array + np.zeros(shape) for array in arrays)
        leading = shape[: len(shape) - self.space.point_ndim]
        results = []
        for index in np.ndindex(leading):
            results.append(solve(*(array[index] for array in arrays)))
        return np.reshape(np.array(results), shape)

    def _times(self, t: ArrayLike) -> Array:
        """Return times followed by the axes of a point."""
        times = np.atleast_1d(real_array(t, "t"))
        if times.ndim != 1:
            raise ArgumentError(f"t must be a number or have shape (n_times,); found {times.shape}")
        return np.expand_dims(times, self.space._point_axes)


def _default_solvers() -> DefaultSolvers:
    # `riemhuman/__init__.py`, where type checkers see that it is true, provides them.
    return cast(DefaultSolvers, default_solvers())


def check_metric(metric: object, name: str = "metric") -> None:
    """Raise an ArgumentTypeError unless a solver was given a metric where it takes one."""
    if not isinstance(metric, RiemannianMetric):
        refuse_type(metric, name, "a metric, such as ElasticMetric(space), before the points")
