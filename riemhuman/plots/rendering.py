"""Pictures of surfaces without display or graphics card, by a depth buffer.

Surfaces are drawn in parallel projection with smooth shading on a transparent background.
"""

from __future__ import annotations

import base64
import io
import json
from collections.abc import Sequence
from functools import cache
from html import escape
from importlib.resources import files

import numpy as np
import PIL.Image
from numpy.typing import ArrayLike

from riemhuman.arrays import Array, Image, Integers, Points, Triangles
from riemhuman.checks import (
    checked,
    flag,
    instance,
    length_of,
    real_array,
    values_of,
)
from riemhuman.checks.labels import text
from riemhuman.errors import ArgumentError
from riemhuman.io import as_arrays
from riemhuman.io.mesh_arrays import check_mesh
from riemhuman.kernels.compilation import compiled
from riemhuman.kernels.surface import vertex_normals
from riemhuman.plots._ground_picture import Ground, window_of
from riemhuman.plots._looks import eyes_of, shade_of
from riemhuman.plots.figures import SKIN, written
from riemhuman.plots.windows import (
    View,
    Window,
    a_height,
    a_view,
    same_heights,
    window_around,
)

_REFLECTED = 0.04  # share of the light that skin mirrors when seen from the front
_SAMPLES = 2  # of a pixel in each direction, which smooth the outline
_STRIP_HEIGHT = 160  # pixels
_MOST_SHOWN = 8  # surfaces in a strip
_DEPTH_SHADE = 0.55  # darkness of the farthest points


def as_surfaces(points: object, faces: ArrayLike | None = None) -> tuple[object, ArrayLike]:
    """Return surfaces and their triangles, from arrays or from one or several mesh objects."""
    if faces is not None:
        return points, faces
    if not isinstance(points, (list, tuple)):
        return as_arrays(points)
    if not points:
        raise ArgumentError("points must hold at least one mesh; found none")
    meshes = [as_arrays(mesh) for mesh in points]
    _, first_triangles = meshes[0]
    if not all(np.array_equal(triangles, first_triangles) for _, triangles in meshes):
        raise ArgumentError("all meshes must have the same triangles")
    return np.stack([vertices for vertices, _ in meshes]), first_triangles


@checked(height=a_height, view=a_view, window=instance(Window, "a Window(...)"), ground=flag)
def render(
    vertices: object,
    faces: ArrayLike | None = None,
    *,
    height: int = 400,
    view: View | None = None,
    window: Window | None = None,
    color: ArrayLike = SKIN,
    ground: bool = False,
) -> Image:
    """Draw a surface.

    Parameters
    ----------
    vertices : array_like, shape (V, 3), or mesh
        Surface, metres, y up; a mesh as in `rh.io.as_arrays`.
    faces : array_like, shape (F, 3), optional
        Triangles, counterclockwise when seen from outside; none for a mesh.
    height : int
        Pixels.
    view : View, optional
    window : Window, optional
        The part that is shown; by default the surface with a margin.
    color : array_like, shape (3,), (F, 3) or (V, 3)
        Red, green and blue between 0 and 1, of the surface, of each triangle or, blended between
        them, of each vertex. In one colour, the folds of the open body model are darker, and its
        eyes have pupils.
    ground : bool
        Whether the surface stands on the ground of viewers, a grid of 25 cm with its shadow.

    Returns
    -------
    array of uint8, shape (height, width, 4)
        Red, green, blue and opacity.

    Examples
    --------
    >>> bodies = rh.datasets.load_open_bodies("coarse")
    >>> rh.plots.render(bodies[0], bodies.template.faces, height=100).shape[0]
    100
    """
    vertices, faces = check_mesh(*as_surfaces(vertices, faces))
    colors = real_array(color, "color", (3,))
    view = View() if view is None else view
    floor = Ground.below([vertices]) if ground else None
    if window is None:
        window = window_of(vertices, view, ground=ground)
    return drawn(vertices, faces, height, view, window, colors, floor)


