"""Labels of a map of bodies: one body of each class with its name, and a scale bar."""

from __future__ import annotations

from collections.abc import Sequence
from textwrap import fill
from typing import TYPE_CHECKING

import numpy as np
from numpy import ndarray
from numpy.typing import ArrayLike

from riemhuman.optional import import_optional
from riemhuman.surfaces.rendering import View, render, window_around

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_THUMBNAIL_INCHES = 0.62
_THUMBNAIL_PIXELS = 200
NAME_POINTS = 9.5
_NAME_BELOW = 0.34  # inches from the middle of the body to its name
_NAME_LETTERS = 14  # in a line
_LETTER_WIDTH = 0.62 * NAME_POINTS / 72  # inches, at most in the mean of a line
# Inches: half the width and height of a body; half the height and the middle of a body with its
# name in two lines, and of the name alone.
_BODY = np.array([0.31, 0.31])
_WHOLE_HEIGHT, _WHOLE_MIDDLE = 0.49, np.array([0.0, -0.16])
_NAME_HEIGHT, _NAME_MIDDLE = 0.15, np.array([0.0, -0.49])


def add_length_bar(ax: Axes, unit: str) -> None:
    """Draw a scale bar of a round length, after giving both axes the same scale.

    Parameters
    ----------
    ax : matplotlib.axes.Axes
        Axes of the map.
    unit : str
        Unit of the positions.
    """
    limits = np.array([ax.get_xlim(), ax.get_ylim()])
    inches = _inches(ax)
    half = (np.ptp(limits, axis=1) / inches).max() * inches / 2
    (left, right), (bottom, top) = limits.mean(axis=1)[:, None] + np.outer(half, [-1, 1])
    ax.set(xlim=(left, right), ylim=(bottom, top))
    most = 0.25 * (right - left)
    power = 10.0 ** np.floor(np.log10(most))
    length = max(times * power for times in (1, 2, 5) if times * power <= most)
    ax.plot([left, left + length], [bottom, bottom], color="#8a8f96", linewidth=2, clip_on=False)
    ax.annotate(
        f"{length:g} {unit}", (left, bottom), xytext=(0, 3), textcoords="offset points",
        ha="left", va="bottom", fontsize=NAME_POINTS,
    )  # fmt: skip


def add_thumbnails(
    ax: Axes,
    positions: ndarray,
    labels: ndarray,
    colors: ndarray,
    names: Sequence[str] | None,
    points: ndarray,
    faces: ArrayLike,
    view: View,
) -> None:
    """Draw a body of each class beside its points, with its name and a line to their middle.

    Parameters
    ----------
    ax : matplotlib.axes.Axes
        Axes of the map.
    positions : array, shape (n, 2)
        Positions of the items.
    labels : array of int, shape (n,)
        Class of each item.
    colors : array, shape (n_classes, 3)
        Colours of the classes.
    names : sequence of str, optional
        Names of the classes.
    points : array, shape (n, V, 3)
        Bodies of the items; the body nearest to the middle of each class is drawn.
    faces : array_like, shape (F, 3)
        Triangles of the bodies.
    view : View
        Direction from which the bodies are seen.
    """
    offsetbox = import_optional("matplotlib.offsetbox", "plot")
    classes = np.unique(labels)
    centres = np.stack([np.median(positions[labels == label], axis=0) for label in classes])
    extent = _inches(ax)
    low = np.array([ax.get_xlim()[0], ax.get_ylim()[0]])
    size = np.array([ax.get_xlim()[1], ax.get_ylim()[1]]) - low
    inches = size / extent
    starts = (centres - low) / inches
    titles = [str(k) if names is None else fill(names[k], _NAME_LETTERS) for k in classes]
    letters = np.array([max(map(len, title.split("\n"))) for title in titles])
    widths = 0.5 * _LETTER_WIDTH * letters
    places = free_places((positions - low) / inches, starts, extent, widths)
    for label, title, start, place, width in zip(
        classes, titles, starts, places, widths, strict=True
    ):
        own = np.flatnonzero(labels == label)
        to_centre = np.linalg.norm(
            (positions[own] - np.median(positions[own], axis=0)) / size, axis=1
        )
        body = points[own[to_centre.argmin()]]
        window = window_around(body, view)
        tint = 0.25 + 0.75 * colors[label]
        picture = render(
            body, faces, height=_THUMBNAIL_PIXELS, view=view, window=window, color=tint
        )
        zoom = _THUMBNAIL_INCHES * 72 / _THUMBNAIL_PIXELS
        line = low + np.stack([start, leader_end(start, place, width)]) * inches
        ax.plot(*line.T, color=colors[label], linewidth=0.6, alpha=0.7, zorder=1)
        at = low + place * inches
        ax.add_artist(
            offsetbox.AnnotationBbox(
                offsetbox.OffsetImage(picture, zoom=zoom), at, frameon=False, pad=0, zorder=2
            )
        )
        ax.annotate(
            title, at, xytext=(0, -72 * _NAME_BELOW), textcoords="offset points",
            ha="center", va="top", fontsize=NAME_POINTS, linespacing=1.0, zorder=4,
        )  # fmt: skip


