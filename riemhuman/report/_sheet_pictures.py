"""Pictures of a person's sheet: scan and body from three sides, silhouettes, and changes."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.spatial import cKDTree

from riemhuman.arrays import Array, Image, Points, Triangles
from riemhuman.kernels.surface import vertex_normals
from riemhuman.measurements import MeasurementSet
from riemhuman.plots.figures import SKIN, value_colors
from riemhuman.plots.rendering import image_source, render
from riemhuman.plots.windows import View, Window
from riemhuman.report.sheet_values import SheetSubject, SheetValues

# Degrees about the vertical, from a body that faces the eye.
SIDES = {"front": 0.0, "side": 90.0, "back": 180.0}
_HEIGHT = 720  # pixels of a picture
_MARGIN = 0.025  # metres around a body
_GAP = 0.015  # metres between views
_UNSEEN = (0.60, 0.67, 0.76)  # parts of a body that are not trusted
_SCAN = (0.72, 0.74, 0.76)
_NEIGHBOURS = 16  # points of a scan that give a normal
_SPARSEST = 2.0  # times the usual distance: wider gaps are holes
_OVERLAP = 0.95  # half the side of a splat over the distance to the fourth neighbour
# Colours of silhouettes: both bodies, the person alone, the average alone.
SHARED, LARGER, SMALLER = (148, 155, 164), (196, 98, 45), (63, 127, 191)
_SHARED_OPACITY = 0.45
LARGEST_CHANGE = 0.02  # metres outward of the last colour
# Between two marks of a ruler, and metres in a unit of its numbers.
_RULER_STEPS = {"cm": 20, "in": 12}
_METRES = {"cm": 0.01, "in": 0.0254}
_HIPS = ("left_trochanterion", "right_trochanterion")


@dataclass(frozen=True, eq=False)
class Picture:
    """A row of views at one scale: its pixels, and the heights at its lower and upper edge."""

    pixels: Image  # (height, width, 4)
    low: float
    high: float
    middles: tuple[float, ...]  # of the views, as shares of the width
    titles: tuple[str, ...]

    @property
    def metres_per_pixel(self) -> float:
        return (self.high - self.low) / len(self.pixels)

    @property
    def first_view(self) -> Image:
        return self.pixels[:, : round(2.0 * self.middles[0] * self.pixels.shape[1])]

    @cached_property
    def source(self) -> str:
        """The address of the picture, encoded once for the page and the PDF file."""
        return image_source(self.pixels)

    def marks(self, units: str) -> list[tuple[float, int]]:
        """Return the marks of a ruler: pixels from the top, and centimetres or inches."""
        step = _RULER_STEPS[units]
        count = int(np.floor(self.high / (step * _METRES[units]))) + 1
        return [
            ((self.high - number * step * _METRES[units]) / self.metres_per_pixel, number * step)
            for number in range(count)
        ]


def front_of(points: Points, definitions: MeasurementSet) -> Array:
    """Return the rotation about the vertical that makes a body face +z, shape (3, 3).

    It is known by the hips; without such landmarks, the body faces +z.
    """
    if not all(name in definitions.landmarks for name in _HIPS):
        return np.eye(3)
    left, right = (
        weights @ points[vertices]
        for vertices, weights in (definitions.landmarks[name] for name in _HIPS)
    )
    across = np.array([1.0, 0.0, 1.0]) * (left - right)
    length = float(np.linalg.norm(across))
    if not length > 0.0:
        return np.eye(3)
    # The left of a body that faces +z is at +x.
    x, _, z = across / length
    return np.array([[x, 0.0, z], [0.0, 1.0, 0.0], [-z, 0.0, x]])


def body_pictures(
    subject: SheetSubject, faces: Triangles, rotation: Array
) -> tuple[Picture | None, Picture]:
    """Return the scan, if there is one, and the body, from the same sides at the same scale."""
    middle = (subject.points.min(axis=0) + subject.points.max(axis=0)) / 2
    ground = np.array([middle[0], subject.points[:, 1].min(), middle[2]])
    body = (subject.points - ground) @ rotation.T
    points = body
    scan = None
    if subject.scan is not None and len(subject.scan):
        scan = (subject.scan - ground) @ rotation.T
        points = np.concatenate([body, scan])
    windows = _windows(points, tuple(SIDES.values()))
    colors = np.where(subject.known_vertices[:, np.newaxis], SKIN, _UNSEEN)
    titles = tuple(SIDES)
    drawn = _views(body, faces, windows, colors, titles)
    if scan is None:
        return None, drawn
    splats, triangles = _splats(scan, body, faces)
    return _views(splats, triangles, windows, np.array(_SCAN), titles), drawn


def silhouette_picture(values: SheetValues, faces: Triangles) -> Picture | None:
    """Return the body in the standard pose over the average of its sex and stature."""
    if values.standing is None or values.average is None or values.average_faces is None:
        return None
    person = _centred(values.standing, faces)
    average = _centred(values.average, values.average_faces)
    sides = (SIDES["front"], SIDES["side"])
    windows = _windows(np.concatenate([person, average]), sides)
    person_views = _views(person, faces, windows, np.array(SKIN), ("front", "side"))
    average_views = _views(
        average, values.average_faces, windows, np.array(SKIN), ("front", "side")
    )
    # Where each body is in the picture.
    person_cover = person_views.pixels[..., 3] / 255.0
    average_cover = average_views.pixels[..., 3] / 255.0
    layers = (
        (SHARED, np.minimum(person_cover, average_cover) * _SHARED_OPACITY),
        (LARGER, np.clip(person_cover - average_cover, 0.0, 1.0)),
        (SMALLER, np.clip(average_cover - person_cover, 0.0, 1.0)),
    )
    opacity = np.sum([share for _, share in layers], axis=0)
    mixed = np.sum([share[..., np.newaxis] * np.array(color) for color, share in layers], axis=0)
    pixels = np.zeros((*opacity.shape, 4), dtype=np.uint8)
    pixels[..., :3] = np.round(mixed / np.maximum(opacity, 1e-6)[..., np.newaxis])
    pixels[..., 3] = np.round(255 * np.clip(opacity, 0.0, 1.0))
    return Picture(
        pixels, person_views.low, person_views.high, person_views.middles, person_views.titles
    )


def change_picture(values: SheetValues, faces: Triangles) -> Picture | None:
    """Return the body at the later visit, coloured by how far it moved outward."""
    if values.changes is None:
        return None
    body = _centred(values.changes.points_after, faces)
    moved = values.changes.displacements
    colors = value_colors(np.nan_to_num(moved), LARGEST_CHANGE, signed=True)
    colors[np.isnan(moved)] = _UNSEEN
    sides = (SIDES["front"], SIDES["back"])
    return _views(body, faces, _windows(body, sides), colors, ("front", "back"))


def _centred(points: Points, faces: Triangles) -> Array:
    """Return a body on the ground whose surface has its centre over the origin."""
    corners = points[faces]
    areas = np.linalg.norm(
        np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1
    )
    centre = np.average(corners.mean(axis=1), axis=0, weights=areas)
    return np.asarray(points - [centre[0], points[:, 1].min(), centre[2]])


def _windows(points: Points, azimuths: tuple[float, ...]) -> list[tuple[View, Window]]:
    """Return views and windows of one height, each as wide as the points."""
    low = points[:, 1].min() - _MARGIN
    high = points[:, 1].max() + _MARGIN
    views = []
    for azimuth in azimuths:
        view = View(azimuth=azimuth, elevation=0.0)
        columns = view.rotate(points)[:, 0]
        left = columns.min() - _GAP
        right = columns.max() + _GAP
        window = Window(((left + right) / 2, (low + high) / 2), right - left, high - low)
        views.append((view, window))
    return views


def _views(
    points: Points,
    faces: Triangles,
    windows: list[tuple[View, Window]],
    colors: Array,
    titles: tuple[str, ...],
) -> Picture:
    pictures = [
        render(points, faces, height=_HEIGHT, view=view, window=window, color=colors)
        for view, window in windows
    ]
    pixels = np.concatenate(pictures, axis=1)
    ends = np.cumsum([picture.shape[1] for picture in pictures])
    middles = [
        (end - picture.shape[1] / 2) / ends[-1] for end, picture in zip(ends, pictures, strict=True)
    ]
    _, window = windows[0]
    low = window.centre[1] - window.height / 2
    return Picture(pixels, low, low + window.height, tuple(map(float, middles)), titles)


def _splats(scan: Points, body: Points, faces: Triangles) -> tuple[Points, Triangles]:
    """Return a small square in the surface at each point of a scan, as a mesh."""
    gaps, neighbours = cKDTree(scan).query(scan, k=min(_NEIGHBOURS, len(scan)))
    offsets = scan[neighbours] - scan[neighbours].mean(axis=1, keepdims=True)
    # The neighbours spread least along the normal, and most along the last axis.
    _, axes = np.linalg.eigh(np.einsum("nki,nkj->nij", offsets, offsets))
    first = axes[..., 1]
    second = axes[..., 2]
    _, nearest = cKDTree(body).query(scan)
    outward = vertex_normals(body, faces)[nearest]
    # Squares are seen from outside.
    is_inward = np.sum(np.cross(first, second) * outward, axis=1) < 0.0
    second = np.where(is_inward[:, np.newaxis], -second, second)
    spacing = gaps[:, min(4, gaps.shape[1] - 1)]
    size = _OVERLAP * np.minimum(spacing, _SPARSEST * np.median(spacing))
    square = np.stack([-first - second, first - second, first + second, second - first], axis=1)
    corners = scan[:, np.newaxis] + size[:, np.newaxis, np.newaxis] * square
    first_corners = 4 * np.arange(len(scan))
    triangles = np.array([[0, 1, 2], [0, 2, 3]]) + first_corners[:, np.newaxis, np.newaxis]
    points: Points = corners.reshape(-1, 3)
    return points, triangles.reshape(-1, 3)
