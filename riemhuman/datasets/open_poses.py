"""Poses of the open bodies, written as joint angles, and their conversion to pose vectors.

Angles are degrees from the T-pose: arms straight out to the sides, legs straight down. In it, the
axes are x to the body's left, y up and z forward, so that

- trunk, neck and head: x bends forward, y turns to the left, z tilts to the right;
- left shoulder: x turns the arm about itself, forward side down; -y swings it forward; z raises it;
- left elbow: -y bends it; x turns the forearm about itself;
- hip: -x lifts the thigh forward; y turns the left toes outward; z moves the left leg outward;
- knee: x bends it; ankle and toes: x points them down.

A joint without a side stands for both: the angles are those of the left joint, and the right joint
mirrors them (y and z change sign).
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from riemhuman.bodies import BodyModel
from riemhuman.errors import ArgumentError

Angles = tuple[Any, ...]
"""Axes, then one angle for each: ("xz", 30, -70) turns by 30 about x, then by -70 about z."""

OPEN_POSES: dict[str, dict[str, Angles]] = {
    "t_like": {"shoulder": ("z", -8), "elbow": ("y", -8), "hip": ("z", 6)},
    "arms_up": {
        "collar": ("z", 18),
        "shoulder": ("z", 50),
        "elbow": ("y", -15),
        "hip": ("z", 4),
        "head": ("x", -8),
    },
    "arms_forward": {
        "collar": ("y", -10),
        "shoulder": ("xzy", 15, -6, -72),
        "elbow": ("y", -10),
        "hip": ("z", 3),
    },
    "bent_elbows": {"shoulder": ("xz", 15, -68), "elbow": ("y", -88), "hip": ("z", 5)},
    "hands_on_hips": {
        "shoulder": ("xyz", 50, 12, -48),
        "elbow": ("y", -88),
        "wrist": ("z", -10),
        "hip": ("z", 9),
    },
    "wave": {
        "left_shoulder": ("z", -66),
        "left_elbow": ("y", -15),
        "right_collar": ("z", -8),
        "right_shoulder": ("xzy", -65, -8, 12),
        "right_elbow": ("y", 80),
        "hip": ("z", 4),
        "head": ("yz", -8, 4),
    },
    "twist": {
        "pelvis": ("y", -6),
        "lower_spine": ("y", 10),
        "middle_spine": ("y", 11),
        "upper_spine": ("y", 11),
        "chest": ("y", 8),
        "neck": ("y", 8),
        "head": ("y", 8),
        "left_shoulder": ("zy", -25, 10),
        "right_shoulder": ("zy", 25, 30),
        "left_elbow": ("y", -25),
        "right_elbow": ("y", 50),
        "hip": ("z", 8),
    },
    "lunge": {
        "lower_spine": ("x", 4),
        "upper_spine": ("x", 3),
        "left_hip": ("zx", 4, -62),
        "left_knee": ("x", 72),
        "left_ankle": ("x", -8),
        "right_hip": ("zx", -4, 26),
        "right_knee": ("x", 22),
        "right_ankle": ("x", -22),
        "right_toes": ("x", -25),
        "left_shoulder": ("zx", -66, 22),
        "right_shoulder": ("zx", 66, -28),
        "left_elbow": ("y", -28),
        "right_elbow": ("y", 35),
    },
    "leg_raised": {
        "left_hip": ("zx", 5, -68),
        "left_knee": ("x", 70),
        "left_ankle": ("x", 12),
        "right_hip": ("z", 2),
        "shoulder": ("z", -35),
        "elbow": ("y", -20),
    },
    "squat": {
        "pelvis": ("x", 18),
        "lower_spine": ("x", 6),
        "middle_spine": ("x", 5),
        "neck": ("x", -10),
        "head": ("x", -8),
        "shoulder": ("xzy", 10, -4, -68),
        "elbow": ("y", -14),
        "hip": ("zyx", 6, 14, -84),
        "knee": ("x", 86),
        "ankle": ("x", -20),
    },
}
"""The ten poses of the plain open bodies."""

_A_STANCE: dict[str, Angles] = {"shoulder": ("xz", 10, -58), "elbow": ("y", -18), "hip": ("z", 5)}
_LEFT_HAND_ON_HIP: dict[str, Angles] = {
    f"left_{joint}": OPEN_POSES["hands_on_hips"][joint] for joint in ("shoulder", "elbow", "wrist")
}
NATURAL_POSES: dict[str, dict[str, Angles]] = {
    "a_stance": _A_STANCE,
    "head_tilted": _A_STANCE | {"neck": ("z", 5), "head": ("z", 13)},
    "arms_up": OPEN_POSES["arms_up"],
    "arms_forward": OPEN_POSES["arms_forward"],
    "hands_on_hips": OPEN_POSES["hands_on_hips"],
    "hands_on_head": {
        "collar": ("z", 8),
        "shoulder": ("xz", -75, 25),
        "elbow": ("y", -125),
        "hip": ("z", 5),
    },
    "hand_on_ear": {
        **_LEFT_HAND_ON_HIP,
        "right_shoulder": ("xzy", -80, 20, 20),
        "right_elbow": ("y", 125),
        "hip": ("z", 5),
        "head": ("z", 4),
    },
    "lunge": OPEN_POSES["lunge"],
    "leg_raised": OPEN_POSES["leg_raised"],
    "squat": OPEN_POSES["squat"],
}
"""The ten poses of the natural open bodies, some similar, some with hands on the body."""

_HIP, _HEAD, _EAR = (0.155, 1.0, 0.01), (0.055, 1.715, 0.03), (0.08, 1.625, 0.04)
TOUCHED: dict[str, dict[str, tuple[float, float, float]]] = {
    "hands_on_hips": {"left": _HIP, "right": _HIP},
    "hands_on_head": {"left": _HEAD, "right": _HEAD},
    "hand_on_ear": {"left": _HIP, "right": _EAR},
}
"""Points of the model's rest surface that hands touch, metres, on the left side of the body."""


