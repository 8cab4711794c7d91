"""Triangle areas, edge lengths and volumes of surfaces, adjacency and orientation of triangles."""

from __future__ import annotations

import numpy as np
from scipy import sparse
from scipy.sparse.csgraph import connected_components

from riemhuman.arrays import Array, Booleans, Integers, Points, Triangles
from riemhuman.checks import real_array
from riemhuman.io.mesh_arrays import check_edges, check_triangles, distinct_pairs
from riemhuman.kernels.surface import doubled_area_vectors, triangle_corners

# Share of the cube of its extent below which the volume of a surface is that of a flat one.
_FLAT = 1e-4
# A part of a mesh has a sign of its own if its triangles look away from its centre by more than
# this share of their distance from it, and if it has more than this share of the area.
_LEAST_CURVATURE, _LEAST_AREA = 0.12, 0.01


def triangle_areas(points: Points, faces: Triangles) -> Array:
    """Return the areas of triangles, square metres, shape (..., F).

    Parameters
    ----------
    points : array, shape (..., V, 3), in metres
    faces : array of int, shape (F, 3)

    Examples
    --------
    >>> bodies = rh.datasets.load_open_bodies("coarse")
    >>> float(rh.surfaces.triangle_areas(bodies[0], bodies.template.faces).sum().round(2))
    1.77
    """
    points = real_array(points, "points", ("n_vertices", 3))
    faces = check_triangles(faces, points.shape[-2])
    doubled_areas: Array = np.linalg.norm(doubled_area_vectors(points, faces), axis=-1)
    return 0.5 * doubled_areas


def edge_lengths(points: Points, edges: Integers) -> Array:
    """Return the lengths of edges, metres, shape (..., E).

    Parameters
    ----------
    points : array, shape (..., V, 3), in metres
    edges : array of int, shape (E, 2)
        Edges, such as `Template.edges`.

    Examples
    --------
    >>> bodies = rh.datasets.load_open_bodies("coarse")
    >>> rh.surfaces.edge_lengths(bodies[0], bodies.template.edges).shape
    (3600,)
    """
    points = real_array(points, "points", ("n_vertices", 3))
    edges = check_edges(edges, points.shape[-2])
    sides = points[..., edges[:, 1], :] - points[..., edges[:, 0], :]
    lengths: Array = np.linalg.norm(sides, axis=-1)
    return lengths


def signed_volume(points: Points, faces: Triangles) -> Array:
    """Return the volumes of closed surfaces, Σ_t det(q₁, q₂, q₃)/6, cubic metres, shape (...).

    They are positive if normals point outward, and NaN if the mesh is not closed.

    Parameters
    ----------
    points : array, shape (..., V, 3), in metres
    faces : array of int, shape (F, 3)

    Examples
    --------
    >>> bodies = rh.datasets.load_open_bodies("coarse")
    >>> float(rh.surfaces.signed_volume(bodies[0], bodies.template.faces).round(3))
    0.059
    """
    points = real_array(points, "points", ("n_vertices", 3))
    faces = check_triangles(faces, points.shape[-2])
    if not is_closed(faces):
        return np.full(points.shape[:-2], np.nan)
    return _enclosed(points, faces)


def _enclosed(points: Points, faces: Triangles) -> Array:
    # Relative to the first vertex, to keep precision for bodies far from the origin.
    points = points - points[..., :1, :]
    corner_1, corner_2, corner_3 = triangle_corners(points, faces)
    volumes: Array = np.sum(corner_1 * np.cross(corner_2, corner_3), axis=(-2, -1)) / 6.0
    return volumes


def body_size(surface: Points, faces: Triangles | None) -> tuple[float, float]:
    """Return the largest extent and the volume, NaN if flat or without triangles that enclose it.

    Parameters
    ----------
    surface : array, shape (V, 3)
    faces : array of int, shape (F, 3), or None
        Triangles of a closed surface.
    """
    extent = float(np.ptp(surface, axis=0).max())
    volume = np.nan if faces is None else float(_enclosed(surface, faces))
    return extent, volume if abs(volume) > _FLAT * extent**3 else np.nan


def share_of_surface(points: Points, faces: Triangles, chosen: Booleans) -> float:
    """Return the share of a surface around some of its vertices, of which hands have many."""
    areas = triangle_areas(points, faces)
    return float(areas @ chosen[faces].mean(axis=1) / areas.sum())


