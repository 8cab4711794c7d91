"""The ground below a body in pictures: grid and shadow of the page.

Both read `ground.json`: the shadow has cells in each direction, and layers for the contact of the
feet and for the sky that the body hides, with heights as shares of the body's and blurs in cells to
each side; lines are metres apart, every fourth is stronger.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import TypeAlias

import numpy as np
from scipy.ndimage import uniform_filter

from riemhuman.arrays import Array, Image, Points
from riemhuman.plots._web_files import web_file
from riemhuman.plots.figures import rgb
from riemhuman.plots.windows import View, Window, window_around

GROUND = json.loads(web_file("plots", "ground.json"))
_CELLS = int(GROUND["cells"])
_INK = 255 * np.array(rgb(GROUND["ink"]["light"]))
SHOWN = 0.85  # least share of the radius in pictures

# Rows and columns of a picture.
Part: TypeAlias = "tuple[slice[int, int, None], slice[int, int, None]]"


@dataclass(frozen=True)
class Ground:
    """A disc below a body: its middle on the ground, the radius, and the height of the body.

    `passed` is how far the ground has moved below a body that the picture follows.
    """

    middle: Points
    radius: float
    height: float
    passed: Array = field(default_factory=lambda: np.zeros(2))

    @classmethod
    def below(
        cls,
        frames: Sequence[Points],
        lowest: float | None = None,
        widest: float = float("inf"),
    ) -> Ground:
        """Return the ground below a body in some frames, each of shape (V, 3).

        It is at the height of the lowest vertex, unless that is given, and of a radius of at most
        `widest`.
        """
        low = np.min([frame.min(axis=0) for frame in frames], axis=0)
        high = np.max([frame.max(axis=0) for frame in frames], axis=0)
        level = low[1] if lowest is None else lowest
        middle = np.array([(low[0] + high[0]) / 2, level, (low[2] + high[2]) / 2])
        around = max(float(np.linalg.norm((f - middle)[:, ::2], axis=1).max()) for f in frames)
        height = float(high[1] - low[1])
        return cls(middle, min(1.15 * max(around, 0.3 * height), widest), height)

    def window(self, frames: Sequence[Points], view: View) -> Window:
        """Return the window that shows a body in some frames, and most of the ground."""
        boxes = [window_around(frame, view) for frame in frames]
        centres = np.array([box.centre for box in boxes])
        halves = np.array([(box.width, box.height) for box in boxes]) / 2
        low, high = (centres - halves).min(axis=0), (centres + halves).max(axis=0)
        across, up, _ = view.rotate(self.middle)
        reach = SHOWN * self.radius
        tilt = abs(float(np.sin(np.radians(view.elevation))))
        low = np.minimum(low, [across - reach, up - reach * tilt])
        high = np.maximum(high, [across + reach, up + reach * tilt])
        centre, size = (low + high) / 2, high - low
        return Window((float(centre[0]), float(centre[1])), float(size[0]), float(size[1]))

    def under(self, picture: Image, surface: Points, view: View, window: Window) -> Array:
        """Return a picture of a body with the ground under it.

        Pictures have shape (rows, columns, 4), colours and opacity up to 255.
        """
        laid = picture.astype(np.float64)
        # The ground is seen as an ellipse; from the side, as a line.
        across, up, _ = view.rotate(self.middle)
        flat = self.radius * abs(float(np.sin(np.radians(view.elevation))))
        pixel, (n_rows, n_columns) = window.height / len(picture), picture.shape[:2]
        middle = np.array([window.centre[1] - up, across - window.centre[0]]) / pixel
        reach = np.array([flat, self.radius]) / pixel
        shape = np.array([n_rows, n_columns])
        first = np.clip(np.floor(shape / 2 + middle - reach), 0, shape).astype(int)
        last = np.clip(np.ceil(shape / 2 + middle + reach), 0, shape).astype(int)
        if flat < pixel or (first >= last).any():
            return laid
        part = slice(first[0], last[0]), slice(first[1], last[1])
        laid[part] = over(
            laid[part], self._picture(surface, view, window, (n_rows, n_columns), part)
        )
        return laid

    def _picture(
        self,
        surface: Points,
        view: View,
        window: Window,
        shape: tuple[int, int],
        part: Part,
    ) -> Array:
        """Return the ground in a part of a picture of some shape."""
        place, wide = self._seen(view, window, shape, part)
        from_middle = np.linalg.norm(place - self.middle[::2], axis=-1) / self.radius
        fade = 1 - _smooth_step(0.35, 1.0, from_middle)
        on_ground, spacing = place + self.passed, GROUND["spacing"]
        lines = np.maximum(
            GROUND["line"] * _lines(on_ground, wide, spacing),
            GROUND["strong_line"] * _lines(on_ground, wide, GROUND["strong"] * spacing),
        )
        grid = np.where(from_middle < 1, fade * (GROUND["grid"] + lines), 0.0)
        cells = (place - self.middle[::2]) / self.radius * _CELLS / 2 + _CELLS / 2
        columns, rows = np.moveaxis(cells.astype(int).clip(0, _CELLS - 1), -1, 0)
        shadow = self._shadow(surface)[columns, rows]
        dark = GROUND["darkest"] * shadow * (1 - _smooth_step(0.6, 1.0, from_middle))
        opacity = dark + grid * (1 - dark)
        color = _INK * (grid * (1 - dark) / np.maximum(opacity, 1e-6))[..., None]
        return np.concatenate([color, 255 * opacity[..., None]], axis=-1)

    def _seen(
        self,
        view: View,
        window: Window,
        shape: tuple[int, int],
        part: Part,
    ) -> tuple[Array, Array]:
        """Return the positions x, z on the ground that pixels show, and their change per pixel."""
        rows, columns = shape
        pixel = window.height / rows
        x = window.centre[0] + (np.arange(columns)[part[1]] + 0.5 - columns / 2) * pixel
        y = window.centre[1] - (np.arange(rows)[part[0]] + 0.5 - rows / 2) * pixel
        right, up, towards = view.rotate(np.eye(3)).T
        x, y = np.meshgrid(x, y)
        depth = (self.middle[1] - y * up[1]) / towards[1]
        points = x[..., None] * right + y[..., None] * up + depth[..., None] * towards
        per_row = pixel * np.abs(up - up[1] / towards[1] * towards)
        return points[..., ::2], (pixel * np.abs(right) + per_row)[::2]

    def _shadow(self, surface: Points) -> Array:
        """Return how dark each cell below a surface is, from 0 to 1."""
        cells = ((surface - self.middle)[:, ::2] / self.radius + 1) * _CELLS / 2
        above = np.maximum(surface[:, 1] - self.middle[1], 0) / self.height
        # Each vertex stands for the same share of the surface, about two square metres a body.
        share = 0.65 * self.height**2 / len(surface) / (2 * self.radius / _CELLS) ** 2
        light = np.ones((_CELLS, _CELLS))
        for layer in GROUND["layers"]:
            cover, _, _ = np.histogram2d(
                cells[:, 0],
                cells[:, 1],
                bins=_CELLS,
                range=[[0, _CELLS], [0, _CELLS]],
                weights=share * np.exp(-above / layer["height"]),
            )
            for _ in range(2):
                cover = uniform_filter(cover, 2 * layer["blur"] + 1, mode="constant")
            light *= 1 - layer["strength"] * (1 - np.exp(-cover))
        return np.asarray(1 - light)


def window_of(surface: Points, view: View, *, ground: bool) -> Window:
    """Return the window that shows a surface, and the ground below it."""
    if ground:
        return Ground.below([surface]).window([surface], view)
    return window_around(surface, view)


def _lines(place: Array, wide: Array, spacing: float) -> Array:
    """Return how much of each pixel a grid line covers; close lines become grey."""
    change = wide / spacing
    near = np.abs((place / spacing - 0.5) % 1 - 0.5) / change
    drawn = np.clip(1.2 - near, 0, 1) * np.clip(0.6 / change - 0.5, 0, 1)
    return np.asarray(drawn.max(axis=-1))


def _smooth_step(low: float, high: float, values: Array) -> Array:
    share = np.clip((values - low) / (high - low), 0, 1)
    return np.asarray(share**2 * (3 - 2 * share))


def over(front: Array, back: Array) -> Array:
    """Lay a picture over another, shape (rows, columns, 4), colours and opacity up to 255."""
    # Shares of the colour that come from the front and from the back.
    front_share = front[..., 3:] / 255
    back_share = back[..., 3:] / 255 * (1 - front_share)
    opacity = front_share + back_share
    colors = front[..., :3] * front_share + back[..., :3] * back_share
    color = colors / np.maximum(opacity, 1e-9)
    return np.concatenate([color, 255 * opacity], axis=-1)
