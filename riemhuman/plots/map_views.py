"""A map on a page: pointing at a dot shows its body."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from markupsafe import Markup
from numpy.typing import ArrayLike

from riemhuman.arrays import Array, Integers
from riemhuman.checks import real_array, values_of
from riemhuman.checks.labels import names_of, text
from riemhuman.errors import ArgumentError
from riemhuman.plots._panels import Panel
from riemhuman.plots._web_files import fill
from riemhuman.plots.figures import class_colors, hexadecimal
from riemhuman.plots.maps import free_places, named_classes
from riemhuman.plots.viewed_bodies import ViewedBody
from riemhuman.plots.viewer import Viewer

_SIZE = 100.0  # of the longer side of the map, in its own units
_MARGIN = 9.0
_MOST_NAMED = 12  # classes that are named in place
# Of names, in units of the map.
_LETTER = 1.65
_LINE = 3.4
_UNITS_PER_INCH = 20.0


@dataclass(frozen=True)
class MapPanel(Panel):
    """Points of a map beside the body that is pointed at.

    `positions` are (n, 2) and `labels` (n,); `note` says what distances on the map mean.
    """

    positions: Array
    labels: Integers
    names: Sequence[str]
    item_names: Sequence[str]
    note: str = ""
    name: str = "map"

    def data(self) -> dict[str, object]:
        """Return the name and the colour of each item."""
        colors = self._colors()
        return {"items": [list(item) for item in zip(self._titles(), colors, strict=True)]}

    def html(self, identifier: str) -> Markup:
        """Return the map."""
        low, high = self.positions.min(axis=0), self.positions.max(axis=0)
        scale = (_SIZE - 2 * _MARGIN) / max(float((high - low).max()), 1e-12)
        places = (self.positions - low) * scale * [1, -1] + [_MARGIN, 0]
        places[:, 1] += _MARGIN - places[:, 1].min()
        width, height = places.max(axis=0) + _MARGIN
        colors = self._colors()
        return fill(
            "map.html",
            width=f"{width:.1f}",
            height=f"{height:.1f}",
            dots=list(zip(places.round(2).tolist(), colors, self._titles(), strict=True)),
            names=self._named(places, colors),
            note=self.note,
        )

    def _colors(self) -> list[str]:
        """Return the colours of items, those of their classes."""
        return list(map(hexadecimal, class_colors(int(self.labels.max()) + 1)[self.labels]))

    def _titles(self) -> list[str]:
        """Return the names of items with those of their classes."""
        classes = [self.names[label] for label in self.labels]
        return [
            f"{item} ({group})" if group and group not in item else item
            for item, group in zip(self.item_names, classes, strict=True)
        ]

    def _named(self, places: Array, colors: list[str]) -> list[tuple[float, float, str, str]]:
        """Return the place, name and colour of classes, beside the points of each."""
        classes = np.unique(self.labels)
        if not 1 < len(classes) <= _MOST_NAMED:
            return []
        members = [np.flatnonzero(self.labels == label) for label in classes]
        centres = np.stack([np.median(places[numbers], axis=0) for numbers in members])
        titles = [self.names[label] for label in classes]
        sizes = np.array([[_LETTER * len(title), _LINE] for title in titles])
        inside = places.max(axis=0) + _MARGIN
        scaled = (values / _UNITS_PER_INCH for values in (centres, sizes, places, inside))
        middles = _UNITS_PER_INCH * free_places(*scaled)
        return [
            (round(float(x), 2), round(float(y) + _LINE / 4, 2), title, colors[numbers[0]])
            for (x, y), title, numbers in zip(middles, titles, members, strict=True)
        ]


def view_map(
    positions: ArrayLike,
    labels: ArrayLike,
    names: Sequence[str] | None = None,
    *,
    points: ArrayLike,
    faces: ArrayLike,
    item_names: Sequence[str] | None = None,
    note: str = "",
    title: str = "Map of bodies",
) -> Viewer:
    """Return a page with a map of bodies, on which pointing at a point shows its body.

    Parameters
    ----------
    positions : array_like, shape (n, 2)
        See `embed`.
    labels : array_like of int, shape (n,)
        Class of each body, counted from 0.
    names : sequence of str, optional
        Names of the classes, shown next to their points if there are at most twelve.
    points : array_like, shape (n, V, 3)
        The bodies, metres, y up.
    faces : array_like, shape (F, 3)
    item_names : sequence of str, length n, optional
        Names of the bodies; by default their numbers.
    note : str
        What distances on the map mean, see `describe_stress`.
    title : str

    Examples
    --------
    >>> bodies = rh.datasets.load_open_bodies("coarse")[:30:5]
    >>> metric = rh.ElasticMetric(rh.AlignedSurfaces(bodies.template))
    >>> distances = metric.dist_pairwise(bodies.points)
    >>> viewer = rh.plots.view_map(
    ...     rh.plots.embed(distances, method="mds"), bodies.subject, bodies.subject_names,
    ...     points=bodies.points, faces=bodies.template.faces)
    >>> viewer.save("map.html")
    """
    places = np.asarray(real_array(positions, "positions", ("n_items", 2), batched=False))
    items, classes = named_classes(labels, names, len(places))
    if names is None:
        classes = ("",) * len(classes)
    surfaces = np.asarray(
        real_array(points, "points", (len(places), "n_vertices", 3), batched=False)
    )
    if surfaces.size == 0:
        raise ArgumentError(f"points must hold at least one body; found shape {surfaces.shape}")
    given_names = range(len(places)) if item_names is None else item_names
    titles = names_of(given_names, "item_names", len(places), "bodies")
    page_title = text(title, "title")
    # All stand in one place.
    low, high = surfaces.min(axis=1, keepdims=True), surfaces.max(axis=1, keepdims=True)
    middle = (low + high) / 2
    middle[..., 1] = low[..., 1]
    body = ViewedBody(titles[0], surfaces - middle)
    return Viewer(
        values_of(faces, "faces"),
        {page_title: [body]},
        title=page_title,
        panel=MapPanel(places, items, classes, titles, text(note, "note")),
    )
