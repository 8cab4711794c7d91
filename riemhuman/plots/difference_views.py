"""Where two bodies differ: signed millimetres along the normal, or a metric's density.

The first body is plain, and the second is coloured by where it differs.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from riemhuman.arrays import Array, Points, Triangles
from riemhuman.checks import checked, instance, real_array
from riemhuman.checks.labels import names_of, text
from riemhuman.errors import ArgumentError
from riemhuman.geometry import AlignedSurfaces, ElasticMetric
from riemhuman.io.mesh_arrays import check_triangles
from riemhuman.kernels.surface import vertex_normals
from riemhuman.measurements import (
    Measurements,
    VisitComparison,
    compare_visits,
    open_measurements,
)
from riemhuman.plots.body_plots import contributions, per_area, plot_path
from riemhuman.plots.figures import colour_limit, new_figure
from riemhuman.plots.measurement_views import measurement_panel
from riemhuman.plots.rendering import as_surfaces
from riemhuman.plots.viewed_bodies import ViewedBody
from riemhuman.plots.viewer import Viewer
from riemhuman.plots.windows import View, a_height, a_view
from riemhuman.readable_units import ReadableUnit, gap_unit
from riemhuman.surfaces import Template
from riemhuman.surfaces.procrustes import procrustes

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from riemhuman.plots._panels import Panel

_MEASUREMENTS = instance(Measurements, "a Measurements(...)")
_DENSITY = "Metric"
_LENGTHS = {"cm": "Millimetres", "in": "Inches"}  # the name of the other choice, with units


@dataclass(frozen=True)
class _Difference:
    """Two bodies in one pose and place, and where the second differs from the first."""

    surfaces: tuple[Points, Points]
    faces: Triangles
    displacements: Array  # (V,) along the normals of the first, metres; NaN where not seen
    is_standard: bool  # whether they are in the standard pose
    panel: Panel | None = None


@checked(measurements=_MEASUREMENTS, title=text)
def view_difference(
    point_a: object,
    point_b: object = None,
    faces: ArrayLike | None = None,
    *,
    names: Sequence[str] = ("first", "second"),
    measurements: Measurements | None = None,
    metric: ElasticMetric | None = None,
    title: str | None = None,
    system: str = "cm",
) -> Viewer:
    """Return a page with two bodies side by side, the second coloured by where it differs.

    One choice of the page is how far its surface is outside (+) or inside (−) of the first, in
    millimetres along normals; the other what each place adds to the squared distance under a
    metric. Bodies of a body model with
    measurements are brought to the standard pose, and their measurements are listed with the
    changes and the noise of changes; others stand as they are, the second moved onto the first by
    Procrustes analysis.

    Parameters
    ----------
    point_a, point_b : array_like, shape (V, 3), or mesh
        The bodies, metres; or a `VisitComparison` of both, with `measurements`.
    faces : array_like, shape (F, 3), optional
        Triangles; none for meshes and comparisons.
    names : sequence of two str
    measurements : Measurements, optional
        By default those of the open body model, if the bodies have its triangles.
    metric : ElasticMetric, optional
        By default the metric of body shape, (1, 0.0001, 0).
    title : str, optional
    system : {"cm", "in"}
        Millimetres between surfaces and centimetres of measurements, or inches.

    Examples
    --------
    >>> bodies = rh.datasets.load_open_bodies("coarse")
    >>> faces = bodies.template.faces
    >>> viewer = rh.plots.view_difference(bodies[0], bodies[10], faces, names=("Anna", "Ben"))
    >>> viewer.save("difference.html")
    """
    gap = gap_unit(system)
    titles = names_of(names, "names", 2, "bodies")
    difference = _difference(point_a, point_b, faces, measurements, titles, system)
    outside = gap.scale * difference.displacements
    density = _density(difference, metric)
    before, after = (surface[np.newaxis] for surface in difference.surfaces)
    first, second = titles
    plain = ViewedBody(first, before)
    lengths = ViewedBody(
        second,
        after,
        values=outside,
        value_label=gap.name,
        value_caption=f"+ outside {first}, − inside",
        value_limit=colour_limit(outside),
        value_signed=True,
    )
    densities = ViewedBody(
        second,
        after,
        values=density,
        value_label="per m²",
        value_caption=f"share of the squared distance from {first}",
        value_limit=colour_limit(density),
    )
    choices = {_LENGTHS[system]: [plain, lengths], _DENSITY: [plain, densities]}
    return Viewer(
        difference.faces,
        choices,
        legend="Colours",
        title=title or f"Differences between {titles[0]} and {titles[1]}",
        description=_description(difference, titles, gap),
        panel=difference.panel,
    )


@checked(measurements=_MEASUREMENTS, height=a_height, view=a_view)
def plot_difference(
    point_a: object,
    point_b: object = None,
    faces: ArrayLike | None = None,
    *,
    names: Sequence[str] = ("first", "second"),
    measurements: Measurements | None = None,
    view: View | None = None,
    height: int = 1440,
    system: str = "cm",
) -> Figure:
    """Draw two bodies side by side, the second coloured by where it differs from the first.

    Both are of one scale, on one floor.

    Parameters
    ----------
    point_a, point_b, faces, names, measurements
        As for `view_difference`.
    view : View, optional
    height : int
        Pixels of the bodies; by default 300 an inch.
    system : {"cm", "in"}
        Millimetres or inches.

    Examples
    --------
    >>> bodies = rh.datasets.load_open_bodies("coarse")
    >>> figure = rh.plots.plot_difference(bodies[0], bodies[10], bodies.template.faces)
    """
    gap = gap_unit(system)
    titles = names_of(names, "names", 2, "bodies")
    difference = _difference(point_a, point_b, faces, measurements, titles)
    outside = gap.scale * difference.displacements
    values = np.stack([np.zeros_like(outside), outside])  # the colour of 0 is that of skin
    figure = new_figure(7.2, 4.8)
    plot_path(
        np.stack(difference.surfaces),
        difference.faces,
        values,
        largest=colour_limit(values),
        labels=titles,
        label=f"{titles[1]} outside (+) or inside (−) {titles[0]}, {gap.name}",
        view=view,
        ax=figure.subplots(),
        height=height,
    )
    return figure


def _description(difference: _Difference, names: tuple[str, ...], gap: ReadableUnit) -> str:
    is_seen = np.isfinite(difference.displacements)
    if not is_seen.any():
        return "No part of the surface was seen in both scans."
    displacements = gap.scale * difference.displacements[is_seen]
    median = np.median(np.abs(displacements))
    inside = max(-displacements.min(), 0.0)
    outside = max(displacements.max(), 0.0)
    pose = "In the standard pose" if difference.is_standard else "As they stand"
    description = (
        f"{pose}, half of the surface of {names[1]} is within {median:.3g} {gap.name} of that of "
        f"{names[0]}; it is up to {inside:.3g} {gap.name} inside and {outside:.3g} {gap.name} "
        "outside."
    )
    if not is_seen.all():
        unseen = 100.0 * (1.0 - is_seen.mean())
        description += f" The grey {unseen:.0f} % was not seen in both scans."
    return description


def _density(difference: _Difference, metric: ElasticMetric | None) -> Array:
    """Return each triangle's share of the squared distance, per area of the template."""
    if metric is None:
        space = AlignedSurfaces(
            Template(difference.surfaces[0], difference.faces), equip=False, scale=None
        )
        metric = ElasticMetric(space)
    added = contributions(metric, *difference.surfaces).total
    template = metric.space.template
    return per_area(added, template.vertices, template.faces)


