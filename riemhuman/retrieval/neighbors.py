"""Exact nearest neighbours, where lower bounds exclude most pairs."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Self

import numpy as np
from numpy import ndarray

from riemhuman.checks import integer_array, length_of, one_of, whole_number
from riemhuman.errors import ArgumentError
from riemhuman.estimator import Estimator
from riemhuman.geometry import RiemannianMetric
from riemhuman.kernels.threads import thread_count
from riemhuman.retrieval._neighbor_index import NeighborIndex

ALGORITHMS = ("auto", "brute", "index")


class NearestNeighbors(Estimator):
    r"""Exact nearest neighbours under a Riemannian metric, without computing all distances.

    Few points are compared with each query, all of them. Many points get an index: each query is
    compared with them in the order of lower bounds of their distances, until no other point can be
    as near as those found. The bounds are Euclidean distances of the metric's
    `lower_bound_coordinates`, projected to the principal components of a sample, with the norm of
    the residual as one more coordinate. Where bounds exclude too little, as under the shape metric,
    all points are compared.

    Parameters
    ----------
    metric : RiemannianMetric
        A metric with a closed-form distance.
    n_neighbors : int
    algorithm : {"auto", "brute", "index"}
        "index" uses bounds whatever the number of points, and "brute" none; by default, bounds are
        used for a thousand points or more, if they exclude most of them.
    n_components : int
        Largest number of principal components. If points form groups that are far from each other,
        there should be more components than groups.
    n_jobs : int, optional
        Number of threads, -1 for one per core; by default one.

    Attributes
    ----------
    n_samples_fit_ : int
        Number of points in the index.
    exact_share_ : float
        Distances that the last `kneighbors` computed, as a share of all pairs of queries and
        points.

    Examples
    --------
    >>> bodies = rh.datasets.load_open_bodies("coarse")
    >>> space = rh.AlignedSurfaces(bodies.template)
    >>> shape = rh.ElasticMetric(space, a=1.0, lam=1e-4, c=0.0)  # who is it?
    >>> neighbors = rh.NearestNeighbors(shape).fit(bodies.points)
    >>> neighbors.kneighbors(bodies.points[14:15], 3)[1] // 10
    array([[1, 1, 1]])
    """

    n_samples_fit_: int
    exact_share_: float

    def __init__(
        self,
        metric: RiemannianMetric,
        n_neighbors: int = 5,
        *,
        algorithm: str = "auto",
        n_components: int = 256,
        n_jobs: int | None = None,
    ) -> None:
        self.metric = metric
        self.n_neighbors = n_neighbors
        self.algorithm = algorithm
        self.n_components = n_components
        self.n_jobs = n_jobs

    def fit(self, X: Sequence[Any] | ndarray) -> Self:
        r"""Index points.

        Parameters
        ----------
        X : array or sequence, shape (n, \*shape)
            Points: an array, or a sequence whose slices are arrays of points.
        """
        whole_number(self.n_neighbors, "n_neighbors", minimum=1)
        thread_count(self.n_jobs)
        if length_of(X, "X") == 0:
            raise ArgumentError("X must hold at least one point; found none")
        one_of(self.algorithm, "algorithm", ALGORITHMS)
        whole_number(self.n_components, "n_components", minimum=0)
        self._index = NeighborIndex(self.metric, X, self.n_jobs)
        if self.algorithm != "brute":
            self._index.fit_projection(self.n_components, always=self.algorithm == "index")
        self.n_samples_fit_ = len(self._index)
        return self

    def kneighbors(
        self,
        X: Sequence[Any] | ndarray | None = None,
        n_neighbors: int | None = None,
        return_distance: bool = True,
        *,
        candidates: ndarray | None = None,
    ) -> tuple[ndarray, ndarray] | ndarray:
        r"""Return the nearest points of the index.

        Parameters
        ----------
        X : array or sequence, shape (n_queries, \*shape), optional
            Queries; by default the points of the index, which are not neighbours of themselves.
        n_neighbors : int, optional
            By default that of the estimator.
        return_distance : bool
        candidates : array of int, shape (n_queries, m), optional
            Points of the index that each query is compared with first, such as the nearest codes of
            `riemhuman.learned.MetricCodes`. Good candidates save comparisons and do not change the
            result.

        Returns
        -------
        distances : array, shape (n_queries, n_neighbors)
            Ascending; left out if `return_distance` is false.
        indices : array of int, shape (n_queries, n_neighbors)
            Numbers of the points; at equal distances, the lower number comes first.
        """
        if not hasattr(self, "_index"):
            raise ArgumentError("kneighbors needs points: call fit first")
        index = self._index
        n_others = len(index) - (X is None)
        k = whole_number(self.n_neighbors if n_neighbors is None else n_neighbors, "n_neighbors")
        if not 1 <= k <= n_others:
            raise ArgumentError(
                f"n_neighbors must be at least 1 and at most {n_others}, the number of other "
                f"points; found {k}"
            )
        n_queries = len(index) if X is None else length_of(X, "X")
        if candidates is not None:
            candidates = integer_array(candidates, "candidates", (n_queries, "m"))
            if candidates.size and not 0 <= candidates.min() <= candidates.max() < len(index):
                raise ArgumentError(
                    f"candidates must number points of the index, from 0 to {len(index) - 1}; "
                    f"found {candidates.min()} to {candidates.max()}"
                )
        distances = np.empty((n_queries, k))
        indices = np.empty((n_queries, k), dtype=np.int64)
        n_exact = 0
        for row, answer in enumerate(index.nearest(X, k, candidates)):
            distances[row], indices[row], n_compared = answer
            n_exact += n_compared
        self.exact_share_ = n_exact / max(1, n_queries * len(index))
        return (distances, indices) if return_distance else indices
