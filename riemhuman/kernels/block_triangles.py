"""Sparse triangular systems in 3 x 3 blocks, for many right sides at once.

The coordinates of a vertex stand together, and so do the right sides: one block of the matrix meets
contiguous numbers.
"""

from __future__ import annotations

from numpy import ndarray

from riemhuman.kernels.compiled import FUSED, compiled


@compiled(fastmath=FUSED)
def solve_lower(ends: ndarray, rows: ndarray, blocks: ndarray, x: ndarray) -> None:
    """Replace X by L⁻¹ X.

    Parameters
    ----------
    ends : array of int, shape (n + 1,)
        Where the blocks of each column of blocks begin, and where the last ends; the first of a
        column is on the diagonal.
    rows : array of int, shape (m,)
        Rows of the blocks.
    blocks : array, shape (m, 9)
        Transposed blocks of L, whose diagonal is 1.
    x : array, shape (n, 3k)
        k right sides of the first coordinate, then of the second and third.
    """
    k = x.shape[1] // 3
    for j in range(len(x)):
        first, y = ends[j], x[j]
        low, corner, last = blocks[first, 1], blocks[first, 2], blocks[first, 5]
        for i in range(k):
            y[k + i] -= low * y[i]
            y[2 * k + i] -= corner * y[i] + last * y[k + i]
        for p in range(first + 1, ends[j + 1]):
            z, b = x[rows[p]], blocks[p]
            for i in range(k):
                y0, y1, y2 = y[i], y[k + i], y[2 * k + i]
                z[i] -= b[0] * y0 + b[3] * y1 + b[6] * y2
                z[k + i] -= b[1] * y0 + b[4] * y1 + b[7] * y2
                z[2 * k + i] -= b[2] * y0 + b[5] * y1 + b[8] * y2


@compiled(fastmath=FUSED)
def solve_upper(ends: ndarray, rows: ndarray, blocks: ndarray, x: ndarray) -> None:
    """Replace X by L⁻ᵀ X.

    Parameters
    ----------
    ends, rows, blocks : array
        L, see `solve_lower`.
    x : array, shape (n, 3k)
        Right sides.
    """
    k = x.shape[1] // 3
    for j in range(len(x) - 1, -1, -1):
        first, y = ends[j], x[j]
        for p in range(first + 1, ends[j + 1]):
            z, b = x[rows[p]], blocks[p]
            for i in range(k):
                z0, z1, z2 = z[i], z[k + i], z[2 * k + i]
                y[i] -= b[0] * z0 + b[1] * z1 + b[2] * z2
                y[k + i] -= b[3] * z0 + b[4] * z1 + b[5] * z2
                y[2 * k + i] -= b[6] * z0 + b[7] * z1 + b[8] * z2
        low, corner, last = blocks[first, 1], blocks[first, 2], blocks[first, 5]
        for i in range(k):
            y[k + i] -= last * y[2 * k + i]
            y[i] -= low * y[k + i] + corner * y[2 * k + i]
