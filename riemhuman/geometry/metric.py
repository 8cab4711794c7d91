"""The abstract Riemannian metric: two primitives, and everything derived from them."""

from __future__ import annotations

from typing import Any

import autograd.numpy as np
from autograd import elementwise_grad, value_and_grad
from numpy import ndarray

from riemhuman.checks import real_array
from riemhuman.docstrings import inherit_sections
from riemhuman.errors import ArgumentError, ArgumentTypeError, NotDefinedError
from riemhuman.geometry.derived_quantities import DerivedQuantities
from riemhuman.geometry.geodesic_quantities import GeodesicQuantities
from riemhuman.geometry.pairwise import ManyDistances
from riemhuman.geometry.space import Space
from riemhuman.kernels.scalars import square_root
from riemhuman.protocols import ExpSolver, GeodesicSolver, LogSolver, TransportSolver
from riemhuman.representation import constructed


class RiemannianMetric(GeodesicQuantities, DerivedQuantities, ManyDistances):
    r"""A Riemannian metric on a manifold.

    A subclass defines `inner_product`, or `squared_dist` where there is a closed form, or both;
    norm, distance, energy, length and their gradients by autograd follow. With
    `squared_dist` alone the inner product is half its second derivative on the diagonal.

    Parameters
    ----------
    space : Manifold
        The manifold.
    geodesic_solver : object, optional
        Strategy with a method ``solve(metric, start, end)`` for geodesics and distances that have
        no closed form, see `riemhuman.solvers`.
    exp_solver : object, optional
        Strategy with a method ``solve(metric, tangent_vec, base_point)`` for `exp` where it has
        no closed form.
    log_solver : object, optional
        Strategy with a method ``solve(metric, point, base_point)`` for `log` where it has no
        closed form.
    transport_solver : object, optional
        Strategy with a method ``solve(metric, tangent_vec, base_point, direction, end_point)`` for
        `parallel_transport` where it has no closed form.

    Notes
    -----
    The parameters of a metric are set at construction and never change.

    Examples
    --------
    >>> import autograd.numpy as np
    >>> import riemhuman as rh
    >>> class Weighted(rh.RiemannianMetric):
    ...     def inner_product(self, tangent_vec_a, tangent_vec_b, base_point):
    ...         return 4.0 * np.sum(tangent_vec_a * tangent_vec_b, axis=-1)
    >>> metric = Weighted(rh.VectorSpace((2,)))
    >>> float(metric.norm(np.array([3.0, 4.0]), np.zeros(2)))
    10.0
    """

    def __init_subclass__(cls, **options: Any) -> None:
        super().__init_subclass__(**options)
        inherit_sections(cls)

    def __init__(
        self,
        space: Space,
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
        return constructed(self, leave_out=("space",))

    def __mul__(self, scale: float) -> RiemannianMetric:
        from riemhuman.geometry.scalar_product import ScalarProductMetric

        return ScalarProductMetric(self, scale)

    __rmul__ = __mul__

    @property
    def has_closed_form_dist(self) -> bool:
        """Whether the class defines `squared_dist` itself."""
        return type(self).squared_dist is not RiemannianMetric.squared_dist

    @property
    def has_inner_product(self) -> bool:
        """Whether the class defines `inner_product` itself."""
        return type(self).inner_product is not RiemannianMetric.inner_product

    @property
    def has_closed_form_geodesic(self) -> bool:
        """Whether the class has geodesics between points that need no solver."""
        return type(self)._geodesic_between is not RiemannianMetric._geodesic_between

    @property
    def has_closed_form_transport(self) -> bool:
        """Whether the class defines `parallel_transport` itself."""
        return type(self).parallel_transport is not RiemannianMetric.parallel_transport

    def inner_product(
        self, tangent_vec_a: ndarray, tangent_vec_b: ndarray, base_point: ndarray | None = None
    ) -> ndarray:
        r"""Return the inner product of tangent vectors.

        The default, for metrics that define `squared_dist` alone, is
        :math:`\tfrac12 \partial_\varepsilon \langle \nabla_y d^2(x, x + \varepsilon a), b\rangle`
        at ε = 0 by central differences of the exact gradient.

        Parameters
        ----------
        tangent_vec_a, tangent_vec_b : array, shape (..., \*shape)
            Tangent vectors.
        base_point : array, shape (..., \*shape), optional
            Base point; needed unless the inner product is the same at every point.

        Returns
        -------
        array, shape (...)
        """
        if not self.has_closed_form_dist:
            raise NotDefinedError(
                f"{type(self).__name__} defines neither inner_product nor squared_dist; "
                "one of the two is needed"
            )
        base_point = self.space.check_point(base_point, "base_point")
        covector = self.covector(tangent_vec_a, base_point)
        return np.sum(covector * tangent_vec_b, axis=self.space._point_axes)

    def covector(self, tangent_vec: ndarray, base_point: ndarray) -> ndarray:
        r"""Lower the index of tangent vectors: ⟨covector(v), w⟩ = inner_product(v, w).

        The default differentiates `inner_product`, or, where only `squared_dist` is defined, takes
        central differences of its exact gradient.

        Parameters
        ----------
        tangent_vec : array, shape (..., \*shape)
            Tangent vectors.
        base_point : array, shape (..., \*shape)
            Base point.

        Returns
        -------
        array, shape (..., \*shape)
        """
        if self.has_inner_product:
            zero = np.zeros(np.broadcast_shapes(np.shape(tangent_vec), np.shape(base_point)))
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

    def gram_matrix(self, vectors: ndarray, base_point: ndarray) -> ndarray:
        r"""Return the inner products of all pairs of tangent vectors, averaged over base points.

        Parameters
        ----------
        vectors : array, shape (K, \*shape)
            Tangent vectors.
        base_point : array, shape (\*shape,) or (n, \*shape)
            One base point, or several to average over.

        Returns
        -------
        array, shape (K, K)
        """
        vectors = self.check_points(vectors, "vectors")
        base_points = self.space.check_point(base_point, "base_point")
        base_points = base_points.reshape((-1, *self.space.shape))
        covectors = np.mean(
            [[self.covector(vector, point) for vector in vectors] for point in base_points], axis=0
        )
        axes = self.space._point_axes
        gram = np.tensordot(covectors, vectors, (axes, axes))
        return 0.5 * (gram + gram.T)

    def squared_norm(self, vector: ndarray, base_point: ndarray | None = None) -> ndarray:
        r"""Return the squared norm of tangent vectors.

        Parameters
        ----------
        vector : array, shape (..., \*shape)
            Tangent vectors.
        base_point : array, shape (..., \*shape)
            Base point.

        Returns
        -------
        array, shape (...)
        """
        return self.inner_product(vector, vector, base_point)

    def norm(self, vector: ndarray, base_point: ndarray | None = None) -> ndarray:
        r"""Return the norm of tangent vectors.

        Parameters
        ----------
        vector : array, shape (..., \*shape)
            Tangent vectors.
        base_point : array, shape (..., \*shape)
            Base point.

        Returns
        -------
        array, shape (...)
        """
        return square_root(self.squared_norm(vector, base_point))

    def squared_dist(self, point_a: ndarray, point_b: ndarray) -> ndarray:
        r"""Return the squared distance of points.

        Where the class has no closed form, it is the energy of the path that `geodesic_solver`
        finds, for one pair of points.

        Parameters
        ----------
        point_a, point_b : array, shape (..., \*shape)
            Points.

        Returns
        -------
        array, shape (...)

        Raises
        ------
        NotDefinedError
            If there is neither a closed form nor a solver.
        """
        return self._solve("squared_dist", point_a, point_b).energy

    def dist(self, point_a: ndarray, point_b: ndarray) -> ndarray:
        r"""Return the distance of points, with gradient 0 where they coincide.

        Parameters
        ----------
        point_a, point_b : array, shape (..., \*shape)
            Points.

        Returns
        -------
        array, shape (...)
        """
        return square_root(self.squared_dist(point_a, point_b))

    def energy(self, path: ndarray) -> ndarray:
        r"""Return the energy of discrete paths with n segments.

        :math:`n \sum_i d^2(x_i, x_{i+1})` where `squared_dist` has a closed form, else the finite
        differences :math:`n \sum_i \|x_{i+1} - x_i\|^2` at the midpoints of the segments
        (equation 7 of the paper).

        Parameters
        ----------
        path : array, shape (..., n_times, \*shape)
            Paths.

        Returns
        -------
        array, shape (...)
        """
        path = self._check_path(path)
        n_segments = path.shape[-len(self.space.shape) - 1] - 1
        return n_segments * np.sum(self._squared_segments(path), axis=-1)

    def energy_and_gradient(self, path: ndarray) -> tuple[float, ndarray]:
        r"""Return the energy of one path and its gradient.

        Parameters
        ----------
        path : array, shape (n_times, \*shape)
            Path.

        Returns
        -------
        energy : float
            May be infinite at a path that leaves the manifold.
        gradient : array, shape (n_times, \*shape)
            Derivatives with respect to all entries of the path.
        """
        path = self.check_points(path, "path")
        energy, gradient = value_and_grad(self.energy)(path)
        return float(energy), gradient

    def squared_dists_and_gradient(
        self, point: ndarray, others: ndarray, weights: ndarray
    ) -> tuple[ndarray, ndarray]:
        r"""Return the squared distances of a point from others, and the gradient of their sum.

        Distances are energies of paths of one segment.

        Parameters
        ----------
        point : array, shape (\*shape,)
            Point x.
        others : array, shape (n, \*shape)
            Points x_i.
        weights : array, shape (n,)
            Weights w_i > 0.

        Returns
        -------
        squared : array, shape (n,)
            d(x_i, x)², infinite where x or x_i leaves the manifold.
        gradient : array, shape (\*shape,)
            Gradient of Σ_i w_i d(x_i, x)² with respect to x.
        """
        squared, gradient = np.empty(len(others)), np.zeros(np.shape(point))
        for i, (weight, other) in enumerate(zip(weights, others, strict=True)):
            squared[i], slopes = self.energy_and_gradient(np.stack([other, point]))
            gradient += weight * slopes[1]
        return squared, gradient

    def remove_drift(self, path: ndarray) -> ndarray:
        r"""Move interior points of a path by motions the metric does not see, if there are any.

        Parameters
        ----------
        path : array, shape (n_times, \*shape)
            Path.

        Returns
        -------
        array, shape (n_times, \*shape)
            A path of the same energy; by default the same path.
        """
        return path

    def length(self, path: ndarray) -> ndarray:
        r"""Return the length of discrete paths, the sum of the lengths of their segments.

        Parameters
        ----------
        path : array, shape (..., n_times, \*shape)
            Paths.

        Returns
        -------
        array, shape (...)
        """
        path = self._check_path(path)
        self.space.check_scale(path, "path")
        return np.sum(square_root(self._squared_segments(path)), axis=-1)

    def _squared_segments(self, path: ndarray) -> ndarray:
        before: Any = (..., slice(None, -1), *self._whole_point)
        after: Any = (..., slice(1, None), *self._whole_point)
        start, end = path[before], path[after]
        if self.has_closed_form_dist:
            return self.squared_dist(start, end)
        return self.squared_norm(end - start, self.space.projection(0.5 * (start + end)))

    @property
    def _whole_point(self) -> tuple[slice, ...]:
        return (slice(None),) * len(self.space.shape)

    def _check_path(self, path: ndarray, batched: bool = True) -> ndarray:
        path = real_array(path, "path", ("n_times", *self.space.shape), batched=batched)
        n_times = path.shape[-len(self.space.shape) - 1]
        if n_times < 2:
            raise ArgumentError(f"path must have at least two times; found {n_times}")
        return path
