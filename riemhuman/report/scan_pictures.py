"""Pictures of points and of surfaces with the same window and light."""

from __future__ import annotations

import numpy as np
from numpy import ndarray

from riemhuman.surfaces.rendering import SKIN, View, Window, render, window_around

_VIEW = View()
_N_SHADES = 0.55


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


def points_picture(
    points: ndarray, window: Window, height: int, colors: ndarray | None = None
) -> ndarray:
    """Draw points as small squares; points behind others are hidden and darker.

    Parameters
    ----------
    points : array, shape (n, 3)
        Points, metres, y up.
    window : Window
        Window of the picture.
    height : int
        Height of the picture, pixels.
    colors : array, shape (n, 3), optional
        Colours of the points; by default the colour of skin.

    Returns
    -------
    array of uint8, shape (height, width, 4)
    """
    scale = height / window.height
    width = max(1, round(height * window.width / window.height))
    seen = _VIEW.turned(points)
    order = np.argsort(seen[:, 2])
    depth = seen[:, 2] - seen[:, 2].min()
    light = 1.0 - _N_SHADES * (1.0 - depth / max(float(depth.max()), 1e-9))
    shown = np.broadcast_to(SKIN if colors is None else colors, points.shape)
    shown = np.round(255 * np.clip(shown * light[:, np.newaxis], 0, 1)).astype(np.uint8)
    # Squares are as wide as the distance between points.
    reach = int(np.clip(round(0.8 * height / np.sqrt(len(points))), 1, 6))
    columns = np.floor((seen[:, 0] - window.centre[0]) * scale + width / 2).astype(int)
    rows = np.floor(height / 2 - (seen[:, 1] - window.centre[1]) * scale).astype(int)
    picture = np.zeros((height, width, 4), dtype=np.uint8)
    steps = np.arange(reach)
    place_rows = rows[order, None, None] + steps[:, None]
    place_columns = columns[order, None, None] + steps
    inside = (
        (place_rows >= 0) & (place_rows < height) & (place_columns >= 0) & (place_columns < width)
    )
    place_rows, place_columns = np.broadcast_arrays(place_rows, place_columns)
    numbers = np.broadcast_to(order[:, None, None], inside.shape)[inside]
    # The last colour of a pixel stays: that of the point in front.
    picture[place_rows[inside], place_columns[inside], :3] = shown[numbers]
    picture[place_rows[inside], place_columns[inside], 3] = 255
    return picture
