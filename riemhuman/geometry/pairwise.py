"""Distances of all pairs of points, block by block: memory is bounded by a budget, not by n."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from functools import partial
from typing import Any

import numpy as np
from numpy import ndarray

from riemhuman.checks import check_shape, one_of, real_array, unflatten, whole_number
from riemhuman.errors import ArgumentError
from riemhuman.geometry.bulk import Bulk, PairByPair
from riemhuman.geometry.space import Space
from riemhuman.kernels.threads import mapped, thread_count
from riemhuman.kernels.tiles import slices
from riemhuman.progress import ProgressBar
from riemhuman.terms.sum import Features

Points = Sequence[Any] | ndarray

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


class ManyDistances:
    """Distances of many pairs of points.

    A part of `RiemannianMetric`, whose `squared_dist` it uses.
    """

    space: Space

    @property
    def bulk(self) -> Bulk:
        """How distances of many pairs are computed; by default one by one."""
        metric: Any = self
        return PairByPair(metric.squared_dist)

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
            Number of threads, -1 for one per core; by default one. The result does not depend on
            it.
        precision : {"single", "double"}
            Precision in which metrics with compiled loops compare features of the points: relative
            errors stay below 1e-5 in single precision, and at rounding errors in double. Pairs too
            close for single precision are detected and computed in double.
        memory : int
            Bytes of features held at once. If those of all points need more, they are recomputed
            for every block of rows.
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
        return _distances(self, points, None, n_jobs, precision, memory, progress)

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
            Precision in which metrics with compiled loops work.
        memory : int
            Bytes of features held at once.
        progress : bool
            Whether to show a progress bar.

        Returns
        -------
        array, shape (n_a, n_b)
        """
        return _distances(self, points_a, points_b, n_jobs, precision, memory, progress)

    def closest_neighbor_index(self, point: ndarray, neighbors: ndarray) -> ndarray:
        r"""Return the index of the nearest of some points; of several equally near, the first.

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

    def features(
        self, points: Points, precision: str = "double", name: str = "points"
    ) -> tuple[ndarray, ...]:
        r"""Return the features from which distances are computed, once for each point.

        `bulk` computes distances from features. The first axis of every array is that of the
        points, so features may be sliced, stored and memory-mapped.

        Parameters
        ----------
        points : array or sequence, shape (n, \*shape)
            Points.
        precision : {"single", "double"}
            Precision of the features, for metrics with compiled loops.
        name : str
            Name of the points, for messages.

        Returns
        -------
        tuple of array, each of shape (n, ...)
            C-contiguous.
        """
        one_of(precision, "precision", PRECISIONS)
        return self.bulk.features(self._members(points, name), precision)

    def _members(self, points: Points, name: str) -> ndarray:
        """Return a set of points that `bulk` takes."""
        return self.check_points(points, name)

    def check_points(self, points: Points, name: str = "points") -> ndarray:
        r"""Return a set of points as a float64 array after checking it.

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
        checked: ndarray = real_array(points, name, self.space.shape, rows=True)
        check_shape(checked, name, ("n_points", *self.space.shape), batched=False)
        return checked


def features_in_threads(
    metric: ManyDistances, points: ndarray, precision: str, n_jobs: int | None
) -> Features:
    r"""Return the features of points, see `RiemannianMetric.features`, computed in threads.

    Parameters
    ----------
    metric : RiemannianMetric
        The metric.
    points : array, shape (n, \*shape)
        Points.
    precision : {"single", "double"}
        Precision of the features.
    n_jobs : int or None
        Number of threads, -1 for one a core.

    Returns
    -------
    tuple of array, each of shape (n, ...)
    """
    n_threads = thread_count(n_jobs)
    parts = list(slices(len(points), max(1, math.ceil(len(points) / n_threads))))
    if len(parts) < 2:
        return metric.features(points, precision)
    try:
        found = list(
            mapped(lambda part: metric.features(points[part], precision), parts, n_threads)
        )
    except ArgumentError:
        # Its message counts from the first point of a part, that of all points from their first.
        return metric.features(points, precision)
    return tuple(np.concatenate(arrays) for arrays in zip(*found, strict=True))


def squared_dist_rectangle(
    metric: ManyDistances,
    features_a: Features,
    features_b: Features,
    points_a: Points,
    points_b: Points,
    n_jobs: int | None = None,
) -> ndarray:
    """Return all squared distances between two sets, those of close pairs in double precision.

    Results depend neither on how a larger table is divided into rectangles, nor on the number of
    threads.

    Parameters
    ----------
    metric : RiemannianMetric
        The metric.
    features_a, features_b : tuple of array
        Features of both sets, see `RiemannianMetric.features`; the same object twice for the
        distances within one set.
    points_a, points_b : sequence
        The points of the features, used only for pairs too close for features in single precision.
    n_jobs : int, optional
        Number of threads, -1 for one a core; by default one.

    Returns
    -------
    array, shape (n_a, n_b)
    """
    bulk, n_threads = metric.bulk, thread_count(n_jobs)
    squared = bulk.squared_distances(features_a, features_b, n_threads)
    rounding = bulk.rounding(features_a)[:, None] + bulk.rounding(features_b)
    # Written so that NaN, from an overflow in single precision, counts as not settled.
    close = ~((ROUNDING_SHARE * np.sqrt(squared) >= rounding) & np.isfinite(squared))
    within = features_a is features_b
    if within:
        close = np.triu(close, 1)
    for rows, columns in _blocks_of(close):
        exact_a = metric.features([points_a[i] for i in rows], "double")
        exact_b = metric.features([points_b[j] for j in columns], "double")
        exact = bulk.squared_distances(exact_a, exact_b, n_threads)
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


