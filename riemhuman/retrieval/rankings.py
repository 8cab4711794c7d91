"""Precision and recall of rankings, and the confusion matrix of nearest neighbours."""

from __future__ import annotations

from collections.abc import Hashable, Sequence

import numpy as np
from numpy import ndarray
from numpy.typing import ArrayLike

from riemhuman.errors import ArgumentError
from riemhuman.retrieval.scores import labelled_distances


def precision_recall(
    distances: ArrayLike, labels: Sequence[Hashable] | ndarray
) -> tuple[ndarray, ndarray]:
    """Return the mean precision of leave-one-out retrieval at every level of recall.

    For a query with n other items in its class, the precision at recall k/n is k over the rank of
    the k-th of them. Items at equal distances keep their order. Queries alone in their class are
    left out. If all classes have one size, the mean over levels is the mean average precision.

    Parameters
    ----------
    distances : array_like, shape (n, n)
        Distance from query i to item j in row i, column j.
    labels : sequence of hashable, length n
        Class of each item.

    Returns
    -------
    recall, precision : array, shape (n_levels,)
        Levels 1/n to 1, with n one less than the size of the largest class, and the mean precision
        at each level.

    Examples
    --------
    >>> import riemhuman as rh
    >>> bodies = rh.datasets.load_open_bodies("coarse")
    >>> space = rh.AlignedSurfaces(bodies.template)
    >>> D = space.metric.dist_pairwise(bodies.points[:30])
    >>> recall, precision = rh.retrieval.precision_recall(D, bodies.subject[:30])
    """
    matrix, classes = labelled_distances(distances, labels)
    relevant = classes[:, None] == classes[None, :]
    n_relevant = relevant.sum(axis=1) - 1
    n_levels = int(n_relevant.max(initial=0))
    if n_levels == 0:
        raise ArgumentError(f"labels holds {len(classes)} classes of one item each")
    recall = np.arange(1, n_levels + 1) / n_levels
    curves = []
    for query in np.flatnonzero(n_relevant):
        order = np.argsort(matrix[query], kind="stable")
        order = order[order != query]
        ranks = np.flatnonzero(relevant[query, order]) + 1
        precision = np.arange(1, len(ranks) + 1) / ranks
        needed = np.ceil(recall * len(ranks) - 1e-9).astype(np.int64)
        curves.append(precision[needed - 1])
    return recall, np.mean(curves, axis=0)


def confusion(distances: ArrayLike, labels: Sequence[Hashable] | ndarray) -> ndarray:
    """Return the confusion matrix of nearest neighbours.

    Parameters
    ----------
    distances : array_like, shape (n, n)
        Distance from query i to item j in row i, column j.
    labels : sequence of hashable, length n
        Class of each item.

    Returns
    -------
    array of int, shape (n_classes, n_classes)
        Number of queries by their class (row) and the class of their nearest neighbour (column),
        in the order of `numpy.unique`.

    Examples
    --------
    >>> import numpy as np
    >>> import riemhuman as rh
    >>> D = np.array([[0, 1, 5, 6], [1, 0, 4, 5], [5, 4, 0, 1], [6, 5, 1, 0]])
    >>> rh.retrieval.confusion(D, ["a", "a", "b", "b"]).tolist()
    [[2, 0], [0, 2]]
    """
    matrix, _ = labelled_distances(distances, labels)
    np.fill_diagonal(matrix, np.inf)
    names, classes = np.unique(np.asarray(labels), return_inverse=True)
    counts = np.zeros((len(names), len(names)), dtype=np.int64)
    np.add.at(counts, (classes, classes[matrix.argmin(axis=1)]), 1)
    return counts
