"""Retrieval scores of distances, rankings, tables of scores, and local scaling of distances."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from riemhuman.arrays import Array, Booleans, Labels
from riemhuman.checks import checked, distance_matrix, instance, whole
from riemhuman.checks.labels import class_numbers, texts_of
from riemhuman.errors import ArgumentError


@dataclass(frozen=True)
class RetrievalScores:
    """Scores of rankings by distance, which say how well they find items of the query's class.

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
    >>> print(rh.retrieval.RetrievalScores(100.0, 94.8, 97.1, 96.0, n_queries=100))
    NN 100.0 %, FT 94.8 %, ST 97.1 %, mAP 96.0 % (100 queries)
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


def scores(
    distances: ArrayLike,
    labels: Labels,
    groups: Labels | None = None,
) -> RetrievalScores:
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
        Class of each item. Missing labels (None, NaN, NaT, pandas' NA, masked entries, empty text)
        are refused, as in tables of labels: leave out the items without a label.
    groups : sequence of hashable, length n, optional
        Group of each item, such as the person: items of the query's group are not ranked. With
        poses as labels and people as groups, the scores are only among other people.

    References
    ----------
    .. [1] Shilane, Min, Kazhdan, Funkhouser, "The Princeton Shape Benchmark", SMI 2004.
    .. [2] McSherry, Najork, "Computing information retrieval performance measures efficiently in
       the presence of tied scores", ECIR 2008.

    Examples
    --------
    >>> D = [[0, 1, 5, 6], [1, 0, 4, 5], [5, 4, 0, 1], [6, 5, 1, 0]]
    >>> rh.retrieval.scores(D, ["a", "a", "b", "b"]).nn
    100.0
    """
    matrix = distance_matrix(distances, "distances", symmetric=False)
    classes, _ = class_numbers(labels, "labels", len(matrix))
    ranked = ~np.eye(len(matrix), dtype=bool)
    if groups is not None:
        members, _ = class_numbers(groups, "groups", len(matrix))
        ranked = members[:, None] != members
    relevant = ranked & (classes[:, None] == classes)
    queries = np.flatnonzero(relevant.any(axis=1))
    if len(queries) == 0:
        raise ArgumentError(
            "labels must have a class with at least two items; found none among "
            f"{len(matrix)} items"
        )
    rows = []
    for query in queries:
        items = ranked[query]
        hits, average_precision = _expected_hits(matrix[query, items], relevant[query, items])
        n = np.count_nonzero(relevant[query])
        rows.append([hits[0], hits[:n].sum() / n, hits[: 2 * n].sum() / n, average_precision])
    nn, first_tier, second_tier, precision = (100.0 * np.mean(rows, axis=0)).tolist()
    return RetrievalScores(nn, first_tier, second_tier, precision, len(queries))


def _expected_hits(distances: Array, relevant: Booleans) -> tuple[Array, float]:
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


@checked(n_neighbors=whole(minimum=1))
def local_scaling(distances: ArrayLike, n_neighbors: int = 7) -> Array:
    r"""Return distances relative to the distances around both items.

    .. math:: d'_{ij} = d_{ij} / \sqrt{\sigma_i \sigma_j}

    with σ the distance of an item from its n-th nearest neighbour [1]_. Items far from all others,
    and items near many others, then no longer dominate rankings. No labels are used.

    Parameters
    ----------
    distances : array_like, shape (n, n)
        Symmetric distances.
    n_neighbors : int
        Number of the neighbour whose distance is the scale.

    References
    ----------
    .. [1] Zelnik-Manor, Perona, "Self-tuning spectral clustering", NIPS 2004.

    Examples
    --------
    >>> D = [[0.0, 1.0, 8.0], [1.0, 0.0, 4.0], [8.0, 4.0, 0.0]]
    >>> rh.retrieval.local_scaling(D, n_neighbors=1)[1:, 1:].tolist()
    [[0.0, 2.0], [2.0, 0.0]]
    """
    matrix = distance_matrix(distances, "distances", symmetric=False)
    if n_neighbors >= len(matrix):
        raise ArgumentError(
            f"n_neighbors must be less than the number of items, {len(matrix)}; found {n_neighbors}"
        )
    scales = np.sqrt(np.partition(matrix, n_neighbors, axis=1)[:, n_neighbors])
    if not scales.all():
        raise ArgumentError(
            f"item {int(np.argmin(scales))} coincides with its {n_neighbors} nearest neighbours, "
            "so it has no scale; use more neighbours"
        )
    return matrix / scales[:, None] / scales


def precision_recall(distances: ArrayLike, labels: Labels) -> tuple[Array, Array]:
    """Return the mean precision of leave-one-out retrieval at every level of recall.

    For a query with n other items in its class, the precision at recall k/n is k over the rank of
    the k-th of them. Items at equal distances keep their order.

    Parameters
    ----------
    distances, labels
        As for `scores`.

    Returns
    -------
    recall, precision : array, shape (n_levels,)
        Levels 1/n to 1, with n + 1 the size of the largest class, and the mean precision at each.

    Examples
    --------
    >>> D = [[0, 1, 5, 6], [1, 0, 4, 5], [5, 4, 0, 1], [6, 5, 1, 0]]
    >>> recall, precision = rh.retrieval.precision_recall(D, ["a", "a", "b", "b"])
    """
    matrix = distance_matrix(distances, "distances", symmetric=False)
    classes, _ = class_numbers(labels, "labels", len(matrix))
    relevant = classes[:, None] == classes
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


def confusion(distances: ArrayLike, labels: Labels) -> Array:
    """Return the confusion matrix of nearest neighbours.

    Of n neighbours at exactly the same distance, each counts 1/n, so that the share of the diagonal
    does not depend on the order of the input; it is the NN of `scores` if no item is alone in its
    class.

    Parameters
    ----------
    distances, labels
        As for `scores`.

    Returns
    -------
    array, shape (n_classes, n_classes)
        Number of queries by their class (row) and the class of their nearest neighbour (column),
        ascending, or in the order of first items if labels cannot be compared.

    Examples
    --------
    >>> D = [[0, 1, 5, 6], [1, 0, 4, 5], [5, 4, 0, 1], [6, 5, 1, 0]]
    >>> rh.retrieval.confusion(D, ["a", "a", "b", "b"]).tolist()
    [[2.0, 0.0], [0.0, 2.0]]
    """
    matrix = distance_matrix(distances, "distances", symmetric=False)
    np.fill_diagonal(matrix, np.inf)
    classes, names = class_numbers(labels, "labels", len(matrix))
    nearest = (matrix == matrix.min(axis=1, keepdims=True)) & np.isfinite(matrix)
    shares = nearest / np.maximum(nearest.sum(axis=1, keepdims=True), 1)
    members = np.equal.outer(np.arange(len(names)), classes).astype(np.float64)
    table: Array = members @ shares @ members.T
    return table


@checked(distances=instance(Mapping, "a mapping of names to distance matrices"))
def retrieval_table(
    distances: Mapping[str, Array], labels: Labels, groups: Labels | None = None
) -> dict[str, RetrievalScores]:
    """Return the scores of several distance matrices for the same labels, by name.

    Parameters
    ----------
    distances : mapping of str to array, shape (n, n)
        Distance matrices by name of representation.
    labels, groups
        As for `scores`.

    Examples
    --------
    >>> D = [[0, 1, 5, 6], [1, 0, 4, 5], [5, 4, 0, 1], [6, 5, 1, 0]]
    >>> rh.retrieval.retrieval_table({"toy": D}, [0, 0, 1, 1])["toy"].first_tier
    100.0
    """
    return {name: scores(matrix, labels, groups) for name, matrix in distances.items()}


@checked(
    title=instance(str, "a text"), rows=instance(Mapping, "a mapping of names to RetrievalScores")
)
def format_table(title: str, rows: Mapping[str, RetrievalScores]) -> str:
    """Return a table as text, one line per representation.

    Parameters
    ----------
    title : str
        Title of the first column.
    rows : mapping of str to RetrievalScores

    Examples
    --------
    >>> D = [[0, 1, 5, 6], [1, 0, 4, 5], [5, 4, 0, 1], [6, 5, 1, 0]]
    >>> rows = rh.retrieval.retrieval_table({"toy": D}, [0, 0, 1, 1])
    >>> print(rh.retrieval.format_table("Who is it?", rows))
    Who is it?     NN     FT     ST
    toy         100.0  100.0  100.0
    """
    names = texts_of(rows.keys(), "names of rows")
    width = max(map(len, [title, *names]))
    lines = [f"{title:<{width}}     NN     FT     ST"]
    for name, row in rows.items():
        cells = (row.nn, row.first_tier, row.second_tier)
        lines.append(f"{name:<{width}}" + "".join(f"  {cell:5.1f}" for cell in cells))
    return "\n".join(lines)
