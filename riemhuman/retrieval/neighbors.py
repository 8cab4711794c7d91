"""Exact nearest neighbours, where lower bounds exclude most pairs."""

from __future__ import annotations

import math
import os
from collections.abc import Iterator, Sequence
from shutil import disk_usage
from tempfile import TemporaryFile
from typing import NamedTuple, Self

import numpy as np
from numpy.typing import DTypeLike

from riemhuman.arrays import Array, Integers, PointsLike
from riemhuman.checks import checked, flag, index_array, length_of, one_of, whole_number
from riemhuman.checks.memory import check_memory, size_text
from riemhuman.errors import ArgumentError, FileError
from riemhuman.estimator import Estimator
from riemhuman.geometry import RiemannianMetric
from riemhuman.geometry.metric import check_metric
from riemhuman.io.files import convert_errors, file_path
from riemhuman.kernels.projections import Projection, in_blocks
from riemhuman.kernels.threads import mapped, slices, thread_count
from riemhuman.retrieval.jobs import checked_part

_ALGORITHMS = ("auto", "brute", "index")

# Numbers of points added, and of queries answered, at a time.
_BLOCK = 64

# What to do about a lack of memory.
_ON_DISK = "pass a folder for their features, compare fewer bodies at a time, or coarser ones"

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

    The features of all points stay in memory, unless there is a `folder` for them: for each full
    body 0.86 MB under the shape metric and 1.5 MB under one that also measures normals, that is, 86
    or 150 GB for 100,000. If there is less memory, `fit` refuses at its first points and says how
    much is needed.

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
    folder : path_like, optional
        Folder in which a temporary file holds the features instead of memory. Queries then read
        from disk what they are compared with: all of it if no index is built.

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
        folder: str | os.PathLike[str] | None = None,
    ) -> None:
        self.metric = metric
        self.n_neighbors = n_neighbors
        self.algorithm = algorithm
        self.n_components = n_components
        self.n_jobs = n_jobs
        self.folder = folder

    def fit(self, X: Sequence[Array] | Array) -> Self:
        r"""Index points.

        Parameters
        ----------
        X : array or sequence, shape (n, \*shape)
            Points: an array, or a sequence whose slices are arrays of points.
        """
        check_metric(self.metric)
        whole_number(self.n_neighbors, "n_neighbors", minimum=1)
        thread_count(self.n_jobs)
        if length_of(X, "X") == 0:
            raise ArgumentError("X must hold at least one point; found none")
        one_of(self.algorithm, "algorithm", _ALGORITHMS)
        whole_number(self.n_components, "n_components", minimum=0)
        self._projection = self._fit_projection(X)
        self._rows = self._all_rows(X)
        self.n_samples_fit_ = len(X)
        if self._projection is not None and self.algorithm == "auto":
            n_compared = []
            for number in np.linspace(0, len(X) - 1, _TRIALS).astype(int):
                trial = slice(number, number + 1)
                n_compared += [nearest.n_compared for nearest in self._search(trial, None, 2, None)]
            if np.mean(n_compared) > (1.0 - _LEAST_EXCLUDED) * len(X):
                self._projection = None
        return self

    @checked(return_distance=flag)
    def kneighbors(
        self,
        X: Sequence[Array] | Array | None = None,
        n_neighbors: int | None = None,
        return_distance: bool = True,
        *,
        candidates: Integers | None = None,
    ) -> tuple[Array, Integers] | Integers:
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
        if not hasattr(self, "_rows"):
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
            candidates = index_array(candidates, "candidates", (n_queries, "m"), n_points)
        distances = np.empty((n_queries, k))
        indices = np.empty((n_queries, k), dtype=np.int64)
        n_exact = 0
        size = max(1, min(_BLOCK, _BOUNDS // n_points))
        for part in slices(n_queries, size):
            for row, nearest in enumerate(self._search(part, X, k, candidates), part.start):
                distances[row], indices[row] = nearest.distances, nearest.numbers
                n_exact += nearest.n_compared
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

    def _rows_of(self, X: PointsLike, part: slice[int, int, None]) -> _Rows:
        """Return what the search needs of some points."""
        points = checked_part(self.metric, X, part, "X")
        coordinates = np.empty((len(points), 0))
        if self._projection is not None:
            coordinates = self._projection(self.metric.lower_bound_coordinates(points))
        return _Rows(coordinates, tuple(self.metric.features(points, n_jobs=self.n_jobs)))

    def _all_rows(self, X: PointsLike) -> _Rows:
        """Return what the search needs of all points, read a block at a time."""
        parts = slices(len(X), _BLOCK)
        block = next(parts)
        rows = self._rows_of(X, block)
        table = rows.empty_table(len(X), self.folder)
        table.fill(block, rows)
        for block in parts:
            table.fill(block, self._rows_of(X, block))
        return table

    def _search(
        self, part: slice[int, int, None], X: PointsLike | None, k: int, candidates: Integers | None
    ) -> Iterator[_Nearest]:
        """Yield the k nearest points of each query: a part of X, or of the points themselves."""
        queries = self._rows.part(part) if X is None else self._rows_of(X, part)
        # Points are not neighbours of themselves.
        themselves = np.arange(part.start, part.stop) if X is None else None
        if self._projection is None:
            yield from self._compare_all(queries, k, themselves)
            return
        bounds, slack = _squared_distances(queries.coordinates, self._rows.coordinates)
        if candidates is not None:
            np.put_along_axis(bounds, candidates[part], -np.inf, axis=1)
        if themselves is not None:
            bounds[np.arange(len(bounds)), themselves] = np.inf

        def search(row: int) -> _Nearest:
            return self._compare_by_bounds(queries.part(slice(row, row + 1)), k, bounds[row], slack)

        yield from mapped(search, range(len(bounds)), n_threads=thread_count(self.n_jobs))

    def _compare_all(
        self, queries: _Rows, k: int, themselves: Integers | None
    ) -> Iterator[_Nearest]:
        """Yield the k nearest points of each query, compared with all of them."""
        squared = self.metric.bulk.squared_distances(
            queries.features, self._rows.features, thread_count(self.n_jobs)
        )
        distances, n_compared = np.sqrt(squared), self.n_samples_fit_
        if themselves is not None:
            distances[np.arange(len(distances)), themselves] = np.inf
            n_compared -= 1
        numbers = np.arange(self.n_samples_fit_)
        for row in distances:
            yield _nearest(row, numbers, k, n_compared)

    def _compare_by_bounds(self, query: _Rows, k: int, bounds: Array, slack: float) -> _Nearest:
        """Return the k nearest points of a query, compared in the order of squared bounds.

        The bounds of points that have been compared are set to infinity.
        """
        distances, numbers = np.empty(0), np.empty(0, dtype=np.int64)
        n_candidates = np.count_nonzero(np.isneginf(bounds))
        size = n_candidates if n_candidates else _FIRST
        largest = float(np.finfo(float).max)
        remaining = np.flatnonzero(bounds <= largest)
        while len(remaining):
            order = np.argpartition(bounds[remaining], min(size, len(remaining)) - 1)
            batch = remaining[order[:size]]
            size = _BATCH
            bounds[batch] = np.inf
            features = tuple(feature[batch] for feature in self._rows.features)
            squared = self.metric.bulk.squared_distances(query.features, features)
            distances = np.concatenate([distances, np.sqrt(squared[0])])
            numbers = np.concatenate([numbers, batch])
            if len(distances) >= k:
                largest = float(np.partition(distances, k - 1)[k - 1]) ** 2 + slack
            remaining = np.flatnonzero(bounds <= largest)
        return _nearest(distances, numbers, k, len(distances))


class _Rows(NamedTuple):
    """Coordinates that bound distances, of width 0 without a projection, and features of points."""

    coordinates: Array
    features: tuple[Array, ...]

    def part(self, part: slice[int, int, None]) -> _Rows:
        return _Rows(self.coordinates[part], tuple(feature[part] for feature in self.features))

    def empty_table(self, n_points: int, folder: str | os.PathLike[str] | None) -> _Rows:
        """Return room for the rows of so many points like these; features may be in a folder."""
        in_memory = [self.coordinates] if folder is not None else [self.coordinates, *self.features]
        n_bytes = sum(array.nbytes for array in in_memory) / len(self.coordinates)
        check_memory(n_bytes * n_points, f"an index of {n_points:,} bodies", _ON_DISK)
        return _Rows(
            np.empty((n_points, *self.coordinates.shape[1:])),
            tuple(_room((n_points, *rows.shape[1:]), rows.dtype, folder) for rows in self.features),
        )

    def fill(self, part: slice[int, int, None], rows: _Rows) -> None:
        """Write the rows of some points."""
        self.coordinates[part] = rows.coordinates
        for table, feature in zip(self.features, rows.features, strict=True):
            table[part] = feature


def _room(shape: tuple[int, ...], dtype: DTypeLike, folder: str | os.PathLike[str] | None) -> Array:
    """Return an array to be filled, of a file without a name if there is a folder."""
    if folder is None:
        return np.empty(shape, dtype)
    place, n_bytes = file_path(folder), math.prod(shape) * np.dtype(dtype).itemsize
    with convert_errors(place, "cannot hold features"):
        # Where the disk ends, writing to a mapped file ends the process.
        if n_bytes > disk_usage(place).free:
            raise FileError(f"{place} cannot hold features: {size_text(n_bytes)} are needed")
        with TemporaryFile(dir=place) as file:
            return np.asarray(np.memmap(file, dtype, "w+", shape=shape))


class _Nearest(NamedTuple):
    """The nearest points of a query, and the number of points that it was compared with."""

    distances: Array
    numbers: Integers
    n_compared: int


def _nearest(distances: Array, numbers: Integers, k: int, n_compared: int) -> _Nearest:
    """Return the k smallest distances and their numbers; at equal ones the lower comes first."""
    order = np.lexsort((numbers, distances))[:k]
    return _Nearest(distances[order], numbers[order], n_compared)


def _squared_distances(rows: Array, others: Array) -> tuple[Array, float]:
    """Return squared Euclidean distances by one matrix product, and a bound on their error."""
    squares, other_squares = np.sum(rows**2, axis=1), np.sum(others**2, axis=1)
    squared = (-2.0 * rows) @ others.T
    squared += squares[:, None]
    squared += other_squares
    return squared, _SLACK * float(squares.max() + other_squares.max())
