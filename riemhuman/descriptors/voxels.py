"""Grids of voxels around a mesh, and the voxels that it encloses."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy import ndarray

# Offset of the rays from the voxels' centres, in voxels, so that no ray meets an edge exactly.
_BESIDE = np.array([7.5487767e-7, 5.6984029e-7])


@dataclass(frozen=True, eq=False)
class VoxelGrid:
    """Cubes of equal size; voxel (i, j, k) has its centre at origin + spacing * (i, j, k).

    Attributes
    ----------
    origin : array, shape (3,)
        Centre of the first voxel, in metres.
    spacing : float
        Side of a voxel, in metres.
    shape : tuple of int
        Number of voxels along each axis.
    """

    origin: ndarray
    spacing: float
    shape: tuple[int, int, int]

    @property
    def centers(self) -> ndarray:
        """Centres of all voxels, shape (*shape, 3), in metres."""
        return self.origin + self.spacing * np.stack(
            np.meshgrid(*map(np.arange, self.shape), indexing="ij"), axis=-1
        )


def grid_around(vertices: ndarray, spacing: float, margin: float) -> VoxelGrid:
    """Return the grid that covers the bounding box of points, with a margin.

    Parameters
    ----------
    vertices : array, shape (V, 3)
        Points, in metres.
    spacing : float
        Side of a voxel, in metres.
    margin : float
        Width of the margin, in metres.

    Returns
    -------
    VoxelGrid
        The grid, centred on the bounding box.
    """
    lower, upper = vertices.min(axis=0), vertices.max(axis=0)
    counts = np.ceil((upper - lower + 2 * margin) / spacing).astype(int) + 1
    origin = (lower + upper) / 2 - spacing * (counts - 1) / 2
    return VoxelGrid(origin, spacing, (int(counts[0]), int(counts[1]), int(counts[2])))


def enclosed_voxels(corners: ndarray, grid: VoxelGrid) -> ndarray:
    """Return which voxels have their centres inside a mesh.

    A centre is inside if rays along at least two of the three axes are inside, by the sum of signed
    crossings with triangles. A hole in the mesh thus has an effect only where it is seen along two
    axes.

    Parameters
    ----------
    corners : array, shape (F, 3, 3)
        Corners of the triangles, oriented outwards.
    grid : VoxelGrid
        Grid that covers the mesh.

    Returns
    -------
    array of bool, shape (*grid.shape)
    """
    positions = (corners - grid.origin) / grid.spacing
    votes = np.zeros(grid.shape, dtype=np.int8)
    for axis in range(3):
        across = [(axis + 1) % 3, (axis + 2) % 3]
        order = [*across, axis]
        inside = _enclosed_along_last_axis(positions[:, :, order], [grid.shape[i] for i in order])
        votes += np.transpose(inside, np.argsort(order))
    return votes >= 2


def _enclosed_along_last_axis(corners: ndarray, shape: list[int]) -> ndarray:
    """Return the voxels inside by the signed crossings of rays; corners are in voxels."""
    plane = corners[:, :, :2] - _BESIDE
    first = np.maximum(np.ceil(plane.min(axis=1)), 0).astype(np.int64)
    last = np.minimum(np.floor(plane.max(axis=1)), np.array(shape[:2]) - 1).astype(np.int64)
    widths = np.maximum(last - first + 1, 0)
    counts = widths.prod(axis=1)
    triangle = np.repeat(np.arange(len(corners)), counts)
    number = np.arange(len(triangle)) - np.repeat(np.cumsum(counts) - counts, counts)
    rows = first[triangle, 0] + number // np.maximum(widths[triangle, 1], 1)
    columns = first[triangle, 1] + number % np.maximum(widths[triangle, 1], 1)

    # Signed areas of a ray's triangles with each side: all have one sign if the ray crosses.
    to_corners = plane[triangle] - np.stack([rows, columns], axis=1)[:, np.newaxis]
    following = np.roll(to_corners, -1, axis=1)
    opposite = to_corners[:, :, 0] * following[:, :, 1] - to_corners[:, :, 1] * following[:, :, 0]
    total = opposite.sum(axis=1)
    crosses = ((opposite > 0).all(axis=1) | (opposite < 0).all(axis=1)) & (total != 0)
    # Side i lies opposite to corner i + 2.
    weights = np.roll(opposite[crosses], -1, axis=1) / total[crosses, np.newaxis]
    heights = np.sum(weights * corners[triangle[crosses], :, 2], axis=1)

    below = np.clip(np.ceil(heights).astype(np.int64), 0, shape[2])
    cell = (rows[crosses] * shape[1] + columns[crosses]) * (shape[2] + 1) + below
    crossings = np.bincount(
        cell, np.sign(total[crosses]), minlength=shape[0] * shape[1] * (shape[2] + 1)
    ).reshape(shape[0], shape[1], shape[2] + 1)
    above = np.cumsum(crossings[:, :, ::-1], axis=2)[:, :, ::-1]
    return above[:, :, 1:] > 0.5
