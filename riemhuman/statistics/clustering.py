"""Clusters of points, from their distances alone."""

from __future__ import annotations

from abc import abstractmethod
from typing import Self

import numpy as np
from numpy.typing import ArrayLike
from scipy.spatial.distance import squareform

from riemhuman.arrays import Array, Integers
from riemhuman.checks import Rng, distance_matrix, generator, one_of, real_array, whole_number
from riemhuman.errors import ArgumentError
from riemhuman.estimator import Estimator

LINKAGES = ("ward", "average", "complete", "single", "weighted")

# An exchange must lower the sum of distances by more than this share of all distances.
_ROUNDING = 1e-12


class _Clustering(Estimator):
    labels_: Integers

    @abstractmethod
    def fit(self, X: ArrayLike, y: object = None) -> Self:
        """Find the clusters.

        Parameters
        ----------
        X : array_like, shape (n, n)
            Symmetric distances.
        y : object
            Not used.
        """

    def fit_predict(self, X: ArrayLike, y: object = None) -> Integers:
        """Fit, and return the labels."""
        return self.fit(X).labels_


class KMedoids(_Clustering):
    """The k points that minimise the sum of distances of all points to the nearest of them.

    Partitioning around medoids [1]_: medoids are chosen one by one, always the best, and then
    exchanged for other points, the best exchange first, as long as the sum decreases [2]_. Further
    runs start from random medoids.

    Parameters
    ----------
    n_clusters : int
        Number of clusters k.
    n_init : int
        Number of runs; the best is kept.
    rng : int or numpy.random.Generator
        Seed of the random medoids, or the generator to draw from.

    Attributes
    ----------
    medoid_indices_ : array of int, shape (n_clusters,)
        The medoids, in increasing order.
    labels_ : array of int, shape (n,)
        Nearest medoid of each point. Points at distance 0 from several medoids belong to the first;
        a medoid belongs to itself.
    inertia_ : float
        Sum of the distances to the nearest medoid.
    n_iter_ : int
        Number of exchanges in the best run.

    References
    ----------
    .. [1] Kaufman, Rousseeuw, "Finding Groups in Data", 1990.
    .. [2] Schubert, Rousseeuw, "Faster k-medoids clustering", SISAP 2019.

    Examples
    --------
    >>> D = np.array([[0, 1, 5, 6], [1, 0, 4, 5], [5, 4, 0, 1], [6, 5, 1, 0]])
    >>> rh.statistics.KMedoids(2).fit(D).labels_.tolist()
    [0, 0, 1, 1]
    """

    medoid_indices_: Integers
    inertia_: float
    n_iter_: int

    def __init__(self, n_clusters: int = 8, *, n_init: int = 5, rng: Rng = 0) -> None:
        self.n_clusters = n_clusters
        self.n_init = n_init
        self.rng = rng

    def fit(self, X: ArrayLike, y: object = None) -> Self:
        distances = distance_matrix(X, "X")
        k = whole_number(self.n_clusters, "n_clusters", minimum=1)
        whole_number(self.n_init, "n_init", minimum=1)
        if k > len(distances):
            raise ArgumentError(f"n_clusters={k} exceeds the {len(distances)} points of X")
        rng = generator(self.rng)
        starts = [_greedy_medoids(distances, k)]
        starts += [rng.choice(len(distances), k, replace=False) for _ in range(self.n_init - 1)]
        runs = [_exchange(distances, start) for start in starts]
        medoids, self.inertia_, self.n_iter_ = min(runs, key=lambda run: run[1])
        self.medoid_indices_ = np.sort(medoids)
        self.labels_ = self.predict(distances)
        self.labels_[self.medoid_indices_] = np.arange(k)
        return self

    def predict(self, X: ArrayLike) -> Integers:
        """Return the nearest medoid of points.

        Parameters
        ----------
        X : array_like, shape (m, n)
            Distances from the points to all points given to `fit`.
        """
        self._require_fit("medoid_indices_")
        distances = real_array(X, "X", ("m", "n"), batched=False)
        if distances.shape[1] <= self.medoid_indices_[-1]:
            raise ArgumentError(
                f"X must hold the distances to all fitted points; found {distances.shape[1]}"
            )
        nearest: Integers = np.argmin(distances[:, self.medoid_indices_], axis=1)
        return nearest


