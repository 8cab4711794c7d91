"""A scan over its body: a page to look through it and cut it, and a figure.

Points outside of a body hide those inside, so that noise alone makes a body look too thin. The body
itself is therefore coloured, by the mean distance of the scan around each vertex.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from markupsafe import Markup
from numpy.typing import ArrayLike
from scipy.spatial import cKDTree

from riemhuman.arrays import Array, Image, Integers, Points, Values
from riemhuman.checks import checked, instance
from riemhuman.checks.labels import text
from riemhuman.kernels.surface import vertex_normals
from riemhuman.plots._packing import deflated, packed, packed_points
from riemhuman.plots._panels import Panel
from riemhuman.plots._web_files import fill
from riemhuman.plots.body_plots import draw_bar
from riemhuman.plots.figures import SIGNED_COLORS, SKIN, hexadecimal, new_figure, value_colors
from riemhuman.plots.rendering import points_picture, render
from riemhuman.plots.viewed_bodies import ViewedBody
from riemhuman.plots.viewer import Viewer
from riemhuman.plots.windows import View, Window, a_height, window_around
from riemhuman.readable_units import ReadableUnit, gap_unit
from riemhuman.registration import RegisteredScan, ScanOverBody, ScanRecord, lay_over_body
from riemhuman.surfaces.measures import share_of_surface

if TYPE_CHECKING:
    from matplotlib.figure import Figure

# Points of a scan on a page: corners of triangles, and loose ones, each drawn as a disc.
_MOST_CORNERS = 60_000
_MOST_DISCS = 40_000
# Ends of the colour scale, in the unit of the distances; the first that is some times the median
# distance is used.
_ENDS: Mapping[str, tuple[float, ...]] = {
    "mm": (1, 2, 3, 5, 10, 15, 20, 30, 50),
    "in": (0.04, 0.1, 0.2, 0.4, 0.6, 0.8, 1.2, 2.0),
}
_MEDIANS = 3.0
_N_BARS = 41  # of the histogram, an odd number: the middle one is about 0
# Of local means: a point weighs as a Gaussian of this deviation says, up to twice as far. Metres.
_LOCAL_METRES = 0.015
_FEWEST_POINTS = 3
_NOT_SEEN = (0.62, 0.68, 0.76)
# Points that do not belong to the body are shown up to this distance from it, metres.
_AROUND_METRES = 0.3
_STEPS_PER_METRE = 10_000.0  # of distances on a page: tenths of a millimetre
# Radii of discs, metres.
_LARGEST_DISC = 0.012
_SMALLEST_DISC = 0.0015
# Discs reach this share of the way to the sixth neighbour, so that few gaps are left. A query for
# the seventh nearest point returns it, since each point is its own nearest.
_OVERLAP = 0.75
_NEIGHBOUR = 7


@dataclass(frozen=True)
class ScanPanel(Panel):
    """A scan over the body of a page, with sliders for what is seen of both.

    `over` has few enough points to be drawn; `counts` (n_bars,) are numbers of points by their
    distance, from minus the limit to the limit, the end of the colour scale in the unit.
    """

    over: ScanOverBody
    counts: Integers
    limit: float
    unit: ReadableUnit
    name: str = "scan"

    def data(self) -> dict[str, object]:
        """Return points, their distances in tenths of millimetres, and what is seen of the body.

        The page multiplies distances by the step of the unit.
        """
        over = self.over
        record: dict[str, object] = {
            **packed_points(over.scan_points),
            "distances": packed(_tenths(over.distances).view("<u2")),
            "background": deflated(over.background.astype(np.uint8)),
            "seen": deflated(over.seen.astype(np.uint8)),
            "unit": {
                "name": self.unit.name,
                "digits": self.unit.digits,
                "step": self.unit.scale / _STEPS_PER_METRE,
            },
            "limit": self.limit,
            "scale": SIGNED_COLORS,
        }
        if over.scan_faces is None:
            record["normals"] = deflated(np.round(127 * over.normals).astype(np.int8))
            record["disc"] = _disc_radius(over.scan_points[~over.background])
        else:
            record["faces"] = packed(over.scan_faces.astype("<u4"))
        return record

    def html(self, identifier: str) -> Markup:
        """Return the sliders."""
        return fill(
            "scan_over_body.html",
            identifier=identifier,
            limit=f"{self.limit:g}",
            unit=self.unit.name,
            bars=_bars(self.counts),
            has_unseen=not self.over.seen.all(),
            has_background=bool(self.over.background.any()),
        )

    def picture(self, height: int) -> Image:
        """Return the scan, the body and the distances side by side."""
        pictures, _ = scan_pictures(self.over, self.limit, self.unit, height)
        return np.concatenate(list(pictures.values()), axis=1)


def _bars(counts: Integers) -> list[tuple[float, float, str]]:
    """Return the left edge and the height of each bar in percent, and its colour."""
    heights = 100 * counts / max(int(counts.max(initial=0)), 1)
    colors = value_colors(np.linspace(-1.0, 1.0, len(counts)), 1.0, signed=True)
    left_edges = 100 * np.arange(len(counts)) / len(counts)
    bars = zip(left_edges.round(2).tolist(), heights.round(1).tolist(), colors, strict=True)
    return [(left, height, hexadecimal(color)) for left, height, color in bars]


def local_means(over: ScanOverBody) -> Array:
    """Return the mean distance of the scan around each vertex of its body, shape (V,), metres.

    It is NaN where the scan has too few points.
    """
    foreground = over.chosen(~over.background)
    feet = foreground.scan_points - foreground.distances[:, np.newaxis] * foreground.normals
    means = np.full(len(over.points), np.nan)
    if not len(feet):
        return means
    near = cKDTree(over.points).sparse_distance_matrix(
        cKDTree(feet), 2.0 * _LOCAL_METRES, output_type="coo_matrix"
    )
    vertices, points = near.row, near.col
    # Points of the other thigh, or of the next finger, face elsewhere.
    facing = vertex_normals(over.points, over.faces)[vertices] * foreground.normals[points]
    is_same_side = facing.sum(axis=1) > 0
    vertices, points = vertices[is_same_side], points[is_same_side]
    weights = np.exp(-0.5 * (near.data[is_same_side] / _LOCAL_METRES) ** 2)
    n_vertices = len(over.points)
    sums = np.bincount(vertices, weights * foreground.distances[points], n_vertices)
    totals = np.bincount(vertices, weights, n_vertices)
    enough = np.bincount(vertices, minlength=n_vertices) >= _FEWEST_POINTS
    means[enough] = sums[enough] / totals[enough]
    return means


def _tenths(distances: Array) -> Values:
    largest = 2**15 - 1
    return np.clip(np.round(_STEPS_PER_METRE * distances), -largest, largest).astype("<i2")


def _disc_radius(points: Points) -> float:
    """Return the radius of discs at points that leave few gaps between them."""
    if len(points) < 2:
        return _LARGEST_DISC
    farthest = min(_NEIGHBOUR, len(points))
    spacings, _ = cKDTree(points).query(points, k=[farthest])
    radius = _OVERLAP * np.median(spacings)
    return float(np.clip(radius, _SMALLEST_DISC, _LARGEST_DISC))


@checked(title=text)
def view_scan(
    scan: object,
    points: object = None,
    faces: ArrayLike | None = None,
    *,
    unit: str | None = None,
    title: str | None = None,
    system: str = "cm",
) -> Viewer:
    """Return a page with a body and its scan, coloured by the distance between them.

    The body has the colours of the mean distance of the scan around each vertex; points of the scan
    have those of their own distances, of which the page has a histogram. Sliders set the opacity of
    both, and a plane cuts them. Parts of the body that the scan does not show are hatched. Of
    larger scans, about 60,000 corners of triangles or 40,000 loose points are drawn.

    Parameters
    ----------
    scan, points, faces, unit
        See `riemhuman.registration.lay_over_body`.
    title : str, optional
    system : {"cm", "in"}
        Millimetres or inches for distances.

    Examples
    --------
    >>> bodies = rh.datasets.load_open_bodies("coarse")
    >>> scan = rh.registration.simulated_scan(bodies[0], bodies.template.faces, rng=0)
    >>> viewer = rh.plots.view_scan(scan.surface, bodies[0], bodies.template.faces)
    >>> viewer.save("over.html")
    """
    gap = gap_unit(system)
    over = lay_over_body(scan, points, faces, unit=unit)
    sentences = [_sentence(over, gap)]
    if isinstance(scan, (RegisteredScan, ScanRecord)):
        trust = "Registered scan" if scan.trusted else "Registered scan, not trusted"
        title = title or trust
        if scan.message:
            sentences.insert(0, f"{scan.message[0].upper()}{scan.message[1:].rstrip('.')}.")
    limit = colour_end([_gaps(over)], gap)
    distances = gap.scale * over.distances[~over.background]
    counts, _ = np.histogram(np.clip(distances, -limit, limit), _N_BARS, (-limit, limit))
    drawn = _around(over).thinned(_MOST_DISCS if over.scan_faces is None else _MOST_CORNERS)
    if len(drawn.scan_points) < over.n_points:
        sentences.append(f"{len(drawn.scan_points):,} of {over.n_points:,} points are drawn.")
    body = ViewedBody(
        "",
        over.points[None],
        values=gap.scale * local_means(drawn),
        value_label=gap.name,
        value_caption="mean distance of the scan: + outside, − inside",
        value_limit=limit,
        value_signed=True,
    )
    return Viewer(
        over.faces,
        {"Body": [body]},
        title=title or "Scan over its body",
        description=" ".join(sentences),
        panel=ScanPanel(drawn, counts, limit, gap),
    )


def _gaps(over: ScanOverBody) -> Array:
    """Return how far points of the scan are from the body, in metres, without the background."""
    gaps: Array = np.abs(over.distances[~over.background])
    return gaps


def _sentence(over: ScanOverBody, gap: ReadableUnit) -> str:
    gaps = _gaps(over)
    if not len(gaps):
        return "No point of the scan is near the body."
    median, most = np.quantile(gaps, [0.5, 0.95])
    seen = share_of_surface(over.points, over.faces, over.seen)
    return (
        f"Half of the scan is within {gap.text(median)} {gap.name} of the body, 95 % within "
        f"{gap.text(most)} {gap.name}; the scan shows {100 * seen:.0f} % of the body's surface."
    )


def _around(over: ScanOverBody) -> ScanOverBody:
    """Return the scan without parts far from the body, such as the far end of a floor."""
    low = over.points.min(axis=0) - _AROUND_METRES
    high = over.points.max(axis=0) + _AROUND_METRES
    is_near = np.all((over.scan_points > low) & (over.scan_points < high), axis=1)
    return over.chosen(is_near)


def colour_end(gaps: Sequence[Array], gap: ReadableUnit) -> float:
    """Return a round end of the colour scale of scans with these gaps in metres, in the unit."""
    medians = [float(np.median(of_scan)) for of_scan in gaps if len(of_scan)]
    most = _MEDIANS * gap.scale * float(np.median(medians)) if medians else 0.0
    ends = _ENDS[gap.name]
    return float(next((end for end in ends if most <= end), ends[-1]))


def scan_pictures(
    over: ScanOverBody, limit: float, gap: ReadableUnit, height: int
) -> tuple[Mapping[str, Image], Window]:
    """Return pictures of the scan, the body and the distances, of one window and one light."""
    view = View()
    foreground = over.chosen(~over.background)
    points, faces = foreground.scan_points, foreground.scan_faces
    window = window_around(np.concatenate([over.points, points]), view)
    if faces is None or not len(faces):
        scan = points_picture(points, window, height, view=view)
    else:
        scan = render(points, faces, height=height, view=view, window=window)
    colors = {
        "body": np.where(over.seen[:, np.newaxis], SKIN, _NOT_SEEN),
        "distances": value_colors(gap.scale * local_means(over), limit, signed=True),
    }
    bodies = {
        name: render(over.points, over.faces, height=height, view=view, window=window, color=color)
        for name, color in colors.items()
    }
    return {"scan": scan, **bodies}, window


@checked(over=instance(ScanOverBody, "a scan over its body"), height=a_height)
def plot_scan(over: ScanOverBody, *, height: int = 1440, system: str = "cm") -> Figure:
    """Draw a scan, its body and their distances side by side, from one viewpoint.

    Parts of the body that the scan does not show are blue-grey. Distances are means around each
    vertex of the body.

    Parameters
    ----------
    over : ScanOverBody
        See `riemhuman.registration.lay_over_body`.
    height : int
        Pixels of the bodies; by default 300 an inch.
    system : {"cm", "in"}
        Millimetres or inches for distances.

    Examples
    --------
    >>> bodies = rh.datasets.load_open_bodies("coarse")
    >>> scan = rh.registration.simulated_scan(bodies[0], bodies.template.faces, rng=0)
    >>> over = rh.registration.lay_over_body(scan.surface, bodies[0], bodies.template.faces)
    >>> figure = rh.plots.plot_scan(over)
    """
    gap, gaps = gap_unit(system), _gaps(over)
    end = colour_end([gaps], gap)
    pictures, window = scan_pictures(over, end, gap, height)
    figure = new_figure(3 * 4.6 * window.width / window.height + 1.2, 5.2)
    axes = figure.subplots(1, 3)
    median = f"{gap.text(np.median(gaps))} {gap.name}" if len(gaps) else ""
    titles = {
        "scan": f"scan, {over.n_points:,} points",
        "body": "registered body",
        "distances": f"median distance: {median}" if median else "",
    }
    for ax, (name, picture) in zip(axes, pictures.items(), strict=True):
        ax.imshow(picture, interpolation="antialiased")
        ax.set_axis_off()
        ax.set_title(titles[name], fontsize=10, pad=8)
    if not over.seen.all():
        axes[1].text(
            0.5,
            -0.01,
            "blue-grey: not scanned",
            transform=axes[1].transAxes,
            ha="center",
            va="top",
            fontsize=9,
        )
    draw_bar(axes[2], -end, end, f"scan outside (+) or inside (−) the body, {gap.name}")
    return figure
