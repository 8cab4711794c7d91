"""Exact nearest neighbours, where lower bounds exclude most pairs."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Self

import numpy as np
from numpy import ndarray

from riemhuman.arrays import Array, PointsLike
from riemhuman.checks import integer_array, length_of, one_of, whole_number
from riemhuman.errors import ArgumentError
from riemhuman.estimator import Estimator
from riemhuman.geometry import RiemannianMetric
from riemhuman.kernels.projections import Projection, in_blocks
from riemhuman.kernels.threads import mapped, slices, thread_count
from riemhuman.memory import check_memory, enough_memory
from riemhuman.retrieval.jobs import checked_part

_ALGORITHMS = ("auto", "brute", "index")

# Numbers of points added, and of queries answered, at a time.
_BLOCK = 64

# Largest number of lower bounds in memory.
_BOUNDS = 2**22

# Largest numbers of points that the projection is fitted to, and of all their coordinates.
_SAMPLE, _SAMPLE_SIZE = 1024, 2**26

# Numbers of points compared with a query at first, and then at a time: their features fit a cache.
_FIRST, _BATCH = 8, 32

# Generous bound on the rounding error of squared lower bounds, relative to the largest.
_SLACK = 1e-9

# With fewer points, all are compared, which is faster than lower bounds. So are all points
# if bounds exclude less than this share of the points for a few trial queries.
_FEW, _LEAST_EXCLUDED, _TRIALS = 1000, 0.5, 8


class NearestNeighbors(Estimator):
    r"""Exact nearest neighbours under a Riemannian metric, without computing all distances.

    If there are few points, every query is compared with all of them. If there are many, an index
    is built: each query is compared with points in the order of lower bounds of their distances,
    until no other point can be as near as those found. The bounds are Euclidean distances between
    the metric's `lower_bound_coordinates`, projected to the principal components of a sample, with
    the norm of the residual as an additional coordinate. If the bounds exclude too few points, as
    under the shape metric, all points are compared.

    Parameters
    ----------
    metric : RiemannianMetric
        A metric with a closed-form distance.
    n_neighbors : int
    algorithm : {"auto", "brute", "index"}
        "index" always uses bounds, and "brute" never does; by default, bounds are used for a
        thousand points or more, if they exclude most of them.
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

    @enough_memory("an index of these bodies")
    def fit(self, X: Sequence[Array] | ndarray) -> Self:
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
        one_of(self.algorithm, "algorithm", _ALGORITHMS)
        whole_number(self.n_components, "n_components", minimum=0)
        self.n_samples_fit_ = len(X)
        self._projection = self._fit_projection(X)
        tables: list[ndarray] = []
        for part in slices(len(X), _BLOCK):
            rows = self._rows_of(X, part)
            if not tables:
                bytes_each = sum(row.nbytes for row in rows) / (part.stop - part.start)
                check_memory(bytes_each * len(X), f"an index of {len(X):,} bodies")
                tables = [np.empty((len(X), *row.shape[1:]), row.dtype) for row in rows]
            for table, row in zip(tables, rows, strict=True):
                table[part] = row
        self._tables = tables
        if self._projection is not None and self.algorithm == "auto":
            trials = np.linspace(0, len(X) - 1, _TRIALS).astype(int)
            compared = [next(self._search(slice(i, i + 1), None, 2, None))[2] for i in trials]
            if np.mean(compared) > (1.0 - _LEAST_EXCLUDED) * len(X):
                self._projection = None
        return self

    def kneighbors(
        self,
        X: Sequence[Array] | ndarray | None = None,
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
            Points of the index with which each query is compared first, such as the nearest codes
            of `riemhuman.learned.MetricCodes`. Good candidates save comparisons, but do not change
            the result.

        Returns
        -------
        distances : array, shape (n_queries, n_neighbors)
            Ascending; left out if `return_distance` is false.
        indices : array of int, shape (n_queries, n_neighbors)
            Indices of the points; at equal distances, the lower index comes first.
        """
        if not hasattr(self, "_tables"):
            raise ArgumentError("kneighbors needs points: call fit first")
        n_points = self.n_samples_fit_
        n_others = n_points - (X is None)
        k = whole_number(self.n_neighbors if n_neighbors is None else n_neighbors, "n_neighbors")
        if not 1 <= k <= n_others:
            raise ArgumentError(
                f"n_neighbors must be at least 1 and at most {n_others}, the number of other "
                f"points; found {k}"
            )
        n_queries = n_points if X is None else length_of(X, "X")
        if candidates is not None:
            candidates = integer_array(candidates, "candidates", (n_queries, "m"))
            if candidates.size and not 0 <= candidates.min() <= candidates.max() < n_points:
                raise ArgumentError(
                    f"candidates must hold indices of the points, from 0 to {n_points - 1}; "
                    f"found {candidates.min()} to {candidates.max()}"
                )
        distances = np.empty((n_queries, k))
        indices = np.empty((n_queries, k), dtype=np.int64)
        n_exact = 0
        size = max(1, min(_BLOCK, _BOUNDS // n_points))
        for part in slices(n_queries, size):
            for row, answer in enumerate(self._search(part, X, k, candidates), part.start):
                distances[row], indices[row], n_compared = answer
                n_exact += n_compared
        self.exact_share_ = n_exact / max(1, n_queries * n_points)
        return (distances, indices) if return_distance else indices

    def _fit_projection(self, X: PointsLike) -> Projection | None:
        """Return the projection to principal components of a sample, if there are to be bounds."""
        unused = self.algorithm == "brute" or (self.algorithm == "auto" and len(X) < _FEW)
        if unused or self.n_components == 0 or not self.metric.has_lower_bound_coordinates:
            return None
        coordinates = self.metric.lower_bound_coordinates
        size = coordinates(checked_part(self.metric, X, slice(0, 1), "X")).size
        n_sample = min(_SAMPLE, max(1, _SAMPLE_SIZE // size), len(X))
        parts = [slice(i, i + 1) for i in np.linspace(0, len(X) - 1, n_sample).astype(int).tolist()]
        points = np.concatenate([checked_part(self.metric, X, part, "X") for part in parts])
        return Projection.fit(in_blocks(coordinates, points), self.n_components)

    def _rows_of(self, X: PointsLike, part: slice) -> list[ndarray]:
        """Return coordinates that bound distances, none without a projection, and features."""
        points = checked_part(self.metric, X, part, "X")
        coordinates = np.empty((len(points), 0))
        if self._projection is not None:
            coordinates = self._projection(self.metric.lower_bound_coordinates(points))
        return [coordinates, *self.metric.features(points, n_jobs=self.n_jobs)]

    def _search(
        self, part: slice, X: PointsLike | None, k: int, candidates: ndarray | None
    ) -> Iterator[tuple[ndarray, ndarray, int]]:
        """Yield k distances, the numbers of the points, and that of comparisons, of some queries.

        The queries are a part of X, or of the points themselves.
        """
        n_threads = thread_count(self.n_jobs)
        rows = [table[part] for table in self._tables] if X is None else self._rows_of(X, part)
        (coordinates, *features), (own_coordinates, *tables) = rows, self._tables
        squared_distances = self.metric.bulk.squared_distances
        if self._projection is None:
            table = np.sqrt(squared_distances(tuple(features), tuple(tables), n_threads))
        else:
            table, slack = _squared_distances(coordinates, own_coordinates)
            if candidates is not None:
                np.put_along_axis(table, candidates[part], -np.inf, axis=1)
        if X is None:
            table[np.arange(len(table)), np.arange(part.start, part.stop)] = np.inf
        if self._projection is None:
            everyone = np.arange(self.n_samples_fit_)
            for distances in table:
                yield *_nearest(distances, everyone, k), len(everyone) - (X is None)
            return

        def search(row: int) -> tuple[ndarray, ndarray, int]:
            query = tuple(feature[row : row + 1] for feature in features)
            bounds, largest = table[row], float(np.finfo(float).max)
            distances, numbers = np.empty(0), np.empty(0, dtype=np.int64)
            size = np.count_nonzero(np.isneginf(bounds)) or _FIRST  # candidates, if any
            while len(left := np.flatnonzero(bounds <= largest)):
                nearest = np.argpartition(bounds[left], min(size, len(left)) - 1)[:size]
                batch, size = left[nearest], _BATCH
                bounds[batch] = np.inf
                squared = squared_distances(query, tuple(rows[batch] for rows in tables))
                distances = np.concatenate([distances, np.sqrt(squared[0])])
                numbers = np.concatenate([numbers, batch])
                if len(distances) >= k:
                    largest = float(np.partition(distances, k - 1)[k - 1]) ** 2 + slack
            return *_nearest(distances, numbers, k), len(distances)

        yield from mapped(search, range(len(table)), n_threads=n_threads)


def _nearest(distances: ndarray, numbers: ndarray, k: int) -> tuple[ndarray, ndarray]:
    """Return the k smallest distances and their numbers; at equal ones the lower comes first."""
    order = np.lexsort((numbers, distances))[:k]
    return distances[order], numbers[order]


def _squared_distances(rows: ndarray, others: ndarray) -> tuple[ndarray, float]:
    """Return squared Euclidean distances by one matrix product, and a bound on their error."""
    squares, other_squares = np.sum(rows**2, axis=1), np.sum(others**2, axis=1)
    squared = (-2.0 * rows) @ others.T
    squared += squares[:, None]
    squared += other_squares
    return squared, _SLACK * float(squares.max() + other_squares.max())
