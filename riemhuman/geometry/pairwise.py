"""Distances of many pairs of points from their features, in memory bounded by a budget."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import NamedTuple, Protocol

import numpy as np
from numpy import ndarray

from riemhuman.arrays import Array, Features, Points, PointsByNumber, PointsLike
from riemhuman.checks import check_shape, one_of, unflatten, whole_number
from riemhuman.errors import ArgumentError
from riemhuman.kernels.threads import mapped, thread_count
from riemhuman.memory import check_memory, enough_memory
from riemhuman.progress import ProgressBar

__all__ = [
    "MEMORY",
    "PRECISIONS",
    "Bulk",
    "Factor",
    "Features",
    "PairByPair",
    "SumOfFactors",
    "squared_dist_rectangle",
]

PRECISIONS = ("single", "double")

MEMORY = 2**29
"""Bytes of features in memory at once, by default."""

_IN_BLOCKS = (
    "pass a smaller `memory`, compute blocks with `cdist`, or let riemhuman.pairwise_job (on the "
    "command line: matrix --resume FOLDER) write them to a file"
)

# A distance is exact enough when rounding of its features is at most this share of it.
_ROUNDING_SHARE = 5e-6
# Points of one block: the progress bar advances after each block of rows and columns.
_BLOCK = 256
# Points of one block of pairs too close for single precision.
_CLOSE_BLOCK = 16


class Bulk(Protocol):
    """Features of points, and tables of distances computed from them: what a metric's `bulk` is.

    Without better, `PairByPair`; for products and images, `SumOfFactors`; for metrics of terms,
    `riemhuman.terms._sums.TablesOfTerms`. A metric keeps it as an object, so that a table goes from
    here to the loops over terms directly, not by a method of every class in between.
    """

    n_arrays: int

    @abstractmethod
    def features(self, points: Points, precision: str) -> Features:
        """Return the features of n points, arrays whose first axis is that of the points."""

    @abstractmethod
    def rounding(self, features: Features) -> Array:
        """Return bounds on the rounding errors of each point's features, as distances."""

    @abstractmethod
    def squared_distances(self, a: Features, b: Features, n_threads: int = 1) -> Array:
        """Return the table of squared distances; the same features twice for those within a set."""


class PairByPair(Bulk):
    """Distances computed one by one: the points are their own features."""

    n_arrays = 1

    def __init__(self, squared_dist: Callable[[Points, Points], Array]) -> None:
        self._squared_dist = squared_dist

    def features(self, points: Points, precision: str) -> Features:
        return (np.ascontiguousarray(points),)

    def rounding(self, features: Features) -> Array:
        return np.zeros(len(features[0]))

    def squared_distances(self, a: Features, b: Features, n_threads: int = 1) -> Array:
        squared = np.zeros((len(a[0]), len(b[0])))

        def fill_row(i: int) -> None:
            for j in range(i + 1 if a is b else 0, len(b[0])):
                squared[i, j] = self._squared_dist(a[0][i], b[0][j])
                if a is b:
                    squared[j, i] = squared[i, j]

        list(mapped(fill_row, range(len(squared)), n_threads))
        return squared


class Factor(NamedTuple):
    """A factor of a product: the map of points to its component, its weight and its bulk."""

    component: Callable[[Points], Array]
    weight: float
    bulk: Bulk


class SumOfFactors(Bulk):
    """Distances of a product, by the weighted sum of the tables of its factors."""

    def __init__(self, factors: Sequence[Factor]) -> None:
        self._factors = tuple(factors)
        self.n_arrays = sum(factor.bulk.n_arrays for factor in factors)

    def features(self, points: Points, precision: str) -> Features:
        features: Features = ()
        for factor in self._factors:
            features += factor.bulk.features(factor.component(points), precision)
        return features

    def rounding(self, features: Features) -> Array:
        squared = np.zeros(())
        for factor, part in zip(self._factors, self._split(features), strict=True):
            squared = squared + factor.weight * factor.bulk.rounding(part) ** 2
        return np.sqrt(squared)

    def squared_distances(self, a: Features, b: Features, n_threads: int = 1) -> Array:
        parts_a = self._split(a)
        # One object stands for distances within a set, in the factors as well.
        parts_b = parts_a if b is a else self._split(b)
        total = np.zeros(())
        for factor, part_a, part_b in zip(self._factors, parts_a, parts_b, strict=True):
            total = total + factor.weight * factor.bulk.squared_distances(part_a, part_b, n_threads)
        return total

    def _split(self, features: Features) -> list[Features]:
        """Return the features of every factor."""
        parts, start = [], 0
        for factor in self._factors:
            parts.append(features[start : start + factor.bulk.n_arrays])
            start += factor.bulk.n_arrays
        return parts


