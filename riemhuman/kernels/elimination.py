"""Sparse symmetric matrices of 3 x 3 blocks: the order of elimination, and triangular solves."""

from __future__ import annotations

from functools import lru_cache
from typing import NamedTuple

import numpy as np
from scipy import sparse
from scipy.sparse.linalg import SuperLU, splu

from riemhuman.arrays import Array, FeatureRows, Integers
from riemhuman.kernels.compilation import FUSED, compiled
from riemhuman.kernels.threads import slices


class Elimination(NamedTuple):
    """The elimination A = L D Lᵀ of matrices with one pattern of blocks, prepared once.

    Blocks of L are numbered column by column: those of column j from ends[j], in the rows `rows`.
    In the order `by_row` they are numbered row by row: those of row i from row_ends[i]. Block
    `sources` of A, in which rows and columns are taken in `order`, goes to block `targets` of L.
    """

    order: Integers
    ends: Integers
    rows: Integers
    columns: Integers
    row_ends: Integers
    by_row: Integers
    sources: Integers
    targets: Integers


def symmetric_factor(matrix: sparse.csr_array) -> SuperLU:
    """Factorise a sparse symmetric matrix in an order of minimum degree, without pivoting."""
    return splu(
        sparse.csc_array(matrix),
        permc_spec="MMD_AT_PLUS_A",
        diag_pivot_thresh=0.0,
        options={"SymmetricMode": True},
    )


# Columns that are solved together, as many as a rotation has entries. Those that are missing are
# filled up with zeros, so that no column depends on how many there are.
_TOGETHER = 9


class SymmetricSolver:
    """Solves A X = B for a sparse matrix A, symmetric and positive definite, factorised once.

    Each column comes out the same, to the last bit, whichever others are there.
    """

    def __init__(self, matrix: sparse.csr_array) -> None:
        # Without pivoting A = L D Lᵀ, rows and columns in one order.
        factor = symmetric_factor(matrix)
        lower = sparse.tril(factor.L, -1, format="csc")
        self._order, self._place = np.argsort(factor.perm_c), factor.perm_c
        self._ends, self._rows, self._entries = lower.indptr, lower.indices, lower.data
        self._pivots = factor.U.diagonal()

    def solve(self, values: Array) -> Array:
        """Return X for right sides B, shape (n,) or (n, k)."""
        columns = values.reshape(len(values), -1)
        solved = np.empty(columns.shape)
        for part in slices(columns.shape[1], _TOGETHER):
            n_columns = part.stop - part.start
            x = np.zeros((len(columns), _TOGETHER))
            x[:, :n_columns] = columns[:, part].take(self._order, axis=0)
            row = np.empty(_TOGETHER)
            _solve_symmetric(self._ends, self._rows, self._entries, self._pivots, x, row)
            solved[:, part] = x[:, :n_columns].take(self._place, axis=0)
        return solved.reshape(values.shape)


@compiled(fastmath=FUSED)
def _solve_symmetric(
    ends: Integers, rows: Integers, entries: Array, pivots: Array, x: Array, y: Array
) -> None:
    """Replace X, of `_TOGETHER` columns, by (L D Lᵀ)⁻¹ X; y is room for a row of it."""
    for j in range(len(x)):
        for i in range(_TOGETHER):
            y[i] = x[j, i]
        for p in range(ends[j], ends[j + 1]):
            row, entry = rows[p], entries[p]
            for i in range(_TOGETHER):
                x[row, i] -= entry * y[i]
    for j in range(len(x) - 1, -1, -1):
        for i in range(_TOGETHER):
            y[i] = x[j, i] / pivots[j]
        for p in range(ends[j], ends[j + 1]):
            row, entry = rows[p], entries[p]
            for i in range(_TOGETHER):
                y[i] -= entry * x[row, i]
        for i in range(_TOGETHER):
            x[j, i] = y[i]


def elimination_of(matrix: sparse.bsr_array) -> Elimination:
    """Return how a symmetric matrix is eliminated, which is kept for the last patterns."""
    # As bytes, patterns can be compared with those that are kept.
    row_ends = matrix.indptr.astype(np.int64).tobytes()
    columns = matrix.indices.astype(np.int64).tobytes()
    return _elimination(row_ends, columns)


@lru_cache(maxsize=4)
def _elimination(row_ends: bytes, columns: bytes) -> Elimination:
    ends = np.frombuffer(row_ends, dtype=np.int64)
    indices = np.frombuffer(columns, dtype=np.int64)
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
        order=order,
        ends=np.concatenate([[0], np.cumsum(counts)]),
        rows=rows.astype(np.intc),
        columns=columns_of_l,
        row_ends=np.concatenate([[0], np.cumsum(np.bincount(rows, minlength=n))]),
        by_row=np.argsort(rows, kind="stable"),
        sources=sources,
        targets=targets,
    )


def _order(ends: Integers, indices: Integers) -> Integers:
    """Return an order of minimum degree."""
    size = len(ends) - 1
    pattern = sparse.csr_array((np.ones(len(indices)), indices, ends), shape=(size, size))
    # Any matrix of this pattern that can be eliminated.
    matrix = pattern + sparse.diags_array(1.0 + np.diff(ends))
    return np.argsort(symmetric_factor(matrix).perm_c)


def _filled(n: int, columns: Integers, rows: Integers) -> tuple[Integers, Integers]:
    """Return how many blocks each column of L has, and their rows."""
    below: list[set[int]] = [set() for _ in range(n)]
    for j, i in zip(columns.tolist(), rows.tolist(), strict=True):
        below[j].add(i)
    for j in range(n):
        below[j].discard(j)
        if below[j]:
            parent = min(below[j])  # in the elimination tree, which inherits all others
            below[parent] |= below[j]
    filled = [[j, *sorted(later)] for j, later in enumerate(below)]
    return np.array([len(column) for column in filled]), np.concatenate(filled)


