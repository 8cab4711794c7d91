"""Colours of classes and values that are legible on light and dark backgrounds."""

from __future__ import annotations

from colorsys import hls_to_rgb

import numpy as np
from numpy import ndarray

# Ten hues of similar lightness; successive hues differ strongly.
_CLASSES = (
    *("4e82b4", "e08a33", "cf5152", "52a39c", "5b9e4d"),
    *("c3a02b", "a674a8", "d97693", "97765f", "77858f"),
)

# From the colour of skin, for 0, to the colour of the largest value.
VALUE_COLORS = ("#d4c8bb", "#ecb169", "#d95f30", "#8c1d3f")


def rgb(hexadecimal: str) -> tuple[float, float, float]:
    """Return red, green and blue between 0 and 1.

    Parameters
    ----------
    hexadecimal : str
        Six digits, with or without a leading #.

    Returns
    -------
    tuple of float
    """
    digits = hexadecimal.removeprefix("#")
    red, green, blue = (int(digits[i : i + 2], 16) / 255 for i in (0, 2, 4))
    return red, green, blue


def class_colors(n_classes: int) -> ndarray:
    """Return distinct colours for classes.

    Parameters
    ----------
    n_classes : int
        Number of classes.

    Returns
    -------
    array, shape (n_classes, 3)
        Red, green and blue between 0 and 1.
    """
    if n_classes <= len(_CLASSES):
        return np.array([rgb(color) for color in _CLASSES[:n_classes]])
    hues = np.arange(n_classes) / n_classes
    return np.array([hls_to_rgb(h, 0.42 + 0.16 * (i % 2), 0.5) for i, h in enumerate(hues)])


def value_colors(values: ndarray, largest: float | None = None) -> ndarray:
    """Return the colours of non-negative values, from the colour of skin to dark red.

    Parameters
    ----------
    values : array, shape (...)
        Non-negative values.
    largest : float, optional
        Value of the last colour, also used for larger values; by default the largest value.

    Returns
    -------
    array, shape (..., 3)
        Red, green and blue between 0 and 1.
    """
    values = np.asarray(values, dtype=np.float64)
    top = float(values.max(initial=0.0)) if largest is None else largest
    share = np.clip(values / (top if top > 0 else 1.0), 0.0, 1.0)
    stops = np.array([rgb(color) for color in VALUE_COLORS])
    places = np.linspace(0.0, 1.0, len(stops))
    return np.stack([np.interp(share, places, stops[:, channel]) for channel in range(3)], axis=-1)