def joint_turns(angles: Mapping[str, Angles], model: BodyModel) -> np.ndarray:
    """Return the rotations of all joints from the T-pose."""
    turns = np.tile(np.eye(3), (model.n_joints, 1, 1))
    sided = {name: turn for name, turn in angles.items() if name in model.joint_names}
    for name, turn in angles.items():
        if name in sided:
            continue
        if f"left_{name}" not in model.joint_names:
            raise ArgumentError(
                f"angles name the joint {name!r}; the model has {', '.join(model.joint_names)}"
            )
        sided.setdefault(f"left_{name}", turn)
        sided.setdefault(f"right_{name}", _mirrored(turn))
    for name, (axes, *degrees) in sided.items():
        turn = Rotation.from_euler(axes, degrees if len(degrees) > 1 else degrees[0], degrees=True)
        turns[model.joint_names.index(name)] = turn.as_matrix()
    return turns


def pose_vectors(turns: np.ndarray, model: BodyModel) -> np.ndarray:
    """Return the model's pose vectors for rotations from the T-pose."""
    straight = _rest_to_t_pose(model)
    parent = np.where(model.parents[:, None, None] < 0, np.eye(3), straight[model.parents])
    turns = np.swapaxes(parent, -1, -2) @ np.asarray(turns, dtype=np.float64) @ straight
    vectors = Rotation.from_matrix(turns.reshape(-1, 3, 3)).as_rotvec()
    return vectors.reshape(turns.shape[:-1])


def _mirrored(turn: Angles) -> Angles:
    axes, *degrees = turn
    return (axes, *(a if axis == "x" else -a for axis, a in zip(axes, degrees, strict=True)))


def _rest_to_t_pose(model: BodyModel) -> np.ndarray:
    """Return each joint's global rotation from the rest pose to the T-pose, shape (J, 3, 3)."""
    joints = dict(zip(model.joint_names, model.joints(), strict=True))
    straight = {name: np.eye(3) for name in model.joint_names}
    down = np.array([0.0, -1.0, 0.0])
    for side, outward in (("left", [1.0, 0.0, 0.0]), ("right", [-1.0, 0.0, 0.0])):
        for upper, lower, end, direction in (
            ("shoulder", "elbow", "wrist", np.array(outward)),
            ("hip", "knee", "ankle", down),
        ):
            first, second, third = (joints[f"{side}_{name}"] for name in (upper, lower, end))
            turn = _shortest_turn(second - first, direction)
            straight[f"{side}_{upper}"] = turn
            straight[f"{side}_{lower}"] = _shortest_turn(turn @ (third - second), direction) @ turn
        straight[f"{side}_wrist"] = straight[f"{side}_elbow"]
    return np.stack([straight[name] for name in model.joint_names])


def _shortest_turn(start: np.ndarray, end: np.ndarray) -> np.ndarray:
    axis = np.cross(start, end)
    sine, cosine = np.linalg.norm(axis), start @ end
    return Rotation.from_rotvec(axis * np.arctan2(sine, cosine) / sine).as_matrix()
