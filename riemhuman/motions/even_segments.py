r"""Smooth curves through polygons, and polygons of equal sides along them.

Transported velocities add up to a polygon in one Euclidean space. Its sides are chords of the
motion between frames, and change with the frames, even where the motion is the same. The cubic
spline through its vertices changes little. Its division into equal lengths, and its Gaussian mean
along its length, do not depend on the times of the frames; the mean takes off what is too short for
the frames to show.
"""

from __future__ import annotations

import numpy as np
from numpy import ndarray
from scipy.interpolate import CubicSpline
from scipy.ndimage import gaussian_filter1d

# Steps in which the length of the spline is measured, for every side and chord.
_FINER = 8

# Sides below this share of the longest are pauses.
_STILL = 1e-6

# Standard deviations after which a Gaussian is cut off.
_BEYOND = 4.0


def even_segments(
    segments: ndarray, n_segments: int, smoothing: float = 0.0
) -> tuple[ndarray, ndarray]:
    """Return chords of equal arcs of the spline through a polygon.

    Parameters
    ----------
    segments : array, shape (n, p)
        Sides of the polygon. The spline passes its vertices at equally spaced times: a motion that
        turns back slows down there, but has a corner when it is parametrised by length. Pauses take
        no time.
    n_segments : int
        Number of chords, m.
    smoothing : float
        Standard deviation of the Gaussian mean along the spline, as a share of its length; its ends
        stay in place.

    Returns
    -------
    chords : array, shape (m, p)
        The chords.
    places : array, shape (m + 1,)
        Positions where they begin and end, in sides of the polygon, increasing from 0 to n.
    """
    n = len(segments)
    products = segments @ segments.T
    lengths = np.sqrt(np.diag(products))
    moving = np.flatnonzero(lengths > _STILL * lengths.max())
    if len(moving) == 0:
        return np.zeros((n_segments, segments.shape[1])), np.linspace(0.0, n, n_segments + 1)
    # Points of the spline are sums of sides: these are their coefficients.
    corners = np.tri(len(moving) + 1, len(moving), -1)
    curve = CubicSpline(np.arange(len(corners)), corners)
    within = products[np.ix_(moving, moving)]
    finer = _FINER * n_segments
    times = even = _even_times(curve, within, finer if smoothing else n_segments)
    if smoothing:
        curve = CubicSpline(np.arange(finer + 1), _smooth(curve(times), smoothing * finer))
        even = _even_times(curve, within, n_segments)
        times = np.interp(even, np.arange(finer + 1), times)
    sides = np.minimum(times.astype(int), len(moving) - 1)
    places = moving[sides] + (times - sides)
    places[[0, -1]] = 0.0, n
    return np.diff(curve(even), axis=0) @ segments[moving], places


def _even_times(curve: CubicSpline, within: ndarray, n_arcs: int) -> ndarray:
    """Return times of a spline between which lie arcs of equal length, shape (n_arcs + 1,)."""
    n_pieces = len(curve.x) - 1
    finer = _FINER * -(-n_arcs // n_pieces)
    squares = []
    for piece in range(n_pieces):
        steps = np.diff(curve(np.linspace(piece, piece + 1, finer + 1)), axis=0)
        squares.append(np.sum(steps @ within * steps, axis=1))
    arcs = np.concatenate([[0.0], np.cumsum(np.sqrt(np.maximum(squares, 0.0)))])
    times = np.linspace(0.0, n_pieces, len(arcs))
    return np.interp(np.linspace(0.0, arcs[-1], n_arcs + 1), arcs, times)


def _smooth(points: ndarray, deviation: float) -> ndarray:
    """Return Gaussian means of points in a row, which go on beyond the ends point-symmetrically."""
    n_beyond = min(int(np.ceil(_BEYOND * deviation)), len(points) - 1)
    before = 2.0 * points[0] - points[n_beyond:0:-1]
    after = 2.0 * points[-1] - points[-2 : -n_beyond - 2 : -1]
    extended = np.concatenate([before, points, after])
    return gaussian_filter1d(extended, deviation, axis=0)[n_beyond : n_beyond + len(points)]