def drawn(
    vertices: Points,
    faces: Triangles,
    height: int,
    view: View,
    window: Window,
    color: Array,
    floor: Ground | None = None,
) -> Image:
    """Draw a checked surface, over a ground if there is one; see `render`."""
    corner_colors = _linear(_corner_colors(color, len(vertices), faces))
    shade = shade_of(faces) if np.ndim(color) == 1 else None
    if shade is not None:
        corner_colors *= shade[faces][..., np.newaxis]
    points, triangles, corner_colors = _with_eyes(vertices, faces, color, corner_colors)

    height, width = window.pixels(height)
    scale = height * _SAMPLES / window.height
    shape = (height * _SAMPLES, width * _SAMPLES)
    rotated = view.rotate(points)
    normals = vertex_normals(rotated, triangles)
    columns = (rotated[:, 0] - window.centre[0]) * scale + shape[1] / 2
    rows = shape[0] / 2 - (rotated[:, 1] - window.centre[1]) * scale
    corners = np.stack([columns, rows, rotated[:, 2]], axis=1)[triangles]
    owner = np.full(shape, -1)
    picture = np.empty((height, width, 4), dtype=np.uint8)
    draw_triangles(corners, np.full(shape, -np.inf), owner)
    _paint(corners, normals[triangles], corner_colors, *_light(), owner, picture)
    if floor is None:
        return picture
    return np.round(floor.under(picture, vertices, view, window)).astype(np.uint8)


def _with_eyes(
    vertices: Points, faces: Triangles, color: Array, corner_colors: Array
) -> tuple[Points, Triangles, Array]:
    """Add the eyes of open bodies: vertices, triangles and colours of the corners of triangles."""
    eyes = eyes_of(faces)
    if eyes is None:
        return vertices, faces, corner_colors
    is_uniform = np.ndim(color) == 1
    socket_colors = _linear(color) if is_uniform else eyes.socket_colors(corner_colors, faces)
    eye_colors = eyes.shares()[eyes.faces(0)][..., np.newaxis] * socket_colors
    return (
        np.concatenate([vertices, eyes.points(vertices)]),
        np.concatenate([faces, eyes.faces(len(vertices))]),
        np.concatenate([corner_colors, eye_colors]),
    )


def _corner_colors(colors: Array, n_vertices: int, faces: Triangles) -> Array:
    """Return the colours of the corners of triangles, shape (F, 3, 3)."""
    shapes = ((3,), (len(faces), 3), (n_vertices, 3))
    if colors.shape not in shapes:
        raise ArgumentError(
            f"color must have shape (3,), ({len(faces)}, 3) or ({n_vertices}, 3); found "
            f"{colors.shape}"
        )
    if colors.min() < 0 or colors.max() > 1:
        raise ArgumentError(
            f"color must lie between 0 and 1; found {colors.min():g} to {colors.max():g}"
        )
    if colors.shape == (n_vertices, 3) and n_vertices != len(faces):
        return colors[faces]
    return np.array(np.broadcast_to(colors.reshape(-1, 1, 3), (len(faces), 3, 3)))


def surface_values(values: ArrayLike, n_vertices: int, n_faces: int) -> Array:
    """Return real values (..., F) of triangles, or (..., V) of vertices, checked.

    Their number tells which; NaN stands for values that are not known.
    """
    numbers = values_of(values, "values")
    shape = numbers.shape
    if shape[-1:] not in ((n_vertices,), (n_faces,)):
        raise ArgumentError(
            f"values must have one number per triangle ({n_faces}) or vertex ({n_vertices}); "
            f"found shape {shape}"
        )
    is_known = ~np.isnan(numbers) if numbers.dtype.kind == "f" else np.ones(shape, dtype=bool)
    checked = real_array(np.where(is_known, numbers, 0.0), "values", shape, batched=False)
    return np.where(is_known, checked, np.nan)


def vertex_values(values: Array, faces: Triangles, n_vertices: int) -> Array:
    """Return values of vertices: their own, or the means of those known of their triangles."""
    if len(values) != len(faces):
        return values
    known = np.isfinite(values)
    corners = faces[known].ravel()
    counts = np.bincount(corners, minlength=n_vertices)
    sums = np.bincount(corners, np.repeat(values[known], 3), n_vertices)
    return np.where(counts > 0, sums / np.maximum(counts, 1), np.nan)


