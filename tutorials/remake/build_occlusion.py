"""Compute how much of its surroundings each vertex of the open body model sees at rest.

Writes riemhuman/plots/web/occlusion.npz: `python tutorials/remake/build_occlusion.py`, some
seconds a model. Pages and pictures darken the folds of bodies by it.
"""

from pathlib import Path

import numpy as np

import riemhuman as rh
from riemhuman.arrays import Array, Points, Triangles
from riemhuman.kernels.surface import vertex_normals
from riemhuman.plots._looks import topology_name
from riemhuman.plots.rendering import draw_triangles

FILE = Path(rh.plots.__file__).parent / "web" / "occlusion.npz"
_N_DIRECTIONS = 256
_PIXELS = 1100  # across the body: a pixel is about 1.6 mm
_NEAR = 3e-3  # metres by which a surface must be nearer to the eye to hide a vertex


def main() -> None:
    """Write the file."""
    arrays = {}
    for resolution in ("coarse", "full"):
        model = rh.datasets.load_open_model(resolution)
        shares = open_shares(model.template.vertices, model.faces)
        arrays[topology_name(model.faces)] = np.round(255 * shares).astype(np.uint8)
    rh.io.save_arrays(FILE, arrays, compressed=True)


def open_shares(
    vertices: Points, faces: Triangles, n_directions: int = _N_DIRECTIONS, pixels: int = _PIXELS
) -> Array:
    """Return the share of the half-space above each vertex from which it is seen, shape (V,).

    Directions count by their cosine with the normal, as light from all sides does.
    """
    middle = (vertices.min(axis=0) + vertices.max(axis=0)) / 2
    centred = vertices - middle
    radius = float(np.linalg.norm(centred, axis=1).max())
    normals = vertex_normals(vertices, faces)
    reached = np.zeros(len(vertices))
    possible = np.zeros(len(vertices))
    for towards in _sphere_points(n_directions):
        frame = _frame(towards)
        rotated = centred @ frame
        depths = _depths(rotated, faces, radius, pixels)
        cosines = np.maximum(normals @ towards, 0.0)
        # Vertices are moved outward a little, so that their own triangles do not hide them.
        places = rotated + _NEAR * (normals @ frame)
        columns = ((places[:, 0] / radius + 1) * pixels / 2).astype(int).clip(0, pixels - 1)
        rows = ((1 - places[:, 1] / radius) * pixels / 2).astype(int).clip(0, pixels - 1)
        is_visible = places[:, 2] >= depths[rows, columns] - _NEAR
        reached += np.where(is_visible, cosines, 0.0)
        possible += cosines
    return np.asarray(reached / np.maximum(possible, 1e-9))


def _depths(rotated: Array, faces: Triangles, radius: float, pixels: int) -> Array:
    """Return how near to the eye a surface is in each pixel, metres; the eye looks along -z."""
    scale = pixels / (2 * radius)
    columns = pixels / 2 + rotated[:, 0] * scale
    rows = pixels / 2 - rotated[:, 1] * scale
    corners = np.stack([columns, rows, rotated[:, 2]], axis=1)[faces]
    nearest = np.full((pixels, pixels), -np.inf)
    owner = np.full((pixels, pixels), -1)
    draw_triangles(corners, nearest, owner)
    return nearest


def _sphere_points(n: int) -> Array:
    """Return evenly spread unit vectors: a spiral by the golden angle."""
    heights = 1 - (2 * np.arange(n) + 1) / n
    angles = np.pi * (3 - np.sqrt(5)) * np.arange(n)
    flat = np.sqrt(1 - heights**2)
    return np.stack([flat * np.cos(angles), heights, flat * np.sin(angles)], axis=1)


def _frame(towards: Array) -> Array:
    """Return right, up and towards the eye as columns."""
    beside = np.array([1.0, 0.0, 0.0]) if abs(towards[0]) < 0.9 else np.array([0.0, 1.0, 0.0])
    right = np.cross(beside, towards)
    right /= np.linalg.norm(right)
    return np.stack([right, np.cross(towards, right), towards], axis=1)


if __name__ == "__main__":
    main()
