"""Pictures of two matched scans, in which places that correspond have the same colour."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy import ndarray

from riemhuman.plots.figures import new_figure
from riemhuman.plots.rendering import View, points_picture, render, window_around
from riemhuman.registration import RegisteredScan, correspondence
from riemhuman.registration.scan_registration import apply_transform

if TYPE_CHECKING:
    from matplotlib.figure import Figure

# From right to left, colours go from blue to yellow, which all common kinds of colour vision tell
# apart; they get lighter from the feet to the head, and dark lines mark equal heights.
_RIGHT, _LEFT = np.array([0.10, 0.36, 0.80]), np.array([0.98, 0.80, 0.16])
_DARKEST, _N_LINES, _LINE_SHARE, _LINE_SHADE = 0.45, 16, 0.14, 0.55
_UNSEEN = np.array([0.72, 0.72, 0.72])
_VIEWS = (("front", View(0.0, 4.0)), ("back", View(180.0, 4.0)))
_HEIGHT = 640  # pixels


def position_colors(points: ndarray) -> ndarray:
    """Return colours of places by how far left and how high they are, shape (N, 3).

    Parameters
    ----------
    points : array, shape (N, 3)
        Places in upright axes, x to the left and y up; NaN for grey.
    """
    seen = np.isfinite(points).all(axis=1)
    colors = np.tile(_UNSEEN, (len(points), 1))
    if not seen.any():
        return colors
    known = points[seen]
    low, high = np.percentile(known, [1.0, 99.0], axis=0)
    across, _, _ = ((known - low) / np.maximum(high - low, 1e-12)).T
    height = (known[:, 1] - low[1]) / max(high[1] - low[1], 1e-12)
    share = np.clip(across, 0.0, 1.0)[:, np.newaxis]
    light = _DARKEST + (1.0 - _DARKEST) * np.clip(height, 0.0, 1.0)
    on_line = np.mod(_N_LINES * height, 1.0) < _LINE_SHARE
    shade = np.where(on_line, _LINE_SHADE * light, light)
    colors[seen] = shade[:, np.newaxis] * ((1.0 - share) * _RIGHT + share * _LEFT)
    return colors


def plot_match(
    result_a: RegisteredScan,
    result_b: RegisteredScan,
    names: tuple[str, str] = ("a", "b"),
) -> Figure:
    """Draw two matched scans from the front and the back, in the colours of the first.

    Parameters
    ----------
    result_a, result_b : RegisteredScan
        Registrations of the scans by the same model.
    names : tuple of str
        Titles of the scans.

    Examples
    --------
    >>> figure = rh.plots.plot_match(result_a, result_b)  # doctest: +SKIP
    """
    there = correspondence(result_a, result_b).seen
    upright_a = apply_transform(result_a.transform, result_a.scan.points)
    origins = correspondence(result_b, result_a)
    scans = (
        (result_a, upright_a, np.where(there[:, np.newaxis], upright_a, np.nan)),
        (
            result_b,
            apply_transform(result_b.transform, result_b.scan.points),
            apply_transform(result_a.transform, origins.points),
        ),
    )
    # One scale for all places, so that a place has one colour in both.
    colors = position_colors(np.concatenate([places for *_, places in scans]))
    tints = np.split(colors, [len(upright_a)])
    figure = new_figure(11.0, 5.6)
    axes = figure.subplots(1, 4)
    for row, (side, view) in enumerate(_VIEWS):
        for column, (result, points, _) in enumerate(scans):
            ax = axes[2 * row + column]
            body = apply_transform(result.transform, result.points)
            ax.imshow(_picture(result, points, tints[column], body, view))
            ax.set_axis_off()
            ax.set_title(f"{names[column]}, {side}", fontsize=9)
    return figure


def _picture(
    result: RegisteredScan, points: ndarray, colors: ndarray, body: ndarray, view: View
) -> ndarray:
    """Return a picture of one scan, cut to its body."""
    window, faces = window_around(body, view), result.scan.faces
    if faces is None:
        shown = ~result.background
        return points_picture(points[shown], window, _HEIGHT, colors[shown], view)
    tints = colors[faces].mean(axis=1)
    return render(points, faces, height=_HEIGHT, view=view, window=window, color=tints)