class PointsOfOneShape(Protocol):
    """A space of points that are arrays of one shape."""

    @property
    def shape(self) -> tuple[int, ...]: ...


class MetricOfFeatures(Protocol):
    """What tables of distances need of a metric, see `RiemannianMetric`."""

    @property
    def space(self) -> PointsOfOneShape: ...

    @property
    def bulk(self) -> Bulk: ...

    def features(self, points: PointsLike, precision: str, *, name: str = ...) -> Features: ...

    def check_points(self, points: object, name: str) -> Points: ...


def features_in_threads(
    metric: MetricOfFeatures, points: PointsLike, precision: str, n_jobs: int
) -> Features:
    """Return the features of points, computed in threads."""
    n_threads = thread_count(n_jobs)
    if n_threads == 1 or len(points) < 2:
        return metric.features(points, precision)
    blocks = _blocks(metric, precision, n_threads, points, "points", 0, len(points))
    arrays = zip(*(features for _, features in blocks), strict=True)
    return tuple(np.concatenate(parts) for parts in arrays)


def squared_dist_rectangle(
    metric: MetricOfFeatures,
    features_a: Features,
    features_b: Features,
    points_a: PointsLike | PointsByNumber,
    points_b: PointsLike | PointsByNumber,
    n_jobs: int | None = None,
) -> Array:
    """Return all squared distances between two sets, those of close pairs in double precision.

    Both sets of features are one object for the distances within a set; points are looked at only
    where two are too close for features in single precision. Results depend neither on how a larger
    table is divided into rectangles, nor on the number of threads.
    """
    bulk, n_threads = metric.bulk, thread_count(n_jobs)
    squared = bulk.squared_distances(features_a, features_b, n_threads)
    rounding = bulk.rounding(features_a)[:, None] + bulk.rounding(features_b)
    # Written so that NaN, from an overflow in single precision, counts as close.
    close = ~((_ROUNDING_SHARE * np.sqrt(squared) >= rounding) & np.isfinite(squared))
    within = features_a is features_b
    if within:
        close = np.triu(close, 1)
    marked = np.flatnonzero(close.any(axis=1))
    for row in range(0, len(marked), _CLOSE_BLOCK):
        rows = marked[row : row + _CLOSE_BLOCK]
        marked_columns = np.flatnonzero(close[rows].any(axis=0))
        for column in range(0, len(marked_columns), _CLOSE_BLOCK):
            columns = marked_columns[column : column + _CLOSE_BLOCK]
            exact_a = metric.features([points_a[i] for i in rows], "double")
            exact_b = metric.features([points_b[j] for j in columns], "double")
            exact = bulk.squared_distances(exact_a, exact_b, n_threads)
            window = np.ix_(rows, columns)
            squared[window] = np.where(close[window], exact, squared[window])
            if not np.isfinite(exact).all():
                raise ArgumentError(
                    "a distance is too large for double precision: use a larger unit for the "
                    "points, or for the weights of the metric"
                )
    if within:
        squared = np.triu(squared, 1)
        squared += squared.T
    return squared


