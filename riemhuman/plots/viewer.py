"""Interactive views of bodies, paths and motions, in a notebook or as one self-contained HTML file.

A page contains the surfaces, and three.js draws them; pictures replace them without WebGL.
"""

from __future__ import annotations

import json
import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from html import escape

import numpy as np
from markupsafe import Markup
from numpy.typing import ArrayLike

from riemhuman.arrays import Image, Integers, JSONRecord, Points, Triangles
from riemhuman.checks import (
    checked,
    flag,
    instance,
    items_of,
    positive,
    real_array,
    values_of,
)
from riemhuman.checks.labels import names_of, text
from riemhuman.datasets import load_open_model
from riemhuman.errors import ArgumentError
from riemhuman.io.files import file_path, suffix_of, write_bytes, write_text
from riemhuman.io.mesh_arrays import check_mesh
from riemhuman.measurements import open_measurements
from riemhuman.mocap.motions import ArrayMotion, ModelMotion, Motion
from riemhuman.plots._films import FILM_ENDINGS, Film, save_film
from riemhuman.plots._ground_picture import GROUND
from riemhuman.plots._looks import eyes_of, shade_of
from riemhuman.plots._packing import deflated, packed
from riemhuman.plots._panels import Panel
from riemhuman.plots._web_files import fill
from riemhuman.plots._web_files import web_file as web_file
from riemhuman.plots._web_files import web_templates as web_templates
from riemhuman.plots.figures import SKIN, VALUE_COLORS
from riemhuman.plots.rendering import (
    as_surfaces,
    image_source,
    png_bytes,
    strip_picture,
    surface_values,
)
from riemhuman.plots.standing import on_the_ground
from riemhuman.plots.viewed_bodies import ViewedBody, body_record
from riemhuman.plots.windows import View

SAVED_VIEWS = (".html", ".htm", ".png", *FILM_ENDINGS)
"""Endings of the files that `save` of a viewer writes."""

_SECONDS = 2.4  # a path is played in, unless its duration is given
# Recordings with more frames are shown at fewer a second, but at no fewer than the second.
_MOST_FRAMES, _LEAST_RATE = 10_000, 30.0
_STILL_HEIGHT = 480
# Parts of the script, in their order.
_SCRIPTS = (
    "viewer_ground.js",
    "viewer_motion.js",
    "viewer_eyes.js",
    "viewer_smooth.js",
    "viewer_body.js",
    "viewer_values.js",
    "viewer_trail.js",
    "viewer_components.js",
    "viewer_panels.js",
    "scan_over_body.js",
    "warp.js",
    "viewer_export.js",
    "measurements.js",
    "map.js",
    "viewer_gestures.js",
    "viewer.js",
)
_NO_PART = 255


def page_styles() -> str:
    """Return the styles of viewers, as an element for the head of a page."""
    return f"<style>{web_file('plots', 'viewer.css')}</style>"


def page_scripts() -> str:
    """Return three.js and the scripts of viewers, as elements for the end of a page."""
    return (
        "<script>/* three.js 0.187.0, MIT licence, Copyright 2010-2026 three.js authors */\n"
        f"{web_file('plots', 'three.min.js')}</script>\n<script>{viewer_script()}</script>"
    )


def viewer_script() -> str:
    """Return the script of viewers, which needs three.js: the light, then one file a subject."""
    scripts = "".join(web_file("plots", name) for name in _SCRIPTS)
    light = json.dumps(json.loads(web_file("plots", "light.json")))
    ground = json.dumps(GROUND)
    return f"(() => {{\nconst LIGHT = {light};\nconst GROUND = {ground};\n{scripts}}})();\n"


