"""What a Riemannian metric measures: inner products, distances, lengths and energies.

Everything is derived from two primitives, `inner_product` and `squared_dist`. What geodesics need,
and the solvers that find them, is added by `riemhuman.geometry.metric.RiemannianMetric`.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from types import EllipsisType
from typing import TypeAlias

import autograd.numpy as np
from autograd import elementwise_grad, value_and_grad
from numpy import ndarray
from scipy import sparse

from riemhuman.arrays import Array, Integers, Points, PointsLike, TangentVectors
from riemhuman.checks import (
    OfOwner,
    check_shape,
    checked,
    choice,
    joint_shape,
    path_array,
    real_array,
)
from riemhuman.errors import ArgumentError, NotDefinedError
from riemhuman.geometry.pairwise import (
    MEMORY,
    PRECISIONS,
    Bulk,
    Features,
    PairByPair,
    features_in_threads,
    table_of_distances,
)
from riemhuman.geometry.point_space import PointSpace
from riemhuman.kernels.drift import still_path
from riemhuman.kernels.surface import square_root
from riemhuman.representation import Unchanging

__all__ = ["MetricTensor"]

# An index of as many axes as paths of points have.
_Index: TypeAlias = "tuple[EllipsisType | slice[int | None, int | None, None], ...]"


POINT = OfOwner(lambda metric: metric.space.check_point)
"""The check of points of a metric's space, shape (..., *shape)."""

POINTS = OfOwner(lambda metric: metric.check_points)
"""The check of several points, or of one path, shape (n, *shape)."""

VECTOR = OfOwner(lambda metric: metric._vectors)
"""The check of tangent vectors, shape (..., *shape)."""


class MetricTensor(Unchanging, ABC):
    """Inner products of tangent vectors, and what is measured with them.

    It is the part of `RiemannianMetric` that needs no geodesics.
    """

    is_translation_invariant: bool = False
    """Whether translating one of two surfaces leaves their distance unchanged."""

    is_rotation_invariant: bool = False
    """Whether rotating one of two surfaces leaves their distance unchanged."""

    is_stretch_invariant: bool = False
    """Whether longer or shorter edges leave the distance of two surfaces unchanged."""

    is_reparametrization_invariant: bool = False
    """Whether it costs nothing when a surface slides along itself."""

    def __init__(self, space: PointSpace) -> None:
        self.space = space

    @property
    @abstractmethod
    def has_closed_form_dist(self) -> bool:
        """Whether distances have a closed form."""

    @abstractmethod
    def squared_dist(self, point_a: Points, point_b: Points) -> Array:
        r"""Return the squared distance of points, shape (...).

        Parameters
        ----------
        point_a, point_b : array, shape (..., \*shape)
        """

    @property
    def has_inner_product(self) -> bool:
        """Whether inner products are defined; by default if the class defines them."""
        return type(self).inner_product is not MetricTensor.inner_product

    @property
    def has_metric_matrix(self) -> bool:
        """Whether `metric_matrix` is defined."""
        return type(self).metric_matrix is not MetricTensor.metric_matrix

    @property
    def has_lower_bound_coordinates(self) -> bool:
        """Whether `lower_bound_coordinates` is defined."""
        default = MetricTensor.lower_bound_coordinates
        return type(self).lower_bound_coordinates is not default

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

    # Distances of many pairs, see `riemhuman.geometry.pairwise`.

    @property
    def bulk(self) -> Bulk:
        """What computes distances of many pairs from features; by default pair by pair."""
        return PairByPair(self.squared_dist)

    def dist_pairwise(
        self,
        points: PointsLike,
        n_jobs: int | None = None,
        *,
        precision: str = "single",
        memory: int = MEMORY,
        progress: bool = False,
    ) -> Array:
        r"""Return all distances within a set of points, shape (n, n), symmetric.

        Parameters
        ----------
        points : array or sequence, shape (n, \*shape)
            Points; a memory-mapped array, or any sequence, is sliced as it is needed.
        n_jobs : int, optional
            Number of threads, -1 for one per core; by default one. The result does not depend on
            it.
        precision : {"single", "double"}
            Precision of features in compiled loops. In single precision, pairs that are too close
            for it are computed in double, and relative errors stay below 1e-5.
        memory : int
            Bytes of features held in memory at once; if all of them need more, they are recomputed.
        progress : bool
        """
        return table_of_distances(self, points, None, n_jobs, precision, memory, progress)

    def cdist(
        self,
        points_a: PointsLike,
        points_b: PointsLike,
        n_jobs: int | None = None,
        *,
        precision: str = "single",
        memory: int = MEMORY,
        progress: bool = False,
    ) -> Array:
        r"""Return all distances between two sets of points, see `dist_pairwise`, shape (n_a, n_b).

        Parameters
        ----------
        points_a, points_b : array or sequence, shape (n_a, \*shape) and (n_b, \*shape)
        n_jobs, precision, memory, progress : optional
            As for `dist_pairwise`.
        """
        return table_of_distances(self, points_a, points_b, n_jobs, precision, memory, progress)

    @checked(precision=choice(*PRECISIONS))
    def features(
        self,
        points: PointsLike,
        precision: str = "double",
        n_jobs: int | None = None,
        *,
        name: str = "points",
    ) -> Features:
        r"""Return the features from which distances are computed, once for each point.

        `bulk` computes distances from features, a tuple of C-contiguous arrays. Their first axis
        runs over the points, so features can be sliced, stored and memory-mapped.

        Parameters
        ----------
        points : array or sequence, shape (n, \*shape)
        precision, n_jobs : optional
            As for `dist_pairwise`.
        name : str, for messages
        """
        if n_jobs is not None:
            return features_in_threads(self, points, precision, n_jobs, name)
        if self.space.is_surface_space:
            checked = self.space.check_point(points, name)
            check_shape(checked, name, ("n_points", *self.space.shape), batched=False)
        else:
            checked = self.check_points(points, name)
        return self.bulk.features(checked, precision)

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

    def _not_defined(self, name: str) -> NotDefinedError:
        return NotDefinedError(f"{type(self).__name__} does not define {name}")
