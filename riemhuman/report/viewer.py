"""Bodies to turn and paths to play, in a notebook or as one HTML file that needs nothing else.

The surfaces travel inside the page, every coordinate as a 16-bit integer; three.js draws them.
"""

from __future__ import annotations

import base64
import json
import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from html import escape
from typing import Any

import numpy as np
from numpy import ndarray
from numpy.typing import ArrayLike

from riemhuman.checks import real_array
from riemhuman.errors import ArgumentError
from riemhuman.report.body_plots import colour_limit
from riemhuman.report.colors import value_colors
from riemhuman.report.reduction import lighter_mesh
from riemhuman.report.text_files import write_text
from riemhuman.report.web_files import scripts, styles
from riemhuman.surfaces.mesh_arrays import mesh_arrays
from riemhuman.surfaces.rendering import SKIN, View

# Above this, a body shows no more in a window, and a path becomes heavy.
MAX_VERTICES = 7000
_LEVELS = 2**16 - 1


@dataclass(frozen=True)
class ViewedBody:
    """A body, or a body in motion, as a viewer shows it.

    Attributes
    ----------
    label : str
        What is written below it.
    frames : array, shape (n_times, V, 3)
        Surfaces at equally spaced times, metres.
    color : tuple of float
        Red, green and blue between 0 and 1.
    values : array, shape (F,), optional
        Values of the triangles, shown as colours.
    """

    label: str
    frames: ndarray
    color: tuple[float, float, float] = SKIN
    values: ndarray | None = None


