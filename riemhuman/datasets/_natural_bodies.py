"""Traits of real people that the open model lacks: hands that touch, soft tissue, detail."""

from __future__ import annotations

import numpy as np

from riemhuman.arrays import Array
from riemhuman.bodies import BodyModel, joint_motions, rotation_matrix, skin_surface
from riemhuman.kernels.rotations import log
from riemhuman.kernels.surface import unit_vectors, vertex_normals

# Direction of the left palm in the model's rest pose, and half the thickness of a hand.
_PALM = np.array([-0.669, -0.691, -0.274])
_HALF_HAND_METRES = 0.012
# Scales of the costs of missing the place, of tilting the palm, and of leaving the defined pose.
_MISS_METRES = 0.003
_TILT_RADIANS = 0.3
_ROTATION_RADIANS = 0.4
_N_STEPS = 20

# Individual detail of the surface that no shape coefficient describes, and soft tissue that bulges
# or sinks in around a point near a joint, in proportion to one minus the cosine of its angle.
_DETAIL_METRES, _DETAIL_WAVELENGTHS = 0.0015, (0.08, 0.3)
_BULGE_METRES = 0.02
_BULGE_WIDTH = 0.08
_BULGE_SHIFT = 0.03
_N_WAVES = 12


def natural_surfaces(
    model: BodyModel,
    joints: Array,
    betas: Array,
    poses: Array,
    rng: np.random.Generator,
) -> Array:
    """Return the surfaces of one person in some poses, with individual detail and soft tissue."""
    points = model.template.vertices
    detail = surface_noise(points, _DETAIL_METRES, _DETAIL_WAVELENGTHS, rng)
    centres = joints + rng.normal(0.0, _BULGE_SHIFT, joints.shape)
    sizes = rng.normal(0.0, _BULGE_METRES, len(joints))
    offsets = (points[:, None] - centres) / _BULGE_WIDTH
    bulges = (sizes * np.exp(-0.5 * np.sum(offsets**2, axis=-1)))[..., None] * offsets
    bent = 1.0 - np.cos(np.linalg.norm(poses, axis=-1))
    rest = model(betas) + detail + np.tensordot(bent, bulges, axes=(1, 1))

    shaped_joints = model.joints(betas)
    rotations, positions = joint_motions(shaped_joints, rotation_matrix(poses), model.parents)
    return skin_surface(rest, model.weights, shaped_joints, rotations, positions)


def reach(model: BodyModel, betas: Array, poses: Array, side: str, points: Array) -> Array:
    """Return poses with one palm on the body, at points on the left side of the rest surface."""
    names = model.joint_names
    mirror = np.array([1.0 if side == "left" else -1.0, 1.0, 1.0])
    arm = [names.index(f"{side}_{joint}") for joint in ("shoulder", "elbow", "wrist")]
    targets, outward = _touched(model, betas, poses, points * mirror)
    joints = model.joints(betas)
    hand = model.weights[:, arm[-1]] > 0.9
    palm = model(betas)[:, hand].mean(axis=1) + _HALF_HAND_METRES * mirror * _PALM
    facing = mirror * _PALM / np.linalg.norm(_PALM)
    defined = rotation_matrix(poses)

    def residuals(vectors: Array) -> Array:
        """Return the residuals, shape (people, m, 15), for axis-angle vectors (people, m, 9)."""
        rotations = np.repeat(defined[:, None], vectors.shape[1], axis=1)
        swings = rotation_matrix(vectors.reshape(*vectors.shape[:-1], 3, 3))
        rotations[..., arm, :, :] = swings @ rotations[..., arm, :, :]
        frames, positions = joint_motions(joints[:, None], rotations, model.parents)
        frame = frames[..., arm[-1], :, :]
        lever = (palm - joints[:, arm[-1]])[:, None, :, None]
        reached = positions[..., arm[-1], :] + (frame @ lever)[..., 0]
        parts = (
            (reached - targets[:, None]) / _MISS_METRES,
            (frame @ facing + outward[:, None]) / _TILT_RADIANS,
            vectors / _ROTATION_RADIANS,
        )
        return np.concatenate(parts, axis=-1)

    # Gauss–Newton for all people at once, with finite differences.
    vectors = np.zeros((len(betas), 9))
    step = 1e-6
    nearby = np.concatenate([np.zeros((1, 9)), step * np.eye(9)])
    for _ in range(_N_STEPS):
        values = residuals(vectors[:, None] + nearby)
        slopes = np.swapaxes(values[:, 1:] - values[:, :1], -1, -2) / step
        normal = np.swapaxes(slopes, -1, -2) @ slopes
        change = np.linalg.solve(normal, np.swapaxes(slopes, -1, -2) @ values[:, 0, :, None])
        vectors = vectors - np.clip(change[..., 0], -0.3, 0.3)
    reached = poses.copy()
    swings = rotation_matrix(vectors.reshape(-1, 3, 3)) @ defined[:, arm]
    reached[:, arm] = log(np.eye(3), swings)
    return reached


def _touched(model: BodyModel, betas: Array, poses: Array, points: Array) -> tuple[Array, Array]:
    """Return points of the posed bodies and their outward normals, shapes (n_people, 3)."""
    arms = [name.endswith(("elbow", "wrist")) for name in model.joint_names]
    elsewhere = np.where(model.weights[:, arms].sum(axis=1) < 0.01, 0.0, np.inf)
    gaps = np.linalg.norm(model.template.vertices - points[:, None], axis=-1) + elsewhere
    nearest = gaps.argmin(axis=1)
    surfaces = model(betas, poses)
    normals = np.stack([vertex_normals(surface, model.faces) for surface in surfaces])
    people = np.arange(len(betas))
    return surfaces[people, nearest], normals[people, nearest]


def surface_noise(
    points: Array, size: float, wavelengths: tuple[float, float], rng: np.random.Generator
) -> Array:
    """Return random plane waves at every point, of root mean square length `size`, metres."""
    directions, displacements = rng.standard_normal((2, _N_WAVES, 3))
    frequencies = 2 * np.pi / rng.uniform(*wavelengths, (_N_WAVES, 1)) * unit_vectors(directions)
    phases = rng.uniform(0.0, 2 * np.pi, _N_WAVES)
    waves = np.cos(points @ frequencies.T + phases)
    lengths: Array = size * np.sqrt(2.0 / _N_WAVES) * (waves @ unit_vectors(displacements))
    return lengths
