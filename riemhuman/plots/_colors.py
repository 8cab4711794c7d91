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

# Share of values beyond the end of a colour scale.
_OUTLIERS = 0.01

# Red, green and blue of a body without other colour, and of a mean.
SKIN = (0.80, 0.73, 0.66)
MEAN = (0.93, 0.74, 0.30)

# From the colour of skin, for 0, to the colour of the largest value.
VALUE_COLORS = ("#d4c8bb", "#ecb169", "#d95f30", "#8c1d3f")


def rgb(hexadecimal: str) -> tuple[float, float, float]:
    """Return red, green and blue between 0 and 1, from six hexadecimal digits."""
    digits = hexadecimal.removeprefix("#")
    red, green, blue = (int(digits[i : i + 2], 16) / 255 for i in (0, 2, 4))
    return red, green, blue


def class_colors(n_classes: int) -> ndarray:
    """Return distinct colours for classes, shape (n_classes, 3)."""
    if n_classes <= len(_CLASSES):
        return np.array([rgb(color) for color in _CLASSES[:n_classes]])
    hues = np.arange(n_classes) / n_classes
    return np.array([hls_to_rgb(h, 0.42 + 0.16 * (i % 2), 0.5) for i, h in enumerate(hues)])


def colour_limit(values: ndarray) -> float:
    """Return the end of the colour scale, which 1 % of the values exceed."""
    # One extreme triangle must not set the scale.
    return float(np.quantile(values, 1.0 - _OUTLIERS)) or float(values.max(initial=0.0))


def value_colors(values: ndarray, largest: float | None = None) -> ndarray:
    """Return colours of non-negative values; those above the largest have the last colour."""
    values = np.asarray(values, dtype=np.float64)
    top = float(values.max(initial=0.0)) if largest is None else largest
    share = np.clip(values / (top if top > 0 else 1.0), 0.0, 1.0)
    stops = np.array([rgb(color) for color in VALUE_COLORS])
    places = np.linspace(0.0, 1.0, len(stops))
    return np.stack([np.interp(share, places, stops[:, channel]) for channel in range(3)], axis=-1)
