"""The Riemannian metric: inner products, distances, lengths, energies, and geodesics.

Everything is derived from two primitives, `inner_product` and `squared_dist`.
"""

from __future__ import annotations

from abc import ABC
from collections.abc import Callable
from types import EllipsisType
from typing import TypeAlias, cast

import autograd.numpy as np
from autograd import elementwise_grad, value_and_grad
from numpy import ndarray
from scipy import sparse

from riemhuman.arrays import Array, ArrayLike, Integers, Points, TangentVectors
from riemhuman.checks import (
    OfOwner,
    a_solver,
    check_shape,
    checked,
    joint_shape,
    path_array,
    real_array,
    refuse_type,
)
from riemhuman.errors import (
    ArgumentError,
    ArgumentTypeError,
    NotDefinedError,
    OutsideManifoldError,
)
from riemhuman.geometry.pairwise import Bulk, DistanceTables, PairByPair
from riemhuman.geometry.point_space import PointSpace
from riemhuman.geometry.strategies import (
    DefaultSolvers,
    ExpSolver,
    GeodesicSolver,
    LogSolver,
    SolvedPath,
    Solvers,
    TransportSolver,
)
from riemhuman.kernels.drift import still_path
from riemhuman.kernels.surface import differential, square_root
from riemhuman.provided import default_solvers
from riemhuman.representation import Unchanging, constructor_text

# An index of as many axes as paths of points have.
_Index: TypeAlias = "tuple[EllipsisType | slice[int | None, int | None, None], ...]"


POINT = OfOwner(lambda metric: metric.space.check_point)
"""The check of points of a metric's space, shape (..., *shape)."""

POINTS = OfOwner(lambda metric: metric.check_points)
"""The check of several points, or of one path, shape (n, *shape)."""

VECTOR = OfOwner(lambda metric: metric._vectors)
"""The check of tangent vectors, shape (..., *shape)."""


