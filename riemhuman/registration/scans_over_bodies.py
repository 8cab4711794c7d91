"""A scan laid over its body: distances with their sign, and the parts that it does not show."""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import product

import numpy as np
from scipy.spatial import cKDTree
from scipy.spatial.transform import Rotation

from riemhuman.arrays import Array, Booleans, Integers, Triangles
from riemhuman.checks import checked, real_array, whole
from riemhuman.errors import ArgumentError
from riemhuman.io.mesh_arrays import check_mesh
from riemhuman.kernels.surface import vertex_normals
from riemhuman.registration._scan_preparation import even_points, prepare_scan
from riemhuman.registration.folders import ScanRecord
from riemhuman.registration.registered_scans import RegisteredScan, apply_transform
from riemhuman.registration.scans import as_scan
from riemhuman.surfaces.measures import share_of_surface
from riemhuman.surfaces.nearest_points import SurfacePoints, nearest_points

# Points of the scan that are placed roughly, and then precisely.
_N_ROUGH, _N_PRECISE = 300, 2000
_N_TURNS = 12  # about each of the directions that may point up
# Steps by closest points, and the starts kept after them; then steps by tangent planes.
_ROUNDS = ((4, 12), (10, 4))
_SURFACE_STEPS, _SMALLEST_STEP = 30, 1e-5
_KEPT = 0.8  # share of the nearest points that a step is computed from
# Median distance of a scan that is in place or nearly so, and the share of it below which a motion
# is no correction of the body's own errors.
_IN_PLACE_METRES, _BETTER = 0.02, 0.8


def motion_onto_body(scan: Array, points: Array, faces: Triangles) -> Array:
    """Return the rigid motion, shape (4, 4), of a scan's points, (N, 3), onto its body, (V, 3).

    The identity if the scan is there already, or a small motion if it almost is; otherwise the best
    of iterated closest points from 76 starts (Besl and McKay, "A method for registration of 3-D
    shapes", IEEE PAMI 1992), the last steps by distances from tangent planes (Chen and Medioni,
    Image and Vision Computing 1992).
    """
    few, many = (scan[even_points(scan, count)] for count in (_N_ROUGH, _N_PRECISE))
    samples = np.concatenate([points, points[faces].mean(axis=1)])
    tree = cKDTree(samples)
    if np.median(tree.query(few)[0]) < _IN_PLACE_METRES:
        improved = _on_surface(np.eye(4), many, points, faces)
        before, after = (
            np.median(nearest_points(apply_transform(motion, many), points, faces)[1])
            for motion in (np.eye(4), improved)
        )
        return improved if after < _BETTER * before else np.eye(4)
    centre, goal = np.median(few, axis=0), np.median(samples, axis=0)
    motions = [_about(rotation, centre, goal) for rotation in _start_rotations(few, samples)]
    for n_steps, n_kept in _ROUNDS:
        ends = [_rough(motion, few, samples, tree, n_steps) for motion in motions]
        ends.sort(key=lambda end: end[0])
        motions = [motion for _, motion in ends[:n_kept]]
    refined = [_on_surface(motion, many, points, faces) for motion in motions]
    return min(refined, key=lambda motion: _mean_distance(motion, many, tree))


def _start_rotations(scan: Array, samples: Array) -> list[Array]:
    """Return rotations with each of six directions up, and those of the principal axes."""
    ups = Rotation.from_rotvec(np.pi / 2 * np.array([*np.eye(3)[[0, 2]], *-np.eye(3)[[0, 2]]]))
    upright = [Rotation.identity(), Rotation.from_rotvec([np.pi, 0.0, 0.0]), *ups]
    turns = 2 * np.pi / _N_TURNS * np.arange(_N_TURNS)
    rotations = [
        (Rotation.from_rotvec([0.0, turn, 0.0]) * up).as_matrix()
        for up, turn in product(upright, turns)
    ]
    scan_axes, body_axes = (
        np.linalg.svd(cloud - cloud.mean(axis=0), full_matrices=False)[2]
        for cloud in (scan, samples)
    )
    for first, second in product((1.0, -1.0), repeat=2):
        signs = np.array([first, second, 1.0])
        signs[2] = np.linalg.det(body_axes.T @ (signs[:, np.newaxis] * scan_axes))
        rotations.append(body_axes.T @ (signs[:, np.newaxis] * scan_axes))
    return rotations


def _about(rotation: Array, centre: Array, goal: Array) -> Array:
    """Return the motion that rotates about a centre and takes it to a goal."""
    motion = np.eye(4)
    motion[:3, :3], motion[:3, 3] = rotation, goal - rotation @ centre
    return motion


def _rough(
    motion: Array, scan: Array, samples: Array, tree: cKDTree, n_steps: int
) -> tuple[float, Array]:
    """Return the mean distance of the nearest points, and the motion, by closest points."""
    for _ in range(n_steps):
        moved = apply_transform(motion, scan)
        distances, nearest = tree.query(moved)
        kept = distances <= np.quantile(distances, _KEPT)
        starts, ends = moved[kept], samples[nearest[kept]]
        middle, goal = starts.mean(axis=0), ends.mean(axis=0)
        turn, _ = Rotation.align_vectors(ends - goal, starts - middle)
        motion = _about(turn.as_matrix(), middle, goal) @ motion
    return _mean_distance(motion, scan, tree), motion


