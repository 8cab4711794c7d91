"""The points of a nearest neighbour search, with lower bounds of their distances."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Self

import numpy as np
from numpy import ndarray

from riemhuman.errors import ArgumentError, FileFormatError
from riemhuman.geometry import RiemannianMetric
from riemhuman.kernels.projections import GrowingRows, Projection
from riemhuman.kernels.threads import slices, thread_count

# Number of points that are added at a time.
_BLOCK = 64
# Largest numbers of points that the projection is fitted to, and of all their coordinates.
_SAMPLE, _SAMPLE_SIZE = 1024, 2**26
# Number of points whose distances identify the metric of a file.
_PROBES = 3
# Largest numbers of a file in single and double precision: squares must not overflow.
_LARGEST = (1e18, 1e50)


class NeighborIndex:
    """Points, their features in single precision, and lower bounds of their distances.

    Parameters
    ----------
    metric : RiemannianMetric
        The metric.
    n_patches : int or None
        Number of patches that `lower_bound_coordinates` averages over.
    n_jobs : int or None
        Number of threads.
    """

    def __init__(self, metric: RiemannianMetric, n_patches: int | None, n_jobs: int | None) -> None:
        self.metric = metric
        self.n_patches = n_patches
        self.n_jobs = n_jobs
        self.projection: Projection | None = None
        self.pivots = np.empty(0, dtype=np.int64)
        self._n_points = 0
        self._points = GrowingRows()
        self._features = tuple(GrowingRows() for _ in range(metric.bulk.n_arrays))
        self._rounding = GrowingRows()
        self._coordinates = GrowingRows()
        self._to_pivots = GrowingRows()

    def __len__(self) -> int:
        """Return the number of points."""
        return self._n_points

    @classmethod
    def build(
        cls,
        metric: RiemannianMetric,
        X: Any,
        n_pivots: int,
        n_components: int,
        n_patches: int | None,
        n_jobs: int | None,
    ) -> Self:
        r"""Build the index of a set of points.

        Parameters
        ----------
        metric : RiemannianMetric
            The metric.
        X : array or sequence, shape (n, \*shape)
            Points, at least one.
        n_pivots, n_components : int
            Largest numbers of pivots and of principal components.
        n_patches, n_jobs : int or None
            Numbers of patches and of threads.

        Returns
        -------
        NeighborIndex
        """
        index = cls(metric, n_patches, n_jobs)
        if metric.has_lower_bound_coordinates:
            first = index._full_coordinates(index.checked(X, 0, 1))
            n_sample = min(_SAMPLE, max(1, _SAMPLE_SIZE // first.size), len(X))
            sample = np.linspace(0, len(X) - 1, n_sample).astype(int).tolist()
            rows = [index._full_coordinates(index.checked(X, i, i + 1)) for i in sample]
            index.projection = Projection.fit(np.concatenate(rows), n_components)
        index.append(X)
        index._choose_pivots(n_pivots)
        return index

    @classmethod
    def from_arrays(
        cls,
        arrays: Mapping[str, ndarray],
        metric: RiemannianMetric,
        n_patches: int | None,
        n_jobs: int | None,
    ) -> Self:
        """Return an index from the arrays that `to_arrays` returned.

        Parameters
        ----------
        arrays : mapping of str to array
            The arrays.
        metric : RiemannianMetric
            The metric of the index.
        n_patches, n_jobs : int or None
            Numbers of patches and of threads.

        Returns
        -------
        NeighborIndex

        Raises
        ------
        ArgumentError
            If the metric is not that of the index.
        FileFormatError
            If the arrays are inconsistent.
        """
        _check_tables(arrays)
        index = cls(metric, n_patches, n_jobs)
        index._n_points = len(arrays["points"])
        index.pivots = arrays["pivots"].astype(np.int64)
        index._points = GrowingRows(arrays["points"])
        index._coordinates = GrowingRows(arrays["coordinates"])
        index._to_pivots = GrowingRows(arrays["to_pivots"])
        n_features = sum(name.startswith("features_") for name in arrays)
        names = [f"features_{k}" for k in range(n_features)]
        if any(name not in arrays for name in names):
            raise FileFormatError("features must be numbered from 0 without gaps")
        index._features = tuple(GrowingRows(arrays[name]) for name in names)
        if "components" in arrays:
            index.projection = Projection(arrays["mean"], arrays["components"])
        index._check_metric(arrays["probe_distances"])
        index._rounding = GrowingRows(metric.bulk.rounding(index.features(slice(None))))
        if any(len(rows.array) != len(index) for rows in index._tables()):
            raise FileFormatError("every array must have a row for each of the points")
        return index

    def to_arrays(self) -> dict[str, ndarray]:
        """Return the whole index as arrays.

        Returns
        -------
        dict of str to array
        """
        arrays = {f"features_{k}": rows.array for k, rows in enumerate(self._features)}
        arrays |= {"points": self.points, "coordinates": self.coordinates, "pivots": self.pivots}
        arrays |= {"to_pivots": self._to_pivots.array, "probe_distances": self._probe_distances()}
        if self.projection is not None:
            arrays |= {"mean": self.projection.mean, "components": self.projection.components}
        return arrays

    def append(self, X: Any) -> None:
        r"""Add points; if one is wrong, add none.

        Parameters
        ----------
        X : array or sequence, shape (n, \*shape)
            Points.
        """
        try:
            for part in slices(len(X), _BLOCK):
                points = self.checked(X, part.start, part.stop)
                features = self.metric.features(points, "single", self.n_jobs)
                self._points.append(points)
                for rows, feature in zip(self._features, features, strict=True):
                    rows.append(feature)
                self._rounding.append(self.metric.bulk.rounding(features))
                self._coordinates.append(self.coordinates_of(points))
                if len(self.pivots):
                    self._to_pivots.append(self.distances(features, self.features(self.pivots)))
        except BaseException:
            for rows in self._tables():
                rows.truncate(len(self))
            raise
        self._n_points += len(X)

    def _choose_pivots(self, n_pivots: int) -> None:
        """Choose the first point, then repeatedly the point farthest from those chosen."""
        everything = self.features(slice(None))
        numbers, columns = [0], []
        nearest = np.full(len(self), np.inf)
        while True:
            columns.append(self.distances(everything, self.features(numbers[-1:]))[:, 0])
            nearest = np.minimum(nearest, columns[-1])
            farthest = int(np.argmax(nearest))
            if len(columns) == n_pivots or nearest[farthest] == 0:
                break
            numbers.append(farthest)
        self.pivots = np.array(numbers)
        self._to_pivots.append(np.stack(columns, axis=1))

    def _check_metric(self, kept_distances: ndarray) -> None:
        """Refuse a metric with other features, coordinates or distances of some points."""
        probes = self.pivots[:_PROBES]
        message = "metric must be that of the index"
        try:
            points = self.metric.check_points(self._points.array[probes])
            found = [*self.metric.features(points, "single"), self._probe_distances()]
            kept = [*self.features(probes), kept_distances]
            if self.metric.has_lower_bound_coordinates:
                found.append(self._full_coordinates(points))
            if self.projection is not None:
                mean, components = self.projection.mean, self.projection.components
                if found[-1].shape[1:] != mean.shape:
                    raise ArgumentError("their coordinates have another shape")
                found[-1] = found[-1] @ components.T - components @ mean
                kept.append(self._coordinates.array[probes, :-1])
        except ArgumentError as error:
            raise ArgumentError(f"{message}; it does not fit the points: {error}") from error
        if len(found) != len(kept) or not all(map(_near, found, kept)):
            raise ArgumentError(f"{message}; features or distances of the points differ")

    def _probe_distances(self) -> ndarray:
        points = self._points.array[self.pivots[:_PROBES]]
        features = self.metric.features(points, "double")
        return np.sqrt(self.metric.bulk.squared_distances(features, features))

    def _tables(self) -> list[GrowingRows]:
        held = [self._points, self._rounding, self._coordinates, self._to_pivots]
        return [*held, *self._features]

    def features(self, numbers: Any) -> tuple[ndarray, ...]:
        """Return features of points in single precision.

        Parameters
        ----------
        numbers : array of int or slice
            Numbers of the points.

        Returns
        -------
        tuple of array
        """
        return tuple(rows.array[numbers] for rows in self._features)

    @property
    def points(self) -> ndarray:
        r"""The points, shape (n, \*shape)."""
        return self._points.array

    @property
    def rounding(self) -> ndarray:
        """Bound on the rounding error of the features of each point, shape (n,)."""
        return self._rounding.array

    @property
    def to_pivots(self) -> ndarray:
        """Distances from the pivots in single precision, shape (n, n_pivots)."""
        return self._to_pivots.array

    @property
    def coordinates(self) -> ndarray:
        """Coordinates whose Euclidean distances are lower bounds of distances, shape (n, m)."""
        return self._coordinates.array

    def coordinates_of(self, points: ndarray) -> ndarray:
        r"""Return the coordinates of other points, see `coordinates`.

        Parameters
        ----------
        points : array, shape (k, \*shape)
            Points.

        Returns
        -------
        array, shape (k, m)
        """
        if self.projection is None:
            return np.empty((len(points), 0))
        return self.projection(self._full_coordinates(points))

    def distances(
        self, features_a: tuple[ndarray, ...], features_b: tuple[ndarray, ...]
    ) -> ndarray:
        """Return the distances between all pairs of two sets of points.

        Parameters
        ----------
        features_a, features_b : tuple of array
            Features of n_a and n_b points.

        Returns
        -------
        array, shape (n_a, n_b)
        """
        squared = self.metric.bulk.squared_distances(
            features_a, features_b, thread_count(self.n_jobs)
        )
        return np.sqrt(squared)

    def checked(self, X: Any, start: int, stop: int) -> ndarray:
        r"""Return a range of points after checking them.

        Parameters
        ----------
        X : array or sequence, shape (n, \*shape)
            Points.
        start, stop : int
            The range.

        Returns
        -------
        array, shape (stop - start, \*shape)

        Raises
        ------
        ArgumentError
            If a point is wrong, or the range has fewer points.
        """
        where = "X" if (start, stop) == (0, len(X)) else f"X[{start}:{stop}]"
        points = self.metric.check_points(X[start:stop], where)
        if len(points) != stop - start:
            raise ArgumentError(
                f"X[{start}:{stop}] must be {stop - start} points; found {len(points)}"
            )
        return points

    def _full_coordinates(self, points: ndarray) -> ndarray:
        metric: Any = self.metric
        return metric.lower_bound_coordinates(points, self.n_patches)


def _check_tables(arrays: Mapping[str, ndarray]) -> None:
    """Refuse arrays that cannot be an index of any metric."""
    pivots, n_points = arrays["pivots"], len(np.atleast_1d(arrays["points"]))
    n_pivots, n_dims = pivots.size, {"pivots": 1, "to_pivots": 2, "coordinates": 2}
    n_dims |= {"probe_distances": 2, "mean": 1, "components": 2}
    for name, array in arrays.items():
        kinds = "iu" if name == "pivots" else "f"
        if array.dtype.kind not in kinds or array.ndim != n_dims.get(name, max(1, array.ndim)):
            raise FileFormatError(f"{name} cannot be {array.dtype} of shape {array.shape}")
        if not float(np.abs(array).max(initial=0)) <= _LARGEST[array.dtype.itemsize > 4]:
            raise FileFormatError(f"{name} holds NaN, infinite or huge entries")
        if (name == "points" or name.startswith("features_")) and len(array) != n_points:
            raise FileFormatError(f"{name} must have a row for each of the {n_points} points")
    if n_pivots == 0 or pivots.min() < 0 or pivots.max() >= n_points:
        raise FileFormatError(f"pivots must be some of the {n_points} points")
    n_probes = min(n_pivots, _PROBES)
    shapes: dict[str, tuple[int, ...]]
    shapes = {"to_pivots": (n_points, n_pivots), "probe_distances": (n_probes, n_probes)}
    n_components, n_numbers = arrays["components"].shape if "components" in arrays else (-1, 0)
    shapes |= {"coordinates": (n_points, n_components + 1), "mean": (n_numbers,)}
    for name, shape in shapes.items():
        if name in arrays and arrays[name].shape != shape:
            raise FileFormatError(f"{name} must have shape {shape}; found {arrays[name].shape}")
    if len(np.unique(pivots)) != n_pivots or (arrays["to_pivots"] < 0).any():
        raise FileFormatError("pivots must differ, and distances from them must not be negative")


def _near(found: ndarray, kept: ndarray) -> bool:
    if found.shape != kept.shape or found.dtype != kept.dtype:
        return False
    rounding = 100 * np.finfo(kept.dtype).eps * np.max(np.abs(kept), initial=0.0)
    return bool(np.all(np.abs(found - kept) <= rounding))
