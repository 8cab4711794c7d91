"""From where surfaces are viewed, and which part of the picture plane is shown."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from riemhuman.arrays import Points
from riemhuman.checks import (
    checked,
    instance,
    real,
    real_array,
    whole,
)
from riemhuman.errors import ArgumentError

# Of a picture.
_LARGEST_HEIGHT = 10_000
_MOST_PIXELS = 50_000_000


@checked(azimuth=real(), elevation=real())
@dataclass(frozen=True)
class View:
    """The direction from which surfaces are viewed.

    Parameters
    ----------
    azimuth : float
        Angle of the eye about the vertical, in degrees, from the front, +z, towards +x.
    elevation : float
        Angle of the eye above the horizontal, in degrees.

    Examples
    --------
    >>> rh.plots.View(azimuth=90.0)
    View(azimuth=90.0, elevation=8.0)
    """

    azimuth: float = 20.0
    elevation: float = 8.0

    def rotate(self, points: Points) -> Points:
        """Return points or vectors in the viewer's frame: right, up, towards the eye.

        Parameters
        ----------
        points : array, shape (..., 3)
        """
        about, above = np.radians([self.azimuth, self.elevation])
        towards = np.array(
            [np.sin(about) * np.cos(above), np.sin(above), np.cos(about) * np.cos(above)]
        )
        right = np.array([np.cos(about), 0.0, -np.sin(about)])
        rotated: Points = points @ np.stack([right, np.cross(towards, right), towards], axis=1)
        return rotated


a_view = instance(View, "a View(...)")
"""The check of a direction."""

a_height = whole(minimum=1, maximum=_LARGEST_HEIGHT)
"""The check of the height of a picture in pixels."""


@dataclass(frozen=True)
class Window:
    """The part of the viewer's picture plane that is shown, metres."""

    centre: tuple[float, float]
    width: float
    height: float

    def pixels(self, height: int) -> tuple[int, int]:
        """Return the height and width of a picture of this window."""
        width = height * self.width / self.height if self.height > 0 else math.inf
        if not height * width <= _MOST_PIXELS:
            raise ArgumentError(
                f"a picture of {self.width:.3g} m by {self.height:.3g} m, {height} pixels high, "
                f"would have more than {_MOST_PIXELS:,} pixels; pass a smaller height"
            )
        return height, max(1, round(width))


def window_around(points: ArrayLike, view: View, margin: float = 0.03) -> Window:
    """Return the smallest window that shows surfaces with a margin, metres."""
    flat = view.rotate(real_array(points, "points", ("n_vertices", 3)))[..., :2].reshape(-1, 2)
    low, high = flat.min(axis=0) - margin, flat.max(axis=0) + margin
    centre, size = (low + high) / 2, high - low
    return Window((float(centre[0]), float(centre[1])), float(size[0]), float(size[1]))


def same_heights(windows: Sequence[Window]) -> list[Window]:
    """Return windows of their own widths and places, which all show the same heights, metres."""
    low = min(window.centre[1] - window.height / 2 for window in windows)
    high = max(window.centre[1] + window.height / 2 for window in windows)
    return [
        Window((window.centre[0], (low + high) / 2), window.width, high - low) for window in windows
    ]