def _on_surface(motion: Array, scan: Array, points: Array, faces: Triangles) -> Array:
    """Return a motion improved by distances from tangent planes of the surface."""
    normals = vertex_normals(points, faces)
    for _ in range(_SURFACE_STEPS):
        moved = apply_transform(motion, scan)
        places, distances = nearest_points(moved, points, faces)
        kept = distances <= np.quantile(distances, _KEPT)
        corners = faces[places.triangles[kept]]
        shares = places.barycentric[kept, :, np.newaxis]
        across, starts = (shares * normals[corners]).sum(axis=1), moved[kept]
        middle = starts.mean(axis=0)
        slopes = np.concatenate([np.cross(starts - middle, across), across], axis=1)
        gaps = np.einsum("nx,nx->n", (shares * points[corners]).sum(axis=1) - starts, across)
        angles_and_shift, *_ = np.linalg.lstsq(slopes, gaps, rcond=None)
        turn = Rotation.from_rotvec(angles_and_shift[:3]).as_matrix()
        step = _about(turn, middle, middle + angles_and_shift[3:])
        motion = step @ motion
        if np.abs(step - np.eye(4)).max() < _SMALLEST_STEP:
            break
    return motion


def _mean_distance(motion: Array, scan: Array, tree: cKDTree) -> float:
    """Return the mean distance of the nearest points of a scan after a motion."""
    distances = np.sort(tree.query(apply_transform(motion, scan))[0])
    return float(distances[: max(1, int(_KEPT * len(distances)))].mean())


# Vertices of a body that are nearer to its scan are seen; farther points are not of the body.
_SEEN_METRES, _BACKGROUND_METRES = 0.02, 0.05
# Points of a scan that are sparser than this many times their spacing leave no holes.
_SPACINGS = 2.0


@dataclass(frozen=True, eq=False)
class ScanOverBody:
    """A scan in the axes of its body, with distances.

    Attributes
    ----------
    scan_points : array, shape (N, 3)
        Points of the scan in the axes of the body, metres.
    scan_faces : array of int, shape (G, 3), or None
        Triangles of the scan; None for loose points.
    distances : array, shape (N,)
        Distance of each point from the body, metres; negative inside the body.
    normals : array, shape (N, 3)
        Unit normals of the body at the nearest places to the points.
    background : array of bool, shape (N,)
        Points that do not belong to the body: floor, strays or hair.
    points : array, shape (V, 3)
        The body, metres, y up.
    faces : array of int, shape (F, 3)
        Triangles of the body.
    seen : array of bool, shape (V,)
        Vertices of the body that the scan shows.
    n_points : int
        Number of points of the original scan; `thinned` keeps fewer.

    Examples
    --------
    See `lay_over_body`.
    """

    scan_points: Array
    scan_faces: Triangles | None
    distances: Array
    normals: Array
    background: Booleans
    points: Array
    faces: Triangles
    seen: Booleans
    n_points: int

    def __repr__(self) -> str:
        millimetres = 1000.0 * np.abs(self.distances[~self.background])
        return (
            f"<ScanOverBody: {self.n_points} points, {np.median(millimetres):.1f} mm median "
            f"distance, "
            f"{100 * share_of_surface(self.points, self.faces, self.seen):.0f} % of the body seen>"
        )

    def chosen(self, kept: Booleans) -> ScanOverBody:
        """Return the scan with some of its points, and the triangles between them.

        Parameters
        ----------
        kept : array of bool, shape (N,)
        """
        triangles = None
        if self.scan_faces is not None:
            numbers = np.cumsum(kept) - 1
            triangles = numbers[self.scan_faces[kept[self.scan_faces].all(axis=1)]]
        return self._with_points(np.flatnonzero(kept), triangles)

    @checked(most_points=whole(minimum=1))
    def thinned(self, most_points: int) -> ScanOverBody:
        """Return the scan with at most about this many points, evenly spread.

        In a mesh, each remaining point replaces those around it, and triangles between different
        points are kept.

        Parameters
        ----------
        most_points : int
        """
        if len(self.scan_points) <= most_points:
            return self
        kept = even_points(self.scan_points, most_points)
        triangles = None
        if self.scan_faces is not None:
            nearest = cKDTree(self.scan_points[kept]).query(self.scan_points)[1]
            triangles = _different_corners(nearest[self.scan_faces])
        return self._with_points(kept, triangles)

    def _with_points(self, kept: Integers, triangles: Triangles | None) -> ScanOverBody:
        return replace(
            self,
            scan_points=self.scan_points[kept],
            scan_faces=triangles,
            distances=self.distances[kept],
            normals=self.normals[kept],
            background=self.background[kept],
        )


