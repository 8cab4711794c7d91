"""Seams: borders of a mesh whose vertices exporters doubled, found and joined.

Exporters of OBJ and GLB files double the vertices where texture coordinates or normals jump. The
copies coincide, but nothing holds them together: surfaces that are moved vertex by vertex tear.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from riemhuman.arrays import Array, Booleans, Integers, Triangles
from riemhuman.checks import choice, real_array
from riemhuman.errors import ArgumentError
from riemhuman.io.mesh_arrays import check_mesh, read_only, triangle_sides

# Two border edges coincide if the distance of their corners is below both shares: of the median
# border edge, and of the shorter of the two. Rounding in files is less, and the lips of a closed
# mouth are farther apart in some body.
_TOLERANCE = 0.03
_LARGEST_GAP = 0.15
# Most pairs of a seam must coincide within the tolerance; all must within this multiple of it.
_SLACK = 3.0
# At most so many sheets of a surface are expected to meet in one edge.
_MOST_SHEETS = 6


@dataclass(frozen=True, eq=False, repr=False)
class Seams:
    """The vertices of a mesh that are duplicated along seams, and the mesh without the copies.

    Attributes
    ----------
    joined_vertices : array of int, shape (V,)
        Vertex of the joined mesh for every vertex of the mesh with seams.
    originals : array of int, shape (W,)
        For every vertex of the joined mesh, the first of its copies in the mesh with seams, in
        increasing order.
    faces : array of int, shape (F, 3)
        Triangles of the joined mesh, in their order.
    edge_pairs : array of int, shape (P, 2, 2)
        Pairs of border edges that coincide corner by corner.

    Examples
    --------
    >>> vertices = [[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 1, 0], [1, 0, 0], [1, 1, 0]]
    >>> seams = rh.io.find_seams(vertices, [[0, 1, 2], [3, 4, 5]])
    >>> seams.faces.tolist()
    [[0, 1, 2], [2, 1, 3]]
    >>> seams.split(seams.join(vertices)).tolist() == vertices
    True
    """

    joined_vertices: Integers
    originals: Integers
    faces: Triangles
    edge_pairs: Integers

    def __bool__(self) -> bool:
        return self.n_copies > 0

    def __repr__(self) -> str:
        return f"Seams(n_edges={len(self.edge_pairs)}, n_copies={self.n_copies})"

    @property
    def n_copies(self) -> int:
        """Number of vertices that joining removes, V − W."""
        return len(self.joined_vertices) - len(self.originals)

    @property
    def first_copies(self) -> Integers:
        """For every vertex of the mesh with seams, the first of its copies, shape (V,)."""
        copies: Integers = self.originals[self.joined_vertices]
        return copies

    def join(self, points: ArrayLike) -> Array:
        """Return surfaces without the copies of vertices, shape (..., W, 3).

        Parameters
        ----------
        points : array_like, shape (..., V, 3)
        """
        points = real_array(points, "points", (len(self.joined_vertices), 3))
        return np.asarray(points)[..., self.originals, :]

    def split(self, points: ArrayLike) -> Array:
        """Return surfaces with the copies of vertices, shape (..., V, 3).

        Parameters
        ----------
        points : array_like, shape (..., W, 3)
        """
        points = real_array(points, "points", (len(self.originals), 3))
        return np.asarray(points)[..., self.joined_vertices, :]


def find_seams(points: ArrayLike, faces: ArrayLike) -> Seams:
    """Find the seams of a mesh: pairs of border edges that coincide and run in opposite directions.

    Vertices that merely touch, such as those of two hands, are not on a border, so they are not
    joined. Borders that touch only in some of the surfaces, such as the lips of an open mouth, are
    not seams.

    Parameters
    ----------
    points : array_like, shape (..., V, 3)
        One surface, or several with the same triangles; corners must coincide in all of them.
    faces : array_like, shape (F, 3)

    Examples
    --------
    >>> bodies = rh.datasets.load_open_bodies("coarse")
    >>> bool(rh.io.find_seams(bodies[0], bodies.template.faces))
    False
    """
    points = np.asarray(real_array(points, "points", ("n_vertices", 3)))
    surfaces = points.reshape(math.prod(points.shape[:-2]), *points.shape[-2:])
    if not len(surfaces):
        raise ArgumentError(f"points must hold at least one surface; found shape {points.shape}")
    _, triangles = check_mesh(surfaces[0], faces)
    pairs = _opposite_borders(surfaces[0], _border_edges(triangles))
    pairs = pairs[_is_coincident(surfaces[0], pairs)]
    if len(pairs):
        gaps = _relative_gaps(surfaces[0], pairs)
        pairs = pairs[_medians(gaps, _chains(pairs, points.shape[-2])) <= 1.0]
    for surface in surfaces[1:]:
        pairs = pairs[_is_coincident(surface, pairs)]
    return _joined(triangles, points.shape[-2], pairs)


def common_seams(seams: Seams, points: Array, faces: Triangles) -> Seams:
    """Return the seams that coincide in other surfaces, too, shape (..., V, 3)."""
    pairs = seams.edge_pairs
    for surface in points.reshape(-1, *points.shape[-2:]):
        pairs = pairs[_is_coincident(surface, pairs)]
    if len(pairs) == len(seams.edge_pairs):
        return seams
    return _joined(faces, points.shape[-2], pairs)


a_seam_choice = choice("join", "keep")
"""The check of the argument of a reader that says whether seams are joined."""


def _border_edges(faces: Triangles) -> Integers:
    """Return the edges that belong to one triangle alone, in its direction, shape (B, 2)."""
    sides = triangle_sides(faces)
    keys = sides.min(axis=1) * (int(faces.max()) + 1) + sides.max(axis=1)
    order = np.argsort(keys)
    is_new = np.concatenate([[True], np.diff(keys[order]) != 0, [True]])
    edges: Integers = sides[np.sort(order[is_new[1:] & is_new[:-1]])]
    return edges


def _opposite_borders(points: Array, edges: Integers) -> Integers:
    """Return pairs of border edges that about coincide in opposite directions, shape (P, 2, 2)."""
    from scipy.spatial import cKDTree  # takes long

    edges = edges[(points[edges[:, 0]] != points[edges[:, 1]]).any(axis=1)]
    if len(edges) < 2:
        return np.zeros((0, 2, 2), dtype=np.int64)
    along = points[edges].reshape(-1, 6)
    back = points[edges[:, ::-1]].reshape(-1, 6)
    limit = 2.0 * _SLACK * _TOLERANCE * _usual_length(points, edges) + np.finfo(float).tiny
    count = min(_MOST_SHEETS, len(edges))
    gaps, partners = cKDTree(back).query(along, k=count, distance_upper_bound=limit)
    first = np.repeat(np.arange(len(edges)), count)
    second = partners.ravel()
    is_pair = (second < len(edges)) & (first < second)
    first, second = first[is_pair], second[is_pair]
    gaps_of_pairs = gaps.ravel()[is_pair]
    # Of several candidates, as on thin triangles, only the nearest; more sheets may be as near.
    least = 1.5 * gaps[:, 0] + 1e-9 * limit
    is_nearest = gaps_of_pairs <= np.minimum(least[first], least[second])
    first, second = first[is_nearest], second[is_nearest]
    return np.stack([edges[first], edges[second, ::-1]], axis=1)


def _is_coincident(points: Array, pairs: Integers) -> Booleans:
    """Return which pairs of edges coincide in a surface, up to the slack."""
    return _relative_gaps(points, pairs) <= _SLACK


def _relative_gaps(points: Array, pairs: Integers) -> Array:
    """Return the distances between the corners of pairs of edges, in units of the largest ones."""
    if not len(pairs):
        return np.zeros(0)
    first_edges, second_edges = points[pairs[:, 0]], points[pairs[:, 1]]
    gaps = np.linalg.norm(first_edges - second_edges, axis=2).max(axis=1)
    first_lengths = np.linalg.norm(first_edges[:, 1] - first_edges[:, 0], axis=1)
    second_lengths = np.linalg.norm(second_edges[:, 1] - second_edges[:, 0], axis=1)
    shorter = np.minimum(first_lengths, second_lengths)
    usual = _usual_length(points, pairs.reshape(-1, 2))
    largest = np.minimum(_TOLERANCE * usual, _LARGEST_GAP * shorter)
    relative: Array = gaps / np.maximum(largest, np.finfo(float).tiny)
    return relative


def _chains(edge_pairs: Integers, n_vertices: int) -> Integers:
    """Return the number of the chain of connected pairs that each pair belongs to, shape (P,)."""
    corners = edge_pairs.reshape(-1, 4)
    links = np.stack([corners[:, :3], corners[:, 1:]], axis=2).reshape(-1, 2)
    return _components(links, n_vertices)[corners[:, 0]]


def _medians(values: Array, groups: Integers) -> Array:
    """Return the median of the group that each value belongs to."""
    from scipy import ndimage

    _, numbers = np.unique(groups, return_inverse=True)
    return np.asarray(ndimage.median(values, numbers, np.arange(numbers.max() + 1)))[numbers]


def _components(links: Integers, n_vertices: int) -> Integers:
    """Return the connected component of every vertex."""
    from scipy import sparse
    from scipy.sparse.csgraph import connected_components

    matrix = sparse.coo_array((np.ones(len(links)), tuple(links.T)), shape=(n_vertices,) * 2)
    return np.asarray(connected_components(matrix, directed=False)[1])


def _usual_length(points: Array, edges: Integers) -> float:
    return float(np.median(np.linalg.norm(points[edges[:, 1]] - points[edges[:, 0]], axis=1)))


def _joined(faces: Triangles, n_vertices: int, edge_pairs: Integers) -> Seams:
    """Return seams that make one vertex of the corners of edges that coincide."""
    links = np.swapaxes(edge_pairs, 1, 2).reshape(-1, 2)
    groups = _components(links, n_vertices)
    _, originals, numbers = np.unique(groups, return_index=True, return_inverse=True)
    order = np.argsort(originals)
    vertices = np.argsort(order)[numbers]
    triangles = vertices[faces]
    corners = np.sort(triangles, axis=1)
    if len(links) and np.any(corners[:, 1:] == corners[:, :-1]):
        return _joined(faces, n_vertices, edge_pairs[:0])  # else these triangles had no area
    return Seams(
        joined_vertices=read_only(vertices),
        originals=read_only(originals[order]),
        faces=read_only(np.ascontiguousarray(triangles)),
        edge_pairs=read_only(edge_pairs),
    )
