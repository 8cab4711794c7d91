"""Triangles of a path that have all but vanished: held so that others move on, and raised.

Where a triangle loses its area its normal jumps, and so does a metric that sees normals. A path may
get stuck there: each direction that still leads down moves such a triangle a little, too. Held as
it is, it lets the others move on.
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import islice
from typing import Any

import numpy as np
from numpy import ndarray
from scipy import sparse

from riemhuman.kernels.triangles import nearly_degenerate_triangles
from riemhuman.solvers.quasi_newton import Operator

# Heights, as shares of the longest edge, of triangles that are flat; and how many are held at most,
# the flattest: each costs three vectors of all coordinates.
_FLAT = 1e-5
_MOST = 20

# By what share heights are raised, more than turns change them by rounding, and how often at most:
# a corner may be the tip of several triangles.
_RAISE = 1e-4
_MOST_RAISES = 20


def holding(inverse: Operator, nodes: ndarray, faces: ndarray) -> Operator:
    r"""Return an inverse Hessian over the motions that leave flat triangles as flat as they are.

    The corner opposite to the longest edge stays where it is relative to that edge. With these
    linear conditions C x = 0 the inverse H becomes H − H Cᵀ (C H Cᵀ)⁻¹ C H.

    Parameters
    ----------
    inverse : callable
        Symmetric positive operator H on the coordinates of all nodes.
    nodes : array, shape (n, V, 3)
        Surfaces.
    faces : array of int, shape (F, 3)
        Triangles.

    Returns
    -------
    callable
    """
    _, n_vertices, n_axes = nodes.shape
    columns, entries = [], []
    for node, corners, weights in islice(_flat_triangles(nodes, faces), _MOST):
        columns.append(n_axes * (n_vertices * node + corners) + np.arange(n_axes)[:, None])
        entries.append(np.broadcast_to(weights, columns[-1].shape))
    if not columns:
        return inverse
    starts = np.arange(0, np.size(columns) + 1, len(weights))
    shape = len(starts) - 1, nodes.size
    conditions = sparse.csr_array((np.ravel(entries), np.ravel(columns), starts), shape=shape)
    images = np.array([inverse(conditions[[row]].toarray()[0]) for row in range(shape[0])])
    # Conditions on triangles that share corners may depend on each other.
    among = np.linalg.pinv((conditions @ images.T).T, hermitian=True)
    return lambda slope: inverse(slope) - (among @ (images @ slope)) @ images


def raised(nodes: ndarray, template: Any) -> ndarray:
    """Return surfaces whose triangles are higher, by next to nothing, where they have no area.

    Parameters
    ----------
    nodes : array, shape (n, V, 3)
        Surfaces, on which triangles have no area by rounding errors alone.
    template : Template
        Their template.

    Returns
    -------
    array, shape (n, V, 3)
    """
    higher = nodes.copy()
    for _ in range(_MOST_RAISES):
        marked = nearly_degenerate_triangles(higher, template.faces, template.frame_coefficients)
        if not marked.any():
            break
        for node, triangle in np.argwhere(marked):
            corners, weights = _tip_over_edge(higher[node], template.faces[triangle])
            higher[node, corners[0]] += _RAISE * weights @ higher[node, corners]
    return higher


def _flat_triangles(nodes: ndarray, faces: ndarray) -> Iterator[tuple[int, ndarray, ndarray]]:
    """Yield node, corners and their weights in the height, the flattest triangle first."""
    corners = nodes[:, faces]
    # Edge k is opposite to corner k.
    edges = np.roll(corners, -2, axis=2) - np.roll(corners, -1, axis=2)
    squares = np.sum(edges**2, axis=-1)
    doubled_areas = np.linalg.norm(np.cross(edges[:, :, 0], edges[:, :, 1]), axis=-1)
    flatness = doubled_areas / squares.max(axis=-1)
    order = np.argsort(flatness, axis=None)[: np.count_nonzero(flatness < _FLAT)]
    for node, triangle in zip(*np.unravel_index(order, flatness.shape), strict=True):
        yield node, *_tip_over_edge(nodes[node], faces[triangle])


def _tip_over_edge(f: ndarray, face: ndarray) -> tuple[ndarray, ndarray]:
    """Return the corner over the longest edge, then its ends, and their weights in the height."""
    x = f[face]
    lengths = [np.linalg.norm(x[k - 1] - x[k - 2]) for k in range(3)]
    cycle = (int(np.argmax(lengths)) + np.arange(3)) % 3
    tip, first, last = x[cycle]
    edge = last - first
    share = (tip - first) @ edge / (edge @ edge)
    return face[cycle], np.array([1.0, share - 1.0, -share])
