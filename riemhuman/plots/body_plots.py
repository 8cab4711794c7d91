"""Bodies, paths and measurement lines as matplotlib pictures, drawn without a display.

Functions draw into the axes that they are given, or into those of a new figure.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from textwrap import fill
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from riemhuman.arrays import Array, Points, Triangles
from riemhuman.checks import (
    checked,
    flag,
    instance,
    positive,
    real,
    real_array,
    whole,
)
from riemhuman.checks.labels import names_of, text
from riemhuman.errors import ArgumentError
from riemhuman.geometry import ElasticMetric
from riemhuman.io.mesh_arrays import check_mesh
from riemhuman.kernels import surface
from riemhuman.optional import import_matplotlib
from riemhuman.plots._ground_picture import SHOWN, Ground, window_of
from riemhuman.plots.figures import (
    SKIN,
    new_axes,
    plain,
    scale_ends,
    value_colors,
)
from riemhuman.plots.rendering import (
    as_surfaces,
    drawn,
    render,
    surface_values,
    vertex_values,
)
from riemhuman.plots.windows import (
    View,
    Window,
    a_height,
    a_view,
    same_heights,
    window_around,
)
from riemhuman.representation import Record
from riemhuman.surfaces.measures import triangle_areas
from riemhuman.terms import EbinTerm, NormalTerm

_LETTER_INCHES = 0.07  # of small text

if TYPE_CHECKING:
    from matplotlib.axes import Axes


# More than eight arguments, because each keyword is one choice about the picture.
@checked(view=a_view, label=text, ground=flag, height=a_height)
def plot_body(
    vertices: object,
    faces: ArrayLike | None = None,
    values: ArrayLike | None = None,
    *,
    color: ArrayLike = SKIN,
    view: View | None = None,
    label: str | None = None,
    ground: bool = True,
    ax: Axes | None = None,
    height: int = 1440,
) -> Axes:
    """Draw a body, coloured by values of its triangles or vertices if they are given.

    Parameters
    ----------
    vertices : array_like, shape (V, 3), or mesh
        Surface, metres, y up; meshes as in `rh.io.as_arrays`.
    faces : array_like, shape (F, 3), optional
        Triangles; none for a mesh.
    values : array_like, shape (F,) or (V,), optional
        Values of the triangles, or of the vertices; 1 % of their sizes exceed that of the last
        colour. The scale begins at 0 or, if some are negative, goes to both sides of it.
    color : array_like, shape (3,), (F, 3) or (V, 3)
        Red, green and blue between 0 and 1, used without `values`.
    view : View, optional
    label : str, optional
        Label of a colour bar.
    ground : bool
        Whether the body stands on the ground of viewers, a grid of 25 cm with its shadow.
    ax : matplotlib.axes.Axes, optional
    height : int
        Pixels; by default 300 an inch of the figure that is made.

    Examples
    --------
    >>> bodies = rh.datasets.load_open_bodies("coarse")
    >>> ax = rh.plots.plot_body(bodies[0], bodies.template.faces)
    """
    vertices, faces = check_mesh(*as_surfaces(vertices, faces))
    ax = new_axes(ax, 3.2, 4.8)
    view = View() if view is None else view
    window = window_of(vertices, view, ground=ground)
    low, limit = 0.0, 0.0
    if values is not None:
        shades = surface_values(values, len(vertices), len(np.asarray(faces)))
        if shades.ndim != 1:
            raise ArgumentError(
                f"values of one body must be a single row; found shape {shades.shape}"
            )
        low, limit = scale_ends(shades)
        color = value_colors(vertex_values(shades, faces, len(vertices)), limit, signed=low < 0)
    picture = render(
        vertices, faces, height=height, view=view, window=window, color=color, ground=ground
    )
    ax.imshow(picture, extent=(0.0, window.width, 0.0, window.height), interpolation="antialiased")
    ax.set_axis_off()
    if values is not None and label is not None:
        draw_bar(ax, low, limit, label)
    return ax


def draw_bar(ax: Axes, low: float, limit: float, label: str) -> None:
    """Draw the bar of a scale beside axes: from 0 or, with a sign, from minus the limit."""
    colors, cm = (import_matplotlib(name) for name in ("colors", "cm"))
    is_signed = low < 0
    table = colors.ListedColormap(value_colors(np.linspace(-1.0 if is_signed else 0.0, 1.0, 256)))
    scale = cm.ScalarMappable(colors.Normalize(low, limit or 1.0), table)
    ax.figure.colorbar(
        scale, ax=ax, label=label, shrink=0.6, pad=0.02, format=_signed if is_signed else None
    )


def _signed(value: float, _: object) -> str:
    """Return a number with its sign, and a real minus."""
    return f"{value:+g}".replace("-", "\u2212") if value else "0"


# More than eight arguments, because each keyword is one choice about the picture.
@checked(
    n_shown=whole(minimum=2),
    largest=real(minimum=0.0),
    spacing=positive,
    view=a_view,
    ground=flag,
    one_floor=flag,
    label=text,
    height=a_height,
)
def plot_path(
    path: ArrayLike | Sequence[object],
    faces: ArrayLike | None = None,
    values: ArrayLike | None = None,
    *,
    n_shown: int | None = None,
    colors: ArrayLike | None = None,
    largest: float | None = None,
    spacing: float | None = None,
    view: View | None = None,
    ground: bool = True,
    one_floor: bool = False,
    labels: Sequence[str] | None = None,
    label: str | None = None,
    ax: Axes | None = None,
    height: int = 720,
) -> Axes:
    """Draw the surfaces of a path side by side as a film strip.

    Parameters
    ----------
    path : array_like, shape (n_times, V, 3), or sequence of meshes
    faces : array_like, shape (F, 3), optional
    values : array_like, shape (n_times, F) or (n_times, V), optional
        As for `plot_body`, of each surface; all share one scale.
    n_shown : int, optional
        Number of surfaces shown, evenly spaced including both ends; by default all.
    colors : array_like, shape (n_times, 3), optional
        Colour of each surface, used without `values`.
    largest : float, optional
        Value of the last colour; by default, 1 % of the values exceed it.
    spacing : float, optional
        Distance between the middles of successive surfaces, metres; by default they do not overlap.
    view : View, optional
    ground : bool
        Whether surfaces stand on the ground of viewers, a grid of 25 cm with their shadows; without
        it, they are drawn at the heights that they have.
    one_floor : bool
        Whether the ground is below the lowest surface and others may be above it, as in a jump; by
        default each surface stands.
    labels : sequence of str, optional
        A name below each surface, shape (n_times,).
    label : str, optional
        Label of a colour bar, used with `values`.
    ax : matplotlib.axes.Axes, optional
    height : int
        Pixels; by default 300 an inch of the figure that is made.

    Examples
    --------
    >>> bodies = rh.datasets.load_open_bodies("coarse")
    >>> ax = rh.plots.plot_path(bodies.points[:6], bodies.template.faces, n_shown=3)
    """
    given, given_faces = as_surfaces(path, faces)
    surfaces = real_array(given, "path", ("n_times", "n_vertices", 3), batched=False)
    if not len(surfaces):
        raise ArgumentError("path must hold at least one surface; found none")
    numbers = np.arange(len(surfaces))
    if n_shown is not None:
        n_shown = min(n_shown, len(surfaces))
        numbers = np.linspace(0, len(surfaces) - 1, n_shown).round().astype(np.int64)
    titles = None if labels is None else names_of(labels, "labels", len(surfaces), "surfaces")
    triangles = check_mesh(surfaces[0], given_faces)[1]
    if ground and not one_floor:
        surfaces = surfaces.copy()
        surfaces[..., 1] -= surfaces[..., 1].min(axis=1, keepdims=True)
    view = View() if view is None else view
    floors, windows = _floors_and_windows(surfaces[numbers], view, spacing, ground=ground)
    widths = np.array([frame.width for frame in windows])
    middles = np.cumsum(widths) - widths / 2
    if spacing is not None:
        middles = widths[0] / 2 + spacing * np.arange(len(numbers))
    tints, low, limit = _tints(surfaces, triangles, values, largest, colors)
    ax = new_axes(ax, min(12.0, 2.4 * (middles[-1] + widths[-1] / 2) / windows[0].height), 2.4)
    across = float(np.diff(middles).min(initial=widths.max()))
    shown_inches = ax.get_position().width * ax.figure.get_figwidth()
    letters = int(shown_inches * across / (middles[-1] + widths[-1] / 2) / _LETTER_INCHES)
    for order, (index, frame, floor) in enumerate(zip(numbers, windows, floors, strict=True)):
        picture = drawn(surfaces[index], triangles, height, view, frame, tints[index], floor)
        left = middles[order] - frame.width / 2
        right = middles[order] + frame.width / 2
        ax.imshow(
            picture,
            extent=(left, right, 0.0, frame.height),
            interpolation="antialiased",
            zorder=2 + order,
        )
        if titles is not None:
            ax.text(
                middles[order],
                0.0,
                _wrapped(plain(titles[index]), letters),
                ha="center",
                va="top",
                fontsize="small",
            )
    ax.set_xlim(0.0, middles[-1] + widths[-1] / 2)
    ax.set_ylim(0.0, windows[0].height)
    ax.set_axis_off()
    if values is not None and label is not None:
        draw_bar(ax, low, limit, label)
    return ax


def _wrapped(title: str, letters: int) -> str:
    """Return a title in lines of at most some letters, if its words are not longer."""
    lines = (fill(line, max(letters, 1), break_long_words=False) for line in title.splitlines())
    return "\n".join(lines)


def _tints(
    surfaces: Points,
    triangles: Triangles,
    values: ArrayLike | None,
    largest: float | None,
    colors: ArrayLike | None,
) -> tuple[Array, float, float]:
    """Return the colours of surfaces, and the ends of the scale of their values."""
    n_surfaces, n_vertices = surfaces.shape[:2]
    if values is None:
        if colors is None:
            colors = np.tile(SKIN, (n_surfaces, 1))
        return real_array(colors, "colors", (n_surfaces, 3), batched=False), 0.0, 0.0
    shades = surface_values(values, n_vertices, len(triangles))
    if shades.shape[:-1] != (n_surfaces,):
        raise ArgumentError(
            f"values must have one row for each of the {n_surfaces} surfaces; "
            f"found shape {shades.shape}"
        )
    low, limit = scale_ends(shades, largest)
    smooth = np.stack([vertex_values(row, triangles, n_vertices) for row in shades])
    return value_colors(smooth, limit, signed=low < 0), low, limit


def _floors_and_windows(
    surfaces: Points, view: View, spacing: float | None, *, ground: bool
) -> tuple[list[Ground | None], list[Window]]:
    """Return the ground below each surface of a strip, and its window.

    Grounds are at one height and hardly overlap. Each surface has its own window, so that a walking
    body stays in its place on the strip.
    """
    lowest = float(surfaces[..., 1].min())
    widest = np.inf if spacing is None else spacing / (2 * SHOWN)
    floors: list[Ground | None] = []
    windows = []
    for points in surfaces:
        if ground:
            floor = Ground.below([points], lowest, widest)
            floors.append(floor)
            windows.append(floor.window([points], view))
        else:
            floors.append(None)
            windows.append(window_around(points, view))
    return floors, same_heights(windows)


@dataclass(frozen=True, repr=False)
class Contributions(Record):
    r"""Parts of the squared distance of two surfaces, triangle by triangle.

    The integrands of equation 5 over each triangle t of the template, of area w_t:

    .. math:: \begin{split} m_t &= a\, w_t\, d^\lambda(g_1, g_2)_t^2 \\
              n_t &= c\, w_t\, d_{S^2}(n_1, n_2)_t^2 \end{split}

    Attributes
    ----------
    metric : array, shape (..., F)
        m_t, from the change of the first fundamental form.
    normal : array, shape (..., F)
        n_t, from the change of the normals.

    Examples
    --------
    >>> float(rh.plots.Contributions(np.ones(1), np.full(1, 0.5)).total[0])
    1.5
    """

    metric: Array
    normal: Array

    @property
    def total(self) -> Array:
        """Their sum m_t + n_t, shape (..., F); the sum over triangles is the squared distance."""
        return self.metric + self.normal


@checked(metric=instance(ElasticMetric, "an ElasticMetric(...)"))
def contributions(metric: ElasticMetric, point_a: Points, point_b: Points) -> Contributions:
    """Return the contribution of every triangle to the squared distance between two surfaces.

    Parameters
    ----------
    metric : ElasticMetric
    point_a, point_b : array, shape (..., V, 3)

    Examples
    --------
    >>> bodies = rh.datasets.load_open_bodies("coarse")
    >>> metric = rh.ElasticMetric(rh.AlignedSurfaces(bodies.template), 1.0, 1.0, 1.0)
    >>> rh.plots.contributions(metric, bodies[0], bodies[1]).normal.shape
    (2400,)
    """
    space = metric.space
    first_a, first_b = (
        surface.derivatives(space.check_point(f, "surface"), space.template.differential_operator)
        for f in (point_a, point_b)
    )
    zeros = np.zeros(np.broadcast_shapes(first_a.areas.shape, first_b.areas.shape))
    parts: dict[type, Array] = {EbinTerm: zeros, NormalTerm: zeros}
    for term in metric.terms:
        if term.needs_area:
            surface.refuse_degenerate(first_a.degenerate | first_b.degenerate)
        values = term.squared_dist(term.fields(first_a), term.fields(first_b))
        parts[type(term)] = term.weight * space.template.face_areas * values
    return Contributions(parts[EbinTerm], parts[NormalTerm])


def per_area(values: ArrayLike, vertices: ArrayLike, faces: ArrayLike) -> Array:
    """Divide values of triangles by their areas.

    Parameters
    ----------
    values : array_like, shape (..., F)
    vertices : array_like, shape (V, 3)
        Surface that gives the areas, such as the template.
    faces : array_like, shape (F, 3)

    Examples
    --------
    >>> rh.plots.per_area([3.0], [[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]])
    array([6.])
    """
    areas = triangle_areas(*check_mesh(vertices, faces))
    if not areas.all():
        raise ArgumentError("faces must not include triangles without area")
    return real_array(values, "values", (len(areas),)) / areas