def _different_corners(triangles: Triangles) -> Triangles:
    """Return triangles with three different corners, each once."""
    a, b, c = triangles.T
    proper = triangles[(a != b) & (b != c) & (c != a)]
    _, first = np.unique(np.sort(proper, axis=1), axis=0, return_index=True)
    distinct: Triangles = proper[np.sort(first)]
    return distinct


def lay_over_body(
    scan: object,
    points: object = None,
    faces: object = None,
    *,
    unit: str | None = None,
) -> ScanOverBody:
    r"""Lay a scan over its body, and measure the distances between them.

    The distance of a point x of the scan from the nearest place y on the body, with the normal n,
    is :math:`\mathrm{sign}\langle x - y, n\rangle \, \|x - y\|`.

    Parameters
    ----------
    scan : RegisteredScan, ScanRecord, or as in `ScanRegistration.solve`
        A result or record, which contains its body; or a scan, with its body as `points`. If the
        scan has other axes than the body, the rigid motion between them is found by iterated
        closest points.
    points : array_like, shape (V, 3), or mesh, optional
        The body of a scan, metres, y up; not for results and records.
    faces : array_like of int, shape (F, 3), optional
    unit : str, optional
        Unit of a scan, see `load_scan`.

    Raises
    ------
    ArgumentError
        If half of the scan is more than 5 cm away from the body.

    Examples
    --------
    >>> bodies = rh.datasets.load_open_bodies("coarse")
    >>> scan = rh.registration.simulated_scan(bodies[0], bodies.template.faces, rng=0)
    >>> over = rh.registration.lay_over_body(scan.surface, bodies[0], bodies.template.faces)
    >>> bool(np.median(abs(over.distances)) < 0.005)
    True
    """
    if isinstance(scan, RegisteredScan):
        return _of_result(scan)
    if isinstance(scan, ScanRecord):
        return _of_record(scan)
    raw = as_scan(scan, unit)
    surface, triangles = check_mesh(points, faces)
    surface = np.asarray(real_array(surface, "points", ("V", 3), batched=False))
    prepared = prepare_scan(raw)
    moved = apply_transform(motion_onto_body(prepared.points, surface, triangles), raw.points)
    places, distances = nearest_points(moved, surface, triangles)
    middle = float(np.median(distances[~prepared.background]))
    if middle > _BACKGROUND_METRES:
        raise ArgumentError(
            f"scan does not lie over the body: half of its points are more than {100 * middle:.0f} "
            "cm away from it; is it the scan from which the body was registered?"
        )
    background = prepared.background | (distances > _BACKGROUND_METRES)
    seen = _seen(moved, raw.faces, surface)
    return _laid((moved, raw.faces), (surface, triangles), places, background, seen)


def _of_result(result: RegisteredScan) -> ScanOverBody:
    moved = apply_transform(result.transform, result.scan.points)
    return _laid(
        (moved, result.scan.faces),
        (result.upright_points, result.faces),
        result.correspondence,
        result.background,
        result.matched,
    )


def _of_record(record: ScanRecord) -> ScanOverBody:
    transform, faces = record.arrays["transform"], record.arrays["faces"]
    points, moved = (
        apply_transform(transform, np.asarray(record.arrays[name], dtype=np.float64))
        for name in ("points", "shown")
    )
    places, distances = nearest_points(moved, points, faces)
    background = np.zeros(len(distances), dtype=bool)  # left out of records
    return _laid((moved, None), (points, faces), places, background, record.arrays["matched"])


def _laid(
    scan: tuple[Array, Triangles | None],
    body: tuple[Array, Triangles],
    places: SurfacePoints,
    background: Booleans,
    seen: Booleans,
) -> ScanOverBody:
    """Return a scan over its body from the places that are nearest to its points."""
    (moved, scan_faces), (points, faces) = scan, body
    corners, shares = faces[places.triangles], places.barycentric[:, :, np.newaxis]
    normals = (shares * vertex_normals(points, faces)[corners]).sum(axis=1)
    normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-12)
    offsets = moved - (shares * points[corners]).sum(axis=1)
    outward = np.einsum("nx,nx->n", offsets, normals)
    return ScanOverBody(
        scan_points=moved,
        scan_faces=scan_faces,
        distances=np.copysign(np.linalg.norm(offsets, axis=1), outward),
        normals=normals,
        background=background,
        points=points,
        faces=faces,
        seen=np.asarray(seen, dtype=bool),
        n_points=len(moved),
    )


def _seen(moved: Array, scan_faces: Triangles | None, points: Array) -> Booleans:
    """Return the vertices of a body near to its scan: to its surface, or to one of its points."""
    if scan_faces is not None and len(scan_faces):
        return np.asarray(nearest_points(points, moved, scan_faces)[1] < _SEEN_METRES)
    tree = cKDTree(moved)
    spacing = float(np.median(tree.query(moved, k=[2])[0]))
    return np.asarray(tree.query(points)[0] < max(_SEEN_METRES, _SPACINGS * spacing))
