"""A depth buffer: which triangle is nearest to the eye in each sample of a picture."""

from __future__ import annotations

import numpy as np

from riemhuman.arrays import Array, Integers
from riemhuman.kernels.compilation import compiled


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
