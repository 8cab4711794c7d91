"""Arms in other positions, as starts for other fits: elbows swung, hands moved.

In goes a pose, out comes a pose; nothing here looks at a scan.
"""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation

from riemhuman.arrays import Array, Integers
from riemhuman.bodies import rotation_matrix
from riemhuman.bodies.skinning import JointMotions, Skeleton
from riemhuman.kernels.surface import unit_vectors
from riemhuman.registration._posed_body import Pose

# Limbs are never moved to reach farther than this share of their length: a straight one, which
# bends by less than 11 degrees, would not say in which plane it bends.
_STRAIGHTEST = 0.995
# Nor less far: with bones of equal length, that is a bend by 151 degrees; people reach about 150.
_MOST_BENT = 0.25


def elbow_bend(skeleton: Skeleton, pose: Pose, joints: Integers) -> float:
    """Return the distance of an elbow from the line from shoulder to wrist, metres."""
    start, middle, end = JointMotions(skeleton, pose.local, pose.betas).positions[joints[1:]]
    return float(np.linalg.norm(np.cross(middle - start, unit_vectors(end - start))))


def swing_elbow(skeleton: Skeleton, pose: Pose, joints: Integers, degrees: float) -> Pose:
    """Return a pose with an elbow swung about the line from shoulder to wrist; the hand stays.

    The joints are those of an arm, from the collar to the wrist.
    """
    motions = JointMotions(skeleton, pose.local, pose.betas)
    _, shoulder, _, wrist = joints
    line = unit_vectors(motions.positions[wrist] - motions.positions[shoulder])
    swing = rotation_matrix(np.radians(degrees) * line)
    local = pose.local.copy()
    local[shoulder] = motions.axes[shoulder].T @ swing @ motions.rotations[shoulder]
    local[wrist] = motions.axes[wrist].T @ swing.T @ motions.rotations[wrist]
    return pose._replace(local=local)


def move_end(skeleton: Skeleton, pose: Pose, joints: Integers, shift: Array) -> Pose:
    """Return a pose with a hand or foot shifted, as far as its limb reaches, and not rotated.

    The joints are shoulder, elbow and wrist, or hip, knee and ankle; the shift is in metres.
    """
    motions = JointMotions(skeleton, pose.local, pose.betas)
    start, middle, end = motions.positions[joints]
    upper, lower = middle - start, end - middle
    lengths = np.linalg.norm(upper), np.linalg.norm(lower)
    goal = end + shift - start
    reach = np.clip(np.linalg.norm(goal), _MOST_BENT * sum(lengths), _STRAIGHTEST * sum(lengths))
    # The elbow bends until the hand is as far from the shoulder as its goal (law of cosines).
    bend = np.arccos(np.clip((reach**2 - np.dot(lengths, lengths)) / (2 * np.prod(lengths)), -1, 1))
    present = np.arccos(np.clip(upper @ lower / np.prod(lengths), -1.0, 1.0))
    hinge = unit_vectors(np.cross(upper, lower))
    turn = rotation_matrix((bend - present) * hinge)
    aim = Rotation.align_vectors(goal, upper + turn @ lower)[0].as_matrix()
    local = pose.local.copy()
    for joint, rotation in zip(joints, (aim, turn, (aim @ turn).T), strict=True):
        local[joint] = motions.axes[joint].T @ rotation @ motions.rotations[joint]
    return pose._replace(local=local)
