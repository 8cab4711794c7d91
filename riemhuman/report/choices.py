"""The choice of single bodies for experiments, by labels and distances."""

from __future__ import annotations

import numpy as np
from numpy import ndarray

Pair = tuple[int, int]


def pair_within(distances: ndarray, same: ndarray, other: ndarray, share: float) -> Pair | None:
    """Return two items that share one class and differ in another, by their distance.

    Parameters
    ----------
    distances : array, shape (n, n)
        Distances.
    same : array of int, shape (n,)
        Class that both share; the first class with such a pair is used.
    other : array of int, shape (n,)
        Class in which they differ.
    share : float
        Position in the order of distances: 0 for the nearest pair, 1 for the farthest.

    Returns
    -------
    tuple of int, or None
        Indices of the items; None if there is no such pair.
    """
    for label in dict.fromkeys(same.tolist()):
        items = np.flatnonzero(same == label)
        first, second = np.triu_indices(len(items), 1)
        apart = other[items[first]] != other[items[second]]
        first, second = items[first[apart]], items[second[apart]]
        if len(first):
            order = np.argsort(distances[first, second], kind="stable")
            chosen = order[round(share * (len(order) - 1))]
            return int(first[chosen]), int(second[chosen])
    return None


def pair_across(distances: ndarray, one: ndarray, other: ndarray, share: float) -> Pair | None:
    """Return the first item and one that differs from it in both classes.

    Parameters
    ----------
    distances : array, shape (n, n)
        Distances.
    one, other : array of int, shape (n,)
        Class of each item.
    share : float
        Position in the order of distances from the first item: 0 for the nearest, 1 for the
        farthest.

    Returns
    -------
    tuple of int, or None
        Indices of the items; None if there is no such pair.
    """
    items = np.flatnonzero((one != one[0]) & (other != other[0]))
    if len(items) == 0:
        return None
    order = items[np.argsort(distances[0, items], kind="stable")]
    return 0, int(order[round(share * (len(order) - 1))])


def group_of(same: ndarray, other: ndarray, size: int) -> ndarray:
    """Return items that share one class and differ in another, evenly chosen.

    Parameters
    ----------
    same : array of int, shape (n,)
        Class that all share; the class with the most other classes is used.
    other : array of int, shape (n,)
        Class in which they differ.
    size : int
        Largest number of items.

    Returns
    -------
    array of int, shape (n_items,)
        Indices of the items, at most one of each other class.
    """
    groups = []
    for label in dict.fromkeys(same.tolist()):
        items = np.flatnonzero(same == label)
        _, first = np.unique(other[items], return_index=True)
        groups.append(items[np.sort(first)])
    group = max(groups, key=len)
    places = np.linspace(0, len(group) - 1, min(size, len(group))).round().astype(np.int64)
    return group[places]