def is_closed(faces: Triangles) -> bool:
    """Return whether every edge belongs to two triangles, which pass it in opposite directions.

    Without triangles, nothing is closed.

    Parameters
    ----------
    faces : array of int, shape (F, 3)

    Examples
    --------
    >>> bodies = rh.datasets.load_open_bodies("coarse")
    >>> rh.surfaces.is_closed(bodies.template.faces)
    True
    """
    faces = check_triangles(faces)
    if len(faces) == 0:
        return False
    sides = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]])
    n_vertices = int(faces.max()) + 1
    keys = sides[:, 0] * n_vertices + sides[:, 1]
    reversed_keys = sides[:, 1] * n_vertices + sides[:, 0]
    return bool(len(np.unique(keys)) == len(keys) and np.isin(reversed_keys, keys).all())


def adjacent_triangles(faces: Triangles) -> tuple[Integers, Integers]:
    """Return pairs of triangles that share an edge, and the vertices of that edge, both (P, 2).

    More than two triangles at an edge form a chain.
    """
    starts, ends = faces.T.ravel(), faces[:, [1, 2, 0]].T.ravel()
    n_vertices = int(faces.max(initial=0)) + 1
    # One number per edge, because sorting pairs takes many times as long.
    keys = np.maximum(starts, ends) * n_vertices + np.minimum(starts, ends)
    order = np.argsort(keys, kind="stable")
    same = np.flatnonzero(np.diff(keys[order]) == 0)
    higher, lower = np.divmod(keys[order[same]], n_vertices)
    # Side k n_faces + t is the k-th of triangle t.
    pairs = np.stack([order[same], order[same + 1]], axis=1) % len(faces)
    return pairs, np.stack([lower, higher], axis=1)


def split_triangles(points: Array, faces: Triangles) -> tuple[Array, Triangles]:
    """Return the surface with every triangle cut into four."""
    sides = np.sort(faces[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1)
    edges, numbers, _ = distinct_pairs(sides)
    a, b, c = faces.T
    ab, bc, ca = (len(points) + numbers.reshape(-1, 3)).T
    parts = [[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]]
    middles = points[edges].mean(axis=1)
    return np.concatenate([points, middles]), np.array(parts).transpose(2, 0, 1).reshape(-1, 3)


def vertex_components(faces: Triangles, n_vertices: int) -> Integers:
    """Return the connected component of every vertex, by triangles or edges."""
    starts, ends = faces[:, :-1].ravel(), faces[:, 1:].ravel()
    shape = (n_vertices, n_vertices)
    links = sparse.coo_array((np.ones(len(starts)), (starts, ends)), shape=shape)
    components: Integers = connected_components(links, directed=False)[1]
    return components


def find_inward_triangles(points: Array, faces: Triangles) -> Booleans:
    """Return which triangles face inward, shape (F,); scanners join parts of both orientations.

    A part consists of triangles connected by consistently oriented neighbours. It faces outward if
    its triangles face away from its centre; small or nearly flat parts are oriented like the whole
    mesh.
    """
    centres = points[faces].mean(axis=1)
    directed = 0.5 * doubled_area_vectors(points, faces)
    areas = np.linalg.norm(directed, axis=1)

    def outwardness(part: Integers) -> tuple[Array, Array]:
        """Return how far each part looks away from its centre, between -1 and 1, and its area."""
        area = np.maximum(np.bincount(part, areas), np.finfo(float).tiny)
        middle = np.stack([np.bincount(part, areas * x) for x in centres.T], axis=1)
        offsets = centres - (middle / area[:, np.newaxis])[part]
        along = np.bincount(part, np.einsum("fx,fx->f", offsets, directed))
        most = np.bincount(part, np.linalg.norm(offsets, axis=1) * areas)
        return along / np.maximum(most, np.finfo(float).tiny), area

    pairs, alike = oriented_alike(faces)
    links = sparse.coo_array((alike[alike], pairs[alike].T), shape=(len(faces),) * 2)
    part = connected_components(links, directed=False)[1]
    curvature, area = outwardness(part)
    together, _ = outwardness(np.zeros(len(faces), dtype=np.int64))
    decided = (np.abs(curvature) > _LEAST_CURVATURE) & (area > _LEAST_AREA * area.sum())
    is_inward: Booleans = np.where(decided, curvature < 0, together[0] < 0)[part]
    return is_inward


def oriented_alike(faces: Triangles) -> tuple[Integers, Booleans]:
    """Return pairs of triangles that share an edge, (P, 2), and which pass it in opposite ways."""
    pairs, edges = adjacent_triangles(faces)
    first, second = _pass_ahead(faces[pairs[:, 0]], edges), _pass_ahead(faces[pairs[:, 1]], edges)
    return pairs, first != second


def _pass_ahead(corners: Triangles, edges: Integers) -> Booleans:
    """Return which triangles pass one of their edges each from its first to its second vertex."""
    is_start, is_end = corners == edges[:, :1], np.roll(corners, -1, axis=1) == edges[:, 1:]
    ahead: Booleans = np.any(is_start & is_end, axis=1)
    return ahead
