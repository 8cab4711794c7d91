"""Other ways to hold the arms of a body that fits a scan.

Start poses hold both arms alike, which people do not; and a hand that touches the body matches the
scan nearly as well when it and its forearm are turned about themselves.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from riemhuman.bodies import BodyModel
from riemhuman.registration.posing import Pose, rotation
from riemhuman.registration.start_poses import joint_names

_JOINTS = ("collar", "shoulder", "elbow", "wrist")
# Arms whose rotations differ by less are alike.
_ALIKE = 0.05
_TURNS = np.radians(60.0 * np.arange(6))


def arms_of(model: BodyModel) -> list[np.ndarray]:
    """Return the joints of each arm, from the collar to the wrist.

    Parameters
    ----------
    model : BodyModel
        A model.

    Returns
    -------
    list of array of int, each of shape (4,)
        Empty if the model has no joints of these names.
    """
    names = joint_names(model)
    arms = [[f"{side}_{joint}" for joint in _JOINTS] for side in ("left", "right")]
    return [np.array([names.index(name) for name in arm]) for arm in arms if {*arm} <= {*names}]


def other_arms(
    arm: np.ndarray, own: np.ndarray, poses: dict[str, np.ndarray]
) -> Iterator[np.ndarray]:
    """Yield the rotations of an arm's joints in some poses, without those that are alike.

    Parameters
    ----------
    arm : array of int, shape (4,)
        Joints of the arm.
    own : array, shape (J, 3, 3)
        The pose whose arm is known already.
    poses : dict of str to array, shape (J, 3, 3)
        Poses.

    Yields
    ------
    array, shape (4, 3, 3)
    """
    seen = [own[arm]]
    for pose in poses.values():
        if all(np.abs(pose[arm] - other).max() > _ALIKE for other in seen):
            seen.append(pose[arm])
            yield pose[arm]


def turned_forearms(pose: Pose, arm: np.ndarray, rest_joints: np.ndarray) -> Iterator[Pose]:
    """Yield a pose with one hand straight, and its forearm turned by sixths of a circle.

    Parameters
    ----------
    pose : Pose
        The pose.
    arm : array of int, shape (4,)
        Joints of the arm.
    rest_joints : array, shape (J, 3)
        The joints in the rest pose.

    Yields
    ------
    Pose
    """
    *_, elbow, wrist = arm
    forearm = rest_joints[wrist] - rest_joints[elbow]
    for angle in _TURNS:
        local = pose.local.copy()
        local[elbow] = local[elbow] @ rotation(angle * forearm / np.linalg.norm(forearm))
        local[wrist] = np.eye(3)
        yield pose._replace(local=local)
