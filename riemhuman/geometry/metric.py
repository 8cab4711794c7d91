"""The abstract Riemannian metric: two primitives, and everything derived from them; multiples."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import autograd.numpy as np
from autograd import elementwise_grad
from numpy import ndarray

from riemhuman.checks import metric_weight
from riemhuman.docstrings import InheritsDocstrings
from riemhuman.errors import ArgumentTypeError, NotDefinedError
from riemhuman.geometry.bulk import Bulk, SumOfFactors
from riemhuman.geometry.derived_quantities import DerivedQuantities
from riemhuman.geometry.geodesic_quantities import GeodesicQuantities
from riemhuman.geometry.pairwise import ManyDistances
from riemhuman.geometry.path_quantities import PathQuantities
from riemhuman.geometry.space import Space
from riemhuman.kernels.scalars import square_root
from riemhuman.protocols import ExpSolver, GeodesicSolver, LogSolver, TransportSolver
from riemhuman.representation import constructor_text


class RiemannianMetric(
    InheritsDocstrings, PathQuantities, GeodesicQuantities, DerivedQuantities, ManyDistances
):
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
        return constructor_text(self, leave_out=("space",))

    def __mul__(self, scale: float) -> RiemannianMetric:
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


class ScalarProductMetric(RiemannianMetric):
    """A metric times a number: ``2.0 * metric``.

    Inner products, energies and squared distances are multiplied; geodesics, exponential, logarithm
    and parallel transport stay.

    Parameters
    ----------
    metric : RiemannianMetric
        The metric.
    scale : float
        The number, above 0.
    """

    def __init__(self, metric: RiemannianMetric, scale: float) -> None:
        super().__init__(
            metric.space,
            metric.geodesic_solver,
            exp_solver=metric.exp_solver,
            log_solver=metric.log_solver,
            transport_solver=metric.transport_solver,
        )
        self.underlying_metric = metric
        self._scale = metric_weight(scale, "scale", strict=True)

    @property
    def scale(self) -> float:
        """The number."""
        return self._scale

    @property
    def has_closed_form_dist(self) -> bool:
        """Whether the metric has distances in closed form."""
        return self.underlying_metric.has_closed_form_dist

    @property
    def has_inner_product(self) -> bool:
        """Whether the metric defines an inner product."""
        return self.underlying_metric.has_inner_product

    @property
    def has_closed_form_geodesic(self) -> bool:
        """Whether the metric has geodesics in closed form."""
        return self.underlying_metric.has_closed_form_geodesic

    @property
    def has_closed_form_transport(self) -> bool:
        """Whether the metric has parallel transport in closed form."""
        return self.underlying_metric.has_closed_form_transport

    def inner_product(
        self, tangent_vec_a: ndarray, tangent_vec_b: ndarray, base_point: ndarray | None = None
    ) -> ndarray:
        """Return the inner product of the metric, multiplied."""
        product = self.underlying_metric.inner_product(tangent_vec_a, tangent_vec_b, base_point)
        return self.scale * product

    def covector(self, tangent_vec: ndarray, base_point: ndarray) -> ndarray:
        """Return the covectors of the metric, multiplied."""
        return self.scale * self.underlying_metric.covector(tangent_vec, base_point)

    def squared_dist(self, point_a: ndarray, point_b: ndarray) -> ndarray:
        """Return the squared distance of the metric, multiplied."""
        return self.scale * self.underlying_metric.squared_dist(point_a, point_b)

    @property
    def bulk(self) -> Bulk:
        """The bulk work of the metric, multiplied."""
        return SumOfFactors([(lambda points: points, self.scale, self.underlying_metric.bulk)])

    def energy(self, path: ndarray) -> ndarray:
        """Return the energy of the metric, multiplied."""
        return self.scale * self.underlying_metric.energy(path)

    def energy_and_gradient(self, path: ndarray) -> tuple[float, ndarray]:
        """Return the energy of one path and its gradient, multiplied."""
        energy, gradient = self.underlying_metric.energy_and_gradient(path)
        return self.scale * energy, self.scale * gradient

    def length(self, path: ndarray) -> ndarray:
        """Return the length of the metric, times the square root of the number."""
        return np.sqrt(self.scale) * self.underlying_metric.length(path)

    def gram_matrix(self, vectors: ndarray, base_point: ndarray) -> ndarray:
        """Return the Gram matrix of the metric, multiplied."""
        return self.scale * self.underlying_metric.gram_matrix(vectors, base_point)

    def remove_drift(self, path: ndarray) -> ndarray:
        """Remove drift as the metric does."""
        return self.underlying_metric.remove_drift(path)

    def exp(self, tangent_vec: ndarray, base_point: ndarray) -> ndarray:
        """Return the exponential of the metric."""
        return self.underlying_metric.exp(tangent_vec, base_point)

    def log(self, point: ndarray, base_point: ndarray) -> ndarray:
        """Return the logarithm of the metric."""
        return self.underlying_metric.log(point, base_point)

    def parallel_transport(
        self,
        tangent_vec: ndarray,
        base_point: ndarray,
        direction: ndarray | None = None,
        end_point: ndarray | None = None,
    ) -> ndarray:
        """Transport vectors as the metric does."""
        return self.underlying_metric.parallel_transport(
            tangent_vec, base_point, direction, end_point
        )

    def injectivity_radius(self, base_point: ndarray | None = None) -> ndarray:
        """Return the radius of the metric, times the square root of the number."""
        return np.sqrt(self.scale) * self.underlying_metric.injectivity_radius(base_point)

    def curvature_form(
        self, tangent_vec_a: ndarray, tangent_vec_b: ndarray, base_point: ndarray
    ) -> ndarray:
        """Return ⟨R(a, b) b, a⟩ of the metric, multiplied."""
        form = self.underlying_metric.curvature_form(tangent_vec_a, tangent_vec_b, base_point)
        return self.scale * form

    def _geodesic_between(self, start: ndarray, end: ndarray) -> Callable[[Any], ndarray]:
        return self.underlying_metric._geodesic_between(start, end)
