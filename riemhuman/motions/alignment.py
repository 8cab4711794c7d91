"""Motions re-timed to the clock of one of them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol

import numpy as np
from numpy import ndarray

from riemhuman.motions.dynamic_time_warping import DynamicTimeWarping
from riemhuman.motions.frames import Motion, n_frames_of
from riemhuman.motions.motion_space import MotionSpace
from riemhuman.motions.warp import Warp

# Share of the even clock in a re-timing, so that it never stands still.
_EVEN = 1e-3


class Alignment(Protocol):
    """What re-times motions: `DynamicTimeWarping`, `VelocityTimeWarping`, `RateInvariantMetric`."""

    def warp(self, m1: Motion, m2: Motion) -> Warp:
        """Return the correspondence between the times of two motions.

        Parameters
        ----------
        m1, m2 : array or sequence, shape (n, V, 3) and (m, V, 3)
            Motions.

        Returns
        -------
        Warp
        """

    def dist_pairwise(self, motions: Sequence[Motion], /) -> ndarray:
        """Return all distances within a set of motions.

        Parameters
        ----------
        motions : sequence of motions
            Motions.

        Returns
        -------
        array, shape (n, n)
        """


def default_alignment(space: MotionSpace) -> Alignment:
    """Return dynamic time warping of changes, with the metric of the frames.

    Parameters
    ----------
    space : MotionSpace
        Space of motions.

    Returns
    -------
    Alignment
    """
    return DynamicTimeWarping(space.frames.metric, centered=True, between_frames=True)


def even_times(warp: Warp, n_times: int) -> ndarray:
    """Return the times of the second motion at equally spaced times of the first.

    Parameters
    ----------
    warp : Warp
        From the first frames to the last.
    n_times : int
        Number of times.

    Returns
    -------
    array, shape (n_times,)
        Increasing from 0 to 1, as shares of the duration of the second motion.

    Examples
    --------
    >>> import numpy as np
    >>> import riemhuman as rh
    >>> warp = rh.motions.Warp(0.0, np.array([0.0, 1.0, 2.0]), np.array([0.0, 1.0, 4.0]))
    >>> rh.motions.even_times(warp, 3).round(2).tolist()
    [0.0, 0.25, 1.0]
    """
    even = np.linspace(0.0, 1.0, n_times)
    times = warp(even * warp.first[-1]) / warp.second[-1]
    times[0], times[-1] = 0.0, 1.0
    return (1.0 - _EVEN) * times + _EVEN * even


def at_times(space: MotionSpace, motion: Motion, times: ndarray, name: str = "motion") -> ndarray:
    """Return a motion at shares of its duration.

    Parameters
    ----------
    space : MotionSpace
        Space of motions.
    motion : array or sequence, shape (n_frames, V, 3)
        The motion.
    times : array, shape (n_times,)
        Times in [0, 1], not decreasing.
    name : str
        Name of the motion, for messages.

    Returns
    -------
    array, shape (n_times, V, 3)
    """
    last = n_frames_of(motion, name) - 1
    return space.resample(motion, at=np.clip(times, 0.0, 1.0) * last, name=name)
