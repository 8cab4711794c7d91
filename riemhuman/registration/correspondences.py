"""Places of one scan's vertices on another scan, by way of the registered bodies."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import sparse
from scipy.sparse.csgraph import dijkstra
from scipy.spatial import cKDTree

from riemhuman.arrays import Array, ArrayLike, Booleans, Integers, Triangles
from riemhuman.checks import checked, instance, integer_array
from riemhuman.errors import ArgumentError, DegenerateSurfaceError
from riemhuman.io.mesh_arrays import check_mesh, distinct_pairs, triangle_sides
from riemhuman.kernels.surface import vertex_normals
from riemhuman.registration.registered_scans import RegisteredScan
from riemhuman.registration.scans import Scan
from riemhuman.surfaces.measures import (
    adjacent_triangles,
    find_inward_triangles,
    triangle_areas,
    vertex_components,
)
from riemhuman.surfaces.nearest_points import SurfacePoints, nearest_points_around

# Lengths are shares of the diagonal of a body's bounding box, about 2 m, because templates have any
# unit. The first counts as much as a rotation of the normal by a radian: a palm and the thigh that
# it touches look different ways.
_NORMAL_LENGTH = 0.025
# Number of vertices whose triangles are searched for the nearest place.
_N_NEAR = 6
# A vertex farther from its registered body is background or not explained; a place on the other
# body that is farther from the other scan is in a hole of it.
_FARTHEST = 0.015
# Geodesic errors are searched up to these lengths first, metres, from so many vertices at once. An
# edge of length 0 would be none.
_LIMITS, _N_SOURCES, _SHORTEST = (0.05, 0.2), 200, 1e-12
# A place on a body is seen if vertices with at least this share of it are trusted.
_SEEN = 0.5
# Neighbours in a scan have places that are farther apart than this multiple of their distance, and
# the length above, only where one of them is on the wrong part of its body.
_MOST_STRETCHED = 3.0


@dataclass(frozen=True, eq=False)
class ScanCorrespondence:
    """The place of every vertex of one scan on another scan.

    Attributes
    ----------
    vertices : array of int, shape (N,)
        The nearest vertex of the other scan; -1 if either scan does not show the place.
    triangles : array of int, shape (N,), or None
        The triangle of the other scan that contains the place, -1 as above; None if the other scan
        has no triangles.
    barycentric : array, shape (N, 3), or None
        Barycentric coordinates of the place in its triangle; NaN as above.
    points : array, shape (N, 3)
        Position of the place on the other scan, in its axes, metres; NaN as above.

    Examples
    --------
    >>> bodies = rh.datasets.load_open_bodies("coarse")
    >>> registration = rh.registration.TemplateRegistration(bodies.template)
    >>> surfaces = [(body, bodies.template.faces) for body in bodies[:2]]
    >>> results = [registration.solve(surface, start=surface[0]) for surface in surfaces]
    >>> match = rh.registration.correspondence(*results)
    >>> bool(np.mean(match.vertices == np.arange(1202)) > 0.9)
    True
    """

    vertices: Integers
    triangles: Triangles | None
    barycentric: Array | None
    points: Array

    def __len__(self) -> int:
        return len(self.vertices)

    @property
    def seen(self) -> Booleans:
        """Which vertices have a place on the other scan; shape (N,)."""
        seen: Booleans = self.vertices >= 0
        return seen


@checked(result_a=instance(RegisteredScan), result_b=instance(RegisteredScan))
def correspondence(result_a: RegisteredScan, result_b: RegisteredScan) -> ScanCorrespondence:
    """Return the place of every vertex of one scan on another scan.

    A vertex goes to the nearest place on its registered body that faces the same way, to the same
    place on the other body, and from there to the nearest place on the other scan that faces the
    same way. Loose points have no side: they go to the nearest place on their body.

    Parameters
    ----------
    result_a, result_b : RegisteredScan
        Registrations of the two scans with the same model or template.

    Returns
    -------
    ScanCorrespondence
        Places are missing for the background, where either scan does not show the body, and for
        parts of a mesh, such as a hand taken for the trunk, whose places are away from those of
        the rest of it.

    Raises
    ------
    ArgumentError
        If the two bodies have different triangles, or if no part of one is trusted.

    Examples
    --------
    >>> registration = rh.registration.ScanRegistration()
    >>> results = [registration.solve(f"{name}.ply") for name in "ab"]  # doctest: +SKIP
    >>> rh.registration.correspondence(*results).vertices  # doctest: +SKIP
    """
    for name, result in (("result_a", result_a), ("result_b", result_b)):
        if not result.trusted_vertices.any():
            raise ArgumentError(f"no part of {name} is trusted: {result.message}")
    faces = result_a.faces
    if not np.array_equal(faces, result_b.faces):
        raise ArgumentError(
            "result_a and result_b must be registered with the same model; found bodies with "
            f"{len(faces):,} and {len(result_b.faces):,} triangles, or others"
        )
    scan, size = result_b.scan, _size_of(result_b)
    places, gaps = _places_on_body(result_a)
    corners = faces[places.triangles]
    targets = np.einsum("nk,nkx->nx", places.barycentric, result_b.points[corners])
    seen = _on_body(result_a, gaps)
    if result_a.scan.faces is not None:
        seen &= _without_jumps(result_a.scan.points, result_a.scan.faces, targets, _FARTHEST * size)
    for result in (result_a, result_b):
        trusted = result.trusted_vertices[corners]
        seen &= np.einsum("nk,nk->n", places.barycentric, trusted) > _SEEN

    body_normals = vertex_normals(result_b.points, faces)
    normals = np.einsum("nk,nkx->nx", places.barycentric, body_normals[corners])
    usable = np.flatnonzero(_on_body(result_b, result_b.distances))
    known = _with_normals(scan.points, _scan_normals(result_b), size)[usable]
    near = usable[_nearest_vertices(_with_normals(targets, normals, size), known)]
    numbers = np.arange(len(targets))
    if scan.faces is None:
        vertices, surface = near[:, 0], None
        points = scan.points[vertices]
        distances = np.linalg.norm(points - targets, axis=1)
    else:
        surface, distances = nearest_points_around(targets, near, scan.points, scan.faces)
        of_triangle = scan.faces[surface.triangles]
        points = np.einsum("nk,nkx->nx", surface.barycentric, scan.points[of_triangle])
        vertices = of_triangle[numbers, surface.barycentric.argmax(axis=1)]
    seen &= distances < np.maximum(_FARTHEST * size, _local_spacing(scan, near[:, 0]))
    return _only_seen(vertices, surface, points, seen)


def _only_seen(
    vertices: Integers, surface: SurfacePoints | None, points: Array, seen: Booleans
) -> ScanCorrespondence:
    missing = seen[:, np.newaxis]
    return ScanCorrespondence(
        vertices=np.where(seen, vertices, -1),
        triangles=None if surface is None else np.where(seen, surface.triangles, -1),
        barycentric=None if surface is None else np.where(missing, surface.barycentric, np.nan),
        points=np.where(missing, points, np.nan),
    )


def _size_of(result: RegisteredScan) -> float:
    """Return the diagonal of the bounding box of a registered body."""
    return float(np.linalg.norm(np.ptp(result.points, axis=0)))


def _places_on_body(result: RegisteredScan) -> tuple[SurfacePoints, Array]:
    """Return the places of a scan's vertices on its registered body, and their distances."""
    scan = result.scan
    if scan.faces is None:
        return result.correspondence, result.distances
    size, body_normals = _size_of(result), vertex_normals(result.points, result.faces)
    near = _nearest_vertices(
        _with_normals(scan.points, _scan_normals(result), size),
        _with_normals(result.points, body_normals, size),
    )
    return nearest_points_around(scan.points, near, result.points, result.faces)


