"""Pictures of points and of surfaces with the same window and light."""

from __future__ import annotations

import numpy as np
from numpy import ndarray

from riemhuman.plots.rendering import View, Window, points_picture, render, window_around

_VIEW = View()


def shared_window(*surfaces: ndarray) -> Window:
    """Return a window that shows several sets of points.

    Parameters
    ----------
    *surfaces : array, shape (n, 3)
        Points, metres, y up.

    Returns
    -------
    Window
    """
    return window_around(np.concatenate(surfaces), _VIEW)


def body_picture(
    points: ndarray, faces: ndarray, window: Window, height: int, colors: ndarray
) -> ndarray:
    """Draw a body.

    Parameters
    ----------
    points : array, shape (V, 3)
        Vertices, metres, y up.
    faces : array of int, shape (F, 3)
        Triangles.
    window : Window
        Window of the picture.
    height : int
        Height of the picture, pixels.
    colors : array, shape (F, 3)
        Colours of the triangles: red, green and blue between 0 and 1.

    Returns
    -------
    array of uint8, shape (height, width, 4)
    """
    return render(points, faces, height=height, view=_VIEW, window=window, color=colors)


__all__ = ["body_picture", "points_picture", "shared_window"]
