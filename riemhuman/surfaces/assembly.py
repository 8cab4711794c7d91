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
        coordinates = (3 * faces[:, :, None] + np.arange(3)).reshape(-1, 9)
        rows = np.repeat(coordinates, 9, axis=1).ravel()
        columns = np.tile(coordinates, (1, 9)).ravel()
        keys, self._positions = np.unique(rows * self._size + columns, return_inverse=True)
        self._columns = (keys % self._size).astype(np.int32)
        counts = np.bincount(keys // self._size, minlength=self._size)
        self._row_ends = np.concatenate([[0], np.cumsum(counts)]).astype(np.int32)

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