@cache
def _light() -> tuple[Array, Array, float]:
    """Return the light of the viewer's page, in the viewer's frame: right, up, towards the eye.

    Lights, shape (n, 6), are unit vectors towards them, and their red, green and blue; the
    hemisphere, shape (2, 3), is the light from above and from below; and the roughness of skin.
    """
    text = (files("riemhuman.plots") / "web" / "light.json").read_text(encoding="utf-8")
    light = json.loads(text)
    rows = []
    for lamp in light["lights"]:
        towards = np.array(lamp["towards"])
        shone = lamp["strength"] * np.array(lamp["color"])
        rows.append([*(towards / np.linalg.norm(towards)), *shone])
    hemisphere = light["hemisphere"]
    halves = hemisphere["strength"] * np.array([hemisphere["sky"], hemisphere["ground"]])
    return np.array(rows), halves, float(light["roughness"])


def _linear(colors: Array) -> Array:
    """Return shares of light from values of sRGB."""
    return np.where(colors > 0.04045, ((colors + 0.055) / 1.055) ** 2.4, colors / 12.92)


@compiled
def draw_triangles(corners: Array, nearest: Array, owner: Integers) -> None:
    """Write the nearest triangle at the middle of each sample."""
    # Corners, shape (F, 3, 3), are columns, rows and depths; greater depths are nearer.
    height, width = owner.shape
    for f in range(len(corners)):
        (ax, ay, az), (bx, by, bz), (cx, cy, cz) = corners[f]
        area = (bx - ax) * (cy - ay) - (by - ay) * (cx - ax)
        # Rows count downwards, so triangles that face the eye are clockwise.
        if not area < 0:
            continue
        top, bottom = np.ceil(min(ay, by, cy) - 0.5), np.floor(max(ay, by, cy) + 0.5)
        left, right = np.ceil(min(ax, bx, cx) - 0.5), np.floor(max(ax, bx, cx) + 0.5)
        for row in range(int(max(top, 0.0)), int(min(bottom, height))):
            for column in range(int(max(left, 0.0)), int(min(right, width))):
                a, b, c = shares_at(corners[f], row + 0.5, column + 0.5)
                depth = a * az + b * bz + c * cz
                if min(a, b, c) >= 0 and depth > nearest[row, column]:
                    nearest[row, column] = depth
                    owner[row, column] = f


@compiled
def shares_at(corners: Array, y: float, x: float) -> tuple[float, float, float]:
    """Return barycentric coordinates."""
    (ax, ay, _), (bx, by, _), (cx, cy, _) = corners
    area = (bx - ax) * (cy - ay) - (by - ay) * (cx - ax)
    return (
        ((bx - x) * (cy - y) - (by - y) * (cx - x)) / area,
        ((cx - x) * (ay - y) - (cy - y) * (ax - x)) / area,
        ((ax - x) * (by - y) - (ay - y) * (bx - x)) / area,
    )


@compiled
def _paint(
    corners: Array,
    normals: Array,
    colors: Array,
    lights: Array,
    hemisphere: Array,
    roughness: float,
    owner: Integers,
    picture: Image,
) -> None:
    """Give each pixel the mean colour of its covered samples, more opaque where there are more."""
    sums = np.empty(4)
    diffuse = np.empty(3)
    mirrored = np.empty(3)
    for row in range(picture.shape[0]):
        for column in range(picture.shape[1]):
            sums[:] = 0.0
            for sample in range(_SAMPLES**2):
                i = row * _SAMPLES + sample // _SAMPLES
                j = column * _SAMPLES + sample % _SAMPLES
                f = owner[i, j]
                if f >= 0:
                    shares = shares_at(corners[f], i + 0.5, j + 0.5)
                    normal = _normal(normals[f], shares)
                    _shade(normal, lights, hemisphere, roughness, diffuse, mirrored)
                    sums[3] += 1.0
                    for channel in range(3):
                        shade = (
                            shares[0] * colors[f, 0, channel]
                            + shares[1] * colors[f, 1, channel]
                            + shares[2] * colors[f, 2, channel]
                        )
                        light = max(shade, 0.0) * diffuse[channel] + mirrored[channel]
                        sums[channel] += _encoded(min(light, 1.0))
            for channel in range(3):
                picture[row, column, channel] = np.round(255 * sums[channel] / max(sums[3], 1.0))
            picture[row, column, 3] = np.round(255 * sums[3] / _SAMPLES**2)