def _difference(
    point_a: object,
    point_b: object,
    faces: ArrayLike | None,
    measurements: Measurements | None,
    names: tuple[str, ...],
    system: str | None = None,
) -> _Difference:
    """Return two bodies in one pose and, if units are given, the list of their measurements."""
    if isinstance(point_a, VisitComparison):
        if measurements is None:
            raise ArgumentError(
                "measurements must be passed with a comparison: the ones with which it was made"
            )
        return _of_comparison(point_a, measurements, names, system)
    if point_b is None:
        raise ArgumentError("point_b must be given, unless point_a is a VisitComparison")
    first, triangles = as_surfaces(point_a, faces)
    second, second_triangles = as_surfaces(point_b, faces)
    surface = np.asarray(real_array(first, "point_a", ("V", 3), batched=False))
    second_surface = np.asarray(real_array(second, "point_b", surface.shape, batched=False))
    triangles = check_triangles(triangles, len(surface), "point_a")
    if faces is None and not np.array_equal(triangles, second_triangles):
        raise ArgumentError("point_a and point_b must have the same triangles")
    if measurements is None:
        definitions = open_measurements(Template(surface, triangles))
        measurements = None if definitions is None else Measurements(definitions)
    if measurements is not None and measurements.definitions.model is not None:
        compared = compare_visits(measurements, surface, second_surface)
        return _of_comparison(compared, measurements, names, system)
    moved = procrustes(second_surface, to=surface, scale=None)
    outward = np.sum((moved - surface) * vertex_normals(surface, triangles), axis=1)
    return _Difference((surface, moved), triangles, outward, is_standard=False)


def _of_comparison(
    compared: VisitComparison,
    measurements: Measurements,
    names: tuple[str, ...],
    system: str | None,
) -> _Difference:
    surfaces = (compared.points_before, compared.points_after)
    panel = None
    if system is not None:
        panel = measurement_panel(measurements, surfaces, compared, names, system)
    faces = measurements.definitions.faces
    return _Difference(surfaces, faces, compared.displacements, is_standard=True, panel=panel)