class HierarchicalClustering(_Clustering):
    """Clusters that are joined one after the other, the two nearest first, by SciPy.

    Parameters
    ----------
    n_clusters : int
    linkage : {"ward", "average", "complete", "single", "weighted"}
        Distance of clusters, see `scipy.cluster.hierarchy.linkage`. "ward" joins the two clusters
        that increase the sum of squares least; its recursion needs only distances, which need not
        be Euclidean, and it does not merge far points as "average" does.

    Attributes
    ----------
    labels_ : array of int, shape (n,)
        Cluster of each point, numbered in the order of their first points.
    linkage_matrix_ : array, shape (n - 1, 4)
        The tree in the format of SciPy: the two clusters joined at each step, their distance, and
        the number of points.

    Examples
    --------
    >>> D = np.array([[0, 1, 5, 6], [1, 0, 4, 5], [5, 4, 0, 1], [6, 5, 1, 0]])
    >>> rh.statistics.HierarchicalClustering(2).fit(D).labels_.tolist()
    [0, 0, 1, 1]
    """

    linkage_matrix_: Array

    def __init__(self, n_clusters: int = 2, *, linkage: str = "ward") -> None:
        self.n_clusters = n_clusters
        self.linkage = linkage

    def fit(self, X: ArrayLike, y: object = None) -> Self:
        distances = distance_matrix(X, "X")
        one_of(self.linkage, "linkage", LINKAGES)
        needed = max(2, whole_number(self.n_clusters, "n_clusters", minimum=1))
        if len(distances) < needed:
            raise ArgumentError(f"X holds {len(distances)} points; at least {needed} are needed")
        from scipy.cluster import hierarchy  # takes long to import

        tree = hierarchy.linkage(squareform(distances, checks=False), self.linkage)
        clusters = hierarchy.cut_tree(tree, self.n_clusters)[:, 0]
        _, first_points, labels = np.unique(clusters, return_index=True, return_inverse=True)
        ranks = np.argsort(np.argsort(first_points))
        self.labels_ = ranks[labels]
        self.linkage_matrix_ = tree
        return self


def _greedy_medoids(distances: Array, k: int) -> Integers:
    """Return k medoids, each the best there is beside those before it."""
    medoids = [int(np.argmin(distances.sum(axis=0)))]
    nearest = distances[medoids[0]]
    while len(medoids) < k:
        gains = np.maximum(nearest - distances, 0.0).sum(axis=1)
        gains[medoids] = -1.0
        medoids.append(int(np.argmax(gains)))
        nearest = np.minimum(nearest, distances[medoids[-1]])
    return np.array(medoids)


def _exchange(distances: Array, medoids: Integers) -> tuple[Integers, float, int]:
    """Exchange medoids for other points while the sum of distances falls."""
    medoids, n_exchanges = medoids.copy(), 0
    rounding = _ROUNDING * distances.sum()
    while True:
        # The column of infinities is a second nearest medoid where there is but one.
        to_medoids = np.column_stack([distances[:, medoids], np.full(len(distances), np.inf)])
        medoid_of = np.argmin(to_medoids, axis=1)
        nearest, second_nearest = np.partition(to_medoids, 1, axis=1)[:, :2].T
        # Distances with the candidate of a row as one more medoid: of points that keep theirs,
        # and of those that lose it and go to the second nearest or to the candidate.
        if_kept, if_lost = np.minimum(distances, nearest), np.minimum(distances, second_nearest)
        belongs = medoid_of[:, None] == np.arange(len(medoids))
        sums = if_kept.sum(axis=1)[:, None] + (if_lost - if_kept) @ belongs
        candidate, place = np.unravel_index(np.argmin(sums), sums.shape)
        if sums[candidate, place] >= nearest.sum() - rounding:
            return medoids, float(nearest.sum()), n_exchanges
        medoids[place] = candidate
        n_exchanges += 1
