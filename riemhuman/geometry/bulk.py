"""Bulk work of metrics: features kept of each point, and distances from these features.

A metric's `bulk` is one of these; it computes the distances of many pairs.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, Protocol

import numpy as np
from numpy import ndarray

from riemhuman.kernels.threads import for_each
from riemhuman.terms.sum import Features


class Bulk(Protocol):
    """Features of points, and distances computed from them."""

    n_arrays: int

    def features(self, points: ndarray, precision: str) -> Features:
        r"""Return the features from which distances are computed.

        Parameters
        ----------
        points : array, shape (n, \*shape)
            Points.
        precision : {"single", "double"}
            Precision of the features.

        Returns
        -------
        tuple of array, each of shape (n, ...)
        """

    def rounding(self, features: Features) -> ndarray:
        """Return a bound on the rounding error of each point's features, as a distance.

        Parameters
        ----------
        features : tuple of array
            Features of n points.

        Returns
        -------
        array, shape (n,)
        """

    def squared_distances(self, a: Features, b: Features, n_threads: int = 1) -> ndarray:
        """Return all squared distances between two sets of points.

        Parameters
        ----------
        a, b : tuple of array
            Features; the same object twice for the distances within one set.
        n_threads : int
            Number of threads.

        Returns
        -------
        array, shape (n_a, n_b)
        """


class PairByPair(Bulk):
    """Bulk work without features: points are kept whole, and distances are computed one by one.

    Parameters
    ----------
    squared_dist : callable
        The squared distance of two points.
    """

    n_arrays = 1

    def __init__(self, squared_dist: Callable[..., ndarray]) -> None:
        self._squared_dist = squared_dist

    def features(self, points: ndarray, precision: str) -> Features:
        return (np.ascontiguousarray(points),)

    def rounding(self, features: Features) -> ndarray:
        return np.zeros(len(features[0]))

    def squared_distances(self, a: Features, b: Features, n_threads: int = 1) -> ndarray:
        squared = np.zeros((len(a[0]), len(b[0])))

        def fill_row(i: int) -> None:
            for j in range(i + 1 if a is b else 0, len(b[0])):
                squared[i, j] = self._squared_dist(a[0][i], b[0][j])
                if a is b:
                    squared[j, i] = squared[i, j]

        for_each(fill_row, range(len(squared)), n_threads)
        return squared


class SumOfFactors(Bulk):
    """Bulk work of a product: the features of all its factors.

    Parameters
    ----------
    parts : sequence of tuple
        For every factor of nonzero weight: the map from points to its component, its weight, and
        its bulk.
    """

    def __init__(self, parts: Sequence[tuple[Callable[[ndarray], ndarray], float, Bulk]]) -> None:
        self._parts = tuple(parts)
        self.n_arrays = sum(bulk.n_arrays for _, _, bulk in parts)

    def features(self, points: ndarray, precision: str) -> Features:
        return tuple(
            feature
            for component, _, bulk in self._parts
            for feature in bulk.features(component(points), precision)
        )

    def rounding(self, features: Features) -> ndarray:
        return np.sqrt(sum(w * bulk.rounding(part) ** 2 for w, bulk, part in self._split(features)))

    def squared_distances(self, a: Features, b: Features, n_threads: int = 1) -> ndarray:
        parts = list(self._split(a))
        others = parts if b is a else list(self._split(b))
        return sum(
            w * bulk.squared_distances(part, other, n_threads)
            for (w, bulk, part), (_, _, other) in zip(parts, others, strict=True)
        )

    def _split(self, features: Features) -> Any:
        start = 0
        for _, weight, bulk in self._parts:
            yield weight, bulk, features[start : start + bulk.n_arrays]
            start += bulk.n_arrays


class OfImages(Bulk):
    """The bulk work of another metric on the images of points.

    Parameters
    ----------
    bulk : Bulk
        Bulk work of the other metric.
    map : callable
        Map from points to their images.
    """

    def __init__(self, bulk: Bulk, map: Callable[[ndarray], ndarray]) -> None:
        self._bulk, self._map, self.n_arrays = bulk, map, bulk.n_arrays

    def features(self, points: ndarray, precision: str) -> Features:
        return self._bulk.features(self._map(points), precision)

    def rounding(self, features: Features) -> ndarray:
        return self._bulk.rounding(features)

    def squared_distances(self, a: Features, b: Features, n_threads: int = 1) -> ndarray:
        return self._bulk.squared_distances(a, b, n_threads)
