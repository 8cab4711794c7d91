"""The order in which a sparse symmetric matrix of 3 x 3 blocks is eliminated, and what it fills."""

from __future__ import annotations

from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy import ndarray
from scipy import sparse
from scipy.sparse.linalg import splu


class Elimination(NamedTuple):
    """What the elimination A = L D Lᵀ of matrices knows from their pattern of blocks alone.

    Attributes
    ----------
    order : array of int, shape (n,)
        The rows of blocks of A in the order of elimination, which leaves few blocks in L.
    ends : array of int, shape (n + 1,)
        Where the blocks of each column of L begin, and where the last ends.
    rows, columns : array of int, shape (m,)
        Where the blocks of L stand, column by column, rows increasing from the diagonal on.
    row_ends : array of int, shape (n + 1,)
        Where the blocks of each row of L begin in `by_row`, and where the last ends.
    by_row : array of int, shape (m,)
        Numbers of the blocks of L, row by row, columns increasing up to the diagonal.
    sources, targets : array of int
        Numbers of the blocks of A in its upper triangle, in the order of elimination, and of those
        of L that they are the transposed start of.
    """

    order: ndarray
    ends: ndarray
    rows: ndarray
    columns: ndarray
    row_ends: ndarray
    by_row: ndarray
    sources: ndarray
    targets: ndarray


def elimination_of(matrix: sparse.bsr_array) -> Elimination:
    """Return how a symmetric matrix is eliminated, which is kept for the last patterns.

    Parameters
    ----------
    matrix : bsr_array
        Symmetric matrix of blocks.

    Returns
    -------
    Elimination
    """
    numbers = matrix.indptr, matrix.indices
    return _elimination(*(some.astype(np.int64).tobytes() for some in numbers))


@lru_cache(maxsize=4)
def _elimination(row_ends: bytes, columns: bytes) -> Elimination:
    ends, indices = (np.frombuffer(numbers, dtype=np.int64) for numbers in (row_ends, columns))
    n = len(ends) - 1
    order = _order(ends, indices)
    place = np.argsort(order)
    # Columns and rows of the transposed blocks, in the order of elimination.
    above, across = place[np.repeat(np.arange(n), np.diff(ends))], place[indices]
    sources = np.flatnonzero(above <= across)
    above, across = above[sources], across[sources]
    counts, rows = _filled(n, above, across)
    columns_of_l = np.repeat(np.arange(n), counts)
    targets = np.searchsorted(columns_of_l * n + rows, above * n + across)
    return Elimination(
        order,
        np.concatenate([[0], np.cumsum(counts)]),
        rows.astype(np.intc),
        columns_of_l,
        np.concatenate([[0], np.cumsum(np.bincount(rows, minlength=n))]),
        np.argsort(rows, kind="stable"),
        sources,
        targets,
    )


def _order(ends: ndarray, indices: ndarray) -> ndarray:
    """Return an order of minimum degree."""
    size = len(ends) - 1
    pattern = sparse.csr_array((np.ones(len(indices)), indices, ends), shape=(size, size))
    # Any matrix of this pattern that can be eliminated.
    matrix = pattern + sparse.diags_array(1.0 + np.diff(ends))
    elimination = splu(
        sparse.csc_array(matrix),
        permc_spec="MMD_AT_PLUS_A",
        diag_pivot_thresh=0.0,
        options={"SymmetricMode": True},
    )
    return np.argsort(elimination.perm_c)


def _filled(n: int, columns: ndarray, rows: ndarray) -> tuple[ndarray, ndarray]:
    """Return how many blocks each column of L has, and their rows.

    The column of the first row below the diagonal inherits all others: it is the parent in the
    elimination tree.
    """
    below: list[set[int]] = [set() for _ in range(n)]
    for j, i in zip(columns.tolist(), rows.tolist(), strict=True):
        below[j].add(i)
    for j in range(n):
        below[j].discard(j)
        if below[j]:
            parent = min(below[j])
            below[parent] |= below[j]
    filled = [[j, *sorted(later)] for j, later in enumerate(below)]
    return np.array([len(column) for column in filled]), np.concatenate(filled)
