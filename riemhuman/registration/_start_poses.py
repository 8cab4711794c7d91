"""Start poses of registration, expected deviations of joints from them, and positions of arms.

Both arms are alike in start poses, which they are not in people; and a hand that touches the body
matches the scan nearly as well when it and its forearm are rotated about themselves. So the arms of
the best body are tried in other ways.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from riemhuman.bodies import BodyModel, rotation_matrix
from riemhuman.datasets import joint_rotations, pose_vectors
from riemhuman.datasets.open_poses import mirror_angles
from riemhuman.registration._posed_body import Pose, rotation

# Axes and degrees of joints from the T-pose, as for `riemhuman.datasets.joint_rotations`.
_Angles = dict[str, tuple[Any, ...]]

_DOWN: _Angles = {"shoulder": ("xz", 10, -78), "elbow": ("y", -10), "hip": ("z", 3)}
_A: _Angles = {"shoulder": ("xz", 10, -50), "elbow": ("y", -18), "hip": ("z", 6)}
_WALK: _Angles = {
    "left_hip": ("x", -32),
    "left_knee": ("x", 15),
    "right_hip": ("x", 22),
    "right_knee": ("x", 28),
    "left_shoulder": ("zx", -74, 28),
    "right_shoulder": ("zx", 74, -28),
    "left_elbow": ("y", -30),
    "right_elbow": ("y", 30),
}
_KNEE: _Angles = {**_A, "left_hip": ("x", -85), "left_knee": ("x", 85)}
_ONE_ARM: _Angles = {**_DOWN, "right_shoulder": ("z", -55), "right_elbow": ("y", 15)}

_START_POSES: dict[str, _Angles] = {
    "a": _A,
    "down": _DOWN,
    "t": {"shoulder": ("z", -5), "hip": ("z", 6)},
    "up": {"collar": ("z", 15), "shoulder": ("z", 55), "elbow": ("y", -15)},
    "forward": {"collar": ("y", -8), "shoulder": ("y", -75), "elbow": ("y", -10)},
    "elbows": {"shoulder": ("xz", 10, -70), "elbow": ("y", -95)},
    "hips": {"shoulder": ("xyz", 45, 15, -45), "elbow": ("y", -95), "hip": ("z", 7)},
    "head": {"shoulder": ("xz", -60, 25), "elbow": ("y", -115)},
    "guard": {"shoulder": ("xzy", 0, -55, -35), "elbow": ("y", -130)},
    "walk": _WALK,
    "knee": _KNEE,
    "one_arm": _ONE_ARM,
    "squat": {
        "pelvis": ("x", 20),
        "hip": ("zx", 10, -85),
        "knee": ("x", 90),
        "shoulder": ("xzy", 0, -10, -60),
    },
    "bend": {
        "pelvis": ("x", 35),
        "lower_spine": ("x", 15),
        "middle_spine": ("x", 12),
        "hip": ("x", -40),
        "shoulder": ("xzy", 0, -50, -40),
    },
    "sit": {"hip": ("x", -85), "knee": ("x", 85), **{k: _DOWN[k] for k in ("shoulder", "elbow")}},
    "wide": {"shoulder": ("z", 20), "hip": ("z", 22)},
    "lunge": {**_WALK, "left_hip": ("x", -75), "left_knee": ("x", 75), "right_knee": ("x", 20)},
}
_SIDED = ("walk", "knee", "one_arm", "lunge")

# The poses by which the direction up is found.
UP_POSES = ("a", "t", "up", "knee", "squat")

# The first joints of SMPL, SMPL-H and SMPL-X by the names of the open model, and their parents.
_SMPL_TREE = {
    "pelvis": -1,
    "left_hip": 0,
    "right_hip": 0,
    "lower_spine": 0,
    "left_knee": 1,
    "right_knee": 2,
    "middle_spine": 3,
    "left_ankle": 4,
    "right_ankle": 5,
    "upper_spine": 6,
    "left_toes": 7,
    "right_toes": 8,
    "neck": 9,
    "left_collar": 9,
    "right_collar": 9,
    "head": 12,
    "left_shoulder": 13,
    "right_shoulder": 14,
    "left_elbow": 16,
    "right_elbow": 17,
    "left_wrist": 18,
    "right_wrist": 19,
}

# Standard deviations of joints from a start pose, degrees.
_TRUNK_DEGREES = {"spine": 10.0, "chest": 8.0, "neck": 12.0, "head": 15.0}
_ARM_DEGREES = {"collar": 10.0, "shoulder": 45.0, "elbow": 45.0, "wrist": 20.0}
_LEG_DEGREES = {"hip": 40.0, "knee": 40.0, "ankle": 15.0, "toes": 12.0}
_DEGREES = _TRUNK_DEGREES | _ARM_DEGREES | _LEG_DEGREES
_OTHER_DEGREES = 15.0

_ARM_JOINTS = ("collar", "shoulder", "elbow", "wrist")
# Arms whose rotations differ by less are alike.
_ALIKE = 0.05
_FOREARM_ANGLES = np.radians(60.0 * np.arange(6))


def joint_names(model: BodyModel) -> tuple[str, ...]:
    """Return the names of a model's joints; those of SMPL's tree are named as in the open model."""
    if "left_shoulder" in model.joint_names:
        return model.joint_names
    if model.parents[: len(_SMPL_TREE)].tolist() == list(_SMPL_TREE.values()):
        return (*_SMPL_TREE, *model.joint_names[len(_SMPL_TREE) :])
    return model.joint_names


def start_poses(model: BodyModel) -> dict[str, np.ndarray]:
    """Return the poses to start from, as rotations of the joints."""
    names = joint_names(model)
    if "left_shoulder" not in names:
        return {"rest": np.tile(np.eye(3), (model.n_joints, 1, 1))}
    if names != model.joint_names:
        model = rename_joints(model, names)
    written = dict(_START_POSES)
    for name in _SIDED:
        written[f"{name}_right"] = _mirror_pose(_START_POSES[name])
    poses = {}
    for name, angles in written.items():
        known = {joint: own for joint, own in angles.items() if _has(names, joint)}
        vectors = pose_vectors(joint_rotations(known, model), model)
        poses[name] = np.ascontiguousarray(rotation_matrix(vectors))
    return poses


def joint_precisions(model: BodyModel) -> np.ndarray:
    """Return inverse variances of the joints' rotations from a start pose, 0 for the root."""
    joints = [name.split("_")[-1] for name in joint_names(model)]
    deviations = np.radians([_DEGREES.get(joint, _OTHER_DEGREES) for joint in joints])
    return np.where(model.parents < 0, 0.0, deviations**-2.0)