def _inches(ax: Axes) -> ndarray:
    """Return the width and height of the axes."""
    if ax.figure.get_layout_engine() is not None:
        ax.figure.draw_without_rendering()  # finds them
    return np.asarray(ax.figure.get_size_inches() * ax.get_position().size)


def free_places(items: ndarray, centres: ndarray, size: ndarray, widths: ndarray) -> list[ndarray]:
    """Return a place for each label: near its class, over few items, with its line off names.

    Parameters
    ----------
    items : array, shape (n, 2)
        Positions of the items, inches.
    centres : array, shape (n_classes, 2)
        Middle of each class, inches.
    size : array, shape (2,)
        Width and height of the map, inches.
    widths : array, shape (n_classes,)
        Half the width of every name, inches.

    Returns
    -------
    list of array, each of shape (2,)
        Middle of the body of every class, inches.
    """
    angles = np.linspace(0, 2 * np.pi, 32, endpoint=False)
    spokes = np.stack([np.cos(angles), np.sin(angles)], axis=1)
    steps = np.concatenate([radius * spokes for radius in (0.5, 0.65, 0.8, 1.05, 1.35, 1.7, 2.1)])
    wholes = np.stack([np.maximum(widths, _BODY[0]), np.full(len(widths), _WHOLE_HEIGHT)], axis=1)
    alone = np.stack([widths, np.full(len(widths), _NAME_HEIGHT)], axis=1)
    places: dict[int, ndarray] = {}
    # Each class in turn takes the best place that the others leave, and does so again.
    for index in [*range(len(centres))] * 6:
        candidates = centres[index] + steps
        boxes = candidates + _WHOLE_MIDDLE
        whole, width = wholes[index], widths[index]
        cost = 1.0 * covered(items, boxes, whole) + 4.0 * np.linalg.norm(steps, axis=1)
        cost += 4.0 * covered(items, candidates + _NAME_MIDDLE, alone[index])
        cost += 50.0 * ((boxes < whole) | (boxes > size - whole)).any(axis=1)
        ends = np.stack([leader_end(centres[index], place, width) for place in candidates])
        for other, place in places.items():
            if other == index:
                continue
            gap = np.abs(candidates - place) / (whole + wholes[other])
            cost += 40.0 * np.clip(1.0 - gap, 0, None).prod(axis=1) ** 0.5
            cost += 10.0 * (gap < 1.0).all(axis=1)
            cost += 30.0 * crosses(centres[index], ends, place + _NAME_MIDDLE, alone[other])
            cost += 10.0 * crosses(centres[index], ends, place, _BODY)
            end = leader_end(centres[other], place, widths[other])
            cost += 30.0 * crosses(centres[other], end, candidates + _NAME_MIDDLE, alone[index])
            cost += 10.0 * crosses(centres[other], end, candidates, _BODY)
        places[index] = candidates[cost.argmin()]
    return [places[index] for index in range(len(centres))]


def covered(items: ndarray, middles: ndarray, reach: ndarray) -> ndarray:
    """Return how many items lie within boxes.

    Parameters
    ----------
    items : array, shape (n, 2)
        Positions of the items.
    middles : array, shape (m, 2)
        Middles of the boxes.
    reach : array, shape (2,)
        Half the width and height of the boxes.

    Returns
    -------
    array of int, shape (m,)
    """
    return (np.abs(items[None] - middles[:, None]) < reach).all(axis=-1).sum(axis=1)


def leader_end(start: ndarray, place: ndarray, width: float) -> ndarray:
    """Return where the line to a body ends: at the edge of the body with its name.

    Parameters
    ----------
    start : array, shape (2,)
        Start of the line, inches.
    place : array, shape (2,)
        Middle of the body, inches.
    width : float
        Half the width of its name, inches.

    Returns
    -------
    array, shape (2,)
    """
    middle = place + _WHOLE_MIDDLE
    whole = np.array([max(width, _BODY[0]), _WHOLE_HEIGHT])
    away = start - middle
    return middle + away * min(1.0, float((whole / np.maximum(np.abs(away), 1e-9)).min()))


def crosses(start: ndarray, end: ndarray, middle: ndarray, reach: ndarray) -> ndarray:
    """Return whether lines cross boxes.

    Parameters
    ----------
    start, end : array, shape (..., 2)
        Ends of the lines.
    middle : array, shape (..., 2)
        Middles of the boxes.
    reach : array, shape (2,)
        Half the width and height of the boxes.

    Returns
    -------
    array of bool, shape (...)
    """
    way = np.where(end == start, 1e-12, end - start)
    one, other = (middle - reach - start) / way, (middle + reach - start) / way
    enters = np.minimum(one, other).max(axis=-1)
    leaves = np.maximum(one, other).min(axis=-1)
    return (enters <= leaves) & (leaves >= 0) & (enters <= 1)