def _on_body(result: RegisteredScan, distances: Array) -> Booleans:
    """Return which vertices of a scan lie on its registered body."""
    near: Booleans = ~result.background & (distances < _FARTHEST * _size_of(result))
    if result.scan.faces is not None:
        near &= np.isin(np.arange(len(near)), result.scan.faces)
    return near


def _without_jumps(points: Array, faces: Triangles, targets: Array, farthest: float) -> Booleans:
    """Return which vertices belong to the largest part of each component, without jumps in it.

    A hand that the registration has lost is taken for the trunk next to it. Every such place is
    plausible alone, but around the wrist, neighbours in the scan go to places far apart.
    """
    edges = triangle_sides(faces)
    before, after = (
        np.linalg.norm(places[edges[:, 0]] - places[edges[:, 1]], axis=1)
        for places in (points, targets)
    )
    stays_near = after < _MOST_STRETCHED * before + farthest
    whole, parts = (vertex_components(some, len(points)) for some in (edges, edges[stays_near]))
    sizes = np.bincount(parts)[parts]
    largest = np.zeros(whole.max() + 1, dtype=sizes.dtype)
    np.maximum.at(largest, whole, sizes)
    belongs: Booleans = sizes == largest[whole]
    return belongs


def _with_normals(points: Array, normals: Array, size: float) -> Array:
    """Return places and normals as points in six dimensions."""
    return np.concatenate([points, _NORMAL_LENGTH * size * normals], axis=1)


