"""Assembly of triangle matrices into one sparse matrix over the vertices of a mesh."""

from __future__ import annotations

import numpy as np
from scipy import sparse


class TriangleAssembler:
    """Sums 9 x 9 matrices of triangles into sparse (3V, 3V) matrices of one pattern.

    Parameters
    ----------
    faces : array of int, shape (F, 3)
        Triangles.
    n_vertices : int
        Number of vertices V.
    """

    def __init__(self, faces: np.ndarray, n_vertices: int) -> None:
        self._size = 3 * n_vertices
        # Each pair of vertices that share a triangle has a block of 3 x 3 entries.
        faces = faces.astype(np.int64)
        pairs = faces[:, :, None] * n_vertices + faces[:, None, :]
        keys, blocks = np.unique(pairs, return_inverse=True)
        above, beside = np.divmod(keys, n_vertices)
        counts = np.bincount(above, minlength=n_vertices)
        starts = np.concatenate([[0], np.cumsum(counts)])[above]
        first = 9 * starts + 3 * (np.arange(len(keys)) - starts)
        i, j = np.arange(3)[:, None], np.arange(3)
        entries = first[:, None, None] + 3 * i * counts[above, None, None] + j
        self._columns = np.empty(entries.size, dtype=np.int32)
        self._columns[entries] = 3 * beside[:, None, None] + j
        self._row_ends = np.concatenate([[0], np.cumsum(np.repeat(3 * counts, 3))]).astype(np.int32)
        self._positions = entries[blocks.reshape(pairs.shape)].swapaxes(2, 3).ravel()

    def assemble(self, blocks: np.ndarray) -> sparse.csr_array:
        """Return the sum of the matrices of all triangles.

        Parameters
        ----------
        blocks : array, shape (F, 9, 9)
            Rows and columns run over the coordinates of the first, second and third corner.

        Returns
        -------
        csr_array, shape (3V, 3V)
        """
        entries = np.bincount(self._positions, blocks.ravel(), minlength=len(self._columns))
        shape = (self._size, self._size)
        return sparse.csr_array((entries, self._columns, self._row_ends), shape=shape)
