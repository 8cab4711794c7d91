"""Pictures of two matched scans, in which places that correspond have the same colour."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from riemhuman.arrays import Array, Image, Points
from riemhuman.checks import checked, instance, real_array
from riemhuman.checks.labels import names_of
from riemhuman.plots.figures import new_figure, plain
from riemhuman.plots.rendering import points_picture, render
from riemhuman.plots.windows import View, Window, window_around
from riemhuman.registration import RegisteredScan, correspondence
from riemhuman.registration.registered_scans import apply_transform

if TYPE_CHECKING:
    from matplotlib.figure import Figure

# From right to left, colours go from blue over white to orange, which all common kinds of colour
# vision tell apart; they get lighter from the feet to the head, and dark bands mark equal heights.
_ACROSS = np.array([[0.05, 0.30, 0.75], [0.96, 0.96, 0.92], [0.93, 0.53, 0.02]])
_DARKEST = 0.6  # light at the feet; 1 at the head
_N_BANDS = 12
_BAND_SHARE = 0.25  # of the height
_BAND_SHADE = 0.72  # light of a band, as a share of that beside it
_UNSEEN = np.array([0.45, 0.45, 0.45])
_VIEWS = (("front", View(0.0, 4.0)), ("back", View(180.0, 4.0)))
_HEIGHT = 640  # pixels


_A_RESULT = instance(RegisteredScan, "a registered scan")


def position_colors(points: Points) -> Array:
    """Return colours of points (N, 3) by how far left and how high they are; NaN gives grey."""
    points = real_array(points, "points", ("n_points", 3), batched=False, finite=False)
    is_seen = np.isfinite(points).all(axis=1)
    colors = np.tile(_UNSEEN, (len(points), 1))
    if not is_seen.any():
        return colors
    seen = real_array(points[is_seen], "points")
    low, high = np.percentile(seen, [1.0, 99.0], axis=0)
    shares = (seen - low) / np.maximum(high - low, 1e-12)
    across = shares[:, 0]
    height = shares[:, 1]
    stops = np.linspace(0.0, 1.0, len(_ACROSS))
    hues = np.stack([np.interp(across, stops, channel) for channel in _ACROSS.T], axis=1)
    light = _DARKEST + (1.0 - _DARKEST) * np.clip(height, 0.0, 1.0)
    on_band = np.mod(_N_BANDS * height, 1.0) < _BAND_SHARE
    shade = np.where(on_band, _BAND_SHADE * light, light)
    colors[is_seen] = shade[:, np.newaxis] * hues
    return colors


@checked(result_a=_A_RESULT, result_b=_A_RESULT)
def plot_match(
    result_a: RegisteredScan,
    result_b: RegisteredScan,
    names: tuple[str, str] = ("a", "b"),
) -> Figure:
    """Draw two matched scans from the front and the back, in the colours of the first.

    Parameters
    ----------
    result_a, result_b : RegisteredScan
        Registrations of the scans with the same model.
    names : tuple of str
        Titles of the scans.

    Examples
    --------
    >>> figure = rh.plots.plot_match(result_a, result_b)  # doctest: +SKIP
    """
    results = (result_a, result_b)
    titles = names_of(names, "names", 2, "scans")
    points_a = apply_transform(result_a.transform, result_a.scan.points)
    points_b = apply_transform(result_b.transform, result_b.scan.points)
    # Where the points of both scans are on the first: one scale, so that a place has one colour.
    is_in_b = correspondence(result_a, result_b).seen
    places_a = np.where(is_in_b[:, np.newaxis], points_a, np.nan)
    places_b = apply_transform(result_a.transform, correspondence(result_b, result_a).points)
    colors = position_colors(np.concatenate([places_a, places_b]))
    scans = (
        (result_a, points_a, colors[: len(points_a)]),
        (result_b, points_b, colors[len(points_a) :]),
    )
    figure = new_figure(11.0, 5.6)
    axes = figure.subplots(1, 4)
    bodies = [result.upright_points for result in results]
    for row, (side, view) in enumerate(_VIEWS):
        windows = [window_around(body, view) for body in bodies]
        width = max(window.width for window in windows)
        height = max(window.height for window in windows)
        for column, (result, points, point_colors) in enumerate(scans):
            ax = axes[2 * row + column]
            window = replace(windows[column], width=width, height=height)
            ax.imshow(_picture(result, points, point_colors, window, view))
            ax.set_axis_off()
            ax.set_title(plain(f"{titles[column]}, {side}"), fontsize=12)
    return figure


def _picture(
    result: RegisteredScan, points: Points, colors: Array, window: Window, view: View
) -> Image:
    """Return a picture of one scan, cut to its body."""
    faces = result.scan.faces
    if faces is None:
        of_body = ~result.background
        return points_picture(points[of_body], window, _HEIGHT, colors[of_body], view)
    tints = colors[faces].mean(axis=1)
    return render(points, faces, height=_HEIGHT, view=view, window=window, color=tints)
