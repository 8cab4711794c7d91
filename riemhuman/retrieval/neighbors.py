"""Exact nearest neighbours, where lower bounds exclude most pairs."""

from __future__ import annotations

import os
from collections.abc import Sequence
from functools import partial
from typing import Any, Self

import numpy as np
from numpy import ndarray

from riemhuman.checks import integer_array, whole_number
from riemhuman.errors import ArgumentError, ArgumentTypeError, FileFormatError
from riemhuman.estimator import Estimator
from riemhuman.geometry import RiemannianMetric
from riemhuman.io.arrays import load_arrays, save_arrays
from riemhuman.kernels.threads import mapped, thread_count
from riemhuman.retrieval.neighbor_index import NeighborIndex
from riemhuman.retrieval.neighbor_search import nearest

_FIELDS = (
    "points",
    "features_0",
    "coordinates",
    "pivots",
    "to_pivots",
    "probe_distances",
    "n_neighbors",
    "n_patches",
)
_FIELDS_OF_PROJECTION = ("mean", "components")


class NearestNeighbors(Estimator):
    r"""Exact nearest neighbours under a Riemannian metric, without computing all distances.

    Each query is compared with the points in the order of lower bounds of their distances, until no
    other point can be as near as those found. There are two bounds:

    - the triangle inequality, :math:`d(x, y) \ge |d(x, p) - d(p, y)|`, for pivots p, each the
      farthest point from those before;
    - for metrics with a method `lower_bound_coordinates`, the Euclidean distance of the projections
      of these coordinates to the principal components of a sample, with the norm of the residual
      as one more coordinate.

    Parameters
    ----------
    metric : RiemannianMetric
        A metric with a closed-form distance that satisfies the triangle inequality.
    n_neighbors : int
        Number of neighbours.
    n_pivots : int
        Largest number of pivots; every query is compared with all of them.
    n_components : int
        Largest number of principal components. If points form groups that are far from each other,
        as people do under the shape metric, there should be more components than groups.
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
        n_pivots: int = 16,
        n_components: int = 256,
        n_patches: int | None = None,
        n_jobs: int | None = None,
    ) -> None:
        self.metric = metric
        self.n_neighbors = n_neighbors
        self.n_pivots = n_pivots
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
        self._index = NeighborIndex.build(
            self.metric,
            X,
            whole_number(self.n_pivots, "n_pivots", minimum=1),
            whole_number(self.n_components, "n_components", minimum=0),
            self.n_patches,
            self.n_jobs,
        )
        self.n_samples_fit_ = len(self._index)
        return self

    def partial_fit(self, X: Sequence[Any] | ndarray) -> Self:
        r"""Add points to the index.

        Pivots and principal components remain those of the first points. Neighbours stay exact, but
        if many points differ from the first ones, `fit` to all points makes a faster index.

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
        in_order = partial(mapped, n_threads=thread_count(self.n_jobs))
        for row, answer in enumerate(nearest(index, X, k, in_order, candidates)):
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
        arrays = self._fitted("save").to_arrays()
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
        FileError
            If the file is missing or cannot be read.
        FileFormatError
            If it does not hold an index.
        ArgumentError
            If the index is for another metric or template.
        """
        arrays = load_arrays(path, _FIELDS)
        if "components" in arrays:
            arrays = load_arrays(path, [*_FIELDS, *_FIELDS_OF_PROJECTION])
        thread_count(n_jobs)
        options = {name: arrays.pop(name) for name in ("n_neighbors", "n_patches")}
        for name, option in options.items():
            if option.shape != () or option.dtype.kind not in "iu" or option < 0:
                raise FileFormatError(f"{os.fspath(path)}: {name} must be a whole number")
        n_patches = int(options["n_patches"]) or None
        try:
            if int(options["n_neighbors"]) < 1:
                raise FileFormatError("n_neighbors must be at least 1; found 0")
            index = NeighborIndex.from_arrays(arrays, metric, n_patches, n_jobs)
        except (ArgumentError, FileFormatError) as error:
            raise type(error)(f"{os.fspath(path)}: {error}") from error
        neighbors = cls(
            metric,
            int(options["n_neighbors"]),
            n_pivots=len(index.pivots),
            n_components=0 if index.projection is None else len(index.projection.components),
            n_patches=n_patches,
            n_jobs=n_jobs,
        )
        neighbors._index = index
        neighbors.n_samples_fit_ = len(index)
        return neighbors

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
