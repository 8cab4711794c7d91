"""Measurements of bodies: a list on a page, beside their lines, and pictures with numbers."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from markupsafe import Markup
from scipy.spatial import cKDTree

from riemhuman.arrays import Array, Booleans, Integers, Points, Triangles
from riemhuman.checks import checked, choice, instance, mask, real_array
from riemhuman.checks.labels import text
from riemhuman.kernels.surface import vertex_normals
from riemhuman.measurements import (
    BodySizes,
    Measurement,
    Measurements,
    ReadableUnit,
    VisitComparison,
    in_standard_pose,
    readable_unit,
)
from riemhuman.optional import import_matplotlib
from riemhuman.plots._packing import packed_points
from riemhuman.plots._panels import Panel
from riemhuman.plots._web_files import fill
from riemhuman.plots.figures import new_figure, plain
from riemhuman.plots.rendering import render
from riemhuman.plots.viewed_bodies import ViewedBody
from riemhuman.plots.viewer import Viewer
from riemhuman.plots.windows import View, a_height, window_around
from riemhuman.readable_units import READABLE_UNITS

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_POSES = ("standard", "as is")
_MEASUREMENTS = instance(Measurements, "a Measurements(...)")
_VIEWS = tuple(View(azimuth, 4.0) for azimuth in (0.0, 90.0, 180.0))
# The figure of all measurements: columns of pictures, their size and the height of a table's row.
_COLUMNS = 2
_PICTURE_WIDTH = 3.1  # inches
_PICTURE_HEIGHT = 3.9
_ROW_INCHES = 0.155
_LONG_NAME = 30  # letters that fit beside a value
_NONE = "–"  # in place of a value that is missing
_LEADER = "#6b7178"
# Lines are pale where normals face away by more than this cosine: behind the body.
_FACING = -0.05
_PALE = 0.3  # opacity
_LABEL_GAP = 0.055  # of numbers beside a body, metres
# Groups of measurements in a list or a picture, as people know them.
MOST_IN_GROUP = 15
_TITLES = ("Girths", "Heights", "Breadths and depths", "Lengths", "Volume, area and mass")
_HALVES = ("upper body", "lower body")
# Words of names, before classes: a breadth between landmarks is a length by its class.
_WORDS = {"girth": 0, "breadth": 2, "depth": 2}
_CLASSES = {"Girth": 0, "Height": 1, "Breadth": 2, "Depth": 2, "Length": 3}
_CLASSES |= {"Volume": 4, "Area": 4, "Mass": 4}

Lines = Mapping[str, Sequence[Array]]


@dataclass(frozen=True)
class MeasurementGroup:
    """Measurements of one kind, by their numbers in the set."""

    title: str
    members: tuple[int, ...]


def grouped(measurements: Sequence[Measurement]) -> list[MeasurementGroup]:
    """Return measurements by kind; those of user-defined classes are lengths."""
    members: dict[int, list[int]] = {}
    for k, measurement in enumerate(measurements):
        members.setdefault(_title_number(measurement), []).append(k)
    return [MeasurementGroup(_TITLES[number], tuple(members[number])) for number in sorted(members)]


def _title_number(measurement: Measurement) -> int:
    """Return which of the titles a measurement belongs to, by its name or else its class."""
    for word, number in _WORDS.items():
        if word in measurement.name:
            return number
    for base in type(measurement).__mro__:
        if base.__name__ in _CLASSES:
            return _CLASSES[base.__name__]
    return _TITLES.index("Lengths")


def pictured(measurements: Sequence[Measurement], lines: Lines) -> list[MeasurementGroup]:
    """Return groups of at most fifteen measurements that have lines, from the head downwards."""
    groups = []
    for group in grouped(measurements):
        drawn = [k for k in group.members if len(lines[measurements[k].name])]
        if not drawn:
            continue
        heights = {k: _height(lines[measurements[k].name]) for k in drawn}
        order = sorted(drawn, key=lambda k: heights[k], reverse=True)
        count = math.ceil(len(order) / MOST_IN_GROUP)
        for number, part in enumerate(np.array_split(np.array(order), count)):
            title = group.title
            if count > 1:
                which = _HALVES[number] if count == 2 else f"{number + 1} of {count}"
                title = f"{title}, {which}"
            groups.append(MeasurementGroup(title, tuple(part.tolist())))
    return groups


def _height(parts: Sequence[Array]) -> float:
    """Return the height of the highest point of lines."""
    return float(np.concatenate([np.asarray(part) for part in parts])[:, 1].max())


@dataclass(frozen=True)
class _Row:
    """A measurement in the list: its texts, and whether it has a line."""

    number: int
    name: str
    unit: str
    numbers: list[str]
    has_line: bool
    changed: bool = False
    why: str = ""


@dataclass(frozen=True)
class MeasurementPanel(Panel):
    """A list of measurements of one or two bodies of a page.

    Rows are grouped by titles, and lines of each body named by measurements; `surfaces` are
    (V, 3), and `visits` are the names of two visits, or empty.
    """

    groups: dict[str, list[_Row]]
    lines: Sequence[Lines]
    surfaces: Sequence[Points]
    faces: Triangles
    visits: tuple[str, ...] = ()
    name: str = "measurements"

    def data(self) -> dict[str, object]:
        """Return the lines of each body in the order of the measurements."""
        return {"bodies": [_packed_lines(lines) for lines in self.lines]}

    def html(self, identifier: str) -> Markup:
        """Return the list."""
        return fill("measurement_list.html", groups=self.groups, visits=self.visits)


def _packed_lines(lines: Lines) -> dict[str, object]:
    every = [np.asarray(part) for parts in lines.values() for part in parts]
    points = np.concatenate(every) if every else np.zeros((0, 3))
    ends = [[len(part) for part in parts] for parts in lines.values()]
    return {**packed_points(points), "ends": ends}


def measurement_panel(
    measurements: Measurements,
    surfaces: Sequence[Points],
    measured: BodySizes | VisitComparison,
    names: tuple[str, ...] = (),
    system: str = "cm",
) -> MeasurementPanel:
    """Return the list of measurements of one body, or of two with their change and their names.

    The bodies are in the standard pose or as they stand; for `system`, see `readable_unit`.
    """
    lines = [measurements.lines(surface, axes="space") for surface in surfaces]
    every = measurements.definitions.measurements
    rows = []
    for k, measurement in enumerate(every):
        has_line = any(len(body_lines[measurement.name]) for body_lines in lines)
        rows.append(_row(k, measured, has_line, system))
    groups = {
        group.title: _with_units([rows[k] for k in group.members]) for group in grouped(every)
    }
    return MeasurementPanel(groups, lines, surfaces, measurements.definitions.faces, names)


def _with_units(rows: list[_Row]) -> list[_Row]:
    """Return rows that name their units, unless all share the unit in the heading."""
    first = rows[0].unit
    return [
        row if row.unit == first else replace(row, name=f"{row.name}, {row.unit}") for row in rows
    ]


def _row(k: int, measured: BodySizes | VisitComparison, has_line: bool, system: str) -> _Row:
    name = measured.names[k]
    unit = readable_unit(measured.units[k], system)
    reasons = [reason for (_, missing), reason in measured.why_missing.items() if missing == name]
    why = "; ".join(dict.fromkeys(reasons))  # each reason once
    if isinstance(measured, BodySizes):
        value = measured.values.reshape(-1, len(measured.names))[0, k]
        text = _NONE if np.isnan(value) else f"{_text(value, unit)} {unit.name}"
        return _Row(k, name, unit.name, [text], has_line, why=why)
    before = _text(measured.before[k], unit)
    after = _text(measured.after[k], unit)
    change = _text(measured.changes[k], unit, "+")
    noise = "" if np.isnan(measured.thresholds[k]) else f"±{_text(measured.thresholds[k], unit)}"
    changed = bool(measured.is_significant[k])
    return _Row(k, name, unit.name, [before, after, change, noise], has_line, changed, why)


def _text(value: float, unit: ReadableUnit, sign: str = "") -> str:
    """Return a value with at most one decimal for centimetres, and a true minus sign."""
    if np.isnan(value):
        return _NONE
    digits = min(unit.digits, 1) if unit.scale == 100.0 else unit.digits
    return replace(unit, digits=digits).text(value, sign=sign).replace("-", "−")


@checked(measurements=_MEASUREMENTS, pose=choice(*_POSES), name=text)
def view_measurements(
    measurements: Measurements,
    points: object,
    *,
    pose: str = "standard",
    name: str = "",
    title: str = "Measurements",
    trusted_vertices: object = None,
    system: str = "cm",
) -> Viewer:
    """Return a page with a body, its measurements in a list, and their lines.

    Pointing at a row shows its line on the body, and pointing at a line shows its row. For two
    visits of one person, see `view_difference`.

    Parameters
    ----------
    measurements : Measurements
    points : array_like, shape (V, 3)
        The body, metres.
    pose : {"standard", "as is"}
        Whether to measure in the standard pose, which needs a body model.
    name, title : str
        Name of the body and title of the page.
    trusted_vertices : array_like of bool, shape (V,), optional
        As for `Measurements.measure`.
    system : {"cm", "in"}
        Units, see `rh.measurements.readable_unit`.

    Examples
    --------
    >>> bodies = rh.datasets.load_open_bodies("coarse")
    >>> measurements = rh.measurements.Measurements(bodies.model)
    >>> viewer = rh.plots.view_measurements(measurements, bodies[0], pose="as is")
    >>> viewer.save("anna.html")
    """
    surface = _posed(measurements, points, pose)
    trusted = _trusted(trusted_vertices, len(surface))
    measured = measurements.measure(
        surface[np.newaxis], axes="space", missing="nan", trusted_vertices=trusted
    )
    return Viewer(
        measurements.definitions.faces,
        {"Body": [ViewedBody(name, surface[np.newaxis])]},
        title=title,
        panel=measurement_panel(measurements, [surface], measured, system=system),
    )


def _trusted(trusted_vertices: object, n_vertices: int) -> Booleans | None:
    """Return which vertices of one body to trust, checked, shape (1, V); None if nothing is known.

    None means all of them.
    """
    if trusted_vertices is None:
        return None
    return mask(trusted_vertices, "trusted_vertices", [(n_vertices,)])[np.newaxis]


def _posed(measurements: Measurements, points: object, pose: str) -> Array:
    """Return a checked body, in the standard pose or as it stands."""
    shape = (measurements.definitions.n_vertices, 3)
    surface = np.asarray(real_array(points, "points", shape, batched=False))
    return in_standard_pose(measurements.definitions, surface) if pose == "standard" else surface


@checked(
    measurements=_MEASUREMENTS,
    pose=choice(*_POSES),
    system=choice(*READABLE_UNITS),
    height=a_height,
    names=instance(Mapping, "a mapping of names to texts"),
)
def plot_measurements(
    measurements: Measurements,
    points: object,
    *,
    pose: str = "standard",
    axes: str = "space",
    system: str = "cm",
    height: int = 640,
    names: Mapping[str, str] | None = None,
    trusted_vertices: object = None,
) -> Figure:
    """Draw the lines of measurements in small pictures, with a table of their values.

    Each picture has at most fifteen numbered lines of one kind, seen from the side on which most of
    them are visible; lines behind the body are pale. The table below gives their names and values.

    Parameters
    ----------
    measurements : Measurements
    points : array_like, shape (V, 3)
        A body, metres.
    pose : {"standard", "as is"}
        Whether to measure in the standard pose, which needs a body model.
    axes : {"space", "body"}
        Axes of a body in its own pose, see `Measurements.measure`.
    system : {"cm", "in"}
        Units, see `readable_unit`.
    height : int
        Pixels of a body.
    names : mapping of str to str, optional
        Names to write instead of those of the measurements, such as "Kneecap height" for "knee
        height (midpatella)".
    trusted_vertices : array_like of bool, shape (V,), optional
        As for `Measurements.measure`; measurements that depend on others are left out.

    Examples
    --------
    >>> bodies = rh.datasets.load_open_bodies("coarse")
    >>> girths = rh.measurements.Measurements(bodies.model, ["waist girth", "hip girth"])
    >>> figure = rh.plots.plot_measurements(girths, bodies[0], pose="as is")
    """
    surface = _posed(measurements, points, pose)
    written_names = _written_names(names)
    trusted = _trusted(trusted_vertices, len(surface))
    lines = measurements.lines(surface, axes=axes)
    measured = measurements.measure(
        surface[np.newaxis], axes=axes, missing="nan", trusted_vertices=trusted
    )
    for _, name in measured.why_missing:
        lines[name] = []
    every = measurements.definitions.measurements
    groups = pictured(every, lines)
    columns = min(_COLUMNS, max(len(groups), 1))
    rows = math.ceil(max(len(groups), 1) / columns)
    longest = max((len(group.members) for group in groups), default=0)
    table_inches = _ROW_INCHES * (longest + 1)
    figure = new_figure(_PICTURE_WIDTH * columns, rows * (_PICTURE_HEIGHT + table_inches))
    panels = figure.subplots(
        2 * rows, columns, squeeze=False, height_ratios=[_PICTURE_HEIGHT, table_inches] * rows
    )
    for ax in panels.ravel():
        ax.set_axis_off()
    for place, group in enumerate(groups):
        row, column = divmod(place, columns)
        picture = panels[2 * row, column]
        picture.set_title(group.title, fontsize=11)
        group_lines = [lines[every[k].name] for k in group.members]
        _draw_group(picture, surface, measurements.definitions.faces, group_lines, height)
        table = panels[2 * row + 1, column]
        table.set(xlim=(0, 1), ylim=(longest + 1, 0))
        _write_table(table, group, measured, system, written_names)
    return figure


def _written_names(names: Mapping[str, str] | None) -> dict[str, str]:
    if names is None:
        return {}
    return {name: plain(text(written, f"names[{name!r}]")) for name, written in names.items()}


def _draw_group(
    ax: Axes, surface: Points, faces: Triangles, lines: Sequence[Sequence[Array]], height: int
) -> None:
    """Draw numbered lines on a body, from the side on which most of them are visible."""
    collections = import_matplotlib("collections")
    normals = vertex_normals(surface, faces)
    tree = cKDTree(surface)
    nearest = [[tree.query(np.asarray(part))[1] for part in parts] for parts in lines]
    view = max(_VIEWS, key=lambda candidate: _length_seen(candidate, lines, nearest, normals))
    window = window_around(surface, view)
    picture = render(surface, faces, height=height, view=view, window=window)
    x, y = window.centre
    half_width = window.width / 2
    half_height = window.height / 2
    extent = (x - half_width, x + half_width, y - half_height, y + half_height)
    ax.imshow(picture, extent=extent, interpolation="antialiased")
    places = []
    for number, (parts, vertices) in enumerate(zip(lines, nearest, strict=True)):
        color = f"C{number % 10}"
        in_picture = [view.rotate(np.asarray(part))[:, :2] for part in parts]
        for flat, near in zip(in_picture, vertices, strict=True):
            is_visible = view.rotate(normals[near])[:, 2] > _FACING
            segments = np.stack([flat[:-1], flat[1:]], axis=1)
            in_front = is_visible[:-1] & is_visible[1:]
            for is_drawn, opacity in ((in_front, 1.0), (~in_front, _PALE)):
                collection = collections.LineCollection(
                    segments[is_drawn], colors=color, linewidths=1.7, alpha=opacity
                )
                ax.add_collection(collection, autolim=False)
        places.append(np.concatenate(in_picture))
    _write_numbers(ax, places, x, half_width)


def _length_seen(
    view: View,
    lines: Sequence[Sequence[Array]],
    nearest: Sequence[Sequence[Integers]],
    normals: Array,
) -> float:
    """Return the length of lines in the picture that is on the near side of the body."""
    total = 0.0
    for parts, vertices in zip(lines, nearest, strict=True):
        for part, near in zip(parts, vertices, strict=True):
            flat = view.rotate(np.asarray(part))[:, :2]
            is_visible = view.rotate(normals[near])[:-1, 2] > 0
            lengths = np.linalg.norm(np.diff(flat, axis=0), axis=1)
            total += float(lengths[is_visible].sum())
    return total


def _write_numbers(ax: Axes, places: Sequence[Array], middle: float, width: float) -> None:
    """Write numbers in columns beside the body, with leader lines to their lines."""
    sides: dict[int, list[tuple[float, int, Array]]] = {-1: [], 1: []}
    for number, points in enumerate(places):
        side = 1 if points[:, 0].mean() >= middle else -1
        end = points[(side * points[:, 0]).argmax()]
        sides[side].append((float(end[1]), number, end))
    for side, entries in sides.items():
        entries.sort(key=lambda entry: entry[0], reverse=True)
        heights = _apart(np.array([height for height, _, _ in entries]))
        for (_, number, end), level in zip(entries, heights, strict=True):
            x = middle + side * (width + 0.10)
            color = f"C{number % 10}"
            ax.plot(
                [end[0], x - side * 0.035],
                [end[1], level],
                color=_LEADER,
                linewidth=0.5,
                linestyle=(0, (1.5, 2)),  # dotted: dashes of 1.5 points, gaps of 2
                zorder=2,
            )
            ax.text(x, level, str(number + 1), ha="center", va="center", fontsize=8, color=color)
    ax.set_xlim(middle - width - 0.16, middle + width + 0.16)


def _apart(heights: Array) -> Array:
    """Return descending heights moved as little as needed to be a gap apart."""
    if not len(heights):
        return heights
    steps = _LABEL_GAP * np.arange(len(heights))
    from scipy.optimize import isotonic_regression  # takes long to import

    # The nearest sequence that descends by a gap or more.
    return np.asarray(isotonic_regression(heights + steps, increasing=False).x - steps)


def _write_table(
    ax: Axes,
    group: MeasurementGroup,
    measured: BodySizes,
    system: str,
    written_names: Mapping[str, str],
) -> None:
    """Write numbers, names and values below a picture."""
    for number, k in enumerate(group.members):
        unit = readable_unit(measured.units[k], system)
        text = _text(float(measured.values[0, k]), unit)
        style: dict[str, object] = {"va": "center", "fontsize": 8}
        ax.text(0.07, number + 0.5, str(number + 1), ha="right", color=f"C{number % 10}", **style)
        name = written_names.get(measured.names[k], measured.names[k])
        small = {**style, "fontsize": 8 if len(name) <= _LONG_NAME else 6.5}
        ax.text(0.11, number + 0.5, name, ha="left", **small)
        ax.text(0.97, number + 0.5, f"{text} {unit.name}", ha="right", **style)
