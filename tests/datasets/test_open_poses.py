"""Poses written as joint angles: the T-pose, and the directions of the angles."""

import numpy as np
import pytest

from riemhuman.datasets import joint_rotations, load_open_model, pose_vectors
from riemhuman.errors import ArgumentError


def test_t_pose_is_straight():
    model = load_open_model("coarse")
    straight = pose_vectors(joint_rotations({}, model), model)
    joints = dict(zip(model.joint_names, model.joints(pose=straight), strict=True))
    for side, outward in (("left", 1.0), ("right", -1.0)):
        for start, end, direction in [
            ("shoulder", "elbow", [outward, 0, 0]),
            ("elbow", "wrist", [outward, 0, 0]),
            ("hip", "knee", [0, -1, 0]),
            ("knee", "ankle", [0, -1, 0]),
        ]:
            bone = joints[f"{side}_{end}"] - joints[f"{side}_{start}"]
            np.testing.assert_allclose(bone / np.linalg.norm(bone), direction, atol=1e-9)


def test_directions_of_joint_angles():
    model = load_open_model("coarse")

    def joint(name, angles):
        pose = pose_vectors(joint_rotations(angles, model), model)
        return model.joints(pose=pose)[model.joint_names.index(name)]

    for side, sign in (("left", 1.0), ("right", -1.0)):
        rest = joint(f"{side}_wrist", {})
        assert joint(f"{side}_wrist", {"shoulder": ("y", -40)})[2] > rest[2] + 0.2  # forward
        assert joint(f"{side}_wrist", {"shoulder": ("z", 40)})[1] > rest[1] + 0.2  # up
        assert joint(f"{side}_wrist", {"elbow": ("y", -40)})[2] > rest[2] + 0.1  # forward
        rest = joint(f"{side}_ankle", {})
        assert joint(f"{side}_ankle", {"hip": ("x", -40)})[2] > rest[2] + 0.2  # forward
        assert joint(f"{side}_ankle", {"knee": ("x", 40)})[2] < rest[2] - 0.1  # backward
        assert sign * (joint(f"{side}_ankle", {"hip": ("z", 20)}) - rest)[0] > 0.1  # outward
    only_left = {"left_shoulder": ("z", 40)}
    assert joint("right_wrist", only_left) == pytest.approx(joint("right_wrist", {}))


def test_joints_that_the_model_lacks_are_refused():
    with pytest.raises(ArgumentError, match="angles name the joint 'tail'; the model has pelvis"):
        joint_rotations({"tail": ("x", 10)}, load_open_model("coarse"))
