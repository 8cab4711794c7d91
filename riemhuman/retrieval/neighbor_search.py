"""Nearest neighbour search: lower bounds, then distances in single and in double precision."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy import ndarray

from riemhuman.kernels.threads import slices
from riemhuman.retrieval.neighbor_index import NeighborIndex

# Number of queries that are answered together.
_BLOCK = 64
# Largest number of lower bounds in memory.
_BOUNDS = 2**22
# Numbers of points compared with a query at first, and then at a time: their features fit a cache.
_FIRST, _BATCH = 8, 32
# Number of points whose features are held in double precision.
_DOUBLE = 256
# Generous bound on the rounding error of squared lower bounds, relative to the largest.
_SLACK = 1e-9
# Generous bound on the relative error of distances in single precision, apart from the rounding of
# features.
_BLUR = 1e-4

Map = Callable[..., Iterable[Any]]


def nearest(
    index: NeighborIndex,
    X: Any | None,
    k: int,
    in_order: Map = map,
    candidates: ndarray | None = None,
) -> Iterator[tuple[ndarray, ndarray, int]]:
    r"""Find the points nearest to each query.

    Parameters
    ----------
    index : NeighborIndex
        The points.
    X : array or sequence, shape (n_queries, \*shape), or None
        Queries; None for the points of the index.
    k : int
        Number of neighbours, at most the number of points other than the query.
    in_order : callable
        The built-in `map`, or one that uses threads.
    candidates : array of int, shape (n_queries, m), optional
        Points that each query is compared with first; by default those with the least bounds.

    Yields
    ------
    distances : array, shape (k,)
        Ascending.
    numbers : array of int, shape (k,)
        Numbers of the points; at equal distances, the lower number comes first.
    n_compared : int
        Number of points that the query was compared with.
    """
    size = max(1, min(_BLOCK, _BOUNDS // len(index)))
    for part in slices(len(index) if X is None else len(X), size):
        points = index.points[part] if X is None else index.checked(X, part.start, part.stop)
        queries = _queries(index, points, part.start if X is None else None)
        guesses = [None] * len(queries) if candidates is None else candidates[part]
        found = list(
            in_order(
                lambda pair: _candidates(index, pair[0], k, pair[1]),
                zip(queries, guesses, strict=True),
            )
        )
        exact = _exact_distances(index, points, [numbers for numbers, _ in found], in_order)
        for (numbers, n_compared), distances in zip(found, exact, strict=True):
            order = np.lexsort((numbers, distances))[:k]
            yield distances[order], numbers[order], n_compared


@dataclass
class _Query:
    """A query with lower bounds: squared, up to `slack`; from pivots, up to `blur`."""

    number: int | None
    features: tuple[ndarray, ...]
    rounding: float
    squared_bounds: ndarray
    to_pivots: ndarray
    slack: float
    blur: float


def _queries(index: NeighborIndex, points: ndarray, first: int | None) -> list[_Query]:
    """Prepare queries: points of the index from number `first` on, or other points if None."""
    if first is None:
        features = index.metric.features(points, "single", index.n_jobs)
        rounding = index.metric.bulk.rounding(features)
        coordinates = index.coordinates_of(points)
        to_pivots = index.distances(features, index.features(index.pivots))
    else:
        own = slice(first, first + len(points))
        features, rounding = index.features(own), index.rounding[own]
        coordinates, to_pivots = index.coordinates[own], index.to_pivots[own]
    largest = max(to_pivots.max(), index.to_pivots.max())
    blur = 2 * _BLUR * largest + 8 * max(rounding.max(), index.rounding.max())
    if index.projection is None:
        bounds, slack = _squared_gaps(index, to_pivots, blur), 0.0
    else:
        bounds, slack = _squared_distances(coordinates, index.coordinates)
    return [
        _Query(
            None if first is None else first + i,
            tuple(feature[i : i + 1] for feature in features),
            float(rounding[i]),
            bounds[i],
            to_pivots[i],
            slack,
            blur,
        )
        for i in range(len(points))
    ]


def _squared_gaps(index: NeighborIndex, to_pivots: ndarray, blur: float) -> ndarray:
    """Return lower bounds by the triangle inequality."""
    gaps = np.zeros((len(to_pivots), len(index)))
    for own, others in zip(to_pivots.T, index.to_pivots.T, strict=True):
        np.maximum(gaps, np.abs(own[:, None] - others), out=gaps)
    return np.maximum(gaps - blur, 0.0) ** 2


def _squared_distances(rows: ndarray, others: ndarray) -> tuple[ndarray, float]:
    """Return squared Euclidean distances by one matrix product, and a bound on their error."""
    squares, other_squares = np.sum(rows**2, axis=1), np.sum(others**2, axis=1)
    squared = (-2.0 * rows) @ others.T
    squared += squares[:, None]
    squared += other_squares
    return squared, _SLACK * float(squares.max() + other_squares.max())


def _candidates(
    index: NeighborIndex, query: _Query, k: int, first: ndarray | None
) -> tuple[ndarray, int]:
    """Return the points that may be among the nearest, and the number of comparisons."""
    bounds = query.squared_bounds
    # Distances from the pivots are known; they limit the search from the start.
    others = index.pivots != query.number
    numbers = index.pivots[others]
    low, high = _interval(index, query, numbers, query.to_pivots[others])
    n_known = 0 if query.number is None else len(numbers)
    bounds[index.pivots] = np.inf
    if query.number is not None:
        bounds[query.number] = np.inf

    def compare(batch: ndarray) -> None:
        nonlocal numbers, low, high
        squared = index.metric.bulk.squared_distances(query.features, index.features(batch))
        more_low, more_high = _interval(index, query, batch, np.sqrt(squared[0]))
        numbers = np.concatenate([numbers, batch])
        low, high = np.concatenate([low, more_low]), np.concatenate([high, more_high])

    n_first = min(max(k, _FIRST), int(np.count_nonzero(bounds < np.inf)))
    if n_first:
        batch = np.argpartition(bounds, n_first - 1)[:n_first] if first is None else first
        batch = np.unique(batch[bounds[batch] < np.inf])
        compare(batch)
        bounds[batch] = np.inf
    left = np.flatnonzero(bounds <= _kth(high, k) ** 2 + query.slack)
    gaps = np.abs(index.to_pivots[left] - query.to_pivots).max(axis=1, initial=0.0)
    bounds = np.maximum(bounds[left], np.maximum(gaps - query.blur, 0.0) ** 2)
    order = np.argsort(bounds)
    left, bounds = left[order], bounds[order]
    for start in range(0, len(left), _BATCH):
        reach = _kth(high, k) ** 2 + query.slack
        n_near = int(np.searchsorted(bounds, reach, side="right"))
        if start >= n_near:
            break
        compare(left[start : min(start + _BATCH, n_near)])
    return numbers[low <= _kth(high, k)], len(numbers) - n_known


def _interval(
    index: NeighborIndex, query: _Query, numbers: ndarray, distances: ndarray
) -> tuple[ndarray, ndarray]:
    """Return lower and upper bounds of exact distances from those in single precision."""
    error = _BLUR * distances + 2.0 * (query.rounding + index.rounding[numbers])
    # NaN, from an overflow in single precision, gives no bound.
    low = np.nan_to_num(distances - error, nan=0.0)
    return low, np.nan_to_num(distances + error, nan=np.inf, posinf=np.inf)


def _exact_distances(
    index: NeighborIndex, points: ndarray, candidates: list[ndarray], in_order: Map
) -> list[ndarray]:
    """Return the distances of each query from its candidates, in double precision."""
    own = index.metric.features(points, "double", index.n_jobs)
    exact = [np.empty(len(numbers)) for numbers in candidates]
    everyone = np.unique(np.concatenate(candidates))
    for part in slices(len(everyone), _DOUBLE):
        some = everyone[part]
        features = index.metric.features(index.points[some], "double", index.n_jobs)

        def compare(i: int, some: ndarray = some, features: Any = features) -> None:
            here = np.flatnonzero(np.isin(candidates[i], some))
            places = np.searchsorted(some, candidates[i][here])
            squared = index.metric.bulk.squared_distances(
                tuple(feature[i : i + 1] for feature in own),
                tuple(feature[places] for feature in features),
            )
            exact[i][here] = np.sqrt(squared[0])

        for _ in in_order(compare, range(len(candidates))):
            pass
    return exact


def _kth(values: ndarray, k: int) -> float:
    return float(np.partition(values, k - 1)[k - 1]) if len(values) >= k else np.inf
