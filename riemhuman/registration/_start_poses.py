"""Start poses of registration, expected deviations of joints from them, and positions of arms.

Both arms are alike in start poses, which they are not in people; and a hand that touches the body
matches the scan nearly as well when it and its forearm are rotated about themselves. So the arms of
the best body are tried in other ways.
"""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from riemhuman.arrays import Array, Integers, JSONValue
from riemhuman.bodies import BodyModel, rotation_matrix
from riemhuman.bodies.skinning import usual_joint_names
from riemhuman.datasets import joint_rotations, pose_vectors
from riemhuman.datasets.open_poses import mirror_angles

_TABLE = json.loads((Path(__file__).parent / "data/start_poses.json").read_text(encoding="utf-8"))
# Axes and degrees of joints from the T-pose, as for `riemhuman.datasets.joint_rotations`.
_START_POSES = _TABLE["poses"]
_MIRRORED = _TABLE["mirrored"]
# The poses by which the direction up is found.
UP_POSES = _TABLE["up_poses"]
# Standard deviations of joints from a start pose, degrees.
_DEGREES = _TABLE["degrees"]
# That of joints whose names say nothing: between those of spines (8 to 10) and limbs (40 to 45),
# because either may be meant.
_OTHER_DEGREES = 15.0


def start_poses(model: BodyModel) -> dict[str, Array]:
    """Return the poses to start from, as rotations of the joints."""
    names = usual_joint_names(model)
    if "left_shoulder" not in names:
        return {"rest": np.tile(np.eye(3), (model.n_joints, 1, 1))}
    if names != model.joint_names:
        model = rename_joints(model, names)
    written = dict(_START_POSES)
    for name in _MIRRORED:
        written[f"{name}_right"] = _mirror_pose(_START_POSES[name])
    rotations = []
    for angles in written.values():
        known = {
            k: joint_angles
            for k, joint_angles in angles.items()
            if k in names or f"left_{k}" in names
        }
        rotations.append(joint_rotations(known, model))
    vectors = pose_vectors(np.stack(rotations), model)
    return dict(zip(written, np.ascontiguousarray(rotation_matrix(vectors)), strict=True))


def joint_precisions(model: BodyModel) -> Array:
    """Return inverse variances of the joints' rotations from a start pose, 0 for the root."""
    joints = [name.split("_")[-1] for name in usual_joint_names(model)]
    deviations = np.radians([_DEGREES.get(joint, _OTHER_DEGREES) for joint in joints])
    return np.where(model.parents < 0, 0.0, deviations**-2.0)


def _mirror_pose(angles: dict[str, JSONValue]) -> dict[str, JSONValue]:
    """Return angles with left and right exchanged."""
    mirrored: dict[str, JSONValue] = {}
    for name, joint_angles in angles.items():
        side, _, joint = name.partition("_")
        mirrored_name = {"left": f"right_{joint}", "right": f"left_{joint}"}.get(side)
        mirrored[mirrored_name or name] = (
            mirror_angles(joint_angles) if mirrored_name else joint_angles
        )
    return mirrored


def rename_joints(model: BodyModel, names: tuple[str, ...]) -> BodyModel:
    return BodyModel(
        model.template.vertices,
        model.faces,
        model.shapedirs,
        model.joint_regressor,
        model.weights,
        np.stack([model.parents, np.arange(model.n_joints)]),
        posedirs=model.posedirs,
        joint_names=names,
        hand_directions=model.hand_directions,
        hand_poses=model.hand_poses,
    )


def other_arms(arm: Integers, current: Array, poses: dict[str, Array]) -> Iterator[Array]:
    """Yield the rotations of an arm's joints in some poses, without duplicates."""
    seen = [current[arm]]
    for pose in poses.values():
        if not any(np.allclose(pose[arm], rotations, atol=1e-6) for rotations in seen):
            seen.append(pose[arm])
            yield pose[arm]
