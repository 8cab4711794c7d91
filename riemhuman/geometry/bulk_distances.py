"""Distances among many points, from what they need to know of each point."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import TYPE_CHECKING

import numpy as np
from numpy import ndarray

from riemhuman.checks import one_of, real_array
from riemhuman.errors import ArgumentError
from riemhuman.geometry.pairwise import MEMORY, PRECISIONS, Points, distances, pair_by_pair

if TYPE_CHECKING:
    from riemhuman.geometry.manifold import Manifold


class BulkDistances(ABC):
    """What a metric says of sets of points, by its `squared_dist` unless told a faster way.

    Features are computed once a point, distances from the features of two points.
    """

    space: Manifold

    @abstractmethod
    def squared_dist(self, point_a: ndarray, point_b: ndarray) -> ndarray:
        r"""Return the squared distance of points.

        Parameters
        ----------
        point_a, point_b : array, shape (..., \*shape)
            Points.

        Returns
        -------
        array, shape (...)
        """

    def check_points(self, points: Points, name: str = "points") -> ndarray:
        r"""Return a set of points as a float64 array, or say what is wrong with it.

        Parameters
        ----------
        points : array_like, shape (n, \*shape)
            Points.
        name : str
            Name of the argument, for messages.

        Returns
        -------
        array, shape (n, \*shape)
        """
        return real_array(points, name, ("n_points", *self.space.shape), batched=False)

    @property
    def n_feature_arrays(self) -> int:
        """The number of arrays in `features`."""
        return 1

    def dist_pairwise(
        self,
        points: Points,
        n_jobs: int | None = None,
        *,
        precision: str = "single",
        memory: int = MEMORY,
        progress: bool = False,
    ) -> ndarray:
        r"""Return all distances within a set of points.

        Parameters
        ----------
        points : array or sequence, shape (n, \*shape)
            Points; a memory-mapped array, or any sequence, is sliced as it is needed.
        n_jobs : int, optional
            Number of threads, -1 for one a core; by default one. It does not change a bit of the
            result.
        precision : {"single", "double"}
            In what precision metrics with compiled loops keep and compare features of the points:
            relative errors stay below 1e-5, or at rounding errors of double precision. Pairs too
            close for single precision are noticed and computed in double.
        memory : int
            Bytes of features held at once. Where those of all points are more, they are computed
            anew for every block of rows.
        progress : bool
            Whether to show a progress bar.

        Returns
        -------
        array, shape (n, n)
            Symmetric, with zero diagonal.

        Raises
        ------
        ArgumentError
            If a point has another shape or an entry that is not finite, or an option is not legal.
        DegenerateSurfaceError
            If the metric needs a normal of a triangle without area.
        """
        return distances(self, points, None, n_jobs, precision, memory, progress)

    def cdist(
        self,
        points_a: Points,
        points_b: Points,
        n_jobs: int | None = None,
        *,
        precision: str = "single",
        memory: int = MEMORY,
        progress: bool = False,
    ) -> ndarray:
        r"""Return all distances between two sets of points, see `dist_pairwise`.

        Parameters
        ----------
        points_a : array or sequence, shape (n_a, \*shape)
            Points of the first set.
        points_b : array or sequence, shape (n_b, \*shape)
            Points of the second set.
        n_jobs : int, optional
            Number of threads, -1 for one a core; by default one.
        precision : {"single", "double"}
            In what precision metrics with compiled loops work.
        memory : int
            Bytes of features held at once.
        progress : bool
            Whether to show a progress bar.

        Returns
        -------
        array, shape (n_a, n_b)
        """
        return distances(self, points_a, points_b, n_jobs, precision, memory, progress)

    def closest_neighbor_index(self, point: ndarray, neighbors: ndarray) -> ndarray:
        r"""Return which of some points is nearest; of several equally near, the first.

        Parameters
        ----------
        point : array, shape (..., \*shape)
            Points.
        neighbors : array, shape (n, \*shape)
            Points to choose from, at least one.

        Returns
        -------
        array of int, shape (...)
            Indices into `neighbors`.

        Raises
        ------
        ArgumentError
            If there is no point to choose from.
        """
        point = self.space.check_point(point)
        if len(neighbors) == 0:
            raise ArgumentError("neighbors must hold at least one point; found none")
        leading = point.shape[: -self.space.point_ndim]
        to_neighbors = self.cdist(point.reshape(-1, *self.space.shape), neighbors)
        return np.argmin(to_neighbors, axis=1).reshape(leading)

    def features(self, points: Points, precision: str = "double") -> tuple[ndarray, ...]:
        r"""Return what a distance needs to know of each point, computed once a point.

        The first axis of every array is that of the points, so features may be sliced, stored and
        mapped from memory. The default is the points themselves.

        Parameters
        ----------
        points : array or sequence, shape (n, \*shape)
            Points.
        precision : {"single", "double"}
            Precision to keep them in; the default pays no heed to it.

        Returns
        -------
        tuple of array, each of shape (n, ...)
            C-contiguous.
        """
        one_of(precision, "precision", PRECISIONS)
        return (np.ascontiguousarray(self.check_points(points)),)

    def rounding(self, features: tuple[ndarray, ...]) -> ndarray:
        """Return how far each point is, at most, from the point its features stand for.

        By the triangle inequality no distance of features is wrong by more than two of these; see
        `squared_dist_rectangle`. The default, for features that keep all digits, is 0.

        Parameters
        ----------
        features : tuple of array
            Features of n points.

        Returns
        -------
        array, shape (n,)
        """
        return np.zeros(len(features[0]))

    def squared_dist_of_features(
        self,
        features_a: tuple[ndarray, ...],
        features_b: tuple[ndarray, ...],
        n_jobs: int | None = None,
    ) -> ndarray:
        """Return all squared distances between two sets of points given by their `features`.

        Pairs that are too close for the precision of the features are not put right here:
        `squared_dist_rectangle` does. The default takes `squared_dist` pair by pair.

        Parameters
        ----------
        features_a, features_b : tuple of array
            Features of n_a and of n_b points; the same object twice for the distances within one
            set, of which only half are computed.
        n_jobs : int, optional
            Number of threads, -1 for one a core; by default one.

        Returns
        -------
        array, shape (n_a, n_b)
        """
        return pair_by_pair(self.squared_dist, features_a, features_b, n_jobs)
