"""The data in a viewer's page: surfaces as compressed 16-bit integers, colours and values."""

from __future__ import annotations

import base64
import zlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy import ndarray
from scipy import sparse

from riemhuman.io.mesh_arrays import check_mesh
from riemhuman.plots._colors import SKIN, VALUE_COLORS, colour_limit, value_colors
from riemhuman.plots.rendering import View

# Bodies of body models and registered scans are shown whole; larger scans would make pages heavy.
MAX_VERTICES = 20_000
_LEVELS = 2**16 - 1


@dataclass(frozen=True)
class ViewedBody:
    """A body or a path of bodies in a viewer.

    Parameters
    ----------
    label : str
        Label of the body.
    frames : array, shape (n_times, V, 3)
        Surfaces at equally spaced times, metres.
    color : tuple of float
        Red, green and blue between 0 and 1.
    values : array, shape (F,), optional
        Non-negative values of the triangles, shown as colours.
    largest : float, optional
        Value of the last colour; by default, 1 % of the values exceed it.
    value_label : str
        Label of the colour scale, such as the unit of the values.

    Examples
    --------
    >>> import numpy as np
    >>> import riemhuman as rh
    >>> body = rh.plots.ViewedBody("mean", np.zeros((1, 3, 3)), color=(0.93, 0.74, 0.30))
    """

    label: str
    frames: ndarray
    color: tuple[float, float, float] = SKIN
    values: ndarray | None = None
    largest: float | None = None
    value_label: str = ""

    @property
    def limit(self) -> float:
        """Value of the last colour; 0 without values."""
        if self.values is None:
            return 0.0
        return colour_limit(self.values) if self.largest is None else self.largest


def payload(
    choices: Mapping[str, Sequence[ViewedBody]], faces: ndarray, view: View, max_vertices: int
) -> dict[str, Any]:
    """Return the data of a viewer in types that JSON can hold."""
    surface = next(body for bodies in choices.values() for body in bodies).frames[0]
    kept, shown_faces = decimate(surface, faces, max_vertices)
    return {
        # Neighbouring triangles have similar numbers.
        "faces": _packed(shown_faces.astype("<u4")),
        "n_vertices": len(kept),
        "n_vertices_whole": len(surface),
        "azimuth": view.azimuth,
        "elevation": view.elevation,
        "scale": VALUE_COLORS,
        "choices": [
            {"name": name, "bodies": [_body(body, faces, kept, shown_faces) for body in bodies]}
            for name, bodies in choices.items()
        ],
    }


def quantize(frames: ndarray) -> tuple[ndarray, ndarray, ndarray]:
    """Return coordinates as 16-bit integers, and the lowest value and the step of each axis.

    low + step · integers is within half a step of the frames, shape (n_times, V, 3).
    """
    low = frames.min(axis=(0, 1))
    step = np.maximum(frames.max(axis=(0, 1)) - low, 1e-9) / _LEVELS
    return np.round((frames - low) / step).astype("<u2"), low, step


def _body(body: ViewedBody, faces: ndarray, kept: ndarray, shown_faces: ndarray) -> dict[str, Any]:
    integers, low, step = quantize(body.frames[:, kept])
    red, green, blue = (round(255 * channel) for channel in body.color)
    record = {
        "label": body.label,
        "n_frames": len(integers),
        # Differences in time, or along the surface of a single frame, are small.
        "frames": _packed(
            integers.reshape(len(integers), -1) if len(integers) > 1 else integers[0]
        ),
        "low": low.tolist(),
        "step": step.tolist(),
        "color": f"#{red:02x}{green:02x}{blue:02x}",
    }
    if body.values is not None:
        at_vertices = _mean_at_vertices(body.values, faces, body.frames.shape[1])[kept]
        colors = np.round(255 * value_colors(at_vertices, body.limit)).astype(np.uint8)
        is_whole = len(kept) == body.frames.shape[1]
        values = body.values if is_whole else at_vertices[shown_faces].mean(axis=1)
        record["colors"] = _deflated(colors)
        record["values"] = _deflated(values.astype("<f4"))
        record["largest"] = body.limit
        record["value_label"] = body.value_label
    return record


def _mean_at_vertices(values: ndarray, faces: ndarray, n_vertices: int) -> ndarray:
    """Return the mean value of the triangles at each vertex."""
    corners = faces.ravel()
    sums = np.bincount(corners, np.repeat(values, 3), n_vertices)
    return sums / np.maximum(np.bincount(corners, minlength=n_vertices), 1)


def _packed(rows: ndarray) -> str:
    """Return differences of successive rows, bytes of one significance together, compressed."""
    differences = rows.copy()
    differences[1:] -= rows[:-1]  # unsigned integers wrap around
    planes = differences.reshape(-1, 1).view(np.uint8).T
    return _deflated(planes)


