"""The correspondence between the times of two motions."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy import ndarray


@dataclass(frozen=True)
class Warp:
    """Matched times of two motions, counted in frames from 0.

    Attributes
    ----------
    dist : float
        Distance of the two motions along it.
    first, second : array, shape (n_matches,)
        Matched times of the first and of the second motion; neither decreases.

    Examples
    --------
    >>> import numpy as np
    >>> import riemhuman as rh
    >>> warp = rh.motions.Warp(0.0, np.array([0.0, 1.0, 2.0]), np.array([0.0, 1.0, 4.0]))
    >>> warp(np.array([0.5, 1.5])).tolist()
    [0.5, 2.5]
    >>> warp.inverse()(2.5).tolist()
    1.5
    """

    dist: float
    first: ndarray
    second: ndarray

    def __call__(self, times: ndarray | float) -> ndarray:
        """Return the times of the second motion that correspond to times of the first.

        Where several were matched with one, it is their mean; in between it is linear.

        Parameters
        ----------
        times : array, shape (...)
            Times of the first motion, in frames.

        Returns
        -------
        array, shape (...)
        """
        moments, places = np.unique(self.first, return_inverse=True)
        counts = np.bincount(places)
        means = np.bincount(places, weights=self.second) / counts
        return np.asarray(np.interp(times, moments, means))

    def inverse(self) -> Warp:
        """Return the warp from the second motion to the first.

        Returns
        -------
        Warp
        """
        return Warp(self.dist, self.second, self.first)
