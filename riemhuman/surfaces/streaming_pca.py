"""Principal components of rows that arrive one by one, in bounded memory."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

# Rows are collected up to this size before they are merged.
_BUFFER_BYTES = 2**28


class PrincipalComponents(NamedTuple):
    """The principal components of all rows seen.

    Attributes
    ----------
    vectors : array, shape (K, n_features)
        Orthonormal components, the strongest first; the largest entry of each is positive.
    variance : array, shape (K,)
        Mean square of the rows along each component; with mean removal, their sample variance.
    variance_ratio : array, shape (K,)
        The variance as a share of the total.
    mean : array, shape (n_features,), or None
        The mean, if it was removed.
    rank : int
        Numerical rank of the rows in the buffer, which K does not exceed.
    n_samples : int
        Number of rows.
    """

    vectors: np.ndarray
    variance: np.ndarray
    variance_ratio: np.ndarray
    mean: np.ndarray | None
    rank: int
    n_samples: int


class StreamingPCA:
    """Principal components of rows that arrive one by one, in bounded memory.

    Rows are collected in a buffer. The rows A = U S Vᵀ of a full buffer are replaced by half as
    many, the strongest rows of S Vᵀ. While all rows fit in the buffer, the result is that of one
    singular value decomposition. Beyond, each merge lowers AᵀA, in the spectral norm, by the square
    of the largest singular value that it drops, and keeps at least 1.5 K larger ones. Nothing is
    lost if half the buffer holds at least as many rows as there are features.

    With mean removal, the rows of each merge are centred on their own mean, and an additional row
    represents the distance of this mean from the previous one [1]_.

    Parameters
    ----------
    n_components : int
        Number of components K.
    n_features : int
        Length of a row.
    remove_mean : bool
        Whether the mean of the rows is removed.
    max_rows : int, optional
        Rows in the buffer; by default as many as 256 MiB hold, and at least 3 K.

    References
    ----------
    .. [1] Ross, Lim, Lin, Yang, "Incremental Learning for Robust Visual Tracking", International
       Journal of Computer Vision 77, 2008, section 3.1.
    """

    def __init__(
        self,
        n_components: int,
        n_features: int,
        *,
        remove_mean: bool = False,
        max_rows: int | None = None,
    ) -> None:
        if max_rows is None:
            fitting = _BUFFER_BYTES // (8 * n_features)
            max_rows = max(3 * n_components, min(fitting, 2 * n_features))
        self._n_components = n_components
        self._max_rows = max_rows
        self._remove_mean = remove_mean
        # One row more for the shift of the mean.
        self._rows = np.empty((max_rows + 1, n_features))
        self._n_filled = 0
        self._singular_values = np.empty(0)
        self._mean = np.zeros(n_features)
        self._n_samples = 0
        self._sum_of_squares = 0.0

    def add(self, row: np.ndarray) -> None:
        """Add a row.

        Parameters
        ----------
        row : array, shape (n_features,)
            The row; it is copied.
        """
        if self._n_filled == self._max_rows:
            self._merge()
        self._rows[self._n_filled] = row
        self._n_filled += 1

    def components(self, *, rounding: float = 0.0) -> PrincipalComponents:
        """Return the components of the rows so far.

        Parameters
        ----------
        rounding : float
            Error of a single entry of the rows; singular values that such errors can explain do
            not count for the rank.
        """
        self._merge()
        values, n_features = self._singular_values, self._rows.shape[1]
        noise = rounding * (np.sqrt(self._n_samples) + np.sqrt(n_features))
        resolution = max(self._n_samples, n_features) * np.finfo(np.float64).eps
        rank = int(np.sum(values > resolution * values.max(initial=0.0) + noise))
        n_components = min(self._n_components, rank)

        values = values[:n_components]
        vectors = self._rows[:n_components] / values[:, np.newaxis]
        peaks = np.abs(vectors).argmax(axis=1)
        vectors *= np.sign(vectors[np.arange(n_components), peaks])[:, np.newaxis]
        freedom = self._n_samples - 1 if self._remove_mean else self._n_samples
        return PrincipalComponents(
            vectors,
            values**2 / max(freedom, 1),
            values**2 / (self._sum_of_squares or 1.0),
            self._mean.copy() if self._remove_mean else None,
            rank,
            self._n_samples,
        )

    def _merge(self) -> None:
        """Replace the rows of the buffer by the strongest rows of S Vᵀ."""
        n_merged = len(self._singular_values)
        if self._n_filled == n_merged:
            return
        n_new = self._n_filled - n_merged
        if self._remove_mean:
            self._centre(self._rows[n_merged : self._n_filled])
        self._n_samples += n_new
        self._sum_of_squares += float(np.sum(self._rows[n_merged : self._n_filled] ** 2))

        rows = self._rows[: self._n_filled]
        # With Aᵀ = Q R, A and Rᵀ have the same left singular vectors. Unlike A Aᵀ, R keeps small
        # singular values to full precision.
        triangle: Any = np.linalg.qr(rows.T, mode="r")
        left, values, _ = np.linalg.svd(triangle.T, full_matrices=False)
        kept = min(max(self._max_rows // 2, self._n_components), len(values))
        self._rows[:kept] = left[:, :kept].T @ rows
        self._singular_values = values[:kept]
        self._n_filled = kept

    def _centre(self, new: np.ndarray) -> None:
        """Centre the new rows, add a row for the shift of their mean, and update the mean."""
        n_old, n_new = self._n_samples, len(new)
        mean = new.mean(axis=0)
        new -= mean
        shift = mean - self._mean
        if n_old:
            self._rows[self._n_filled] = shift * np.sqrt(n_old * n_new / (n_old + n_new))
            self._n_filled += 1
        self._mean += shift * (n_new / (n_old + n_new))
