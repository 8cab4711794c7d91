"""Coarse to fine in time."""

from __future__ import annotations

import numpy as np
from numpy import ndarray
from scipy.interpolate import make_interp_spline


def interpolate_in_time(coefficients: ndarray, n_segments: int) -> ndarray:
    """Return coefficients of the interior times at another number of segments, by a spline.

    Parameters
    ----------
    coefficients : array, shape (n − 1, K)
        Coefficients at the interior times of n segments; they vanish at both ends.
    n_segments : int
        New number of segments.

    Returns
    -------
    array, shape (n_segments − 1, K)
    """
    known = np.pad(coefficients, ((1, 1), (0, 0)))
    spline = make_interp_spline(np.linspace(0, 1, len(known)), known, k=min(3, len(known) - 1))
    return spline(np.linspace(0, 1, n_segments + 1)[1:-1])
