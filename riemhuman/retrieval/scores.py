"""Retrieval scores: nearest neighbour, first and second tier, mean average precision."""

from __future__ import annotations

from collections.abc import Hashable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from riemhuman.checks import real_array
from riemhuman.errors import ArgumentError, ArgumentTypeError


@dataclass(frozen=True)
class RetrievalScores:
    """Scores of rankings by distance: how well they find items of the query's class.

    Parameters
    ----------
    nn : float
        Nearest neighbour: share of queries whose first result is of their class, per cent.
    first_tier : float
        Share of the C - 1 others of the class among the first C - 1 results, per cent.
    second_tier : float
        Share of the C - 1 others of the class among the first 2 (C - 1) results, per cent.
    mean_average_precision : float
        Mean over queries of the average precision, per cent.
    n_queries : int
        Number of queries that are not alone in their class.

    Examples
    --------
    >>> import numpy as np
    >>> import riemhuman as rh
    >>> D = np.array([[0, 1, 5, 6], [1, 0, 4, 5], [5, 4, 0, 1], [6, 5, 1, 0]])
    >>> rh.retrieval.scores(D, ["a", "a", "b", "b"]).nn
    100.0
    """

    nn: float
    first_tier: float
    second_tier: float
    mean_average_precision: float
    n_queries: int

    def __str__(self) -> str:
        return (
            f"NN {self.nn:.1f} %, FT {self.first_tier:.1f} %, ST {self.second_tier:.1f} %, "
            f"mAP {self.mean_average_precision:.1f} % ({self.n_queries} queries)"
        )


def scores(distances: ArrayLike, labels: Sequence[Hashable] | np.ndarray) -> RetrievalScores:
    """Score a distance matrix by leave-one-out retrieval.

    Each item in turn is the query and ranks all others by their distance from it. With C the size
    of the query's class, the first tier is the first C - 1 results, and the second tier the first
    2 (C - 1) results, or all if there are fewer [1]_. Scores are averages over queries. Queries
    alone in their class are left out; `n_queries` counts the others.

    For results at exactly the same distance, each score is the expected one over all their orders,
    so that it does not depend on the order of the input: at a rank within n tied results, r of them
    of the query's class, the expected hit is r / n, and the expected precision follows McSherry and
    Najork [2]_.

    Parameters
    ----------
    distances : array_like, shape (n, n)
        Distance from query i to item j in row i, column j. The matrix need not be symmetric; its
        diagonal is not read.
    labels : sequence of hashable, length n
        Class of each item.

    Returns
    -------
    scores : RetrievalScores

    Raises
    ------
    ArgumentTypeError
        If distances are not numbers or labels are not hashable.
    ArgumentError
        If the matrix is not square, a distance off the diagonal is negative, NaN or infinite,
        the number of labels is not n, or no two items share a class.

    References
    ----------
    .. [1] Shilane, Min, Kazhdan, Funkhouser, "The Princeton Shape Benchmark", SMI 2004.
    .. [2] McSherry, Najork, "Computing information retrieval performance measures efficiently in
       the presence of tied scores", ECIR 2008.

    Examples
    --------
    >>> import numpy as np
    >>> import riemhuman as rh
    >>> D = np.array([[0, 1, 5, 6], [1, 0, 4, 5], [5, 4, 0, 1], [6, 5, 1, 0]])
    >>> rh.retrieval.scores(D, ["a", "a", "b", "b"]).nn
    100.0
    """
    matrix, classes = labelled_distances(distances, labels)
    n_relevant = np.bincount(classes)[classes] - 1
    queries = np.flatnonzero(n_relevant)
    if len(queries) == 0:
        raise ArgumentError(
            f"labels must have a class of two items; found {len(classes)} classes of one item each"
        )
    rows = []
    for query in queries:
        others = np.arange(len(matrix)) != query
        relevant = classes[others] == classes[query]
        hits, average_precision = _expected_hits(matrix[query, others], relevant)
        n = n_relevant[query]
        rows.append([hits[0], hits[:n].sum() / n, hits[: 2 * n].sum() / n, average_precision])
    nn, first_tier, second_tier, mean_average_precision = 100.0 * np.mean(rows, axis=0)
    return RetrievalScores(
        nn=float(nn),
        first_tier=float(first_tier),
        second_tier=float(second_tier),
        mean_average_precision=float(mean_average_precision),
        n_queries=len(queries),
    )


def _expected_hits(distances: np.ndarray, relevant: np.ndarray) -> tuple[np.ndarray, float]:
    """Return the probability of a hit at each rank, and the expected average precision."""
    _, tie, n_tied = np.unique(distances, return_inverse=True, return_counts=True)
    n_hits = np.bincount(tie, weights=relevant)
    # For each rank: the numbers of results and of hits before its tie, and within it.
    results_before = np.repeat(np.cumsum(n_tied) - n_tied, n_tied)
    hits_before = np.repeat(np.cumsum(n_hits) - n_hits, n_tied)
    hits_in_tie = np.repeat(n_hits, n_tied)
    results_in_tie = np.repeat(n_tied, n_tied)

    rank = np.arange(1, len(distances) + 1)
    hits = hits_in_tie / results_in_tie
    # Given a hit at this rank, the other hits of the tie are uniform over its other ranks.
    earlier_in_tie = (rank - 1 - results_before) / np.maximum(results_in_tie - 1, 1)
    precision = (hits_before + 1 + earlier_in_tie * (hits_in_tie - 1)) / rank
    return hits, float(hits @ precision / relevant.sum())


def labelled_distances(
    distances: ArrayLike, labels: Sequence[Hashable] | np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return distances with zero diagonal, and the number of each item's class, after checks.

    Parameters
    ----------
    distances : array_like, shape (n, n)
        Distances; the diagonal is not read.
    labels : sequence of hashable, length n
        Class of each item.

    Returns
    -------
    distances : array, shape (n, n)
    classes : array of int, shape (n,)
        Classes are numbered in the order of their first items.

    Raises
    ------
    ArgumentTypeError, ArgumentError
        As for `scores`, but classes may have one item each.
    """
    matrix = real_array(distances, "distances", ("n", "n"), batched=False, finite=False).copy()
    if matrix.shape[0] != matrix.shape[1]:
        raise ArgumentError(f"distances must be a square matrix; found shape {matrix.shape}")
    np.fill_diagonal(matrix, 0.0)
    bad = np.argwhere(~(np.isfinite(matrix) & (matrix >= 0)))
    if len(bad):
        row, column = bad[0].tolist()
        raise ArgumentError(
            f"distances must be finite and not negative; distances[{row}, {column}] is "
            f"{matrix[row, column]:g}, the first of {len(bad)} wrong entries"
        )
    try:
        names = list(labels.tolist() if isinstance(labels, np.ndarray) else labels)
        numbers = {name: number for number, name in enumerate(dict.fromkeys(names))}
    except TypeError as error:
        raise ArgumentTypeError(
            f"labels must be a sequence of hashable class labels ({error})"
        ) from error
    if len(names) != len(matrix):
        raise ArgumentError(
            f"{len(names)} labels found; distances is a matrix of {len(matrix)} items"
        )
    return matrix, np.array([numbers[name] for name in names], dtype=np.int64)