@compiled
def _encoded(light: float) -> float:
    """Return the value of sRGB of a share of light."""
    return 1.055 * light ** (1.0 / 2.4) - 0.055 if light > 0.0031308 else 12.92 * light


@compiled
def _normal(normals: Array, shares: tuple[float, float, float]) -> tuple[float, float, float]:
    """Return the unit normal where the corners of a triangle have these shares."""
    a, b, c = shares
    x = a * normals[0, 0] + b * normals[1, 0] + c * normals[2, 0]
    y = a * normals[0, 1] + b * normals[1, 1] + c * normals[2, 1]
    z = a * normals[0, 2] + b * normals[1, 2] + c * normals[2, 2]
    length = max(np.sqrt(x * x + y * y + z * z), 1e-300)  # normals may cancel
    return x / length, y / length, z / length


@compiled
def _shade(
    normal: tuple[float, float, float],
    lights: Array,
    hemisphere: Array,
    roughness: float,
    diffuse: Array,
    mirrored: Array,
) -> None:
    """Write the light that a white surface scatters towards the eye, and what any colour mirrors.

    Lambert's law and the mirrored light of rough surfaces (Walter et al., "Microfacet models for
    refraction through rough surfaces", EGSR 2007), as three.js draws them.
    """
    x, y, z = normal
    square = roughness**4
    facing = max(z, 1e-4)
    for channel in range(3):
        from_above = 0.5 + 0.5 * y
        diffuse[channel] = (
            from_above * hemisphere[0, channel] + (1.0 - from_above) * hemisphere[1, channel]
        ) / np.pi
        mirrored[channel] = 0.0
    for light in lights:
        right, up, towards = light[0], light[1], light[2]
        along = right * x + up * y + towards * z
        if along <= 0.0:
            continue
        # Halfway between the light and the eye, which is at (0, 0, 1).
        half = max(np.sqrt(2.0 + 2.0 * towards), 1e-9)
        on_half = (along + z) / half
        spread = on_half**2 * (square - 1.0) + 1.0
        hidden = along * np.sqrt(square + (1.0 - square) * facing**2)
        hidden += facing * np.sqrt(square + (1.0 - square) * along**2)
        fresnel = _REFLECTED + (1.0 - _REFLECTED) * (1.0 - min(half / 2.0, 1.0)) ** 5
        share = square / (np.pi * spread**2) * 0.5 / max(hidden, 1e-9) * fresnel
        for channel in range(3):
            diffuse[channel] += along * light[3 + channel] / np.pi
            mirrored[channel] += along * light[3 + channel] * share


def points_picture(
    points: Points,
    window: Window,
    height: int,
    colors: Array | None = None,
    view: View | None = None,
) -> Image:
    """Draw points as small squares, shape (height, width, 4); far points are darker."""
    view = View() if view is None else view
    right, up, towards = view.rotate(np.eye(3)).T
    depth = points @ towards
    light = 1.0 - _DEPTH_SHADE * (depth.max() - depth) / max(float(np.ptp(depth)), 1e-9)
    tints = np.clip((SKIN if colors is None else colors) * light[:, None], 0, 1)
    # Squares are as wide as the distance between points, and at most six pixels.
    side = min(0.8 / np.sqrt(len(points)), 6 / height) * window.height
    corners = side * np.array([0.0 * up, -up, right - up, right])
    squares = (points[:, None] + corners).reshape(-1, 3)
    faces = np.array([[0, 1, 2], [0, 2, 3]]) + 4 * np.arange(len(points))[:, None, None]
    colors = np.repeat(tints, 2, axis=0)
    return render(
        squares, faces.reshape(-1, 3), height=height, view=view, window=window, color=colors
    )


