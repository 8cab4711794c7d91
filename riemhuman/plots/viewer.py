"""Interactive views of bodies and paths, in a notebook or as one self-contained HTML file.

The page contains the surfaces, and three.js draws them; pictures replace them without WebGL.
"""

from __future__ import annotations

import base64
import json
import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from html import escape
from string import Template

import numpy as np
from numpy import ndarray
from numpy.typing import ArrayLike

from riemhuman.checks import real_array
from riemhuman.errors import ArgumentError
from riemhuman.io.files import write_text
from riemhuman.io.mesh_arrays import check_mesh
from riemhuman.plots.body_plots import colour_limit
from riemhuman.plots.colors import value_colors
from riemhuman.plots.viewer_data import ViewedBody, payload
from riemhuman.plots.web_files import scripts, styles, web_file
from riemhuman.surfaces.html_pictures import png_bytes, strip_picture
from riemhuman.surfaces.rendering import View

_STILL_HEIGHT = 240


@dataclass(frozen=True)
class Viewer:
    """An interactive view of bodies or paths, shown in notebooks or saved as a page.

    Parameters
    ----------
    faces : array of int, shape (F, 3)
        Triangles of all bodies.
    choices : mapping of str to list of ViewedBody
        Bodies side by side, for each choice by name.
    legend : str
        Label of the choices.
    title : str
        Title of the view.
    view : View
        Initial direction from which the bodies are seen.
    max_vertices : int, optional
        Largest number of vertices; bodies with more are shown with fewer. By default 7,000, or
        30,000 for triangles with values.
    description : str
        Text below the title of the page.

    Examples
    --------
    >>> import riemhuman as rh
    >>> bodies = rh.datasets.load_open_bodies("coarse")
    >>> viewer = rh.plots.view_bodies(bodies.points[:2], bodies.template.faces)
    >>> viewer.save("bodies.html")
    """

    faces: ndarray
    choices: Mapping[str, Sequence[ViewedBody]]
    legend: str = "Show"
    title: str = "Bodies"
    view: View = field(default_factory=View)
    max_vertices: int | None = None
    description: str = ""

    def __repr__(self) -> str:
        return f"Viewer({self.title!r}, choices={list(self.choices)})"

    def fragment(self, identifier: str) -> str:
        """Return the viewer as part of a page that includes `styles` and `scripts`.

        Parameters
        ----------
        identifier : str
            Identifier of the viewer, unique in the page.

        Returns
        -------
        str
        """
        options = "".join(
            f'<label><input type="radio" name="{identifier}-choice" value="{index}"'
            f"{' checked' if index == 0 else ''}> {escape(name)}</label>"
            for index, name in enumerate(self.choices)
        )
        stills = "".join(
            f'<img class="still" src="{self._still(bodies)}" '
            f'alt="{escape(f"Picture of the bodies: {name or self.title}", quote=True)}"'
            f"{' hidden' if index else ''}>"
            for index, (name, bodies) in enumerate(self.choices.items())
        )
        shown_first = next(iter(self.choices.values()))
        data = payload(self.choices, self.faces, self.view, self.max_vertices)
        return Template(web_file("viewer.html")).substitute(
            identifier=escape(identifier, quote=True),
            title=escape(self.title, quote=True),
            legend=escape(self.legend),
            options=options,
            hidden=" hidden" if len(self.choices) == 1 else "",
            still="" if any(len(body.frames) > 1 for body in shown_first) else " hidden",
            stills=stills,
            payload=json.dumps(data, separators=(",", ":")).replace("<", "\\u003c"),
        )

    def page(self) -> str:
        """Return a complete HTML page with only the viewer.

        Returns
        -------
        str
        """
        return Template(web_file("viewer_page.html")).substitute(
            title=escape(self.title),
            description=f"<p>{escape(self.description)}</p>" if self.description else "",
            styles=styles(),
            body=self.fragment("viewer"),
            end=scripts(),
        )

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write the page to a file for any browser, without a network connection.

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
        """Return the page in a frame, which separates it from the notebook."""
        return (
            f'<iframe title="{escape(self.title, quote=True)}" sandbox="allow-scripts" '
            'style="width: 100%; height: 36rem; border: 0" '
            f'srcdoc="{escape(self.page(), quote=True)}"></iframe>'
        )

    def _still(self, bodies: Sequence[ViewedBody]) -> str:
        """Return a picture of a choice: bodies half way, or times of the path of a single body."""
        if len(bodies) == 1:
            (body,) = bodies
            places = np.linspace(0, len(body.frames) - 1, min(len(body.frames), 6))
            bodies = [replace(body, frames=body.frames[[round(place)]]) for place in places]
        surfaces = [body.frames[len(body.frames) // 2] for body in bodies]
        colors = [
            body.color if body.values is None else value_colors(body.values, body.limit)
            for body in bodies
        ]
        picture = strip_picture(surfaces, self.faces, colors, self.view, _STILL_HEIGHT)
        return f"data:image/png;base64,{base64.b64encode(png_bytes(picture)).decode('ascii')}"


def view_path(
    path: ArrayLike | Mapping[str, ArrayLike],
    faces: ArrayLike,
    *,
    side_by_side: bool = False,
    legend: str = "Path",
    title: str = "Path of bodies",
    description: str = "",
    view: View | None = None,
) -> Viewer:
    """Return an interactive view that plays a path, or several to choose from.

    Parameters
    ----------
    path : array_like, shape (n_times, V, 3), or mapping of str to such
        Surfaces at equally spaced times, metres, y up; several paths by name.
    faces : array_like, shape (F, 3)
        Triangles.
    side_by_side : bool
        Whether to play several paths beside each other instead.
    legend : str
        Label of the choices.
    title : str
        Title of the view.
    description : str
        Text below the title of the page.
    view : View, optional
        Initial direction from which the bodies are seen.

    Returns
    -------
    Viewer

    Raises
    ------
    ArgumentError
        If a path or the triangles are malformed, or paths have different numbers of vertices.

    Examples
    --------
    >>> import riemhuman as rh
    >>> bodies = rh.datasets.load_open_bodies("coarse")
    >>> viewer = rh.plots.view_path(bodies.points[:4], bodies.template.faces)
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
    return _viewer(faces, choices, legend, title, description, view)


def view_bodies(
    points: ArrayLike,
    faces: ArrayLike,
    names: Sequence[str] | None = None,
    *,
    values: ArrayLike | None = None,
    value_label: str = "",
    title: str = "Bodies",
    description: str = "",
    view: View | None = None,
) -> Viewer:
    """Return an interactive view of bodies side by side.

    Parameters
    ----------
    points : array_like, shape (n, V, 3) or (V, 3)
        Surfaces, metres, y up.
    faces : array_like, shape (F, 3)
        Triangles.
    names : sequence of str, length n, optional
        Labels of the bodies.
    values : array_like, shape (n, F) or (F,), optional
        Non-negative value of each triangle, such as `contributions` per area. All bodies share one
        colour scale, whose end 1 % of the values exceed.
    value_label : str
        Label of the colour scale, such as the unit of the values.
    title : str
        Title of the view.
    description : str
        Text below the title of the page.
    view : View, optional
        Initial direction from which the bodies are seen.

    Returns
    -------
    Viewer

    Raises
    ------
    ArgumentError
        If an array has the wrong shape or values.

    Examples
    --------
    >>> import riemhuman as rh
    >>> bodies = rh.datasets.load_open_bodies("coarse")
    >>> viewer = rh.plots.view_bodies(bodies.points[:2], bodies.template.faces)
    >>> viewer.save("bodies.html")
    """
    surfaces = real_array(points, "points", ("n_vertices", 3))
    surfaces = surfaces.reshape(-1, *surfaces.shape[-2:])
    n_bodies = len(surfaces)
    labels = [""] * n_bodies if names is None else list(names)
    if len(labels) != n_bodies or n_bodies == 0:
        raise ArgumentError(
            f"names must have one entry per body; found {len(labels)} for {n_bodies} bodies"
        )
    shades: list[ndarray | None] = [None] * n_bodies
    largest = None
    if values is not None:
        n_faces = len(np.asarray(faces))
        rows = real_array(values, "values", (n_faces,)).reshape(-1, n_faces)
        shades, largest = list(rows), colour_limit(rows)
        if len(shades) != n_bodies:
            raise ArgumentError(
                f"values must have one row per body; found {len(shades)} for {n_bodies} bodies"
            )
    bodies = [
        ViewedBody(label, surface[None], values=shade, largest=largest, value_label=value_label)
        for label, surface, shade in zip(labels, surfaces, shades, strict=True)
    ]
    return _viewer(faces, {title: bodies}, "Show", title, description, view)


def _viewer(
    faces: ArrayLike,
    choices: dict[str, list[ViewedBody]],
    legend: str,
    title: str,
    description: str,
    view: View | None,
) -> Viewer:
    every = [body for bodies in choices.values() for body in bodies]
    _, triangles = check_mesh(every[0].frames[0], faces)
    sizes = {body.frames.shape[1] for body in every}
    if len(sizes) > 1:
        raise ArgumentError(f"all bodies must have the same vertices; found {sorted(sizes)}")
    return Viewer(triangles, choices, legend, title, view or View(), description=description)