@checked(
    choices=instance(Mapping, "a mapping of names to lists of bodies"),
    legend=text,
    title=text,
    description=text,
    seconds=positive,
    frames_per_second=positive,
    panel=instance(Panel),
)
@dataclass(frozen=True)
class Viewer:
    """An interactive view of bodies or paths, shown in notebooks or saved as a page.

    Parameters
    ----------
    faces : array of int, shape (F, 3)
        Triangles of all bodies.
    choices : mapping of str to list of ViewedBody
        Bodies side by side, for each choice by name.
    legend, title, description : str
        Label of the choices, title of the view, and text below the title of the page.
    seconds : float
        Duration of paths at speed 1, unless it follows from `frames_per_second`.
    frames_per_second : float, optional
        Rate of recordings: the page then shows seconds and frame numbers, and plays them in real
        time at speed 1. Without it, paths are shown from t = 0 to 1.
    panel : Panel, optional
        Something else drawn on the bodies, such as a scan, with controls next to them.

    Examples
    --------
    See `view_bodies`.
    """

    faces: Triangles
    choices: Mapping[str, Sequence[ViewedBody]]
    legend: str = "Show"
    title: str = "Bodies"
    description: str = ""
    seconds: float = _SECONDS
    frames_per_second: float | None = None
    panel: Panel | None = None

    def __post_init__(self) -> None:
        choices = {
            text(name, "choices"): items_of(bodies, f"choices[{name!r}]", "a list of ViewedBody")
            for name, bodies in self.choices.items()
        }
        if not (choices and all(choices.values())):
            raise ArgumentError("choices must hold at least one body, and none may be empty")
        object.__setattr__(self, "choices", choices)
        surfaces = [body.frames[0] for bodies in self.choices.values() for body in bodies]
        sizes = {len(surface) for surface in surfaces}
        if len(sizes) > 1:
            raise ArgumentError(f"all bodies must have the same vertices; found {sorted(sizes)}")
        object.__setattr__(self, "faces", check_mesh(surfaces[0], self.faces)[1])
        for bodies in self.choices.values():
            for body in bodies:
                if body.values is not None:
                    surface_values(body.values, len(surfaces[0]), len(self.faces))

    def __repr__(self) -> str:
        return f"Viewer({self.title!r}, choices={list(self.choices)})"

    def fragment(self, identifier: str) -> str:
        """Return the viewer as part of a page that includes `page_styles` and `page_scripts`.

        Parameters
        ----------
        identifier : str
            Identifier of the viewer, unique in the page.
        """
        text(identifier, "identifier")
        first_choice = next(iter(self.choices.values()))
        view = View()
        data: JSONRecord = {
            # Neighbouring triangles have similar numbers.
            "faces": packed(self.faces.astype("<u4")),
            "n_vertices": len(first_choice[0].frames[0]),
            "azimuth": view.azimuth,
            "elevation": view.elevation,
            "scale": VALUE_COLORS,
            "choices": [
                {"name": name, "bodies": [body_record(body, self.faces) for body in bodies]}
                for name, bodies in self.choices.items()
            ],
            "seconds": self.seconds,
        }
        if self.frames_per_second is not None:
            data["frames_per_second"] = self.frames_per_second
        shade = shade_of(self.faces)
        if shade is not None:
            data["shade"] = deflated(np.round(255 * shade).astype(np.uint8))
        eyes = eyes_of(self.faces)
        if eyes is not None:
            data["eyes"] = eyes.record()
        parts = _parts_of(self.faces)
        if parts:
            data["parts"] = _numbered_parts(parts, len(self.faces))
        if self.panel is not None:
            data["panel"] = {"name": self.panel.name, **self.panel.data()}
        return fill(
            "viewer.html",
            identifier=identifier,
            title=self.title,
            legend=self.legend,
            stills={
                name: image_source(self._picture(bodies, _STILL_HEIGHT))
                for name, bodies in self.choices.items()
            },
            moving=any(len(body.frames) > 1 for body in first_choice),
            has_values=any(body.values is not None for body in first_choice),
            shares=_component_shares(first_choice),
            panel="" if self.panel is None else self.panel.html(identifier),
            data=data,
        )

    def page(self) -> str:
        """Return the self-contained HTML page."""
        page = fill(
            "viewer_page.html",
            title=self.title,
            description=self.description,
            viewer=self.fragment("viewer"),
            scripts=Markup(page_scripts()),
            styles=Markup(page_styles()),
        )
        return str(page)

    def save(self, path: str | os.PathLike[str], *, progress: bool = False) -> None:
        """Write a page that works in any browser without a network connection, or a picture.

        Parameters
        ----------
        path : path_like
            ``x.html`` is the page; ``x.png`` is a picture of the first choice, twice as high as the
            one that the page shows without WebGL; ``x.gif`` and ``x.mp4`` (extra ``video``) are
            films of it, in which still bodies turn once.
        progress : bool
            Whether to show a progress bar while a film is drawn.

        Raises
        ------
        FileFormatError
            If the ending is another one.
        MissingDependencyError
            If the extra that writes films in MP4 is not installed.
        """
        file = file_path(path)
        ending = suffix_of(file, SAVED_VIEWS)
        bodies = next(iter(self.choices.values()))
        if ending in FILM_ENDINGS:
            if self.panel is not None and self.panel.picture(_STILL_HEIGHT) is not None:
                raise ArgumentError(
                    f"{file}: films show only bodies; save this view as .html or .png"
                )
            film = Film(bodies, self.faces, self._duration(bodies), self.frames_per_second)
            save_film(file, film, progress=progress)
        elif ending == ".png":
            write_bytes(file, png_bytes(self._picture(bodies, 960)))
        else:
            write_text(file, self.page())

    def _duration(self, bodies: Sequence[ViewedBody]) -> float:
        """Return the seconds that bodies play at speed 1."""
        if self.frames_per_second is None:
            return self.seconds
        return (max(body.n_times for body in bodies) - 1) / self.frames_per_second

    def _repr_html_(self) -> str:
        """Return the page in a frame, which separates it from the notebook."""
        return (
            f'<iframe title="{escape(self.title, quote=True)}" sandbox="allow-scripts" '
            'style="width: 100%; height: 36rem; border: 0" '
            f'srcdoc="{escape(self.page(), quote=True)}"></iframe>'
        )

    def _picture(self, bodies: Sequence[ViewedBody], height: int) -> Image:
        """Return a picture of a choice: bodies half way, or times of the path of a single body."""
        of_panel = None if self.panel is None else self.panel.picture(height)
        if of_panel is not None:
            return of_panel
        if len(bodies) == 1:
            (body,) = bodies
            places = np.linspace(0, len(body.frames) - 1, min(len(body.frames), 6))
            numbers = places.round().astype(int).tolist()
            surfaces = [body.surface(number) for number in numbers]
            colors = [body.colors(self.faces)] * len(numbers)
            return strip_picture(surfaces, self.faces, colors, height, ground=body.ground)
        surfaces = [body.surface(len(body.frames) // 2) for body in bodies]
        colors = [body.colors(self.faces) for body in bodies]
        names = [body.label for body in bodies]
        return strip_picture(surfaces, self.faces, colors, height, names=names)


def _parts_of(faces: Triangles) -> Mapping[str, Integers]:
    """Return the triangles of the parts of the open body model, if these are its triangles."""
    for resolution in ("coarse", "full"):
        model = load_open_model(resolution)
        if len(faces) == len(model.faces) and np.array_equal(faces, model.faces):
            measurement_set = open_measurements(resolution)
            return {} if measurement_set is None else measurement_set.parts
    return {}


def _numbered_parts(parts: Mapping[str, Integers], n_faces: int) -> JSONRecord:
    """Return the names of parts, and for each triangle the number of its part, or 255."""
    numbers = np.full(n_faces, _NO_PART, dtype=np.uint8)
    for number, triangles in enumerate(parts.values()):
        numbers[triangles] = number
    return {"names": list(parts), "numbers": deflated(numbers)}


def _component_shares(bodies: Sequence[ViewedBody]) -> list[float]:
    """Return the percentages of the variance that the first choice has sliders for."""
    changes = bodies[0].components
    return [] if changes is None else [100 * float(share) for share in changes.shares]


@checked(side_by_side=flag, keep_places=flag, title=text)
def view_path(
    path: ArrayLike | Sequence[object] | Motion | Mapping[str, ArrayLike | Motion],
    faces: ArrayLike | None = None,
    *,
    side_by_side: bool = False,
    legend: str = "Path",
    title: str = "Path of bodies",
    description: str = "",
    seconds: float | None = None,
    frames_per_second: float | None = None,
    keep_places: bool = False,
) -> Viewer:
    """Return an interactive view that plays a path, or several to choose from.

    Parameters
    ----------
    path : array_like, shape (n_times, V, 3), sequence of meshes, motion, or mapping of str to such
        Surfaces at equally spaced times, metres, y up; several paths by name. The page poses
        motions of body models by their bones, which keeps it small.
    faces : array_like, shape (F, 3), optional
        Triangles; none for mesh objects and motions.
    side_by_side : bool
        Whether to play several paths side by side instead.
    legend, title, description : str
        As for `Viewer`.
    seconds : float, optional
        Duration of the path at speed 1, by default 2.4.
    frames_per_second : float, optional
        Rate of a recording, instead of `seconds`; the page shows seconds and frame numbers. Of more
        than 10,000 frames it shows fewer, at least 30 a second, and says so.
    keep_places : bool
        Whether surfaces stay where they are, as those of recordings do; by default the surfaces of
        a path are moved so that they stand on the ground, see `on_the_ground`.

    Examples
    --------
    >>> bodies = rh.datasets.load_open_bodies("coarse")
    >>> viewer = rh.plots.view_path(bodies.points[:4], bodies.template.faces)
    >>> motion = rh.datasets.load_open_motions("coarse", sequences="knees")[0]
    >>> rate = motion.frames_per_second
    >>> viewer = rh.plots.view_path(motion, frames_per_second=rate)
    """
    paths = path if isinstance(path, Mapping) else {"": path}
    is_recording = keep_places or frames_per_second is not None
    frames: dict[str, Points | ModelMotion] = {}
    triangles = faces
    for name, one_path in paths.items():
        if isinstance(one_path, Motion):
            triangles = one_path.faces if triangles is None else triangles
            frames[name] = one_path if isinstance(one_path, ModelMotion) else one_path[:]
            continue
        surfaces, triangles = as_surfaces(one_path, triangles)
        places = real_array(surfaces, "path", ("n_times", "n_vertices", 3), batched=False)
        frames[name] = places if is_recording else on_the_ground(places)
    if frames_per_second is not None and max(map(len, frames.values())) > _MOST_FRAMES:
        step = max(1, int(frames_per_second / _LEAST_RATE))
        frames = {name: _every(step, surfaces) for name, surfaces in frames.items()}
        frames_per_second /= step
        if step > 1:
            description = f"{description} Showing one in {step} frames.".strip()
    if side_by_side:
        choices = {title: [ViewedBody(name, surfaces) for name, surfaces in frames.items()]}
    else:
        choices = {name: [ViewedBody("", surfaces)] for name, surfaces in frames.items()}
    if frames_per_second is not None and seconds is not None:
        raise ArgumentError("pass either seconds or frames_per_second; found both")
    return Viewer(
        values_of(triangles, "faces"),
        choices,
        legend,
        title,
        description,
        seconds=_SECONDS if seconds is None else seconds,
        frames_per_second=frames_per_second,
    )


def _every(step: int, surfaces: Points | ModelMotion) -> Points | ModelMotion:
    """Return the first of each `step` frames."""
    if not isinstance(surfaces, ModelMotion):
        return surfaces[::step]
    return ArrayMotion(
        (surfaces.subject, surfaces.sequence),
        surfaces.frames_per_second / step,
        surfaces.model,
        surfaces.betas,
        surfaces.pose_vectors[::step],
        surfaces.translations[::step],
    )


@checked(title=text)
def view_bodies(
    points: object,
    faces: ArrayLike | None = None,
    names: Sequence[str] | None = None,
    *,
    colors: ArrayLike | None = None,
    title: str = "Bodies",
) -> Viewer:
    """Return an interactive view of bodies side by side.

    Parameters
    ----------
    points : array_like, shape (n, V, 3) or (V, 3), mesh or sequence of meshes
        Surfaces, metres, y up; meshes as in `rh.io.as_arrays`.
    faces : array_like, shape (F, 3), optional
        Triangles; none for mesh objects.
    names : sequence of str, length n, optional
    colors : array_like, shape (n, 3), optional
        Red, green and blue of each body, between 0 and 1.
    title : str

    Examples
    --------
    >>> bodies = rh.datasets.load_open_bodies("coarse")
    >>> viewer = rh.plots.view_bodies(bodies.points[:2], bodies.template.faces)
    >>> viewer.save("bodies.html")
    """
    points, triangles = as_surfaces(points, faces)
    surfaces = real_array(points, "points", ("n_vertices", 3))
    if surfaces.size == 0:
        raise ArgumentError(f"points must hold at least one body; found shape {surfaces.shape}")
    surfaces = surfaces.reshape(-1, *surfaces.shape[-2:])
    given_names = [""] * len(surfaces) if names is None else names
    labels = names_of(given_names, "names", len(surfaces), "bodies")
    skin = np.tile(SKIN, (len(surfaces), 1))
    tints = skin if colors is None else real_array(colors, "colors", skin.shape, batched=False)
    bodies = [
        ViewedBody(label, surface[np.newaxis], (red, green, blue))
        for label, surface, (red, green, blue) in zip(labels, surfaces, tints.tolist(), strict=True)
    ]
    return Viewer(values_of(triangles, "faces"), {title: bodies}, title=title)
