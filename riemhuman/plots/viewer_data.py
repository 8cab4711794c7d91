"""The data in a viewer's page: surfaces as 16-bit integers, colours and values."""

from __future__ import annotations

import base64
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy import ndarray

from riemhuman.plots.body_plots import colour_limit
from riemhuman.plots.colors import VALUE_COLORS, value_colors
from riemhuman.plots.reduction import lighter_mesh
from riemhuman.surfaces.rendering import SKIN, View

# More vertices show no more detail in a window and make pages of paths large. Bodies with values
# keep more, so that each value shown is that of a triangle.
MAX_VERTICES = 7000
MAX_VERTICES_WITH_VALUES = 30000
_LEVELS = 2**16 - 1


@dataclass(frozen=True)
class ViewedBody:
    """A body or a path of bodies in a viewer.

    Attributes
    ----------
    label : str
        Label of the body.
    frames : array, shape (n_times, V, 3)
        Surfaces at equally spaced times, metres.
    color : tuple of float
        Red, green and blue between 0 and 1.
    values : array, shape (F,), optional
        Non-negative values of the triangles, shown as colours.
    largest : float, optional
        Value of the last colour; by default, 1 % of the values exceed it.
    value_label : str
        Label of the colour scale, such as the unit of the values.
    """

    label: str
    frames: ndarray
    color: tuple[float, float, float] = SKIN
    values: ndarray | None = None
    largest: float | None = None
    value_label: str = ""

    @property
    def limit(self) -> float:
        """Value of the last colour; 0 without values."""
        if self.values is None:
            return 0.0
        return colour_limit(self.values) if self.largest is None else self.largest


def payload(
    choices: Mapping[str, Sequence[ViewedBody]],
    faces: ndarray,
    view: View,
    max_vertices: int | None,
) -> dict[str, Any]:
    """Return the data of a viewer in types that JSON can hold.

    Parameters
    ----------
    choices : mapping of str to list of ViewedBody
        Bodies side by side in each choice.
    faces : array of int, shape (F, 3)
        Triangles of all bodies.
    view : View
        Initial direction from which the bodies are seen.
    max_vertices : int, optional
        Largest number of vertices; bodies with more are shown with fewer.

    Returns
    -------
    dict
    """
    every = [body for bodies in choices.values() for body in bodies]
    if max_vertices is None:
        valued = any(body.values is not None for body in every)
        max_vertices = MAX_VERTICES_WITH_VALUES if valued else MAX_VERTICES
    kept, light = lighter_mesh(every[0].frames[0], faces, max_vertices)
    dtype = "<u4" if len(kept) > _LEVELS else "<u2"
    return {
        "faces": _encode(light.astype(dtype)),
        "n_vertices": len(kept),
        "azimuth": view.azimuth,
        "elevation": view.elevation,
        "scale": VALUE_COLORS,
        "choices": [
            {"name": name, "bodies": [_body(body, faces, kept, light) for body in bodies]}
            for name, bodies in choices.items()
        ],
    }


def quantized(frames: ndarray) -> tuple[ndarray, ndarray, ndarray]:
    """Return coordinates as 16-bit integers.

    Parameters
    ----------
    frames : array, shape (n_times, V, 3)
        Surfaces, metres.

    Returns
    -------
    packed : array of uint16, shape (n_times, V, 3)
        Number of steps above the lowest value.
    low, step : array, shape (3,)
        Lowest value and step of each axis: low + step · packed is within half a step of the
        surfaces.
    """
    low = frames.min(axis=(0, 1))
    step = np.maximum(frames.max(axis=(0, 1)) - low, 1e-9) / _LEVELS
    return np.round((frames - low) / step).astype(np.uint16), low, step


def _body(body: ViewedBody, faces: ndarray, kept: ndarray, light: ndarray) -> dict[str, Any]:
    packed, low, step = quantized(body.frames[:, kept])
    red, green, blue = (round(255 * channel) for channel in body.color)
    written = {
        "label": body.label,
        "n_frames": len(packed),
        "frames": _encode(packed.astype("<u2")),
        "low": low.tolist(),
        "step": step.tolist(),
        "color": f"#{red:02x}{green:02x}{blue:02x}",
    }
    if body.values is not None:
        at_vertices = _at_vertices(body.values, faces, body.frames.shape[1])[kept]
        colors = value_colors(at_vertices, body.limit)
        whole = len(kept) == body.frames.shape[1]
        values = body.values if whole else at_vertices[light].mean(axis=1)
        written["colors"] = _encode(np.round(255 * colors).astype(np.uint8))
        written["values"] = _encode(values.astype("<f4"))
        written["largest"] = body.limit
        written["value_label"] = body.value_label
    return written


def _at_vertices(values: ndarray, faces: ndarray, n_vertices: int) -> ndarray:
    """Return the mean value of the triangles at each vertex."""
    sums, counts = np.zeros(n_vertices), np.zeros(n_vertices)
    for corner in faces.T:
        np.add.at(sums, corner, values)
        np.add.at(counts, corner, 1.0)
    return sums / np.maximum(counts, 1.0)


def _encode(array: ndarray) -> str:
    return base64.b64encode(np.ascontiguousarray(array).tobytes()).decode("ascii")