def _deflated(array: ndarray) -> str:
    return base64.b64encode(zlib.compress(np.ascontiguousarray(array).tobytes(), 9)).decode("ascii")


def decimate(vertices: ndarray, faces: ndarray, max_vertices: int) -> tuple[ndarray, ndarray]:
    """Choose vertices of a surface and triangles between them that keep its silhouette.

    Edges collapse onto one of their ends, those first that move the surface least by its quadrics
    (Garland and Heckbert, 1997). Borders stay, triangles do not flip and no handle closes. The same
    choice thins surfaces registered to this one.

    Returns the indices of the kept vertices, increasing, and the triangles as indices into them;
    more than `max_vertices` are kept where no further edge may collapse.
    """
    vertices, faces = check_mesh(vertices, faces)
    kept = np.arange(len(vertices))
    quadrics = _quadrics(vertices, faces)
    while len(np.unique(faces)) > max_vertices:
        collapsed = _collapses(vertices, faces, quadrics, len(np.unique(faces)) - max_vertices)
        if not collapsed:
            break
        target = np.arange(len(vertices))
        for removed, end in collapsed:
            target[removed] = end
            quadrics[end] += quadrics[removed]
        faces = target[faces]
        distinct = (faces != np.roll(faces, 1, axis=1)).all(axis=1)
        faces = faces[distinct]
    if len(faces) and len(kept) > max_vertices:
        kept = np.unique(faces)
        faces = np.searchsorted(kept, faces)
    return kept, faces


def _quadrics(vertices: ndarray, faces: ndarray) -> ndarray:
    """Return the squared distance from the planes at each vertex as forms, shape (V, 4, 4)."""
    corners = vertices[faces]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    double_areas = np.linalg.norm(normals, axis=1)
    normals /= np.maximum(double_areas, 1e-300)[:, None]
    planes = np.column_stack([normals, -np.einsum("fx,fx->f", normals, corners[:, 0])])
    forms = double_areas[:, None, None] * planes[:, :, None] * planes[:, None]
    quadrics = np.zeros((len(vertices), 4, 4))
    for corner in faces.T:
        np.add.at(quadrics, corner, forms)
    return quadrics


def _collapses(
    vertices: ndarray, faces: ndarray, quadrics: ndarray, n_wanted: int
) -> list[tuple[int, int]]:
    """Return pairs (removed vertex, its target) that may collapse together, the cheapest."""
    n_vertices = len(vertices)
    sides = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]])
    ones = np.ones(len(sides))
    counts = sparse.coo_array((ones, sides.T), shape=(n_vertices,) * 2).tocsr()
    counts = (counts + counts.T).tocoo()
    on_border = np.zeros(n_vertices, dtype=bool)
    on_border[counts.row[counts.data != 2]] = True
    neighbours = sparse.csr_array(
        (np.ones(counts.nnz), (counts.row, counts.col)), shape=(n_vertices,) * 2
    )
    shared = (neighbours @ neighbours).multiply(neighbours).tocoo()
    # Ends that share more than two neighbours enclose a tunnel or a fold.
    allowed = (shared.data == 2) & ~on_border[shared.row]
    removed, ends = shared.row[allowed], shared.col[allowed]
    places = np.column_stack([vertices[ends], np.ones(len(ends))])
    costs = np.einsum("ei,eij,ej->e", places, quadrics[removed] + quadrics[ends], places)
    order = np.argsort(costs, kind="stable")
    # In each pass only the cheaper half, so that later passes know what has changed.
    order = order[: max(1, len(order) // 2)]
    incident = sparse.csr_array(
        (np.ones(faces.size), (faces.ravel(), np.repeat(np.arange(len(faces)), 3))),
        shape=(n_vertices, len(faces)),
    )
    touched = np.zeros(n_vertices, dtype=bool)
    chosen: list[tuple[int, int]] = []
    for number in order:
        vertex, end = int(removed[number]), int(ends[number])
        if touched[vertex] or touched[end]:
            continue
        around = faces[incident.indices[incident.indptr[vertex] : incident.indptr[vertex + 1]]]
        if touched[around].any() or _flips(vertices, around, vertex, end):
            continue
        touched[around] = True
        chosen.append((vertex, end))
        if len(chosen) == n_wanted:
            break
    return chosen


def _flips(vertices: ndarray, around: ndarray, vertex: int, end: int) -> bool:
    """Return whether a triangle would turn by more than about 75° if a vertex moved to `end`."""
    staying = around[~(around == end).any(axis=1)]
    before = vertices[staying]
    after = vertices[np.where(staying == vertex, end, staying)]
    old, new = (np.cross(c[:, 1] - c[:, 0], c[:, 2] - c[:, 0]) for c in (before, after))
    lengths = np.linalg.norm(old, axis=1) * np.linalg.norm(new, axis=1)
    return bool((np.einsum("fx,fx->f", old, new) <= 0.25 * lengths).any())
