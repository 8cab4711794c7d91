"""Distances of many pairs of points from their features, in memory bounded by a budget."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import NamedTuple, Protocol

import numpy as np
from numpy import ndarray
from tqdm import tqdm

from riemhuman.arrays import Array, Features, Points, PointsByNumber, PointsLike
from riemhuman.checks import check_shape, checked, choice, flag, unflatten, whole
from riemhuman.checks.memory import check_memory
from riemhuman.errors import ArgumentError
from riemhuman.geometry.point_space import PointSpace
from riemhuman.kernels.threads import mapped, thread_count

__all__ = [
    "MEMORY",
    "PRECISIONS",
    "Bulk",
    "DistanceTables",
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

    Every metric has one, on surfaces or not, with a template or without. By default it computes
    `PairByPair`. Metrics of terms answer from compiled loops (`riemhuman.terms._sums`), products
    and images by the tables of their factors (`SumOfFactors`). What only sums of terms on surfaces
    have, such as energies of paths, is another protocol there, `SumOnSurfaces`.

    A bulk is an object, rather than methods of the metric: products and images are made of the
    bulks of other metrics, and a table goes from here to the loops over terms directly.
    """

    n_arrays: int
    """Length of the tuples of features."""

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


class _Block(NamedTuple):
    """Some consecutive points: their place in the set, and their features."""

    place: slice[int, int, None]
    features: Features


class DistanceTables(ABC):
    """Distances of many pairs of points, which every metric has, from the features of its bulk."""

    space: PointSpace

    @property
    @abstractmethod
    def bulk(self) -> Bulk:
        """What computes distances of many pairs from features."""

    @abstractmethod
    def check_points(self, points: object, name: str = "points") -> Points:
        """Return a set of points as a float64 array after checking it."""

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
        return self._table(points, None, n_jobs, precision, memory, progress)

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
        return self._table(points_a, points_b, n_jobs, precision, memory, progress)

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
        n_threads = thread_count(n_jobs)
        if n_threads > 1 and len(points) > 1:
            blocks = self._blocks(precision, n_threads, points, name, 0, len(points))
            parts_of_arrays = zip(*(block.features for block in blocks), strict=True)
            return tuple(np.concatenate(parts) for parts in parts_of_arrays)
        if self.space.is_surface_space:
            checked = self.space.check_point(points, name)
            check_shape(checked, name, ("n_points", *self.space.shape), batched=False)
        else:
            checked = self.check_points(points, name)
        return self.bulk.features(checked, precision)

    @checked(precision=choice(*PRECISIONS), memory=whole(minimum=1), progress=flag)
    def _table(
        self,
        points_a: PointsLike,
        points_b: PointsLike | None,
        n_jobs: int | None,
        precision: str,
        memory: int,
        progress: bool,
    ) -> Array:
        """Return the distances between two sets, or within the first; see `cdist`."""
        blocks = partial(self._blocks, precision, thread_count(n_jobs))
        within = points_b is None
        row_name, column_name = ("points", "points") if within else ("points_a", "points_b")
        rows = columns = self._point_set(points_a, row_name)
        if points_b is not None:
            columns = self._point_set(points_b, column_name)
        if not len(rows) or not len(columns):
            return np.zeros((len(rows), len(columns)))

        [first_block] = blocks(rows, row_name, 0, 1)
        bytes_per_point = sum(array.nbytes for array in first_block.features)
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
        n_pairs = len(rows) * (len(rows) - 1) // 2 if within else result.size
        with tqdm(total=n_pairs, desc="Distances", disable=not progress, unit=" pairs") as bar:
            for first in range(0, len(rows), n_at_once):
                row_blocks = blocks(rows, row_name, first, first + n_at_once)
                for start in range(first if within else 0, len(columns), n_at_once):
                    is_diagonal = within and start == first
                    column_blocks = row_blocks
                    if not is_diagonal:
                        column_blocks = blocks(columns, column_name, start, start + n_at_once)
                    for i, a in row_blocks:
                        for j, b in column_blocks:
                            if is_diagonal and j.start < i.start:
                                continue
                            squared = squared_dist_rectangle(
                                self, a, b, rows[i], columns[j], n_jobs
                            )
                            result[i, j] = np.sqrt(squared)
                            if within:
                                result[j, i] = result[i, j].T
                            n = len(squared)
                            bar.update(n * (n - 1) // 2 if a is b else squared.size)
                    # The next features reuse this memory.
                    del column_blocks, b
                del row_blocks, a
        return result

    def _point_set(self, points: PointsLike, name: str) -> PointsLike:
        """Return a set of points: an array after checking it, or what can be sliced."""
        has_slices = hasattr(points, "__len__") and hasattr(points, "__getitem__")
        if not has_slices or isinstance(points, (Mapping, memoryview)):
            return self.check_points(points, name)
        if not isinstance(points, ndarray):
            return points  # sliced, and the parts checked, as they are needed
        array = unflatten(points, self.space.shape)
        check_shape(array, name, ("n_points", *self.space.shape), batched=False)
        return array

    def _blocks(
        self,
        precision: str,
        n_threads: int,
        points: PointsLike,
        name: str,
        first: int,
        last: int,
    ) -> list[_Block]:
        """Return the features of the points from `first` to `last`, block by block, in threads."""
        last = min(last, len(points))
        if not isinstance(points, ndarray):
            # Other sequences may not be safe to read in several threads.
            n_threads = 1
        size = min(_BLOCK, math.ceil((last - first) / n_threads))
        places = [slice(start, min(start + size, last)) for start in range(first, last, size)]

        def block_at(place: slice[int, int, None]) -> _Block:
            is_whole = place == slice(0, len(points))
            # Messages count from the start of the block.
            label = name if is_whole else f"{name}[{place.start}:{place.stop}]"
            try:
                return _Block(place, self.features(points[place], precision, name=label))
            except ArgumentError as error:
                if is_whole or label in str(error):
                    raise
                raise type(error)(f"{label}: {error}") from error

        return list(mapped(block_at, places, min(n_threads, len(places))))


def squared_dist_rectangle(
    metric: DistanceTables,
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
    if within:
        squared = np.triu(squared, 1)
        squared += squared.T
    return squared
