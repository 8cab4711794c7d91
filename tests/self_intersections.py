"""How often a surface runs through itself."""

import numpy as np


def count_self_intersections(vertices, faces):
    """Return the number of pairs of triangles without a common vertex that meet."""
    corners = vertices[faces]
    low, high = corners.min(axis=1), corners.max(axis=1)
    first, second = [], []
    for t in range(len(faces) - 1):
        near = np.all((low[t + 1 :] <= high[t]) & (high[t + 1 :] >= low[t]), axis=1)
        others = t + 1 + np.flatnonzero(near)
        others = others[~np.isin(faces[others], faces[t]).any(axis=1)]
        first.append(np.full(len(others), t))
        second.append(others)
    a, b = corners[np.concatenate(first)], corners[np.concatenate(second)]
    return int(np.sum(_edges_meet(a, b) | _edges_meet(b, a)))


def _edges_meet(a, b):
    """Tell of pairs of triangles, shape (m, 3, 3), whether an edge of one pierces the other."""
    origin, side, other = b[:, 0], b[:, 1] - b[:, 0], b[:, 2] - b[:, 0]
    normal = np.cross(side, other)
    found = np.zeros(len(a), dtype=bool)
    for start, end in ((0, 1), (1, 2), (2, 0)):
        p, q = a[:, start] - origin, a[:, end] - origin
        above, below = np.sum(p * normal, axis=1), np.sum(q * normal, axis=1)
        crossing = above * below < 0
        share = np.where(crossing, above / np.where(crossing, above - below, 1.0), 0.0)
        hit = p + share[:, None] * (q - p)
        weights = np.stack(
            [
                np.sum(np.cross(hit, other) * normal, axis=1),
                np.sum(np.cross(side, hit) * normal, axis=1),
            ]
        )
        inside = (weights >= 0).all(axis=0) & (weights.sum(axis=0) <= np.sum(normal**2, axis=1))
        found |= crossing & inside
    return found