@enough_memory("a table of distances", _IN_BLOCKS)
def table_of_distances(
    metric: MetricOfFeatures,
    points_a: PointsLike,
    points_b: PointsLike | None,
    n_jobs: int | None,
    precision: str,
    memory: int,
    progress: bool,
) -> Array:
    """Return the distances between two sets, or within the first; see `RiemannianMetric.cdist`."""
    n_threads = thread_count(n_jobs)
    one_of(precision, "precision", PRECISIONS)
    memory = whole_number(memory, "memory", minimum=1)
    within = points_b is None
    sets = _point_sets(metric, points_a, points_b)
    (row_name, rows), *_, (column_name, columns) = 2 * list(sets.items())
    if not len(rows) or not len(columns):
        return np.zeros((len(rows), len(columns)))

    blocks = partial(_blocks, metric, precision, n_threads)
    [(_, features_of_one)] = blocks(rows, row_name, 0, 1)
    bytes_per_point = sum(array.nbytes for array in features_of_one)
    n_at_once = len(rows) if within else len(rows) + len(columns)
    if n_at_once * bytes_per_point > memory:
        # If the features of all points do not fit, use as many rows as columns.
        n_at_once = max(1, memory // (2 * bytes_per_point))
    check_memory(
        8 * len(rows) * len(columns) + n_at_once * bytes_per_point,
        f"a table of {len(rows):,} × {len(columns):,} distances",
        _IN_BLOCKS,
    )
    result = np.zeros((len(rows), len(columns)))
    n_pairs = len(result) * (len(result) - 1) // 2 if within else result.size
    with ProgressBar(total=n_pairs, desc="Distances", disable=not progress, unit=" pairs") as bar:
        for first in range(0, len(rows), n_at_once):
            of_rows = blocks(rows, row_name, first, first + n_at_once)
            for start in range(first if within else 0, len(columns), n_at_once):
                same = within and start == first
                of_columns = of_rows
                if not same:
                    of_columns = blocks(columns, column_name, start, start + n_at_once)
                for i, a in of_rows:
                    for j, b in of_columns:
                        if same and j.start < i.start:
                            continue
                        squared = squared_dist_rectangle(metric, a, b, rows[i], columns[j], n_jobs)
                        result[i, j] = np.sqrt(squared)
                        if within:
                            result[j, i] = result[i, j].T
                        n = len(squared)
                        bar.update(n * (n - 1) // 2 if a is b else squared.size)
                # The next features reuse this memory.
                del of_columns, b
            del of_rows, a
    return result


def _point_sets(
    metric: MetricOfFeatures, points_a: PointsLike, points_b: PointsLike | None
) -> dict[str, PointsLike]:
    """Return one or two sets of points by their names in messages; arrays are checked."""
    sets: dict[str, PointsLike] = {"points": points_a}
    if points_b is not None:
        sets = {"points_a": points_a, "points_b": points_b}
    for name, points in sets.items():
        # Other sequences are sliced, and their parts checked, as they are needed.
        has_slices = hasattr(points, "__len__") and hasattr(points, "__getitem__")
        if not has_slices or isinstance(points, (Mapping, memoryview)):
            sets[name] = metric.check_points(points, name)
        elif isinstance(points, ndarray):
            array = unflatten(points, metric.space.shape)
            check_shape(array, name, ("n_points", *metric.space.shape), batched=False)
            sets[name] = array
    return sets


def _blocks(
    metric: MetricOfFeatures,
    precision: str,
    n_threads: int,
    points: PointsLike,
    name: str,
    first: int,
    last: int,
) -> list[tuple[slice[int, int, None], Features]]:
    """Return the features of the points from `first` to `last`, block by block, in threads."""
    last = min(last, len(points))
    if not isinstance(points, ndarray):
        # Other sequences may not be safe to read in several threads.
        n_threads = 1
    size = min(_BLOCK, -((first - last) // n_threads))
    parts = [slice(k, min(k + size, last)) for k in range(first, last, size)]

    def of_part(part: slice[int, int, None]) -> tuple[slice[int, int, None], Features]:
        is_whole = part == slice(0, len(points))
        # Messages count from the start of the part.
        where = name if is_whole else f"{name}[{part.start}:{part.stop}]"
        try:
            return part, metric.features(points[part], precision, name=where)
        except ArgumentError as error:
            if is_whole or where in str(error):
                raise
            raise type(error)(f"{where}: {error}") from error

    return list(mapped(of_part, parts, min(n_threads, len(parts))))
