"""The rigid motion that lays a scan over its body if their axes differ.

In go the points of a scan and a body; out comes a matrix, the identity if they agree already.
"""

from __future__ import annotations

from itertools import product

import numpy as np
from scipy.spatial import cKDTree
from scipy.spatial.transform import Rotation

from riemhuman.arrays import Array, Triangles
from riemhuman.kernels.surface import vertex_normals
from riemhuman.registration._even_points import thin_points
from riemhuman.registration.registered_scans import apply_transform
from riemhuman.surfaces.nearest_points import nearest_points

# Points of the scan that are placed roughly, and then precisely.
_N_ROUGH, _N_PRECISE = 300, 2000
_N_TURNS = 12  # about each of the directions that may point up
# Starts kept after this many steps by closest points, and steps by tangent planes.
_ROUNDS = ((4, 12), (10, 4))
_PRECISE_STEPS, _SURFACE_STEPS, _SMALLEST_STEP = 15, 20, 1e-5
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
    rng = np.random.default_rng(0)
    few, many = (scan[thin_points(scan, count, rng)] for count in (_N_ROUGH, _N_PRECISE))
    normals = vertex_normals(points, faces)
    samples = np.concatenate([points, points[faces].mean(axis=1)])
    across = np.concatenate([normals, normals[faces].mean(axis=1)])
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
    refined = [_precise(motion, many, samples, across, tree) for motion in motions]
    best = min(refined, key=lambda end: end[0])[1]
    return _on_surface(best, many, points, faces)


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


def _precise(
    motion: Array, scan: Array, samples: Array, across: Array, tree: cKDTree
) -> tuple[float, Array]:
    """Return the mean distance of the nearest points, and the motion, by tangent planes."""
    for _ in range(_PRECISE_STEPS):
        moved = apply_transform(motion, scan)
        distances, nearest = tree.query(moved)
        step = _step_to_planes(moved, samples[nearest], across[nearest], distances)
        motion = step @ motion
        if np.abs(step - np.eye(4)).max() < _SMALLEST_STEP:
            break
    return _mean_distance(motion, scan, tree), motion


def _on_surface(motion: Array, scan: Array, points: Array, faces: Triangles) -> Array:
    """Return a motion improved by distances from the surface itself."""
    normals = vertex_normals(points, faces)
    for _ in range(_SURFACE_STEPS):
        moved = apply_transform(motion, scan)
        places, distances = nearest_points(moved, points, faces)
        corners, shares = faces[places.triangles], places.barycentric[:, :, np.newaxis]
        ends = (shares * points[corners]).sum(axis=1)
        across = (shares * normals[corners]).sum(axis=1)
        step = _step_to_planes(moved, ends, across, distances)
        motion = step @ motion
        if np.abs(step - np.eye(4)).max() < _SMALLEST_STEP:
            break
    return motion


def _step_to_planes(starts: Array, ends: Array, across: Array, distances: Array) -> Array:
    """Return the small motion that brings the nearer points nearest to planes."""
    kept = distances <= np.quantile(distances, _KEPT)
    moved, normals = starts[kept], across[kept]
    middle = moved.mean(axis=0)
    slopes = np.concatenate([np.cross(moved - middle, normals), normals], axis=1)
    gaps = np.einsum("nx,nx->n", ends[kept] - moved, normals)
    step, *_ = np.linalg.lstsq(slopes, gaps, rcond=None)
    turn = Rotation.from_rotvec(step[:3]).as_matrix()
    return _about(turn, middle, middle + step[3:])


def _mean_distance(motion: Array, scan: Array, tree: cKDTree) -> float:
    """Return the mean distance of the nearest points of a scan after a motion."""
    distances = np.sort(tree.query(apply_transform(motion, scan))[0])
    return float(distances[: max(1, int(_KEPT * len(distances)))].mean())
