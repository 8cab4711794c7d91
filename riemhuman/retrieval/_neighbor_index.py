"""The points of a nearest neighbour search, and the search."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy import ndarray

from riemhuman.errors import ArgumentError
from riemhuman.geometry import RiemannianMetric
from riemhuman.geometry.pairwise import features_in_threads
from riemhuman.kernels.projections import Projection
from riemhuman.kernels.threads import mapped, slices, thread_count

# Numbers of points that are added, and of queries that are answered, at a time.
_BLOCK = 64

# Largest numbers of lower bounds in memory, and of points whose features are held in double
# precision.
_BOUNDS, _DOUBLE = 2**22, 256

# Largest numbers of points that the projection is fitted to, and of all their coordinates.
_SAMPLE, _SAMPLE_SIZE = 1024, 2**26

# Numbers of points compared with a query at first, and then at a time: their features fit a cache.
_FIRST, _BATCH = 8, 32

# Generous bound on the rounding error of squared lower bounds, relative to the largest.
_SLACK = 1e-9

# Generous bound on the relative error of distances in single precision, apart from the rounding of
# features.
_BLUR = 1e-4

# Fewer points are compared with all others, which takes less time than lower bounds do. So are all
# points if bounds exclude less than this share of the points for a few trial queries.
_FEW, _LEAST_EXCLUDED, _TRIALS = 1000, 0.5, 8


class NeighborIndex:
    """Points, their features in single precision, and coordinates that bound their distances."""

    def __init__(self, metric: RiemannianMetric, X: Any, n_jobs: int | None) -> None:
        self.metric, self.n_jobs = metric, n_jobs
        tables: tuple[ndarray, ...] = ()
        for part in slices(len(X), _BLOCK):
            points = self.checked(X, part.start, part.stop)
            features = features_in_threads(metric, points, "single", thread_count(n_jobs))
            block = (points, metric.bulk.rounding(features), *features)
            tables = tables or tuple(np.empty((len(X), *b.shape[1:]), b.dtype) for b in block)
            for table, rows in zip(tables, block, strict=True):
                table[part] = rows
        self.points, self._rounding, *self._features = tables
        self.projection: Projection | None = None
        self._coordinates: ndarray = np.empty((0, 0))

    def __len__(self) -> int:
        """Return the number of points."""
        return len(self.points)

    def fit_projection(self, n_components: int, *, always: bool) -> None:
        """Find coordinates that bound distances, unless they would save too little work."""
        coordinates = self.metric.lower_bound_coordinates
        if not self.metric.has_lower_bound_coordinates or n_components == 0:
            return
        if not always and len(self) < _FEW:
            return
        n_sample = min(
            _SAMPLE, max(1, _SAMPLE_SIZE // coordinates(self.points[:1]).size), len(self)
        )
        sample = np.linspace(0, len(self) - 1, n_sample).astype(int)
        rows = [coordinates(self.points[i : i + 1]) for i in sample]
        self.projection = Projection.fit(np.concatenate(rows), n_components)
        self._coordinates = np.concatenate(
            [self.projection(coordinates(self.points[p])) for p in slices(len(self), _BLOCK)]
        )
        if not always:
            trials = sample[np.linspace(0, n_sample - 1, _TRIALS).astype(int)]
            compared = [self._search(*self._query(int(i)), 2, None)[1] for i in trials]
            if np.mean(compared) > (1.0 - _LEAST_EXCLUDED) * len(self):
                self.projection, self._coordinates = None, np.empty((0, 0))

    def checked(self, X: Any, start: int, stop: int) -> ndarray:
        """Return a range of points after checking them."""
        where = "X" if (start, stop) == (0, len(X)) else f"X[{start}:{stop}]"
        points = self.metric.check_points(X[start:stop], where)
        if len(points) != stop - start:
            raise ArgumentError(
                f"X[{start}:{stop}] must be {stop - start} points; found {len(points)}"
            )
        return points

    def nearest(
        self, X: Any | None, k: int, candidates: ndarray | None
    ) -> Iterator[tuple[ndarray, ndarray, int]]:
        """Yield, for each query, k distances, the numbers of the points, and the comparisons."""
        n_threads = thread_count(self.n_jobs)
        size = max(1, min(_BLOCK, _BOUNDS // len(self)))
        for part in slices(len(self) if X is None else len(X), size):
            points = self.points[part] if X is None else self.checked(X, part.start, part.stop)
            features = features_in_threads(self.metric, points, "single", thread_count(self.n_jobs))
            numbers = [part.start + i if X is None else None for i in range(len(points))]
            found: list[tuple[ndarray, int]]
            if self.projection is None:
                found = self._compare_all(features, numbers, k)
            else:
                rounding = self.metric.bulk.rounding(features)
                rows = self.projection(self.metric.lower_bound_coordinates(points))
                bounds, slack = _squared_distances(rows, self._coordinates)

                def search(i: int) -> tuple[ndarray, int]:
                    one = tuple(feature[i : i + 1] for feature in features)  # noqa: B023
                    if numbers[i] is not None:  # noqa: B023
                        bounds[i, numbers[i]] = np.inf  # noqa: B023
                    first = None if candidates is None else candidates[part][i]  # noqa: B023
                    return self._search(one, float(rounding[i]), bounds[i], slack, k, first)  # noqa: B023

                found = list(mapped(search, range(len(points)), n_threads=n_threads))
            exact = self._exact_distances(points, [some for some, _ in found], n_threads)
            for (some, n_compared), distances in zip(found, exact, strict=True):
                order = np.lexsort((some, distances))[:k]
                yield distances[order], some[order], n_compared

    def _compare_all(
        self, features: tuple[ndarray, ...], numbers: list[int | None], k: int
    ) -> list[tuple[ndarray, int]]:
        """Return the points that may be among the nearest, by all distances of some queries."""
        own = tuple(self._features)
        squared = self.metric.bulk.squared_distances(features, own, thread_count(self.n_jobs))
        rounding = self.metric.bulk.rounding(features)
        everyone = np.arange(len(self))
        found = []
        for row, number, error in zip(np.sqrt(squared), numbers, rounding, strict=True):
            others = everyone if number is None else np.delete(everyone, number)
            low, high = self._interval(row[others], others, float(error))
            found.append((others[low <= _kth(high, k)], len(others)))
        return found

    def _query(self, number: int) -> tuple[tuple[ndarray, ...], float, ndarray, float]:
        """Return features, rounding, bounds and their slack of a point of the index."""
        coordinates = self._coordinates
        bounds, slack = _squared_distances(coordinates[number : number + 1], coordinates)
        bounds[0, number] = np.inf
        features = tuple(rows[number : number + 1] for rows in self._features)
        return features, float(self._rounding[number]), bounds[0], slack

    def _search(
        self,
        features: tuple[ndarray, ...],
        rounding: float,
        bounds: ndarray,
        slack: float,
        k: int,
        first: ndarray | None,
    ) -> tuple[ndarray, int]:
        """Return the points that may be among the nearest, and the number of comparisons."""
        numbers, low, high = np.empty(0, dtype=np.int64), np.empty(0), np.empty(0)

        def compare(batch: ndarray) -> None:
            nonlocal numbers, low, high
            own = tuple(rows[batch] for rows in self._features)
            squared = self.metric.bulk.squared_distances(features, own)
            more_low, more_high = self._interval(np.sqrt(squared[0]), batch, rounding)
            numbers = np.concatenate([numbers, batch])
            low, high = np.concatenate([low, more_low]), np.concatenate([high, more_high])

        n_first = min(max(k, _FIRST), int(np.count_nonzero(bounds < np.inf)))
        batch = np.argpartition(bounds, n_first - 1)[:n_first] if first is None else first
        batch = np.unique(batch[bounds[batch] < np.inf])
        if len(batch):
            compare(batch)
            bounds[batch] = np.inf
        left = np.flatnonzero(bounds <= min(_kth(high, k) ** 2 + slack, np.finfo(float).max))
        left = left[np.argsort(bounds[left])]
        bounds = bounds[left]
        for start in range(0, len(left), _BATCH):
            n_near = int(np.searchsorted(bounds, _kth(high, k) ** 2 + slack, side="right"))
            if start >= n_near:
                break
            compare(left[start : min(start + _BATCH, n_near)])
        return numbers[low <= _kth(high, k)], len(numbers)

    def _interval(
        self, distances: ndarray, numbers: ndarray, rounding: float
    ) -> tuple[ndarray, ndarray]:
        """Return lower and upper bounds of exact distances from those in single precision."""
        error = _BLUR * distances + 2.0 * (rounding + self._rounding[numbers])
        # NaN, from an overflow in single precision, gives no bound.
        low = np.nan_to_num(distances - error, nan=0.0)
        return low, np.nan_to_num(distances + error, nan=np.inf, posinf=np.inf)

    def _exact_distances(
        self, points: ndarray, candidates: list[ndarray], n_threads: int
    ) -> list[ndarray]:
        """Return the distances of each query from its candidates, in double precision."""
        own = features_in_threads(self.metric, points, "double", thread_count(self.n_jobs))
        exact = [np.empty(len(numbers)) for numbers in candidates]
        everyone = np.unique(np.concatenate(candidates))
        for part in slices(len(everyone), _DOUBLE):
            some = everyone[part]
            features = features_in_threads(
                self.metric, self.points[some], "double", thread_count(self.n_jobs)
            )

            def compare(i: int, some: ndarray = some, features: Any = features) -> None:
                here = np.flatnonzero(np.isin(candidates[i], some))
                places = np.searchsorted(some, candidates[i][here])
                squared = self.metric.bulk.squared_distances(
                    tuple(feature[i : i + 1] for feature in own),
                    tuple(feature[places] for feature in features),
                )
                exact[i][here] = np.sqrt(squared[0])

            for _ in mapped(compare, range(len(candidates)), n_threads=n_threads):
                pass
        return exact


def _squared_distances(rows: ndarray, others: ndarray) -> tuple[ndarray, float]:
    """Return squared Euclidean distances by one matrix product, and a bound on their error."""
    squares, other_squares = np.sum(rows**2, axis=1), np.sum(others**2, axis=1)
    squared = (-2.0 * rows) @ others.T
    squared += squares[:, None]
    squared += other_squares
    return squared, _SLACK * float(squares.max() + other_squares.max())


def _kth(values: ndarray, k: int) -> float:
    return float(np.partition(values, k - 1)[k - 1]) if len(values) >= k else np.inf
