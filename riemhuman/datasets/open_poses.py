"""Poses written as joint angles, and their conversion to pose vectors of the open model.

Angles are degrees from the T-pose: arms straight out to the sides, legs straight down. In it, the
axes are x to the body's left, y up and z forward, so that

- trunk, neck and head: x bends forward, y turns to the left, z tilts to the right;
- left shoulder: x rotates the arm about itself, forward side down; -y swings it forward; z lifts
  it;
- left elbow: -y bends it; x rotates the forearm about itself;
- hip: -x lifts the thigh forward; y turns the left toes outward; z moves the left leg outward;
- knee: x bends it; ankle and toes: x points them down.

A joint without a side stands for both: the angles are those of the left joint, and the right joint
mirrors them (y and z change sign). The poses of the open bodies are in data/open_poses.json.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from functools import cache
from pathlib import Path
from typing import TypeAlias

import numpy as np
from scipy.spatial.transform import Rotation

from riemhuman.arrays import Array, ArrayLike, JSONRecord
from riemhuman.bodies import BodyModel
from riemhuman.bodies.skinning import LIMBS
from riemhuman.checks import real_array
from riemhuman.errors import ArgumentError
from riemhuman.kernels.rotations import log, shortest_rotations
from riemhuman.kernels.surface import unit_vectors

DATA = Path(__file__).parent / "data"


Curve: TypeAlias = float | Sequence[float] | Array
"""An angle in degrees, or angles at even times of a cycle."""

Angles: TypeAlias = tuple[str, *tuple[Curve, ...]]
"""Axes of rotations, and the angle or the curve of angles about each, degrees."""


@cache
def read_table(name: str) -> JSONRecord:
    """Return a table of people, poses or motions of the open data sets."""
    table: JSONRecord = json.loads((DATA / f"{name}.json").read_text(encoding="utf-8"))
    return table


def joint_rotations(angles: Mapping[str, Angles], model: BodyModel) -> Array:
    """Return the rotations of all joints from the T-pose, shape (J, 3, 3), in the body's axes.

    Parameters
    ----------
    angles : mapping of str to sequence
        Axes and angles of some joints, degrees: ("xz", 30, -70) rotates by 30 about x, then by -70
        about z. In the T-pose, x points to the body's left, y up and z forward. A joint named
        without a side means both, the right one mirrored. Other joints do not rotate.
    model : BodyModel
        The open model.

    Examples
    --------
    >>> model = rh.datasets.load_open_model("coarse")
    >>> rh.datasets.joint_rotations({"shoulder": ("z", 90)}, model).shape
    (23, 3, 3)
    """
    rotations = np.tile(np.eye(3), (model.n_joints, 1, 1))
    for name, (axes, *degrees) in with_both_sides(angles, model.joint_names).items():
        # For a single axis, SciPy expects a number.
        angle = degrees if len(degrees) > 1 else degrees[0]
        rotation = Rotation.from_euler(axes, angle, degrees=True)
        rotations[model.joint_names.index(name)] = rotation.as_matrix()
    return rotations


def with_both_sides(angles: Mapping[str, Angles], joint_names: Sequence[str]) -> dict[str, Angles]:
    """Return angles by joint, those of joints without a side written out for both sides."""
    sided: dict[str, Angles] = {}
    for name, value in angles.items():
        if name in joint_names:
            sided[name] = value
        elif f"left_{name}" in joint_names:
            sided.setdefault(f"left_{name}", value)
            sided.setdefault(f"right_{name}", mirror_angles(value))
        else:
            raise ArgumentError(
                f"angles name the joint {name!r}; the model has {', '.join(joint_names)}"
            )
    return sided


def mirror_angles(angles: Angles) -> Angles:
    """Return axes and angles, or curves, of the joint on the other side: y and z change sign."""
    axes, *degrees = angles
    mirrored = (
        angle if axis == "x" else np.negative(angle)
        for axis, angle in zip(axes, degrees, strict=True)
    )
    return axes, *mirrored


def pose_vectors(rotations: ArrayLike, model: BodyModel) -> Array:
    """Return the model's pose vectors, shape (..., J, 3), for rotations from the T-pose.

    With T_j the rotation of joint j that brings the rest pose to the T-pose, in global axes,
    and p its parent, a rotation Q_j from the T-pose is the rotation T_p⁻¹ Q_j T_j from the rest
    pose.

    Parameters
    ----------
    rotations : array_like, shape (..., J, 3, 3)
        As from `joint_rotations`.
    model : BodyModel
        The open model.

    Examples
    --------
    >>> model = rh.datasets.load_open_model("coarse")
    >>> t_pose = rh.datasets.pose_vectors(rh.datasets.joint_rotations({}, model), model)
    >>> model(pose=t_pose).shape
    (1202, 3)
    """
    straight = _rest_to_t_pose(model)
    parent = np.where(model.parents[:, None, None] < 0, np.eye(3), straight[model.parents])
    rotations = real_array(rotations, "rotations", (model.n_joints, 3, 3))
    return np.asarray(log(parent, rotations @ straight))


def _rest_to_t_pose(model: BodyModel) -> Array:
    """Return each joint's global rotation from the rest pose to the T-pose, shape (J, 3, 3)."""
    joints = dict(zip(model.joint_names, model.joints(), strict=True))
    straight = {name: np.eye(3) for name in model.joint_names}
    for upper, lower, end in LIMBS:
        direction = np.array([0.0, -1.0, 0.0])
        if end.endswith("wrist"):
            direction = np.array([1.0 if end.startswith("left") else -1.0, 0.0, 0.0])
        rotation = np.eye(3)
        for name, following in ((upper, lower), (lower, end)):
            bone = unit_vectors(joints[following] - joints[name])
            rotation = shortest_rotations(rotation @ bone, direction) @ rotation
            straight[name] = rotation
        if end.endswith("wrist"):
            straight[end] = rotation
    return np.stack([straight[name] for name in model.joint_names])
