"""Simulated scans of known bodies, for tests and tutorials."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import sparse
from scipy.spatial import cKDTree
from scipy.spatial.transform import Rotation

from riemhuman.arrays import Array, ArrayLike, Booleans, Integers, Triangles
from riemhuman.checks import Rng, checked, flag, generator, real, real_array, whole
from riemhuman.errors import ArgumentError, DegenerateSurfaceError
from riemhuman.io.mesh_arrays import check_mesh, triangle_sides
from riemhuman.kernels.surface import vertex_normals
from riemhuman.surfaces.measures import split_triangles, triangle_areas

_HOLE_METRES = 0.06
_PIXEL_METRES, _DEPTH_METRES = 0.006, 0.012
_FLOOR_METRES, _FLOOR_SPACING = 1.6, 0.012


@dataclass(frozen=True, eq=False)
class SimulatedScan:
    """A simulated scan of a body, and the body itself.

    Attributes
    ----------
    points : array, shape (N, 3)
        Points of the scan, metres.
    faces : array of int, shape (F, 3), or None
        Triangles of a mesh; None for loose points.
    body : array, shape (V, 3)
        The body in the position of the scan, metres.

    Examples
    --------
    >>> bodies = rh.datasets.load_open_bodies("coarse")
    >>> scan = rh.registration.simulated_scan(bodies[0], bodies.template.faces, rng=0)
    >>> scan.body.shape, scan.faces is None
    ((1202, 3), True)
    """

    points: Array
    faces: Triangles | None
    body: Array

    @property
    def surface(self) -> Array | tuple[Array, Triangles]:
        """The scan as an argument of `ScanRegistration.solve`: points, or vertices and faces."""
        return self.points if self.faces is None else (self.points, self.faces)


# More than eight arguments, because each keyword is one fault of scanners.
@checked(
    n_points=whole(minimum=1),
    mesh=flag,
    noise=real(minimum=0.0),
    missing=real(minimum=0.0, maximum=0.99),
    rotate=flag,
    clothing=real(minimum=0.0),
    floor=flag,
)
def simulated_scan(
    points: ArrayLike,
    faces: ArrayLike,
    rng: Rng = None,
    *,
    n_points: int = 20_000,
    mesh: bool = False,
    noise: float = 0.002,
    missing: float = 0.0,
    rotate: bool = True,
    clothing: float = 0.0,
    view: ArrayLike | None = None,
    floor: bool = False,
) -> SimulatedScan:
    """Return a simulated scan of a body.

    The points are sampled from the surface, independently of its triangles; the vertical axis is y.

    Parameters
    ----------
    points : array_like, shape (V, 3)
        The body, metres.
    faces : array_like of int, shape (F, 3)
        Its triangles.
    rng : None, int or numpy.random.Generator
        Source of random numbers.
    n_points : int
        Number of points, approximate for a mesh, before parts are removed.
    mesh : bool
        Whether new triangles join the points.
    noise : float
        Standard deviation of every coordinate, metres.
    missing : float
        Share of the points in holes, which are balls of 6 cm radius.
    rotate : bool
        Whether to rotate the body about the vertical by a random angle.
    clothing : float
        Largest distance of clothes from the body, metres.
    view : array_like, shape (3,), optional
        Direction from the body, before it is rotated, to the only scanner.
    floor : bool
        Whether the scan contains the floor.

    Examples
    --------
    >>> bodies = rh.datasets.load_open_bodies("coarse")
    >>> scan = rh.registration.simulated_scan(bodies[0], bodies.template.faces, n_points=3000)
    >>> scan.points.shape
    (3000, 3)
    """
    vertices, triangles = check_mesh(points, faces)
    if triangle_areas(vertices, triangles).sum() <= 0.0:
        raise DegenerateSurfaceError("points and faces have no area that could be scanned")
    random = generator(rng)
    direction = None if view is None else _direction(view)
    surface = vertices
    if clothing:
        surface = _add_clothes(vertices, triangles, clothing, random)
    if mesh:
        scan, new_faces = remesh(surface, triangles, n_points, random)
    else:
        scan, new_faces = _sample(surface, triangles, n_points, random), None
    keep = np.ones(len(scan), dtype=bool)
    if direction is not None:
        keep &= _visible(scan, surface, triangles, direction, random)
    while missing and 1.0 - keep.mean() < missing:
        centre = scan[random.integers(len(scan))]
        keep &= np.linalg.norm(scan - centre, axis=1) > _HOLE_METRES
    if new_faces is None:
        scan = scan[keep]
    else:
        new_faces = new_faces[keep[new_faces].all(axis=1)]
        used, corners = np.unique(new_faces, return_inverse=True)
        scan, new_faces = scan[used], np.asarray(corners.reshape(-1, 3), np.int64)
    scan = scan + noise * random.standard_normal(scan.shape)
    if floor:
        scan = np.concatenate([scan, _floor_below(vertices, random)])
    if rotate:
        angle = random.uniform(0.0, 2.0 * np.pi)
        rotation = Rotation.from_rotvec([0.0, angle, 0.0]).as_matrix().T
        scan, vertices = scan @ rotation, vertices @ rotation
    return SimulatedScan(scan, new_faces, vertices)


def _direction(view: ArrayLike) -> Array:
    """Return the unit vector to a scanner."""
    vector = real_array(view, "view", (3,), batched=False)
    length = np.linalg.norm(vector)
    if length == 0.0:
        raise ArgumentError("view must be a direction; found a vector of length 0")
    unit: Array = vector / length
    return unit


def remesh(
    points: Array, faces: Triangles, n_vertices: int, rng: np.random.Generator
) -> tuple[Array, Triangles]:
    """Return the surface with about a given number of random vertices and new triangles."""
    fine, triangles = points, faces
    while len(fine) < 8 * n_vertices:
        fine, triangles = split_triangles(fine, triangles)
    areas = triangle_areas(fine, triangles)
    # Draw four times as many points, and keep those that are not close to an earlier one.
    sampled = rng.choice(len(triangles), 4 * n_vertices, p=areas / areas.sum())
    sampled = np.unique(triangles[sampled, 0])
    rng.shuffle(sampled)
    chosen = _spread_apart(fine, sampled, n_vertices, float(areas.sum()))
    edges = triangle_sides(triangles)
    lengths = np.linalg.norm(fine[edges[:, 0]] - fine[edges[:, 1]], axis=1) + 1e-12
    graph = sparse.csr_array((lengths, edges.T), shape=(len(fine), len(fine)))
    graph = graph.maximum(graph.T)
    owners = sparse.csgraph.dijkstra(graph, indices=chosen, min_only=True, return_predecessors=True)
    place = np.full(len(fine), -1)
    place[chosen] = np.arange(len(chosen))
    regions = place[owners[2]]
    met = regions[triangles]
    met = met[(met[:, 0] != met[:, 1]) & (met[:, 1] != met[:, 2]) & (met[:, 2] != met[:, 0])]
    once = np.unique(np.sort(met, axis=1), axis=0, return_index=True)[1]
    return fine[chosen], met[np.sort(once)]


def _spread_apart(fine: Array, sampled: Integers, n_vertices: int, area: float) -> Integers:
    """Return about a given number of the points, no two of them close together."""
    radius = 0.75 * np.sqrt(area / n_vertices)
    close = cKDTree(fine[sampled]).query_pairs(radius, output_type="ndarray")
    dropped = np.zeros(len(sampled), dtype=bool)
    order = np.lexsort((close.max(axis=1), close.min(axis=1)))
    for first, second in np.sort(close[order], axis=1).tolist():
        if not dropped[first]:
            dropped[second] = True
    return sampled[~dropped]


def _sample(points: Array, faces: Triangles, n_points: int, rng: np.random.Generator) -> Array:
    """Return points distributed uniformly over the surface."""
    corners = points[faces]
    areas = triangle_areas(points, faces)
    sampled = rng.choice(len(faces), n_points, p=areas / areas.sum())
    first, second = rng.random((2, n_points, 1))
    beyond = first + second > 1.0
    first, second = (np.where(beyond, 1.0 - first, first), np.where(beyond, 1.0 - second, second))
    a, b, c = corners[sampled].transpose(1, 0, 2)
    sampled_points: Array = a + first * (b - a) + second * (c - a)
    return sampled_points


def _add_clothes(points: Array, faces: Triangles, size: float, rng: np.random.Generator) -> Array:
    """Return the surface moved outward by varying distances up to a size."""
    waves = rng.standard_normal((8, 3))
    waves *= 2.0 * np.pi / 0.4 / np.linalg.norm(waves, axis=1, keepdims=True)
    depth = np.cos(points @ waves.T + rng.uniform(0, 2 * np.pi, 8)).sum(axis=1) / 4.0
    depth = size * np.clip(0.5 + 0.5 * depth, 0.0, 1.0)
    moved: Array = points + depth[:, np.newaxis] * vertex_normals(points, faces)
    return moved


def _visible(
    scan: Array,
    points: Array,
    faces: Triangles,
    view: Array,
    rng: np.random.Generator,
) -> Booleans:
    """Return which points are visible to a distant scanner."""
    across = np.linalg.svd(view[np.newaxis])[2][1:]
    dense = _sample(points, faces, 200_000, rng)
    low = (dense @ across.T).min(axis=0) - _PIXEL_METRES

    def pixels(points: Array) -> tuple[Integers, ...]:
        return tuple(((points @ across.T - low) / _PIXEL_METRES).astype(np.int64).T)

    dense_pixels = pixels(dense)
    nearest = np.full([axis_pixels.max() + 2 for axis_pixels in dense_pixels], -np.inf)
    np.maximum.at(nearest, dense_pixels, dense @ view)
    visible: Booleans = nearest[pixels(scan)] - scan @ view <= _DEPTH_METRES
    return visible


def _floor_below(body: Array, rng: np.random.Generator) -> Array:
    low, high = body.min(axis=0), body.max(axis=0)
    count = int((_FLOOR_METRES / _FLOOR_SPACING) ** 2)
    places = rng.uniform(-0.5, 0.5, (count, 3)) * [_FLOOR_METRES, 0.0, _FLOOR_METRES]
    places += [0.5 * (low[0] + high[0]), low[1], 0.5 * (low[2] + high[2])]
    return places + rng.normal(0.0, 0.002, places.shape)