def _has(names: tuple[str, ...], joint: str) -> bool:
    return joint in names or f"left_{joint}" in names


def _mirror_pose(angles: _Angles) -> _Angles:
    """Return angles with left and right exchanged."""
    mirrored: _Angles = {}
    for name, own in angles.items():
        side, _, joint = name.partition("_")
        if side in ("left", "right"):
            mirrored[f"{'right' if side == 'left' else 'left'}_{joint}"] = mirror_angles(own)
        else:
            mirrored[name] = own
    return mirrored


def rename_joints(model: BodyModel, names: tuple[str, ...]) -> BodyModel:
    return BodyModel(
        model.template.vertices,
        model.faces,
        model.shapedirs,
        model.joint_regressor,
        model.weights,
        np.stack([model.parents, np.arange(model.n_joints)]),
        joint_names=names,
    )


def arms_of(model: BodyModel) -> list[np.ndarray]:
    """Return the joints of each arm, from the collar to the wrist."""
    names = joint_names(model)
    arms = [[f"{side}_{joint}" for joint in _ARM_JOINTS] for side in ("left", "right")]
    return [np.array([names.index(name) for name in arm]) for arm in arms if {*arm} <= {*names}]


def other_arms(
    arm: np.ndarray, own: np.ndarray, poses: dict[str, np.ndarray]
) -> Iterator[np.ndarray]:
    """Yield the rotations of an arm's joints in some poses, without those that are alike."""
    seen = [own[arm]]
    for pose in poses.values():
        if all(np.abs(pose[arm] - other).max() > _ALIKE for other in seen):
            seen.append(pose[arm])
            yield pose[arm]


def rotate_forearm(pose: Pose, arm: np.ndarray, rest_joints: np.ndarray) -> Iterator[Pose]:
    """Yield a pose with one hand straight and its forearm rotated by sixths of 360°."""
    *_, elbow, wrist = arm
    forearm = rest_joints[wrist] - rest_joints[elbow]
    for angle in _FOREARM_ANGLES:
        local = pose.local.copy()
        local[elbow] = local[elbow] @ rotation(angle * forearm / np.linalg.norm(forearm))
        local[wrist] = np.eye(3)
        yield pose._replace(local=local)