def _nearest_vertices(queries: Array, known: Array) -> Integers:
    """Return the nearest vertices, (N, k), by place and normal."""
    count = min(_N_NEAR, len(known))
    near: Integers = cKDTree(known).query(queries, k=range(1, count + 1))[1]
    return near


def _scan_normals(result: RegisteredScan) -> Array:
    """Return outward normals of a scan's vertices; those of the body for loose points."""
    scan = result.scan
    if scan.faces is not None:
        inward = find_inward_triangles(scan.points, scan.faces)
        faces = np.where(inward[:, np.newaxis], scan.faces[:, ::-1], scan.faces)
        return vertex_normals(scan.points, faces)
    normals = vertex_normals(result.points, result.faces)
    places = result.correspondence
    sums: Array = np.einsum(
        "nk,nkx->nx", places.barycentric, normals[result.faces[places.triangles]]
    )
    return sums


def _local_spacing(scan: Scan, vertices: Integers) -> Array:
    """Return the distance of some of a scan's vertices to their neighbours, metres."""
    distances: Array = cKDTree(scan.points).query(scan.points[vertices], k=[4])[0][:, 0]
    return distances


def geodesic_errors(
    vertices: ArrayLike, faces: ArrayLike, found: ArrayLike, truth: ArrayLike
) -> Array:
    """Return the distances between found and true vertices along the surface.

    Lengths are divided by the square root of the area, as in benchmarks of matching. Paths run
    along edges, and straight between the far corners of adjacent triangles; their lengths are
    within a few per cent of those of geodesics.

    Parameters
    ----------
    vertices : array_like, shape (V, 3)
        A mesh.
    faces : array_like of int, shape (F, 3)
    found, truth : array_like of int, shape (n,)
        Vertices of the mesh; -1 for none found.

    Returns
    -------
    array, shape (n,)
        NaN where none was found; straight distances between parts that are not connected.

    Examples
    --------
    >>> bodies = rh.datasets.load_open_bodies("coarse")
    >>> mesh = bodies[0], bodies.template.faces
    >>> rh.registration.geodesic_errors(*mesh, [5, -1], [5, 5]).tolist()
    [0.0, nan]
    """
    points, triangles = check_mesh(vertices, faces)
    reached = np.asarray(integer_array(found, "found", ("n",)))
    expected = np.asarray(integer_array(truth, "truth", (len(reached),)))
    if max(reached.max(initial=0), expected.max(initial=0)) >= len(points) or np.any(expected < 0):
        raise ArgumentError(f"found and truth must be vertices of the mesh, below {len(points)}")
    area = float(triangle_areas(points, triangles).sum())
    if area <= 0.0:
        raise DegenerateSurfaceError("vertices and faces have no area to divide lengths by")
    graph = _shortcut_graph(points, triangles)
    errors = np.where(reached < 0, np.nan, 0.0)
    rest = np.flatnonzero((reached >= 0) & (reached != expected))
    for limit in (*_LIMITS, np.inf):
        farther = []
        for part in np.array_split(rest, max(1, -(-len(rest) // _N_SOURCES))):
            sources, rows = np.unique(expected[part], return_inverse=True)
            lengths = dijkstra(graph, directed=False, indices=sources, limit=limit)
            errors[part] = lengths[rows, reached[part]]
            farther.append(part[np.isinf(errors[part])])
        rest = np.concatenate(farther)
        if not len(rest):
            break
    errors[rest] = np.linalg.norm(points[reached[rest]] - points[expected[rest]], axis=1)
    scaled: Array = errors / np.sqrt(area)
    return scaled


def _shortcut_graph(points: Array, faces: Triangles) -> sparse.csr_array:
    """Return a graph of the lengths of edges, and of those across pairs of adjacent triangles."""
    pairs, edges = adjacent_triangles(faces)
    opposite = [
        faces[triangles].sum(axis=1) - edges.sum(axis=1)
        for triangles in pairs.T  # the corners off the edge
    ]
    joined = np.concatenate([triangle_sides(faces), np.stack(opposite, axis=1)])
    ends, *_ = distinct_pairs(np.sort(joined, axis=1))
    ends = ends[ends[:, 0] != ends[:, 1]]
    lengths = np.linalg.norm(points[ends[:, 0]] - points[ends[:, 1]], axis=1)
    shape = (len(points), len(points))
    return sparse.csr_array((np.maximum(lengths, _SHORTEST), ends.T), shape=shape)