WIDTH = 16
"""Number of right sides that loops are compiled for: 16 then take no longer than 6 otherwise."""


@compiled(fastmath=FUSED)
def eliminate(
    ends: Integers,
    rows: Integers,
    columns: Integers,
    row_ends: Integers,
    by_row: Integers,
    blocks: Array,
    pivots: Array,
) -> None:
    """Replace the lower triangle of A by L, column by column of blocks."""
    n = len(pivots)
    work = np.zeros((n, 9))
    for j in range(n):
        first, last = ends[j], ends[j + 1]
        for p in range(first, last):
            for c in range(9):
                work[rows[p], c] = blocks[p, c]
        for s in range(row_ends[j], row_ends[j + 1] - 1):
            q = by_row[s]
            k = columns[q]
            d0, d1, d2 = pivots[k, 0], pivots[k, 1], pivots[k, 2]
            a0, a1, a2 = d0 * blocks[q, 0], d0 * blocks[q, 1], d0 * blocks[q, 2]
            b0, b1, b2 = d1 * blocks[q, 3], d1 * blocks[q, 4], d1 * blocks[q, 5]
            c0, c1, c2 = d2 * blocks[q, 6], d2 * blocks[q, 7], d2 * blocks[q, 8]
            for p in range(q, ends[k + 1]):
                i = rows[p]
                for r in range(3):
                    x, y, z = blocks[p, r], blocks[p, 3 + r], blocks[p, 6 + r]
                    work[i, r] -= x * a0 + y * b0 + z * c0
                    work[i, 3 + r] -= x * a1 + y * b1 + z * c1
                    work[i, 6 + r] -= x * a2 + y * b2 + z * c2
        d0 = work[j, 0]
        low, corner = work[j, 1] / d0, work[j, 2] / d0
        d1 = work[j, 4] - low * work[j, 1]
        last_of_three = (work[j, 5] - low * work[j, 2]) / d1
        d2 = work[j, 8] - corner * work[j, 2] - last_of_three * last_of_three * d1
        pivots[j, 0], pivots[j, 1], pivots[j, 2] = d0, d1, d2
        blocks[first, 1], blocks[first, 2], blocks[first, 5] = low, corner, last_of_three
        for p in range(first + 1, last):
            i = rows[p]
            for r in range(3):
                x = work[i, r]
                y = work[i, 3 + r] - low * x
                z = work[i, 6 + r] - corner * x - last_of_three * y
                blocks[p, r], blocks[p, 3 + r], blocks[p, 6 + r] = x / d0, y / d1, z / d2


@compiled(fastmath=FUSED)
def solve_lower(
    ends: Integers,
    rows: Integers,
    blocks: FeatureRows,
    x: FeatureRows,
    lanes: tuple[int, ...] | None,
) -> None:
    """Replace X by L⁻¹ X."""
    k = x.shape[1] // 3 if lanes is None else len(lanes)
    y0, y1, y2 = np.empty(k, x.dtype), np.empty(k, x.dtype), np.empty(k, x.dtype)
    for j in range(len(x)):
        first, y = ends[j], x[j]
        low, corner, last = blocks[first, 1], blocks[first, 2], blocks[first, 5]
        for i in range(k):
            y0[i] = y[i]
            y1[i] = y[k + i] - low * y0[i]
            y2[i] = y[2 * k + i] - (corner * y0[i] + last * y1[i])
            y[k + i], y[2 * k + i] = y1[i], y2[i]
        for p in range(first + 1, ends[j + 1]):
            z, b = x[rows[p]], blocks[p]
            for i in range(k):
                z[i] -= b[0] * y0[i] + b[3] * y1[i] + b[6] * y2[i]
                z[k + i] -= b[1] * y0[i] + b[4] * y1[i] + b[7] * y2[i]
                z[2 * k + i] -= b[2] * y0[i] + b[5] * y1[i] + b[8] * y2[i]


@compiled(fastmath=FUSED)
def solve_upper(
    ends: Integers,
    rows: Integers,
    blocks: FeatureRows,
    x: FeatureRows,
    lanes: tuple[int, ...] | None,
) -> None:
    """Replace X by L⁻ᵀ X."""
    k = x.shape[1] // 3 if lanes is None else len(lanes)
    y0, y1, y2 = np.empty(k, x.dtype), np.empty(k, x.dtype), np.empty(k, x.dtype)
    for j in range(len(x) - 1, -1, -1):
        first, y = ends[j], x[j]
        for i in range(k):
            y0[i], y1[i], y2[i] = y[i], y[k + i], y[2 * k + i]
        for p in range(first + 1, ends[j + 1]):
            z, b = x[rows[p]], blocks[p]
            for i in range(k):
                z0, z1, z2 = z[i], z[k + i], z[2 * k + i]
                y0[i] -= b[0] * z0 + b[1] * z1 + b[2] * z2
                y1[i] -= b[3] * z0 + b[4] * z1 + b[5] * z2
                y2[i] -= b[6] * z0 + b[7] * z1 + b[8] * z2
        low, corner, last = blocks[first, 1], blocks[first, 2], blocks[first, 5]
        for i in range(k):
            second = y1[i] - last * y2[i]
            y[i] = y0[i] - (low * second + corner * y2[i])
            y[k + i], y[2 * k + i] = second, y2[i]