def strip_picture(
    surfaces: Sequence[Points] | Points,
    faces: Triangles | None,
    colors: Sequence[ArrayLike] | None = None,
    height: int = _STRIP_HEIGHT,
    *,
    ground: float | None = None,
    names: Sequence[str] | None = None,
) -> Image:
    """Draw at most eight surfaces side by side at one scale, evenly chosen from more.

    Their names are written below them. Each stands on its own ground, or all of a motion on one at
    a height.
    """
    n_surfaces = len(surfaces)
    view = View()
    numbers = np.linspace(0, n_surfaces - 1, min(n_surfaces, _MOST_SHOWN)).round().astype(int)
    strip = np.stack([surfaces[number] for number in numbers])
    low = strip.min(axis=1, keepdims=True)
    high = strip.max(axis=1, keepdims=True)
    # What becomes the origin of each surface: its middle, on the ground.
    origins = (low + high) / 2
    origins[..., 1] = low[..., 1] if ground is None else ground
    strip = strip - origins
    if faces is None:
        windows = same_heights([window_around(points, view) for points in strip])
        pictures = [
            points_picture(points, window, height)
            for points, window in zip(strip, windows, strict=True)
        ]
    else:
        floors = [Ground.below([surface], lowest=0.0) for surface in strip]
        windows = same_heights(
            [floor.window([surface], view) for floor, surface in zip(floors, strip, strict=True)]
        )
        pictures = []
        for number, surface, window, floor in zip(numbers, strip, windows, floors, strict=True):
            color = np.asarray(SKIN if colors is None else colors[number])
            pictures.append(drawn(surface, faces, height, view, window, color, floor))
    if names is not None and any(names):
        pictures = [
            _named(picture, names[number])
            for number, picture in zip(numbers, pictures, strict=True)
        ]
    return np.concatenate(pictures, axis=1)


def _named(picture: Image, name: str) -> Image:
    """Return a picture with a name below it, smaller if it is long, at most as wide."""
    height, width = picture.shape[:2]
    pixels = height // 20
    text = written(name, pixels)
    if text.shape[1] > width:
        # Letters are whole pixels wide: a little smaller, so that the last one is not cut.
        text = written(name, max(1, pixels * width // (text.shape[1] + pixels)))[:, :width]
    below = np.zeros((height // 16, width, 4), dtype=np.uint8)
    left = (width - text.shape[1]) // 2
    below[: len(text), left : left + text.shape[1]] = text
    return np.concatenate([picture, below])


def surfaces_html(
    surfaces: Sequence[Points] | Points, faces: Triangles | None, caption: str
) -> str:
    """Return HTML with a picture of at most eight surfaces side by side, and a caption.

    Parameters
    ----------
    surfaces : sequence of array, each of shape (V, 3)
        Surfaces, metres, y up; of more than eight, eight evenly spaced ones are shown.
    faces : array of int, shape (F, 3), or None
        Triangles; without them, vertices are drawn.
    caption : str

    Examples
    --------
    >>> bodies = rh.datasets.load_open_bodies("coarse")
    >>> rh.plots.surfaces_html(bodies.points[:2], bodies.template.faces, "Two")[:7]
    '<figure'
    """
    image, words = "", escape(text(caption, "caption"), quote=True)
    if length_of(surfaces, "surfaces"):
        strip = real_array(surfaces, "surfaces", ("n", "n_vertices", 3), batched=False)
        if strip.size == 0:
            raise ArgumentError(f"surfaces must have vertices; found shape {strip.shape}")
        triangles = None if faces is None else check_mesh(strip[0], faces)[1]
        image = f'<img src="{image_source(strip_picture(strip, triangles))}" alt="{words}">'
    return f'<figure style="margin:0">{image}<figcaption>{words}</figcaption></figure>'


def image_source(picture: Image) -> str:
    """Return a picture as the address of an HTML image."""
    return f"data:image/png;base64,{base64.b64encode(png_bytes(picture)).decode('ascii')}"


def png_bytes(picture: Image) -> bytes:
    """Return a picture, shape (height, width, 4), as a PNG file."""
    file = io.BytesIO()
    PIL.Image.fromarray(picture).save(file, format="PNG")
    return file.getvalue()
