"""Pictures of measuring tapes on a body."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy import ndarray
from numpy.typing import ArrayLike

from riemhuman.plots.figures import new_figure
from riemhuman.surfaces.rendering import View, Window, render, window_around

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_SIDES = (("front", 0.0), ("left side", 90.0), ("back", 180.0))
_ELEVATION = 4.0
_HEIGHT_INCHES = 4.6  # of the bodies
_COLUMNS = 4  # of names
_ROW_INCHES = 0.19


def plot_tapes(
    surface: ArrayLike,
    faces: ArrayLike,
    tapes: Mapping[str, Sequence[ArrayLike]],
    *,
    height: int = 700,
) -> Figure:
    """Draw a body from three sides with measuring tapes.

    Tapes are also drawn where the body would hide them.

    Parameters
    ----------
    surface : array_like, shape (V, 3)
        The body, metres, y up.
    faces : array_like, shape (F, 3)
        Triangles.
    tapes : mapping of str to sequence of array, shape (k, 3)
        Curves by name, as `rh.measurements.Measurements.tapes` returns them.
    height : int
        Height of the pictures in pixels.

    Returns
    -------
    matplotlib.figure.Figure

    Raises
    ------
    MissingDependencyError
        If matplotlib is not installed.

    Examples
    --------
    >>> import riemhuman as rh
    >>> bodies = rh.datasets.load_open_bodies("coarse")
    >>> tapes = rh.measurements.Measurements(bodies.model).tapes(bodies[0])
    >>> figure = rh.plots.plot_tapes(bodies[0], bodies.template.faces, tapes)
    """
    drawn = {name: curves for name, curves in tapes.items() if len(curves)}
    figure = new_figure(9.6, _HEIGHT_INCHES + _ROW_INCHES * -(-len(drawn) // _COLUMNS))
    views = [View(azimuth, _ELEVATION) for _, azimuth in _SIDES]
    windows = [window_around(surface, view) for view in views]
    tall = max(window.height for window in windows)
    # Windows have one height, so that all sides have one scale.
    windows = [replace(window, height=tall) for window in windows]
    all_axes = figure.subplots(1, len(_SIDES), width_ratios=[window.width for window in windows])
    for axes, (side, _), view, window in zip(all_axes, _SIDES, views, windows, strict=True):
        _draw_side(axes, surface, faces, drawn, view, window, height)
        axes.set_title(side)
    handles = [axes.lines[_first(drawn, name)] for name in drawn]
    figure.legend(
        handles,
        list(drawn),
        loc="outside lower center",
        ncols=_COLUMNS,
        fontsize=9,
        frameon=False,
    )
    return figure


def _draw_side(
    axes: Any,
    surface: ArrayLike,
    faces: ArrayLike,
    tapes: Mapping[str, Sequence[ArrayLike]],
    view: View,
    window: Window,
    height: int,
) -> None:
    (x, y), width, tall = window.centre, window.width / 2, window.height / 2
    picture = render(surface, faces, height=height, view=view, window=window)
    axes.imshow(picture, extent=(x - width, x + width, y - tall, y + tall))
    for number, curves in enumerate(tapes.values()):
        for curve in curves:
            flat: ndarray = view.turned(np.asarray(curve))[:, :2]
            axes.plot(*flat.T, color=f"C{number % 10}", linewidth=0.9, linestyle=_line(number))
    axes.set_axis_off()


def _line(number: int) -> str:
    return ("-", "--", ":", "-.")[number // 10 % 4]


def _first(tapes: Mapping[str, Sequence[ArrayLike]], name: str) -> int:
    """Return the number of the first line of a tape."""
    before = list(tapes)[: list(tapes).index(name)]
    return sum(len(tapes[other]) for other in before)
