"""Tables that grow by rows, and projections of rows to principal components."""

from __future__ import annotations

from typing import Self

import numpy as np
from numpy import ndarray


class GrowingRows:
    """A table to which rows are added in time proportional to their number.

    Parameters
    ----------
    rows : array, shape (n, ...), optional
        The first rows.
    """

    def __init__(self, rows: ndarray | None = None) -> None:
        self._table = rows
        self._n_rows = 0 if rows is None else len(rows)

    @property
    def array(self) -> ndarray:
        """The rows, shape (n, ...)."""
        if self._table is None:
            return np.empty((0, 0))
        return self._table[: self._n_rows]

    def truncate(self, n_rows: int) -> None:
        """Remove the last rows.

        Parameters
        ----------
        n_rows : int
            Number of rows to keep.
        """
        self._n_rows = min(self._n_rows, n_rows)

    def append(self, rows: ndarray) -> None:
        """Add rows.

        Parameters
        ----------
        rows : array, shape (k, ...)
            Rows of the shape of the others.
        """
        if self._table is None:
            self._table = np.empty_like(rows, order="C")
        end = self._n_rows + len(rows)
        if end > len(self._table):
            # Double the size: on average, each row is then moved only a few times.
            table = np.empty((max(end, 2 * len(self._table)), *rows.shape[1:]), rows.dtype)
            table[: self._n_rows] = self.array
            self._table = table
        self._table[self._n_rows : end] = rows
        self._n_rows = end


class Projection:
    """A projection that never increases distances: principal components and the residual's norm.

    For an orthogonal projection P, |u − v|² ≥ |Pu − Pv|² + (|u − Pu| − |v − Pv|)² by the triangle
    inequality for the residuals.

    Parameters
    ----------
    mean : array, shape (m,)
        Centre.
    components : array, shape (k, m)
        Orthonormal rows.
    """

    def __init__(self, mean: ndarray, components: ndarray) -> None:
        self.mean = mean
        self.components = components

    @classmethod
    def fit(cls, sample: ndarray, n_components: int) -> Self:
        """Return the projection to the principal components of a sample.

        Parameters
        ----------
        sample : array, shape (n, m)
            Rows.
        n_components : int
            Largest number of components.

        Returns
        -------
        Projection
        """
        mean = sample.mean(axis=0)
        centered = sample - mean
        values, vectors = np.linalg.eigh(centered @ centered.T)
        kept = np.flatnonzero(values > 1e-12 * values[-1])[::-1][:n_components]
        # QR makes the components orthonormal to rounding; otherwise distances could increase.
        orthonormal, _ = np.linalg.qr(centered.T @ (vectors[:, kept] / np.sqrt(values[kept])))
        return cls(mean, np.ascontiguousarray(orthonormal.T))

    def __call__(self, rows: ndarray) -> ndarray:
        """Return the projected rows.

        Parameters
        ----------
        rows : array, shape (n, m)
            Rows.

        Returns
        -------
        array, shape (n, k + 1)
        """
        centered = rows - self.mean
        projected = centered @ self.components.T
        rest = np.sum(centered**2, axis=1) - np.sum(projected**2, axis=1)
        return np.column_stack([projected, np.sqrt(np.maximum(rest, 0.0))])
