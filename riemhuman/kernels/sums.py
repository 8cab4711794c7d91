"""Integrals over the template: ∫_T h dx = Σ_t w_t h_t."""

from __future__ import annotations

import autograd.numpy as np
from numpy import ndarray


def integrate(values: ndarray, areas: ndarray) -> ndarray:
    """Return Σ_t w_t h_t.

    Parameters
    ----------
    values : array, shape (..., F)
        Values h_t on the triangles.
    areas : array, shape (F,)
        Template areas w_t.

    Returns
    -------
    array, shape (...)
    """
    return np.sum(values * areas, axis=-1)
