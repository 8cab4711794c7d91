"""Small pictures of surfaces, which notebooks show for objects that have `_repr_html_`."""

from __future__ import annotations

import base64
import struct
import zlib
from collections.abc import Callable, Sequence
from html import escape

import numpy as np
from numpy import ndarray
from numpy.typing import ArrayLike

from riemhuman.surfaces.rendering import SKIN, View, Window, render, window_around

_HEIGHT = 160
_MOST_SHOWN = 8


def surfaces_html(surfaces: Sequence[ndarray] | ndarray, faces: ndarray, caption: str) -> str:
    """Return a picture of at most eight surfaces side by side, with a caption.

    Parameters
    ----------
    surfaces : sequence of array, each of shape (V, 3)
        Surfaces in metres, y up; of more than eight, eight evenly spaced ones are shown.
    faces : array of int, shape (F, 3)
        Triangles.
    caption : str
        Plain text below the picture.

    Returns
    -------
    str
        An HTML fragment that needs no other file.
    """

    def draw(f: ndarray, view: View, window: Window) -> ndarray:
        return render(f, faces, height=_HEIGHT, view=view, window=window)

    return _figure(surfaces, draw, caption)


def vertices_html(surfaces: Sequence[ndarray] | ndarray, caption: str) -> str:
    """Return a picture of the vertices of at most eight surfaces side by side, with a caption.

    Parameters
    ----------
    surfaces : sequence of array, each of shape (V, 3)
        Surfaces in metres, y up; of more than eight, eight evenly spaced ones are shown.
    caption : str
        Plain text below the picture.

    Returns
    -------
    str
        An HTML fragment that needs no other file.
    """
    return _figure(surfaces, _draw_vertices, caption)


def strip_picture(
    surfaces: Sequence[ndarray],
    faces: ndarray,
    colors: Sequence[ArrayLike],
    view: View,
    height: int = _HEIGHT,
) -> ndarray:
    """Return a picture of at most eight surfaces side by side, at the same scale.

    Parameters
    ----------
    surfaces : sequence of array, each of shape (V, 3)
        At least one surface, metres, y up; of more than eight, eight evenly spaced ones are shown.
    faces : array of int, shape (F, 3)
        Triangles.
    colors : sequence of array_like, each of shape (3,) or (F, 3)
        Colour of each surface, or colours of its triangles.
    view : View
        View direction.
    height : int
        Height of the picture in pixels.

    Returns
    -------
    array of uint8, shape (height, width, 4)
    """
    shown = _shown(len(surfaces))
    drawn = iter([colors[i] for i in shown])

    def draw(f: ndarray, view: View, window: Window) -> ndarray:
        return render(f, faces, height=height, view=view, window=window, color=next(drawn))

    return _strip([surfaces[i] for i in shown], draw, view)


def _figure(
    surfaces: Sequence[ndarray] | ndarray,
    draw: Callable[[ndarray, View, Window], ndarray],
    caption: str,
) -> str:
    """Return a strip of pictures with a caption."""
    text = f"<figcaption>{escape(caption)}</figcaption>"
    if len(surfaces) == 0:
        return f"<figure>{text}</figure>"
    strip = _strip([surfaces[i] for i in _shown(len(surfaces))], draw, View())
    source = base64.b64encode(png_bytes(strip)).decode()
    image = f'<img src="data:image/png;base64,{source}" alt="{escape(caption, quote=True)}">'
    return f'<figure style="margin:0">{image}{text}</figure>'


def _shown(n_surfaces: int) -> ndarray:
    return np.linspace(0, n_surfaces - 1, min(n_surfaces, _MOST_SHOWN)).round().astype(int)


def _strip(
    surfaces: Sequence[ndarray], draw: Callable[[ndarray, View, Window], ndarray], view: View
) -> ndarray:
    """Return pictures of centred surfaces side by side, at the same scale."""
    chosen = np.stack(surfaces)
    chosen = chosen - (chosen.min(axis=1, keepdims=True) + chosen.max(axis=1, keepdims=True)) / 2
    window = window_around(chosen, view)
    return np.concatenate([draw(f, view, window) for f in chosen], axis=1)


def _draw_vertices(f: ndarray, view: View, window: Window) -> ndarray:
    """Draw vertices as dots; near ones are lighter and cover far ones."""
    width = max(1, round(_HEIGHT * window.width / window.height))
    picture = np.zeros((_HEIGHT, width, 4), dtype=np.uint8)
    seen = view.turned(f)
    seen = seen[np.argsort(seen[:, 2])]
    across = (seen[:, 0] - window.centre[0]) / window.width + 0.5
    down = 0.5 - (seen[:, 1] - window.centre[1]) / window.height
    rows = np.clip((down * _HEIGHT).astype(int), 0, _HEIGHT - 1)
    columns = np.clip((across * width).astype(int), 0, width - 1)
    depth = np.ptp(seen[:, 2]) or 1.0
    light = 0.35 + 0.65 * (seen[:, 2] - seen[0, 2]) / depth
    picture[rows, columns, :3] = np.round(255 * light[:, None] * np.array(SKIN))
    picture[rows, columns, 3] = 255
    return picture


def png_bytes(picture: ndarray) -> bytes:
    """Return a picture as a PNG file.

    Parameters
    ----------
    picture : array of uint8, shape (height, width, 4)
        Red, green, blue and opacity.
    """
    height, width, _ = picture.shape
    # Each row begins with the number of its filter; 0 means none.
    rows = np.zeros((height, 1 + 4 * width), dtype=np.uint8)
    rows[:, 1:] = picture.reshape(height, -1)
    header = struct.pack(">IIBBBBB", width, height, 8, 6, 0, 0, 0)
    chunks = ((b"IHDR", header), (b"IDAT", zlib.compress(rows.tobytes(), 9)), (b"IEND", b""))
    return b"\x89PNG\r\n\x1a\n" + b"".join(
        struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))
        for kind, data in chunks
    )