def _distances(
    metric: ManyDistances,
    points_a: Points,
    points_b: Points | None,
    n_jobs: int | None,
    precision: str,
    memory: int,
    progress: bool,
) -> ndarray:
    """Return the distances between two sets, or within the first; see `RiemannianMetric.cdist`."""
    n_jobs = thread_count(n_jobs)
    one_of(precision, "precision", PRECISIONS)
    memory = whole_number(memory, "memory", minimum=1)
    within = points_b is None
    names = ("points", "points") if within else ("points_a", "points_b")
    rows = _sliceable(metric, points_a, names[0])
    columns = rows if within else _sliceable(metric, points_b, names[1])
    result = np.zeros((len(rows), len(columns)))
    if not result.size:
        return result

    features_of_rows = partial(_features, metric, rows, names[0], precision, n_jobs)
    features_of_columns = partial(_features, metric, columns, names[1], precision, n_jobs)
    n_points = len(result) if within else sum(result.shape)
    _, of_one = features_of_rows(0, 1)[0]
    a_point = sum(array.nbytes for array in of_one)
    # Without room for the features of all, there is for those of as many rows as columns.
    n_held = n_points if n_points * a_point <= memory else max(1, memory // (2 * a_point))
    n_pairs = len(result) * (len(result) - 1) // 2 if within else result.size
    with ProgressBar(total=n_pairs, desc="Distances", disable=not progress, unit=" pairs") as bar:
        for first in range(0, len(rows), n_held):
            kept_rows = features_of_rows(first, first + n_held)
            for start in range(first if within else 0, len(columns), n_held):
                same = within and start == first
                kept_columns = kept_rows if same else features_of_columns(start, start + n_held)
                for i, one in kept_rows:
                    for j, other in kept_columns:
                        if same and j.start < i.start:
                            continue
                        block = np.sqrt(
                            squared_dist_rectangle(metric, one, other, rows[i], columns[j], n_jobs)
                        )
                        result[i, j] = block
                        if within:
                            result[j, i] = block.T
                        diagonal = one is other
                        bar.update(len(block) * (len(block) - 1) // 2 if diagonal else block.size)
                # The next features take the place of these.
                del kept_columns, other
            del kept_rows, one
    return result


def _sliceable(metric: ManyDistances, points: Any, name: str) -> Any:
    """Return points whose parts can be looked at one by one, by `RiemannianMetric.features`."""
    if not hasattr(points, "__len__") or not hasattr(points, "__getitem__"):
        points = metric.check_points(points, name)
    if isinstance(points, np.ndarray):
        points = unflatten(points, metric.space.shape)
        check_shape(points, name, ("n_points", *metric.space.shape), batched=False)
    return points


def _features(
    metric: ManyDistances,
    points: Any,
    name: str,
    precision: str,
    n_threads: int,
    first: int,
    last: int,
) -> list[tuple[slice, Features]]:
    """Return the features of the points from `first` to `last`, block by block, in threads."""
    last = min(last, len(points))
    if not isinstance(points, np.ndarray):
        # Whether other objects may be read from in several threads is not known.
        n_threads = 1
    size = min(_BLOCK, math.ceil((last - first) / n_threads))
    parts = [slice(k, min(k + size, last)) for k in range(first, last, size)]

    def of_part(part: slice) -> tuple[slice, Features]:
        whole = part == slice(0, len(points))
        # Errors count from the start of what was looked at together.
        where = name if whole else f"{name}[{part.start}:{part.stop}]"
        try:
            return part, metric.features(points[part], precision, where)
        except ArgumentError as error:
            if whole or where in str(error):
                raise
            raise type(error)(f"{where}: {error}") from error

    return list(mapped(of_part, parts, min(n_threads, len(parts))))


def _blocks_of(close: ndarray) -> Iterator[tuple[ndarray, ndarray]]:
    """Yield small blocks of rows and columns that hold all the pairs marked."""
    marked = np.flatnonzero(close.any(axis=1))
    for first in range(0, len(marked), _CLOSE_BLOCK):
        rows = marked[first : first + _CLOSE_BLOCK]
        in_columns = np.flatnonzero(close[rows].any(axis=0))
        for start in range(0, len(in_columns), _CLOSE_BLOCK):
            yield rows, in_columns[start : start + _CLOSE_BLOCK]
