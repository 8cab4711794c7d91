"""Arrays as text in pages: small numbers, compressed."""

from __future__ import annotations

import base64
import zlib

import numpy as np

from riemhuman.arrays import Points, Values

LEVELS = 2**16 - 1  # of coordinates


def packed(rows: Values) -> str:
    """Return differences of successive rows, bytes of one significance together, compressed."""
    differences = rows.copy()
    differences[1:] -= rows[:-1]  # unsigned integers wrap around
    planes = differences.reshape(-1, 1).view(np.uint8).T
    return deflated(planes)


def deflated(array: Values) -> str:
    """Return the bytes of an array, compressed, as text."""
    return base64.b64encode(zlib.compress(np.ascontiguousarray(array).tobytes(), 9)).decode("ascii")


def packed_points(points: Points) -> dict[str, object]:
    """Return points, shape (n, 3), as whole numbers of 16 bits between their lowest and highest."""
    low = points.min(axis=0)
    step = np.maximum(points.max(axis=0) - low, 1e-9) / LEVELS
    integers = np.round((points - low) / step).astype("<u2")
    return {"points": packed(integers), "low": low.tolist(), "step": step.tolist()}