class RiemannianMetric(Unchanging, DistanceTables, ABC):
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

    is_translation_invariant: bool = False
    """Whether translating one of two surfaces leaves their distance unchanged."""

    is_rotation_invariant: bool = False
    """Whether rotating one of two surfaces leaves their distance unchanged."""

    is_stretch_invariant: bool = False
    """Whether longer or shorter edges leave the distance of two surfaces unchanged."""

    is_reparametrization_invariant: bool = False
    """Whether it costs nothing when a surface slides along itself."""

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
        self.space = space
        self.geodesic_solver = geodesic_solver
        self.exp_solver = exp_solver
        self.log_solver = log_solver
        self.transport_solver = transport_solver

    def __repr__(self) -> str:
        return constructor_text(self, leave_out=("space",))

    # What a metric has.

    # Read by its name, that of the constructors' argument: texts and descriptions of metrics.
    @property
    def solvers(self) -> Solvers:
        """The solvers that were passed to the metric, by name."""
        given: Solvers = {}
        if self.geodesic_solver is not None:
            given["geodesic_solver"] = self.geodesic_solver
        if self.exp_solver is not None:
            given["exp_solver"] = self.exp_solver
        if self.log_solver is not None:
            given["log_solver"] = self.log_solver
        if self.transport_solver is not None:
            given["transport_solver"] = self.transport_solver
        return given

    @property
    def has_closed_form_dist(self) -> bool:
        """Whether distances have a closed form; by default if the class defines `squared_dist`."""
        return type(self).squared_dist is not RiemannianMetric.squared_dist

    @property
    def has_inner_product(self) -> bool:
        """Whether inner products are defined; by default if the class defines them."""
        return type(self).inner_product is not RiemannianMetric.inner_product

    @property
    def has_metric_matrix(self) -> bool:
        """Whether `metric_matrix` is defined."""
        return type(self).metric_matrix is not RiemannianMetric.metric_matrix

    @property
    def has_lower_bound_coordinates(self) -> bool:
        """Whether `lower_bound_coordinates` is defined."""
        default = RiemannianMetric.lower_bound_coordinates
        return type(self).lower_bound_coordinates is not default

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

    # Inner products.

    def inner_product(
        self,
        tangent_vec_a: TangentVectors,
        tangent_vec_b: TangentVectors,
        base_point: Points | None = None,
    ) -> Array:
        r"""Return the inner product of tangent vectors, shape (...).

        Parameters
        ----------
        tangent_vec_a, tangent_vec_b : array, shape (..., \*shape)
        base_point : array, shape (..., \*shape), optional
            Base point; needed unless the inner product is the same at every point.
        """
        if not self.has_closed_form_dist:
            raise NotDefinedError(
                f"{type(self).__name__} defines neither inner_product nor squared_dist; one of the "
                "two is needed"
            )
        base_point = self.space.check_point(base_point, "base_point")
        covector = self.covector(tangent_vec_a, base_point)
        return np.sum(covector * tangent_vec_b, axis=self.space._point_axes)

    @checked(tangent_vec=VECTOR, base_point=POINT)
    def covector(self, tangent_vec: TangentVectors, base_point: Points) -> Array:
        r"""Lower the index of tangent vectors: ⟨covector(v), w⟩ = inner_product(v, w).

        The default differentiates `inner_product` or, if only `squared_dist` is defined, takes
        central differences of its gradient.

        Parameters
        ----------
        tangent_vec, base_point : array, shape (..., \*shape)
        """
        shape = joint_shape(tangent_vec=tangent_vec, base_point=base_point)
        if self.has_inner_product:
            zero = np.zeros(shape)
            pairing = elementwise_grad(
                lambda w: np.sum(self.inner_product(tangent_vec, w, base_point))
            )
            return pairing(zero)
        slope = elementwise_grad(lambda y: np.sum(self.squared_dist(base_point, y)))
        axes = self.space._point_axes
        size = np.max(np.abs(tangent_vec), axis=axes, keepdims=True)
        step = 1e-4 * np.max(np.abs(base_point), axis=axes, keepdims=True)
        step = np.where(step > 0, step, 1e-4) / np.where(size > 0, size, 1.0)
        ahead = slope(base_point + step * tangent_vec)
        behind = slope(base_point - step * tangent_vec)
        return (ahead - behind) / (4.0 * step)

    def _vectors(self, vectors: object, name: str) -> Array:
        """Return tangent vectors as float64 arrays."""
        return real_array(vectors, name, self.space.shape)

    def gram_matrix(self, vectors: TangentVectors, base_point: Points) -> Array:
        r"""Return the inner products of all pairs of vectors, averaged over points, shape (K, K).

        Parameters
        ----------
        vectors : array, shape (K, \*shape)
        base_point : array, shape (\*shape,) or (n, \*shape)
            One base point, or several to average over.
        """
        vectors = self.check_points(vectors, "vectors")
        base_points = self._base_points(base_point)
        if not len(vectors):
            return np.zeros((0, 0))
        covectors = np.mean(
            [[self.covector(vector, point) for vector in vectors] for point in base_points], axis=0
        )
        axes = self.space._point_axes
        gram = np.tensordot(covectors, vectors, (axes, axes))
        return 0.5 * (gram + gram.T)

    def _base_points(self, base_point: Points) -> Points:
        """Return one base point, or several to average over, in a row, shape (n, *shape)."""
        base_points = self.space.check_point(base_point, "base_point")
        if base_points.size == 0:
            raise ArgumentError("base_point must hold at least one point; found none")
        return base_points.reshape((-1, *self.space.shape))

    def metric_matrix(self, base_point: Points) -> sparse.csr_array:
        r"""Return the sparse matrix M of the metric: ⟨h, k⟩ = h·(M k), points flattened.

        Parameters
        ----------
        base_point : array, shape (\*shape,) or (n, \*shape)
            One base point, or several to average over.
        """
        raise self._not_defined("metric_matrix")

    def squared_norm(self, vector: TangentVectors, base_point: Points | None = None) -> Array:
        r"""Return the squared norm of tangent vectors, shape (...).

        Parameters
        ----------
        vector, base_point : array, shape (..., \*shape)
        """
        return self.inner_product(vector, vector, base_point)

    def norm(self, vector: TangentVectors, base_point: Points | None = None) -> Array:
        r"""Return the norm of tangent vectors, shape (...).

        Parameters
        ----------
        vector, base_point : array, shape (..., \*shape)
        """
        return square_root(self.squared_norm(vector, base_point))

    def normalize(self, vector: TangentVectors, base_point: Points | None = None) -> Array:
        r"""Return tangent vectors scaled to norm 1, shape (..., \*shape); zero vectors stay zero.

        Parameters
        ----------
        vector : array, shape (..., \*shape)
        base_point : array, shape (..., \*shape), optional
        """
        norm = self.norm(vector, base_point)
        scale = 1.0 / np.where(norm == 0.0, 1.0, norm)
        return np.expand_dims(scale, self.space._point_axes) * vector

    # Distances.

    def dist(self, point_a: Points, point_b: Points) -> Array:
        r"""Return the distance of points, with gradient 0 where they coincide, shape (...).

        Parameters
        ----------
        point_a, point_b : array, shape (..., \*shape)
        """
        return square_root(self.squared_dist(point_a, point_b))

    @property
    def bulk(self) -> Bulk:
        """What computes distances of many pairs from features; by default pair by pair."""
        return PairByPair(self.squared_dist)

    def lower_bound_coordinates(self, points: Points) -> Array:
        r"""Return coordinates, shape (..., m), whose Euclidean distances are lower bounds.

        Parameters
        ----------
        points : array, shape (..., \*shape)
        """
        raise self._not_defined("lower_bound_coordinates")

    @checked(point=POINT, neighbors=POINTS)
    def closest_neighbor_index(self, point: Points, neighbors: Points) -> Integers:
        r"""Return the index of the neighbour that is nearest to each point, shape (...).

        Estimators of geomstats call it.

        Parameters
        ----------
        point : array, shape (..., \*shape)
        neighbors : array, shape (n, \*shape)
        """
        lead = point.shape[: point.ndim - self.space.point_ndim]
        distances = self.dist(point.reshape(*lead, 1, *self.space.shape), neighbors)
        return np.argmin(distances, axis=-1)

    def check_points(self, points: object, name: str = "points") -> Points:
        r"""Return a set of points as a float64 array after checking it, shape (n, \*shape).

        Parameters
        ----------
        points : array_like, shape (n, \*shape)
        name : str, for messages
        """
        if not isinstance(points, ndarray):
            points = self.space.as_array(points, name)
        checked = real_array(points, name, self.space.shape, rows=True)
        check_shape(checked, name, ("n_points", *self.space.shape), batched=False)
        return checked

    # Energies and lengths of discrete paths.

    def energy(self, path: Points) -> Array:
        r"""Return the energy of discrete paths with n segments, shape (...).

        :math:`n \sum_i d^2(x_i, x_{i+1})` if `squared_dist` has a closed form, otherwise the finite
        differences :math:`n \sum_i \|x_{i+1} - x_i\|^2` at the midpoints of the segments (equation
        7 of the paper).

        Parameters
        ----------
        path : array, shape (..., n_times, \*shape)
        """
        path = path_array(path, self.space)
        n_segments: int = path.shape[-len(self.space.shape) - 1] - 1
        return n_segments * np.sum(self._squared_segments(path), axis=-1)

    @checked(path=POINTS)
    def energy_and_gradient(self, path: Points) -> tuple[float, Array]:
        r"""Return the energy of one path, infinite outside the manifold, and its gradient.

        Parameters
        ----------
        path : array, shape (n_times, \*shape)
        """
        energy, gradient = value_and_grad(self.energy)(path)
        return float(energy), gradient

    def length(self, path: Points) -> Array:
        r"""Return the length of discrete paths, summed over their segments, shape (...).

        Parameters
        ----------
        path : array, shape (..., n_times, \*shape)
        """
        path = path_array(path, self.space)
        self.space.check_scale(path, "path")
        return np.sum(square_root(self._squared_segments(path)), axis=-1)

    def squared_dists_and_gradient(
        self, point: Points, others: Points, weights: Array
    ) -> tuple[Array, Array]:
        r"""Return the squared distances of a point from others, and the gradient of their sum.

        Distances are energies of paths with one segment, infinite if a point leaves the manifold;
        the gradient is that of Σ_i w_i d(x_i, x)².

        Parameters
        ----------
        point : array, shape (\*shape,)
        others : array, shape (n, \*shape)
        weights : array, shape (n,), above 0
        """
        squared, gradient = np.empty(len(others)), np.zeros(np.shape(point))
        for i, (weight, start) in enumerate(zip(weights, others, strict=True)):
            squared[i], slopes = self.energy_and_gradient(np.stack([start, point]))
            gradient += weight * slopes[1]
        return squared, gradient

    def remove_drift(self, path: Points) -> Array:
        r"""Move interior points of a path by motions that leave its energy unchanged, if any do.

        Parameters
        ----------
        path : array, shape (n_times, \*shape)
        """
        template = self.space.template if self.space.is_surface_space else None
        if template is None or not self.is_translation_invariant:
            return path
        path = self.check_points(path, "path")
        return still_path(path, template.vertex_areas, rotations=self.is_rotation_invariant)

    def _squared_segments(self, path: Points) -> Array:
        whole_point = (slice(None),) * len(self.space.shape)
        before: _Index = (..., slice(None, -1), *whole_point)
        after: _Index = (..., slice(1, None), *whole_point)
        start, end = path[before], path[after]
        if self.has_closed_form_dist:
            return self.squared_dist(start, end)
        return self.squared_norm(end - start, self.space.projection(0.5 * (start + end)))

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

    def _not_defined(self, name: str) -> NotDefinedError:
        return NotDefinedError(f"{type(self).__name__} does not define {name}")


def _default_solvers() -> DefaultSolvers:
    # `riemhuman/__init__.py`, where type checkers see that it is true, provides them.
    return cast(DefaultSolvers, default_solvers())


def check_metric(metric: object, name: str = "metric") -> None:
    """Raise an ArgumentTypeError unless a solver was given a metric where it takes one."""
    if not isinstance(metric, RiemannianMetric):
        refuse_type(metric, name, "a metric, such as ElasticMetric(space), before the points")
