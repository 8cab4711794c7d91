"""Metrics whose distances of many pairs run in compiled loops."""

from __future__ import annotations

from numpy import ndarray

from riemhuman.checks import one_of
from riemhuman.geometry.metric import RiemannianMetric
from riemhuman.geometry.pairwise import PRECISIONS, Points, thread_count


class BulkMetric(RiemannianMetric):
    """A metric with compiled loops over pairs, on features in single or double precision.

    A subclass defines `_pack` and `_squared_distances`. Loading numba takes longer than a single
    distance does, so they import the loops when they are called.
    """

    n_feature_arrays = 2

    def features(self, points: Points, precision: str = "double") -> tuple[ndarray, ...]:
        r"""Return what a distance needs to know of each point, and its rounding.

        Parameters
        ----------
        points : array or sequence, shape (n, \*shape)
            Points.
        precision : {"single", "double"}
            Precision to keep them in.

        Returns
        -------
        tuple of array, each of shape (n, ...)
            Features and `rounding`.
        """
        one_of(precision, "precision", PRECISIONS)
        return self._pack(self.check_points(points), precision)

    def rounding(self, features: tuple[ndarray, ...]) -> ndarray:
        """Return how far each point is, at most, from the point its features stand for.

        Parameters
        ----------
        features : tuple of array
            Features of n points.

        Returns
        -------
        array, shape (n,)
        """
        return features[1]

    def squared_dist_of_features(
        self,
        features_a: tuple[ndarray, ...],
        features_b: tuple[ndarray, ...],
        n_jobs: int | None = None,
    ) -> ndarray:
        """Return all squared distances between two sets of points given by their features.

        Parameters
        ----------
        features_a, features_b : tuple of array
            Features of n_a and of n_b points; the same object twice for the distances within one
            set.
        n_jobs : int, optional
            Number of threads, -1 for one a core; by default one.

        Returns
        -------
        array, shape (n_a, n_b)
        """
        return self._squared_distances(features_a[0], features_b[0], thread_count(n_jobs))

    def _pack(self, points: ndarray, precision: str) -> tuple[ndarray, ndarray]:
        raise TypeError(f"{type(self).__name__} must say what its features are")

    def _squared_distances(self, a: ndarray, b: ndarray, n_threads: int) -> ndarray:
        raise TypeError(f"{type(self).__name__} must say what the distances of features are")
