"""Pooling: one vector from values at all vertices."""

from __future__ import annotations

import numpy as np
from numpy import ndarray


def area_histograms(
    values: ndarray, areas: ndarray, lower: float, upper: float, n_bins: int
) -> ndarray:
    """Return histograms of functions on a surface, weighted by area.

    Parameters
    ----------
    values : array, shape (m, V)
        Functions.
    areas : array, shape (V,)
        Vertex areas.
    lower, upper : float
        Lower end of the first and upper end of the last bin, which also count values beyond them.
    n_bins : int
        Number of bins of equal width.

    Returns
    -------
    array, shape (m * n_bins,)
        One histogram after the other; each sums to 1.
    """
    position = (values - lower) * (n_bins / (upper - lower))
    bins = np.clip(position, 0, n_bins - 1).astype(np.int64)
    bins += n_bins * np.arange(len(values))[:, np.newaxis]
    shares = np.broadcast_to(areas / areas.sum(), values.shape)
    return np.bincount(bins.ravel(), shares.ravel(), minlength=len(values) * n_bins)
