"""How often a surface runs through itself."""

import numpy as np


def count_self_intersections(vertices, faces):
    """Return the number of pairs of triangles without a common vertex that meet."""
    corners = vertices[faces]
    order = corners[:, :, 0].min(axis=1).argsort()
    corners, faces = corners[order], faces[order]
    low, high = corners.min(axis=1), corners.max(axis=1)
    # Of every triangle, those that begin along x before it ends.
    counts = np.searchsorted(low[:, 0], high[:, 0], side="right") - np.arange(len(faces)) - 1
    first = np.repeat(np.arange(len(faces)), counts)
    second = first + 1 + np.arange(len(first)) - np.repeat(np.cumsum(counts) - counts, counts)
    near = np.all((low[second] <= high[first]) & (high[second] >= low[first]), axis=1)
    first, second = first[near], second[near]
    apart = (faces[first][:, :, None] != faces[second][:, None]).all(axis=(1, 2))
    a, b = corners[first[apart]], corners[second[apart]]
    return int(np.sum(_edges_meet(a, b) | _edges_meet(b, a)))


def _edges_meet(a, b):
    """Tell of pairs of triangles, shape (m, 3, 3), whether an edge of one pierces the other."""
    origin, side, second_side = b[:, 0], b[:, 1] - b[:, 0], b[:, 2] - b[:, 0]
    normal = np.cross(side, second_side)
    meets = np.zeros(len(a), dtype=bool)
    for start, end in ((0, 1), (1, 2), (2, 0)):
        p, q = a[:, start] - origin, a[:, end] - origin
        above, below = np.sum(p * normal, axis=1), np.sum(q * normal, axis=1)
        crossing = above * below < 0
        share = np.where(crossing, above / np.where(crossing, above - below, 1.0), 0.0)
        hit = p + share[:, None] * (q - p)
        weights = np.stack(
            [
                np.sum(np.cross(hit, second_side) * normal, axis=1),
                np.sum(np.cross(side, hit) * normal, axis=1),
            ]
        )
        inside = (weights >= 0).all(axis=0) & (weights.sum(axis=0) <= np.sum(normal**2, axis=1))
        meets |= crossing & inside
    return meets
