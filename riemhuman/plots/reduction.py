"""Coarser triangulations of surfaces, for display."""

from __future__ import annotations

import numpy as np
from numpy import ndarray
from scipy import sparse
from scipy.sparse import csgraph

from riemhuman.checks import whole_number
from riemhuman.io.mesh_arrays import check_mesh


def lighter_mesh(vertices: ndarray, faces: ndarray, max_vertices: int) -> tuple[ndarray, ndarray]:
    """Choose some vertices of a surface, and triangles between them.

    No two chosen vertices are neighbours, and every other vertex has a chosen neighbour. Each
    vertex is replaced by the nearest chosen one along the edges; triangles with three different
    corners remain. This is repeated until there are few enough vertices. The same choice thins
    surfaces registered to this one.

    Parameters
    ----------
    vertices : array, shape (V, 3)
        Surface, metres.
    faces : array of int, shape (F, 3)
        Triangles.
    max_vertices : int
        Largest number of vertices to keep, unless no triangle would remain.

    Returns
    -------
    kept : array of int, shape (n_kept,)
        Indices of the kept vertices, in increasing order.
    faces : array of int, shape (n_faces, 3)
        Triangles of the kept vertices, as indices into `kept`.
    """
    vertices, faces = check_mesh(vertices, faces)
    whole_number(max_vertices, "max_vertices", minimum=4)
    kept = np.arange(len(vertices))
    while len(kept) > max_vertices:
        seeds, fewer = _once(vertices[kept], faces)
        if len(fewer) == 0:
            break
        kept, faces = kept[seeds], fewer
    return kept, faces


def _once(vertices: ndarray, faces: ndarray) -> tuple[ndarray, ndarray]:
    sides = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]])
    lengths = np.linalg.norm(vertices[sides[:, 1]] - vertices[sides[:, 0]], axis=1)
    graph = sparse.csr_array((lengths + 1e-12, sides.T), shape=(len(vertices),) * 2)
    graph = graph.maximum(graph.T).tocsr()
    taken = np.zeros(len(vertices), dtype=bool)
    seeds = []
    for vertex in range(len(vertices)):
        if not taken[vertex]:
            seeds.append(vertex)
            taken[graph.indices[graph.indptr[vertex] : graph.indptr[vertex + 1]]] = True
    _, _, nearest = csgraph.dijkstra(graph, indices=seeds, min_only=True, return_predecessors=True)
    number = np.searchsorted(seeds, nearest)
    corners = number[faces]
    distinct = (
        (corners[:, 0] != corners[:, 1])
        & (corners[:, 1] != corners[:, 2])
        & (corners[:, 2] != corners[:, 0])
    )
    turned = np.take_along_axis(
        corners[distinct],
        (corners[distinct].argmin(axis=1)[:, None] + np.arange(3)) % 3,
        axis=1,
    )
    return np.array(seeds), np.unique(turned, axis=0)
