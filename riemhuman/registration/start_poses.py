"""Start poses of registration, and the expected deviations of joints from them."""

from __future__ import annotations

import numpy as np

from riemhuman.bodies import BodyModel, rotation_matrix
from riemhuman.datasets.open_poses import Angles, joint_turns, pose_vectors

_DOWN: dict[str, Angles] = {"shoulder": ("xz", 10, -78), "elbow": ("y", -10), "hip": ("z", 3)}
_A: dict[str, Angles] = {"shoulder": ("xz", 10, -50), "elbow": ("y", -18), "hip": ("z", 6)}
_WALK: dict[str, Angles] = {
    "left_hip": ("x", -32),
    "left_knee": ("x", 15),
    "right_hip": ("x", 22),
    "right_knee": ("x", 28),
    "left_shoulder": ("zx", -74, 28),
    "right_shoulder": ("zx", 74, -28),
    "left_elbow": ("y", -30),
    "right_elbow": ("y", 30),
}
_KNEE: dict[str, Angles] = {**_A, "left_hip": ("x", -85), "left_knee": ("x", 85)}
_ONE_ARM: dict[str, Angles] = {**_DOWN, "right_shoulder": ("z", -55), "right_elbow": ("y", 15)}

_START_POSES: dict[str, dict[str, Angles]] = {
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

FEW = ("a", "t", "up", "knee", "squat")
"""The poses by which the direction up is found."""

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
_DEGREES = {
    "spine": 10.0,
    "chest": 8.0,
    "neck": 12.0,
    "head": 15.0,
    "collar": 10.0,
    "shoulder": 45.0,
    "elbow": 45.0,
    "wrist": 20.0,
    "hip": 40.0,
    "knee": 40.0,
    "ankle": 15.0,
    "toes": 12.0,
}
_OTHER_DEGREES = 15.0


def joint_names(model: BodyModel) -> tuple[str, ...]:
    """Return the names of a model's joints; those of SMPL's tree are named as in the open model.

    Parameters
    ----------
    model : BodyModel
        A model.
    """
    if "left_shoulder" in model.joint_names:
        return model.joint_names
    if model.parents[: len(_SMPL_TREE)].tolist() == list(_SMPL_TREE.values()):
        return (*_SMPL_TREE, *model.joint_names[len(_SMPL_TREE) :])
    return model.joint_names


def start_poses(model: BodyModel) -> dict[str, np.ndarray]:
    """Return the poses to start from, as rotations of the joints.

    Parameters
    ----------
    model : BodyModel
        A model with the joint names of the open model or the tree of SMPL. For any other model, the
        rest pose is the only start.

    Returns
    -------
    poses : dict of str to array, shape (J, 3, 3)
        In the axes of the rest pose.
    """
    names = joint_names(model)
    if "left_shoulder" not in names:
        return {"rest": np.tile(np.eye(3), (model.n_joints, 1, 1))}
    if names != model.joint_names:
        model = _renamed(model, names)
    written = dict(_START_POSES)
    for name in _SIDED:
        written[f"{name}_right"] = _mirrored(_START_POSES[name])
    return {
        name: np.ascontiguousarray(rotation_matrix(pose_vectors(joint_turns(known, model), model)))
        for name, known in (
            (name, {k: v for k, v in angles.items() if _has(names, k)})
            for name, angles in written.items()
        )
    }


def joint_precisions(model: BodyModel) -> np.ndarray:
    """Return inverse variances of the joints' turns from a start pose, 0 for the root.

    Parameters
    ----------
    model : BodyModel
        A model.

    Returns
    -------
    precisions : array, shape (J,)
        Inverse squared radians.
    """
    degrees = [
        _DEGREES.get(name.removeprefix("left_").removeprefix("right_").split("_")[-1])
        for name in joint_names(model)
    ]
    deviations = np.radians([_OTHER_DEGREES if each is None else each for each in degrees])
    return np.where(model.parents < 0, 0.0, deviations**-2.0)


def _has(names: tuple[str, ...], joint: str) -> bool:
    return joint in names or f"left_{joint}" in names


def _mirrored(angles: dict[str, Angles]) -> dict[str, Angles]:
    """Return angles with left and right exchanged."""
    swapped: dict[str, Angles] = {}
    for name, (axes, *degrees) in angles.items():
        side, _, joint = name.partition("_")
        if side in ("left", "right"):
            other = f"{'right' if side == 'left' else 'left'}_{joint}"
            turned = [a if axis == "x" else -a for axis, a in zip(axes, degrees, strict=True)]
            swapped[other] = (axes, *turned)
        else:
            swapped[name] = (axes, *degrees)
    return swapped


def _renamed(model: BodyModel, names: tuple[str, ...]) -> BodyModel:
    return BodyModel(
        model.template.vertices,
        model.faces,
        model.shapedirs,
        model.joint_regressor,
        model.weights,
        np.stack([model.parents, np.arange(model.n_joints)]),
        joint_names=names,
    )