@dataclass(frozen=True)
class Viewer:
    """Bodies to turn and paths to play; notebooks show it, `save` makes a file of it.

    Parameters
    ----------
    faces : array of int, shape (F, 3)
        Triangles of all bodies.
    choices : mapping of str to list of ViewedBody
        What there is to choose from, and the bodies side by side in each choice.
    legend : str
        What is chosen.
    title : str
        What is shown.
    view : View
        Where the bodies are seen from at first.
    max_vertices : int
        Bodies with more vertices are shown by fewer of them.

    Examples
    --------
    >>> import riemhuman as rh
    >>> bodies = rh.datasets.load_open_bodies("coarse")
    >>> viewer = rh.report.view_bodies(bodies.points[:2], bodies.template.faces)
    >>> viewer.save("bodies.html")
    """

    faces: ndarray
    choices: Mapping[str, Sequence[ViewedBody]]
    legend: str = "Show"
    title: str = "Bodies"
    view: View = field(default_factory=View)
    max_vertices: int = MAX_VERTICES

    def __repr__(self) -> str:
        return f"Viewer({self.title!r}, choices={list(self.choices)})"

    def fragment(self, identifier: str) -> str:
        """Return the viewer as part of a page that also holds `styles` and `scripts`.

        Parameters
        ----------
        identifier : str
            Name of the viewer, unique in the page.

        Returns
        -------
        str
        """
        options = "".join(
            f'<label><input type="radio" name="{identifier}-choice" value="{index}"'
            f"{' checked' if index == 0 else ''}> {escape(name)}</label>"
            for index, name in enumerate(self.choices)
        )
        hidden = " hidden" if len(self.choices) == 1 else ""
        payload = json.dumps(self._payload(), separators=(",", ":")).replace("<", "\\u003c")
        return _FRAGMENT.format(
            identifier=escape(identifier, quote=True),
            title=escape(self.title, quote=True),
            legend=escape(self.legend),
            options=options,
            hidden=hidden,
            payload=payload,
        )

    def page(self) -> str:
        """Return a whole page with the viewer alone.

        Returns
        -------
        str
        """
        return _PAGE.format(
            title=escape(self.title), styles=styles(), body=self.fragment("viewer"), end=scripts()
        )

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write the page to a file that opens in any browser, without a connection.

        Parameters
        ----------
        path : path_like
            The file; an existing file is replaced.

        Raises
        ------
        FileError
            If the file cannot be written.
        """
        write_text(path, self.page())

    def _repr_html_(self) -> str:
        """Show the page in a frame of its own, so that nothing of the notebook meets it."""
        return (
            f'<iframe title="{escape(self.title, quote=True)}" sandbox="allow-scripts" '
            'style="width: 100%; height: 36rem; border: 0" '
            f'srcdoc="{escape(self.page(), quote=True)}"></iframe>'
        )

    def _payload(self) -> dict[str, Any]:
        every = [body for bodies in self.choices.values() for body in bodies]
        kept, light = lighter_mesh(every[0].frames[0], self.faces, self.max_vertices)
        dtype = "<u4" if len(kept) > _LEVELS else "<u2"
        return {
            "faces": _encode(light.astype(dtype)),
            "n_vertices": len(kept),
            "azimuth": self.view.azimuth,
            "elevation": self.view.elevation,
            "choices": [
                {"name": name, "bodies": [self._body(body, kept) for body in bodies]}
                for name, bodies in self.choices.items()
            ],
        }

    def _body(self, body: ViewedBody, kept: ndarray) -> dict[str, Any]:
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
            values = _at_vertices(body.values, self.faces, body.frames.shape[1])[kept]
            colors = value_colors(values, colour_limit(body.values))
            written["colors"] = _encode(np.round(255 * colors).astype(np.uint8))
        return written


def view_path(
    path: ArrayLike | Mapping[str, ArrayLike],
    faces: ArrayLike,
    *,
    side_by_side: bool = False,
    legend: str = "Path",
    title: str = "Path of bodies",
    view: View | None = None,
) -> Viewer:
    """Show a path to play, scrub and turn, or several to choose from.

    Parameters
    ----------
    path : array_like, shape (n_times, V, 3), or mapping of str to such
        Surfaces at equally spaced times, metres, y up; several paths by name.
    faces : array_like, shape (F, 3)
        Triangles.
    side_by_side : bool
        Whether several paths run beside each other instead.
    legend : str
        What is chosen.
    title : str
        What is shown.
    view : View, optional
        Where the bodies are seen from at first.

    Returns
    -------
    Viewer

    Raises
    ------
    ArgumentError
        If a path or the triangles are malformed, or paths differ in their vertices.

    Examples
    --------
    >>> import riemhuman as rh
    >>> bodies = rh.datasets.load_open_bodies("coarse")
    >>> viewer = rh.report.view_path(bodies.points[:4], bodies.template.faces)
    >>> viewer.save("path.html")
    """
    paths = path if isinstance(path, Mapping) else {"": path}
    if not paths:
        raise ArgumentError("path is empty; at least one path is needed")
    bodies = {}
    for name, frames in paths.items():
        frames = real_array(frames, "path", ("n_times", "n_vertices", 3), batched=False)
        bodies[name] = ViewedBody(name, frames)
    choices = {name: [ViewedBody("", body.frames)] for name, body in bodies.items()}
    if side_by_side:
        choices = {title: list(bodies.values())}
    return _viewer(faces, choices, legend, title, view)


def view_bodies(
    points: ArrayLike,
    faces: ArrayLike,
    names: Sequence[str] | None = None,
    *,
    values: ArrayLike | None = None,
    title: str = "Bodies",
    view: View | None = None,
) -> Viewer:
    """Show bodies side by side, to turn.

    Parameters
    ----------
    points : array_like, shape (n, V, 3) or (V, 3)
        Surfaces, metres, y up.
    faces : array_like, shape (F, 3)
        Triangles.
    names : sequence of str, length n, optional
        What is written below each.
    values : array_like, shape (n, F) or (F,), optional
        A value of at least 0 for every triangle, such as `contributions` per area.
    title : str
        What is shown.
    view : View, optional
        Where the bodies are seen from at first.

    Returns
    -------
    Viewer

    Raises
    ------
    ArgumentError
        If an array does not fit.

    Examples
    --------
    >>> import riemhuman as rh
    >>> bodies = rh.datasets.load_open_bodies("coarse")
    >>> viewer = rh.report.view_bodies(bodies.points[:2], bodies.template.faces)
    >>> viewer.save("bodies.html")
    """
    surfaces = real_array(points, "points", ("n_vertices", 3))
    surfaces = surfaces.reshape(-1, *surfaces.shape[-2:])
    n_bodies = len(surfaces)
    labels = [""] * n_bodies if names is None else list(names)
    if len(labels) != n_bodies or n_bodies == 0:
        raise ArgumentError(f"{len(labels)} names found for {n_bodies} bodies")
    shades: list[ndarray | None] = [None] * n_bodies
    if values is not None:
        n_faces = len(np.asarray(faces))
        shades = list(real_array(values, "values", (n_faces,)).reshape(-1, n_faces))
        if len(shades) != n_bodies:
            raise ArgumentError(f"{len(shades)} rows of values found for {n_bodies} bodies")
    bodies = [
        ViewedBody(label, surface[None], values=shade)
        for label, surface, shade in zip(labels, surfaces, shades, strict=True)
    ]
    return _viewer(faces, {title: bodies}, "Show", title, view)


def quantized(frames: ndarray) -> tuple[ndarray, ndarray, ndarray]:
    """Return coordinates as integers of 16 bits.

    Parameters
    ----------
    frames : array, shape (n_times, V, 3)
        Surfaces.

    Returns
    -------
    packed : array of uint16, shape (n_times, V, 3)
        Steps above the lowest value.
    low, step : array, shape (3,)
        Lowest value and size of a step of each axis, so that low + step · packed is within half a
        step of the surfaces.
    """
    low = frames.min(axis=(0, 1))
    step = np.maximum(frames.max(axis=(0, 1)) - low, 1e-9) / _LEVELS
    return np.round((frames - low) / step).astype(np.uint16), low, step


def _viewer(
    faces: ArrayLike,
    choices: dict[str, list[ViewedBody]],
    legend: str,
    title: str,
    view: View | None,
) -> Viewer:
    every = [body for bodies in choices.values() for body in bodies]
    _, triangles = mesh_arrays(every[0].frames[0], faces)
    sizes = {body.frames.shape[1] for body in every}
    if len(sizes) > 1:
        raise ArgumentError(f"all bodies must have the same vertices; found {sorted(sizes)}")
    return Viewer(triangles, choices, legend, title, View() if view is None else view)


def _at_vertices(values: ndarray, faces: ndarray, n_vertices: int) -> ndarray:
    """Return the mean of the values of the triangles at each vertex."""
    sums, counts = np.zeros(n_vertices), np.zeros(n_vertices)
    for corner in faces.T:
        np.add.at(sums, corner, values)
        np.add.at(counts, corner, 1.0)
    return sums / np.maximum(counts, 1.0)


def _encode(array: ndarray) -> str:
    return base64.b64encode(np.ascontiguousarray(array).tobytes()).decode("ascii")


_FRAGMENT = """<div class="viewer" id="{identifier}" role="group" aria-label="{title}">
<div class="stage" data-part="stage">
<canvas data-part="canvas" tabindex="0" role="img"
aria-label="{title}. Drag, or use the arrow keys, to turn; plus and minus change the size.">
</canvas>
<div data-part="labels" aria-hidden="true"></div>
</div>
<noscript><p class="message">Turning the bodies needs JavaScript.</p></noscript>
<p class="message" data-part="message" hidden>This browser draws no 3-D graphics (WebGL).</p>
<div class="controls" data-part="controls">
<fieldset{hidden}><legend>{legend}</legend>{options}</fieldset>
<div class="time" data-part="running">
<button type="button" data-part="play">Play</button>
<label for="{identifier}-time">Time</label>
<input id="{identifier}-time" data-part="time" type="range" min="0" max="200" value="0">
<output for="{identifier}-time" data-part="moment">0.00</output>
</div>
<div class="turn" role="group" aria-label="View">
<button type="button" data-action="left" aria-label="Turn left">←</button>
<button type="button" data-action="right" aria-label="Turn right">→</button>
<button type="button" data-action="farther" aria-label="Smaller">−</button>
<button type="button" data-action="closer" aria-label="Larger">+</button>
<button type="button" data-action="reset">Reset</button>
</div>
</div>
<script type="application/json" data-part="data">{payload}</script>
</div>"""

_PAGE = """<!doctype html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<meta name="color-scheme" content="light dark">
<title>{title}</title>
<style>
:root {{ color-scheme: light dark; }}
body {{ margin: 0.8rem; font: 1rem/1.5 system-ui, sans-serif; }}
h1 {{ font-size: 1rem; font-weight: 600; margin: 0; }}
</style>
{styles}
</head>
<body>
<h1>{title}</h1>
{body}
{end}
</body>
</html>
"""
