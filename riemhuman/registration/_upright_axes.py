"""The direction up of a registered body, and the rigid motion to upright axes.

In goes the final pose; out come a unit vector, and a matrix of shape (4, 4).
"""

from __future__ import annotations

import numpy as np

from riemhuman.arrays import Array
from riemhuman.registration._constants import (
    FEET_AGREE,
    LEANING,
)
from riemhuman.registration._posed_body import Pose
from riemhuman.registration._registration_model import RegistrationModel
from riemhuman.registration._scan_preparation import PreparedScan

_SIDES = ("left", "right")
# Cosine of the pelvis' left with the horizontal below which the forward direction is used instead.
_LEAST_LEVEL = 0.3


def find_up(body: RegistrationModel, pose: Pose, scan: PreparedScan, start_up: Array) -> Array:
    """Return the direction up of a body in a scan: that of its start, or a better one."""
    if scan.up is None:
        return _standing_up(body, pose, start_up)
    return _upright_plane(body, pose, scan.up, scan.other_ups) if scan.other_ups else start_up


def _standing_up(body: RegistrationModel, pose: Pose, up: Array) -> Array:
    """Return an axis or, if feet and trunk both lean away from it, the direction up of the feet."""
    names = body.parts.names
    if not {"left_ankle", "right_ankle", "neck"} <= {*names}:
        return up
    motions = body.joint_motions(pose)
    left, right = (motions.rotations[names.index(f"{s}_ankle")][:, 1] for s in _SIDES)
    trunk = motions.positions[names.index("neck")] - motions.positions[body.root]
    trunk, feet = (way / np.linalg.norm(way) for way in (trunk, left + right))
    leans = max(feet @ up, trunk @ up) < LEANING and left @ right > FEET_AGREE
    return feet if leans else up


def _upright_plane(
    body: RegistrationModel, pose: Pose, up: Array, other_ups: tuple[Array, ...]
) -> Array:
    """Return the plane's normal along which the trunk is upright, or else `up`."""
    root = body.joint_motions(pose).rotations[body.root]
    best = max((up, *other_ups), key=lambda normal: float(root[:, 1] @ normal))
    return best if root[:, 1] @ best > LEANING else up


def upright_transform(points: Array, root: Array, up: Array) -> Array:
    """Return the rigid motion to y up, facing z, of a body with this rotation of its pelvis."""
    # The left side stays level in people who bend forward; models have x to the left, z forward.
    left = root[:, 0] - (root[:, 0] @ up) * up
    if np.linalg.norm(left) < _LEAST_LEVEL:  # someone who lies on one side
        left = np.cross(up, root[:, 2])
    left /= np.linalg.norm(left)
    rotation = np.stack([left, up, np.cross(left, up)])
    rotated = points @ rotation.T
    low, high = rotated.min(axis=0), rotated.max(axis=0)
    transform = np.eye(4)
    transform[:3, :3] = rotation
    transform[:3, 3] = -0.5 * (low + high)
    transform[1, 3] = -low[1]
    return transform
