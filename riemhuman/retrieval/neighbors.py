"""Exact nearest neighbours, where lower bounds exclude most pairs."""

from __future__ import annotations

import os
from collections.abc import Sequence
from typing import Any, Self

import numpy as np
from numpy import ndarray

from riemhuman.checks import integer_array, one_of, whole_number
from riemhuman.errors import ArgumentError, ArgumentTypeError, FileFormatError
from riemhuman.estimator import Estimator
from riemhuman.geometry import RiemannianMetric
from riemhuman.io.arrays import load_arrays, save_arrays
from riemhuman.io.files import file_path
from riemhuman.kernels.projections import Projection
from riemhuman.kernels.threads import thread_count
from riemhuman.retrieval._neighbor_index import NeighborIndex

ALGORITHMS = ("auto", "brute", "index")

_FIELDS = ("points", "probes", "n_neighbors", "n_patches")
_FIELDS_OF_PROJECTION = ("mean", "components")

# Number of points whose distances identify the metric of a file, and their relative rounding.
_PROBES, _ROUNDING = 4, 1e-9


class NearestNeighbors(Estimator):
    r"""Exact nearest neighbours under a Riemannian metric, without computing all distances.

    Few points are compared with each query, all of them. Many points get an index: each query is
    compared with them in the order of lower bounds of their distances, until no other point can be
    as near as those found. The bounds are Euclidean distances of the metric's
    `lower_bound_coordinates`, projected to the principal components of a sample, with the norm of
    the residual as one more coordinate. Under the shape metric, where all people are far from each
    other, bounds exclude too little, and points are compared with each query there, too.

    Parameters
    ----------
    metric : RiemannianMetric
        A metric with a closed-form distance.
    n_neighbors : int
        Number of neighbours.
    algorithm : {"auto", "brute", "index"}
        "index" uses bounds whatever the number of points, and "brute" none; by default, bounds are
        used for a thousand points or more, if they exclude most of them.
    n_components : int
        Largest number of principal components. If points form groups that are far from each other,
        there should be more components than groups.
    n_patches : int, optional
        Number of patches over which `lower_bound_coordinates` averages; by default it does not
        average. With fewer patches, adding points is faster and the bounds are weaker.
    n_jobs : int, optional
        Number of threads, -1 for one per core; by default one.

    Attributes
    ----------
    n_samples_fit_ : int
        Number of points in the index.
    n_exact_ : int
        Number of distances that the last `kneighbors` computed.
    exact_share_ : float
        The same as a share of all pairs of queries and points.

    Examples
    --------
    >>> import riemhuman as rh
    >>> bodies = rh.datasets.load_open_bodies("coarse")
    >>> space = rh.AlignedSurfaces(bodies.template)
    >>> shape = rh.ElasticMetric(space, a=1.0, lam=1e-4, c=0.0)  # who is it?
    >>> neighbors = rh.NearestNeighbors(shape).fit(bodies.points[10:])
    >>> distances, indices = neighbors.kneighbors(bodies.points[14:15], 2)
    >>> [bodies.subject_names[bodies.subject[10 + i]] for i in indices[0]]
    ['short stout woman', 'short stout woman']
    """

    n_samples_fit_: int
    n_exact_: int
    exact_share_: float

    def __init__(
        self,
        metric: RiemannianMetric,
        n_neighbors: int = 5,
        *,
        algorithm: str = "auto",
        n_components: int = 256,
        n_patches: int | None = None,
        n_jobs: int | None = None,
    ) -> None:
        self.metric = metric
        self.n_neighbors = n_neighbors
        self.algorithm = algorithm
        self.n_components = n_components
        self.n_patches = n_patches
        self.n_jobs = n_jobs

    def fit(self, X: Sequence[Any] | ndarray) -> Self:
        r"""Index points, and forget points indexed before.

        Parameters
        ----------
        X : array or sequence, shape (n, \*shape)
            Points: an array, or a sequence whose slices are arrays of points.

        Returns
        -------
        NearestNeighbors
            The estimator itself.

        Raises
        ------
        ArgumentError
            If a point or a parameter is wrong.
        """
        whole_number(self.n_neighbors, "n_neighbors", minimum=1)
        if self.n_patches is not None:
            whole_number(self.n_patches, "n_patches", minimum=1)
        thread_count(self.n_jobs)
        if _length(X) == 0:
            raise ArgumentError("X must hold at least one point; found none")
        one_of(self.algorithm, "algorithm", ALGORITHMS)
        whole_number(self.n_components, "n_components", minimum=0)
        index = NeighborIndex(self.metric, self.n_patches, self.n_jobs)
        index.append(X)
        self._index = index
        self._fit_projection()
        self.n_samples_fit_ = len(self._index)
        return self

    def partial_fit(self, X: Sequence[Any] | ndarray) -> Self:
        r"""Add points to the index.

        The principal components of an index remain those of the first points. Neighbours stay
        exact, but if many points differ from the first ones, `fit` to all points makes a faster
        index.

        Parameters
        ----------
        X : array or sequence, shape (n, \*shape)
            Points.

        Returns
        -------
        NearestNeighbors
            The estimator itself.

        Raises
        ------
        ArgumentError
            If a point is wrong; the index then stays as it was.
        """
        if not hasattr(self, "_index"):
            return self.fit(X)
        _length(X)
        self._index.append(X)
        if self._index.projection is None:
            self._fit_projection()
        self.n_samples_fit_ = len(self._index)
        return self

    def kneighbors(
        self,
        X: Sequence[Any] | ndarray | None = None,
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
            Number of neighbours; by default that of the estimator.
        return_distance : bool
            Whether to return the distances as well.
        candidates : array of int, shape (n_queries, m), optional
            Points of the index that each query is compared with first, such as the nearest codes of
            `riemhuman.learned.MetricCodes`. Good candidates save comparisons and do not change the
            result.

        Returns
        -------
        distances : array, shape (n_queries, n_neighbors)
            Ascending; left out if `return_distance` is false.
        indices : array of int, shape (n_queries, n_neighbors)
            Numbers of the points; at equal distances, the lower number comes first.

        Raises
        ------
        ArgumentError
            If nothing was fitted, a query is wrong, or there are fewer points than neighbours.
        """
        index = self._fitted("kneighbors")
        n_others = len(index) - (X is None)
        k = whole_number(self.n_neighbors if n_neighbors is None else n_neighbors, "n_neighbors")
        if not 1 <= k <= n_others:
            raise ArgumentError(
                f"n_neighbors must be at least 1 and at most {n_others}, the number of other "
                f"points; found {k}"
            )
        n_queries = len(index) if X is None else _length(X)
        if candidates is not None:
            candidates = integer_array(candidates, "candidates", (n_queries, "m"))
            if candidates.size and not 0 <= candidates.min() <= candidates.max() < len(index):
                raise ArgumentError(
                    f"candidates must number points of the index, from 0 to {len(index) - 1}; "
                    f"found {candidates.min()} to {candidates.max()}"
                )
        distances = np.empty((n_queries, k))
        indices = np.empty((n_queries, k), dtype=np.int64)
        n_exact = 0
        for row, answer in enumerate(index.nearest(X, k, candidates)):
            distances[row], indices[row], n_compared = answer
            n_exact += n_compared
        self.n_exact_ = n_exact
        self.exact_share_ = n_exact / max(1, n_queries * len(index))
        return (distances, indices) if return_distance else indices

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write the index to an .npz file.

        Parameters
        ----------
        path : path_like
            The file.

        Raises
        ------
        ArgumentError
            If nothing was fitted.
        FileError
            If the file cannot be written.
        """
        index = self._fitted("save")
        arrays = {"points": index.points, "probes": _probe_distances(self.metric, index.points)}
        if index.projection is not None:
            arrays |= {"mean": index.projection.mean, "components": index.projection.components}
        arrays["n_neighbors"] = np.array(self.n_neighbors)
        arrays["n_patches"] = np.array(self.n_patches or 0)
        save_arrays(path, arrays)

    @classmethod
    def load(
        cls, path: str | os.PathLike[str], metric: RiemannianMetric, *, n_jobs: int | None = None
    ) -> Self:
        """Read an index that `save` wrote.

        Parameters
        ----------
        path : path_like
            The file.
        metric : RiemannianMetric
            The metric of the index, on the same space.
        n_jobs : int, optional
            Number of threads, -1 for one per core; by default one.

        Returns
        -------
        NearestNeighbors

        Raises
        ------
        ArgumentTypeError
            If `path` is not a path.
        FileError
            If the file is missing or cannot be read.
        FileFormatError
            If it does not hold an index.
        ArgumentError
            If the index is for another metric or template.
        """
        file = str(file_path(path))
        arrays = load_arrays(path, _FIELDS)
        if "components" in arrays:
            arrays = load_arrays(path, [*_FIELDS, *_FIELDS_OF_PROJECTION])
        options = [_whole_number(file, name, arrays[name]) for name in ("n_neighbors", "n_patches")]
        if options[0] < 1:
            raise FileFormatError(f"{file}: n_neighbors must be at least 1; found 0")
        points, probes = (_numbers(file, name, arrays[name]) for name in ("points", "probes"))
        message = f"{file}: metric must be that of the index"
        try:
            found = _probe_distances(metric, points)
        except ArgumentError as error:
            raise ArgumentError(f"{message}; it does not fit the points: {error}") from error
        if found.shape != probes.shape or not np.allclose(
            found, probes, rtol=_ROUNDING, atol=_ROUNDING * probes.max(initial=0.0)
        ):
            raise ArgumentError(f"{message}; distances of its points differ")
        neighbors = cls(metric, options[0], n_patches=options[1] or None, n_jobs=n_jobs)
        index = NeighborIndex(metric, neighbors.n_patches, n_jobs)
        index.append(points)
        if "components" in arrays:
            mean, components = (
                _numbers(file, name, arrays[name]) for name in _FIELDS_OF_PROJECTION
            )
            if metric.has_lower_bound_coordinates:
                size = metric.lower_bound_coordinates(points[:1], neighbors.n_patches).shape[1]
                if mean.shape != (size,) or components.shape[1:] != (size,):
                    raise FileFormatError(
                        f"{file}: mean and components must have {size} columns; found shapes "
                        f"{mean.shape} and {components.shape}"
                    )
                gap = np.abs(components @ components.T - np.eye(len(components))).max(initial=0.0)
                if gap > _ROUNDING:
                    raise FileFormatError(f"{file}: components must be orthonormal")
                index.set_projection(Projection(mean, components))
        neighbors.n_components = 0 if index.projection is None else len(components)
        neighbors._index, neighbors.n_samples_fit_ = index, len(index)
        return neighbors

    def _fit_projection(self) -> None:
        if self.algorithm != "brute":
            self._index.fit_projection(self.n_components, always=self.algorithm == "index")

    def _fitted(self, method: str) -> NeighborIndex:
        if not hasattr(self, "_index"):
            raise ArgumentError(f"{method} needs an index: call fit first")
        return self._index


def _length(X: Any) -> int:
    if not hasattr(X, "__len__") or not hasattr(X, "__getitem__"):
        raise ArgumentTypeError(
            f"X must be an array, or have a length and slices; found {type(X).__name__}"
        )
    return len(X)


def _probe_distances(metric: RiemannianMetric, points: ndarray) -> ndarray:
    """Return the distances among a few points, by which a metric is recognised."""
    some = points[np.unique(np.linspace(0, len(points) - 1, _PROBES).astype(int))]
    return metric.dist_pairwise(some, precision="double")


def _whole_number(file: str, name: str, array: ndarray) -> int:
    if array.shape != () or array.dtype.kind not in "iu" or array < 0:
        raise FileFormatError(f"{file}: {name} must be a whole number")
    return int(array)


def _numbers(file: str, name: str, array: ndarray) -> ndarray:
    if (
        array.dtype.kind not in "f"
        or array.ndim < 1
        or not len(array)
        or not np.isfinite(array).all()
    ):
        raise FileFormatError(f"{file}: {name} must hold finite real numbers")
    return array.astype(np.float64)
