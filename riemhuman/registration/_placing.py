"""The rigid motion that lays a scan over its body, where the axes of the two differ."""

from __future__ import annotations

from itertools import product

import numpy as np
from numpy import ndarray
from scipy.spatial import cKDTree
from scipy.spatial.transform import Rotation

from riemhuman.kernels.surface import vertex_normals
from riemhuman.registration._scan_preparation import thin_points
from riemhuman.registration.registered_scans import apply_transform

# Points of the scan that are placed roughly, and then precisely.
_N_ROUGH, _N_PRECISE = 300, 2000
_N_TURNS = 12  # about each of the directions that may point up
# Starts that go on after these many steps by closest points, and steps by tangent planes.
_ROUNDS = ((4, 12), (10, 4))
_PRECISE_STEPS = 15
_KEPT = 0.8  # share of the points, the nearest ones, that a step is computed from
_IN_PLACE_METRES = 0.02  # median distance of a scan that needs no motion


def motion_onto_body(scan: ndarray, points: ndarray, faces: ndarray) -> ndarray:
    """Return the rigid motion, shape (4, 4), of a scan's points, (N, 3), onto its body, (V, 3).

    The identity if the scan is there already; otherwise the best of iterated closest points from
    76 starts (Besl and McKay, "A method for registration of 3-D shapes", IEEE PAMI 1992), the last
    steps by distances from tangent planes (Chen and Medioni, Image and Vision Computing 1992).
    """
    rng = np.random.default_rng(0)
    few, many = (scan[thin_points(scan, count, rng)] for count in (_N_ROUGH, _N_PRECISE))
    normals = vertex_normals(points, faces)
    samples = np.concatenate([points, points[faces].mean(axis=1)])
    across = np.concatenate([normals, normals[faces].mean(axis=1)])
    tree = cKDTree(samples)
    if np.median(tree.query(few)[0]) < _IN_PLACE_METRES:
        return np.eye(4)
    centre, goal = np.median(few, axis=0), np.median(samples, axis=0)
    motions = [_about(rotation, centre, goal) for rotation in _start_rotations(few, samples)]
    for n_steps, n_kept in _ROUNDS:
        ends = [_rough(motion, few, samples, tree, n_steps) for motion in motions]
        ends.sort(key=lambda end: end[0])
        motions = [motion for _, motion in ends[:n_kept]]
    refined = [_precise(motion, many, samples, across, tree) for motion in motions]
    return min(refined, key=lambda end: end[0])[1]


def _start_rotations(scan: ndarray, samples: ndarray) -> list[ndarray]:
    """Return rotations with each of six directions up, and those of the principal axes."""
    ups = Rotation.from_rotvec(np.pi / 2 * np.array([*np.eye(3)[[0, 2]], *-np.eye(3)[[0, 2]]]))
    upright = [Rotation.identity(), Rotation.from_rotvec([np.pi, 0.0, 0.0]), *ups]
    turns = 2 * np.pi / _N_TURNS * np.arange(_N_TURNS)
    rotations = [
        (Rotation.from_rotvec([0.0, turn, 0.0]) * up).as_matrix()
        for up, turn in product(upright, turns)
    ]
    own, others = (
        np.linalg.svd(each - each.mean(axis=0), full_matrices=False)[2] for each in (scan, samples)
    )
    for first, second in product((1.0, -1.0), repeat=2):
        signs = np.array([first, second, 1.0])
        signs[2] = np.linalg.det(others.T @ (signs[:, np.newaxis] * own))
        rotations.append(others.T @ (signs[:, np.newaxis] * own))
    return rotations


def _about(rotation: ndarray, centre: ndarray, goal: ndarray) -> ndarray:
    """Return the motion that rotates about a centre and takes it to a goal."""
    motion = np.eye(4)
    motion[:3, :3], motion[:3, 3] = rotation, goal - rotation @ centre
    return motion


def _rough(
    motion: ndarray, scan: ndarray, samples: ndarray, tree: cKDTree, n_steps: int
) -> tuple[float, ndarray]:
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
    motion: ndarray, scan: ndarray, samples: ndarray, across: ndarray, tree: cKDTree
) -> tuple[float, ndarray]:
    """Return the mean distance of the nearest points, and the motion, by tangent planes."""
    for _ in range(_PRECISE_STEPS):
        moved = apply_transform(motion, scan)
        distances, nearest = tree.query(moved)
        kept = distances <= np.quantile(distances, _KEPT)
        starts, normals = moved[kept], across[nearest[kept]]
        middle = starts.mean(axis=0)
        slopes = np.concatenate([np.cross(starts - middle, normals), normals], axis=1)
        gaps = np.einsum("nx,nx->n", samples[nearest[kept]] - starts, normals)
        step, *_ = np.linalg.lstsq(slopes, gaps, rcond=None)
        turn = Rotation.from_rotvec(step[:3]).as_matrix()
        motion = _about(turn, middle, middle + step[3:]) @ motion
        if np.abs(step).max() < 1e-5:
            break
    return _mean_distance(motion, scan, tree), motion


def _mean_distance(motion: ndarray, scan: ndarray, tree: cKDTree) -> float:
    """Return the mean distance of the nearest points of a scan after a motion."""
    distances = np.sort(tree.query(apply_transform(motion, scan))[0])
    return float(distances[: max(1, int(_KEPT * len(distances)))].mean())
