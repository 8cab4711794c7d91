"""Points of a scan: an evenly spread choice, and their outward normals."""

from __future__ import annotations

import numpy as np
from scipy import sparse
from scipy.sparse import csgraph
from scipy.spatial import cKDTree

from riemhuman.kernels.vertex_normals import unit_vectors

_N_NEIGHBOURS = 14
_NORMAL_METRES = 0.03
# A mesh has no consistent side if more than this share of its edges join triangles that face
# different sides.
_MIXED = 0.05


def estimated_normals(points: np.ndarray) -> np.ndarray:
    """Return outward normals of loose points on a surface."""
    n = len(points)
    neighbours = cKDTree(points).query(points, k=min(_N_NEIGHBOURS, n))[1]
    around = points[neighbours] - points[neighbours].mean(axis=1, keepdims=True)
    spread = np.einsum("nkx,nky->nxy", around, around)
    normals = np.linalg.eigh(spread)[1][:, :, 0]

    first = np.repeat(np.arange(n), neighbours.shape[1] - 1)
    second = neighbours[:, 1:].ravel()
    cosines = np.einsum("ex,ex->e", normals[first], normals[second])
    graph = sparse.csr_array((1.001 - np.abs(cosines), (first, second)), shape=(n, n))
    tree = csgraph.minimum_spanning_tree(graph.maximum(graph.T))
    tree = tree + tree.T
    n_parts, part = csgraph.connected_components(tree, directed=False)
    signs = np.ones(n)
    for number in range(n_parts):
        start = int(np.argmax(part == number))
        order, parents = csgraph.breadth_first_order(tree, start, directed=False)
        for place in order[1:].tolist():
            parent = parents[place]
            same = normals[place] @ normals[parent] >= 0
            signs[place] = signs[parent] if same else -signs[parent]
    normals *= signs[:, np.newaxis]
    for number in range(n_parts):
        members = part == number
        outward = points[members] - points[members].mean(axis=0)
        if np.sum(outward * normals[members]) < 0:
            normals[members] *= -1.0
    return normals


def smoothed_normals(points: np.ndarray, normals: np.ndarray) -> np.ndarray:
    """Return normals averaged over neighbours with similar normals."""
    places = np.concatenate([points, _NORMAL_METRES * normals], axis=1)
    neighbours = cKDTree(places).query(places, k=min(_N_NEIGHBOURS, len(points)))[1]
    return unit_vectors(normals[neighbours].mean(axis=1))


def has_one_side(faces: np.ndarray) -> bool:
    """Tell whether neighbouring triangles are consistently oriented, with few exceptions."""
    edges = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]])
    n_vertices = int(faces.max()) + 1
    forward = np.sort(edges[:, 0] * n_vertices + edges[:, 1])
    # Two consistently oriented triangles pass their common edge in opposite directions.
    twice = np.count_nonzero(forward[1:] == forward[:-1])
    return bool(twice <= _MIXED * len(edges))


def outward(points: np.ndarray, normals: np.ndarray) -> bool:
    """Tell whether normals point away from the centre of their points, on the whole."""
    return bool(np.sum((points - points.mean(axis=0)) * normals) >= 0)


def thinned(points: np.ndarray, n_points: int, rng: np.random.Generator) -> np.ndarray:
    """Return the numbers of about a given number of points, spread evenly."""
    if len(points) <= n_points:
        return np.arange(len(points))
    order = rng.permutation(len(points))
    shuffled = points[order] - points.min(axis=0)
    low, high = 0.0, float(shuffled.max())
    # The first estimate assumes a surface, where the number of cubes grows as 1/width².
    width = high / np.sqrt(n_points)
    best: np.ndarray = order[:n_points]
    for _ in range(12):
        cubes = (shuffled / width).astype(np.int64)
        extent = cubes.max(axis=0) + 1
        keys = (cubes[:, 0] * extent[1] + cubes[:, 1]) * extent[2] + cubes[:, 2]
        first = np.unique(keys, return_index=True)[1]
        best = order[first]
        if abs(len(first) - n_points) <= 0.03 * n_points:
            break
        low, high = (low, width) if len(first) < n_points else (width, high)
        width = np.clip(width * np.sqrt(len(first) / n_points), 0.0, None)
        if not low < width < high:
            width = 0.5 * (low + high)
    return np.sort(best)
