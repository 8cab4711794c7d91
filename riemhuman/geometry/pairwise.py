"""Distances of all pairs of points, block by block: memory is bounded by a budget, not by n."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy import ndarray

from riemhuman.checks import check_shape, one_of, whole_number
from riemhuman.errors import ArgumentError
from riemhuman.progress import ProgressBar

if TYPE_CHECKING:
    from riemhuman.geometry.metric import RiemannianMetric

Points = Sequence[Any] | ndarray
Features = tuple[ndarray, ...]

PRECISIONS = ("single", "double")
"""What features are kept in."""

MEMORY = 2**29
"""Bytes of features held at once, unless told otherwise."""

ROUNDING_SHARE = 5e-6
"""A distance is settled when rounding of its features is at most this share of it."""

# Bodies of one block: progress is told after each block of rows and columns.
_BLOCK = 256
# Bodies of one block of pairs too close for single precision.
_CLOSE_BLOCK = 16


def thread_count(n_jobs: int | None) -> int:
    """Return the number of threads that `n_jobs` asks for.

    Parameters
    ----------
    n_jobs : int or None
        Number of threads: None is 1, -1 is one a core.

    Returns
    -------
    int

    Raises
    ------
    ArgumentTypeError
        If the number is not an integer.
    ArgumentError
        If it is 0 or below -1.
    """
    if n_jobs is None:
        return 1
    n_jobs = whole_number(n_jobs, "n_jobs")
    if n_jobs == -1:
        return os.cpu_count() or 1
    if n_jobs < 1:
        raise ArgumentError(f"n_jobs must be -1, or at least 1; found {n_jobs}")
    return n_jobs


def pair_by_pair(
    squared_dist: Callable[..., ndarray],
    features_a: Features,
    features_b: Features,
    n_jobs: int | None = None,
) -> ndarray:
    """Return a function of all pairs of points, computed pair by pair.

    Parameters
    ----------
    squared_dist : callable
        Takes the features of one point and those of another to a number, 0 for the same.
    features_a, features_b : tuple of array
        Features of n_a and of n_b points; the same object twice for the pairs within one set.
    n_jobs : int, optional
        Number of threads, -1 for one a core; by default one.

    Returns
    -------
    array, shape (n_a, n_b)
    """
    within = features_a is features_b
    n_a, n_b = len(features_a[0]), len(features_b[0])
    squared = np.zeros((n_a, n_b))

    def fill_row(i: int) -> None:
        one = [feature[i] for feature in features_a]
        for j in range(i + 1 if within else 0, n_b):
            other = [feature[j] for feature in features_b]
            squared[i, j] = squared_dist(*one, *other)
            if within:
                squared[j, i] = squared[i, j]

    n_threads = thread_count(n_jobs)
    if n_threads == 1:
        for i in range(n_a):
            fill_row(i)
    else:
        with ThreadPoolExecutor(n_threads) as pool:
            list(pool.map(fill_row, range(n_a)))
    return squared


def squared_dist_rectangle(
    metric: RiemannianMetric,
    features_a: Features,
    features_b: Features,
    points_a: Points,
    points_b: Points,
    n_jobs: int | None = None,
) -> ndarray:
    """Return all squared distances between two sets, those of close pairs in double precision.

    Bits do not depend on how a larger table is cut into rectangles, nor on the number of threads.

    Parameters
    ----------
    metric : RiemannianMetric
        The metric.
    features_a, features_b : tuple of array
        Features of both sets, see `RiemannianMetric.features`; the same object twice for the
        distances within one set.
    points_a, points_b : sequence
        The points the features are of, looked at only where a pair is too close for features in
        single precision.
    n_jobs : int, optional
        Number of threads, -1 for one a core; by default one.

    Returns
    -------
    array, shape (n_a, n_b)
    """
    squared = metric.squared_dist_of_features(features_a, features_b, n_jobs)
    rounding = metric.rounding(features_a)[:, None] + metric.rounding(features_b)
    # Written so that NaN, from an overflow in single precision, counts as not settled.
    close = ~((ROUNDING_SHARE * np.sqrt(squared) >= rounding) & np.isfinite(squared))
    within = features_a is features_b
    if within:
        close = np.triu(close, 1)
    for rows, columns in _blocks_of(close):
        exact_a = metric.features([points_a[i] for i in rows], "double")
        exact_b = metric.features([points_b[j] for j in columns], "double")
        exact = metric.squared_dist_of_features(exact_a, exact_b, n_jobs)
        window = np.ix_(rows, columns)
        squared[window] = np.where(close[window], exact, squared[window])
        if not np.isfinite(exact).all():
            raise ArgumentError(
                "a distance is too large for double precision: the points, or the weights of the "
                "metric, must be given in a larger unit"
            )
    if within:
        squared = np.triu(squared, 1)
        squared += squared.T
    return squared


def distances(
    metric: RiemannianMetric,
    points_a: Points,
    points_b: Points | None,
    n_jobs: int | None,
    precision: str,
    memory: int,
    progress: bool,
) -> ndarray:
    """Return the distances between two sets, or within the first; see `RiemannianMetric.cdist`.

    Parameters
    ----------
    metric : RiemannianMetric
        The metric.
    points_a : sequence of n_a points
        Points, sliced as they are needed.
    points_b : sequence of n_b points, or None
        Points; None for the distances within the first set.
    n_jobs : int or None
        Number of threads.
    precision : {"single", "double"}
        Precision of the features.
    memory : int
        Bytes of features held at once.
    progress : bool
        Whether to show a progress bar over pairs.

    Returns
    -------
    array, shape (n_a, n_b)
    """
    thread_count(n_jobs)
    one_of(precision, "precision", PRECISIONS)
    memory = whole_number(memory, "memory", minimum=1)
    names = ("points", "points") if points_b is None else ("points_a", "points_b")
    within = points_b is None
    rows = _PointSet(metric, points_a, names[0], precision)
    columns = rows if points_b is None else _PointSet(metric, points_b, names[1], precision)
    result = np.zeros((len(rows), len(columns)))
    if not result.size:
        return result
    n_pairs = len(rows) * (len(rows) - 1) // 2 if within else result.size
    size = _block_size(rows, columns, memory)
    with ProgressBar(total=n_pairs, desc="Distances", disable=not progress, unit=" pairs") as bar:
        for row in _slices(len(rows), size):
            features_a = rows.features(row)
            for column in _slices(len(columns), size):
                if within and column.start < row.start:
                    continue
                same = within and column == row
                features_b = features_a if same else columns.features(column)
                for i, j in _windows(row, column, same):
                    part_a = _part(features_a, row, i)
                    part_b = part_a if same and i == j else _part(features_b, column, j)
                    block = np.sqrt(
                        squared_dist_rectangle(
                            metric, part_a, part_b, rows.points[i], columns.points[j], n_jobs
                        )
                    )
                    result[i, j] = block
                    if within:
                        result[j, i] = block.T
                    diagonal = part_a is part_b
                    bar.update(len(block) * (len(block) - 1) // 2 if diagonal else block.size)
                # The next features take the place of these.
                del features_b, part_a, part_b
            del features_a
    return result


class _PointSet:
    """Points, and the features of slices of them."""

    def __init__(self, metric: RiemannianMetric, points: Any, name: str, precision: str) -> None:
        self.metric, self.name, self.precision = metric, name, precision
        if not hasattr(points, "__len__") or not hasattr(points, "__getitem__"):
            points = metric.check_points(points, name)
        if isinstance(points, np.ndarray):
            check_shape(points, name, ("n_points", *metric.space.shape), batched=False)
        self.points = points

    def __len__(self) -> int:
        return len(self.points)

    def features(self, part: slice) -> Features:
        """Return the features of a slice, of which few points are looked at together."""
        n_points = part.stop - part.start
        kept: Features = ()
        for some in _slices(part.stop, _BLOCK, part.start):
            features = self._features(some)
            if some == part:
                return features
            kept = kept or tuple(np.empty((n_points, *f.shape[1:]), f.dtype) for f in features)
            for array, feature in zip(kept, features, strict=True):
                array[some.start - part.start : some.stop - part.start] = feature
        return kept

    def _features(self, part: slice) -> Features:
        points = self.points[part]
        whole = len(points) == len(self)
        # Errors count from the start of what was looked at together.
        where = self.name if whole else f"{self.name}[{part.start}:{part.stop}]"
        points = self.metric.check_points(points, where)
        try:
            return self.metric.features(points, self.precision)
        except ArgumentError as error:
            if whole:
                raise
            raise type(error)(f"{where}: {error}") from error


def _block_size(rows: _PointSet, columns: _PointSet, memory: int) -> int:
    """Return how many points of each set to hold at once."""
    sizes = [
        sum(array.nbytes for array in points.features(slice(0, 1))) for points in (rows, columns)
    ]
    n_points = len(rows) if rows is columns else len(rows) + len(columns)
    if n_points * max(sizes) <= memory:
        return max(len(rows), len(columns))
    return max(1, memory // (2 * max(sizes)))


def _slices(n_points: int, size: int, start: int = 0) -> Iterator[slice]:
    for first in range(start, n_points, size):
        yield slice(first, min(first + size, n_points))


def _windows(row: slice, column: slice, same: bool) -> Iterator[tuple[slice, slice]]:
    for i in _slices(row.stop, _BLOCK, row.start):
        for j in _slices(column.stop, _BLOCK, column.start):
            if not same or j.start >= i.start:
                yield i, j


def _part(features: Features, held: slice, wanted: slice) -> Features:
    inside = slice(wanted.start - held.start, wanted.stop - held.start)
    return tuple(feature[inside] for feature in features)


def _blocks_of(close: ndarray) -> Iterator[tuple[ndarray, ndarray]]:
    """Yield small blocks of rows and columns that hold all the pairs marked."""
    marked = np.flatnonzero(close.any(axis=1))
    for first in range(0, len(marked), _CLOSE_BLOCK):
        rows = marked[first : first + _CLOSE_BLOCK]
        in_columns = np.flatnonzero(close[rows].any(axis=0))
        for start in range(0, len(in_columns), _CLOSE_BLOCK):
            yield rows, in_columns[start : start + _CLOSE_BLOCK]
