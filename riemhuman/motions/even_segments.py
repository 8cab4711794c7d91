r"""Smooth curves through polygons, and polygons of equal sides along them.

Transported velocities add up to a polygon in one Euclidean space. The sides of a polygon are chords
of the motion between its frames: other frames have other chords, which point elsewhere, however
little the motion differs. The cubic spline through the same vertices hardly depends on where the
frames lie, and its division into equal lengths does not depend on when they were taken.
"""

from __future__ import annotations

import numpy as np
from numpy import ndarray
from scipy.interpolate import CubicSpline

# Steps in which the length of the spline is measured, for every side and chord.
_FINER = 8

# Sides below this share of the longest are pauses.
_STILL = 1e-6


def even_segments(segments: ndarray, n_segments: int) -> tuple[ndarray, ndarray]:
    """Return chords of equal arcs of the spline through a polygon.

    Parameters
    ----------
    segments : array, shape (n, p)
        Sides of the polygon. The spline passes its vertices at equally spaced times, since a motion
        that turns back slows down there in time, and has a corner in length. Pauses take no time.
    n_segments : int
        Number of chords, m.

    Returns
    -------
    chords : array, shape (m, p)
        The chords.
    places : array, shape (m + 1,)
        Where they begin and end, counted in sides of the polygon; rising from 0 to n.
    """
    n = len(segments)
    products = segments @ segments.T
    lengths = np.sqrt(np.diag(products))
    moving = np.flatnonzero(lengths > _STILL * lengths.max())
    if len(moving) == 0:
        return np.zeros((n_segments, segments.shape[1])), np.linspace(0.0, n, n_segments + 1)
    # Points of the spline are sums of sides: these are their coefficients.
    corners = np.tri(len(moving) + 1, len(moving), -1)
    spline = CubicSpline(np.arange(len(corners)), corners)
    within = products[np.ix_(moving, moving)]
    finer = _FINER * -(-n_segments // len(moving))
    squares = []
    for side in range(len(moving)):
        steps = np.diff(spline(np.linspace(side, side + 1, finer + 1)), axis=0)
        squares.append(np.sum(steps @ within * steps, axis=1))
    arcs = np.concatenate([[0.0], np.cumsum(np.sqrt(np.maximum(squares, 0.0)))])
    times = np.linspace(0.0, len(moving), len(arcs))
    even = np.interp(np.linspace(0.0, arcs[-1], n_segments + 1), arcs, times)
    sides = np.minimum(even.astype(int), len(moving) - 1)
    places = moving[sides] + (even - sides)
    places[[0, -1]] = 0.0, n
    return np.diff(spline(even), axis=0) @ segments[moving], places
