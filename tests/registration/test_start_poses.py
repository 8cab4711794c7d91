"""Start poses of models of any names, and the positions in which arms are tried."""

import numpy as np
from scanned_people import with_other_names, with_smpls_tree

from riemhuman.bodies.skinning import SMPL_JOINTS, usual_joint_names
from riemhuman.registration._limbs import BodyParts
from riemhuman.registration._start_poses import (
    joint_precisions,
    other_arms,
    start_poses,
)


def test_arms_reach_from_the_collar_to_the_wrist(model):
    for named in (model, with_smpls_tree(model)):
        names = usual_joint_names(named)
        for side, arm in zip(("left", "right"), BodyParts(named).arms, strict=True):
            joints = [f"{side}_{joint}" for joint in ("collar", "shoulder", "elbow", "wrist")]
            assert [names[joint] for joint in arm] == joints
            np.testing.assert_array_equal(named.parents[arm[1:]], arm[:-1])


def test_a_model_without_names_has_no_arms(model):
    assert BodyParts(with_other_names(model)).arms == []


def test_every_way_to_hold_an_arm_is_tried_once(model):
    poses = start_poses(model)
    for arm in BodyParts(model).arms:
        others = list(other_arms(arm, poses["a"], poses))
        known = np.stack([poses["a"][arm], *others])
        apart = np.abs(known[:, None] - known).max(axis=(2, 3, 4))
        assert apart[np.triu_indices(len(known), 1)].min() > 0.05
        for pose in poses.values():
            assert np.abs(known - pose[arm]).max(axis=(1, 2, 3)).min() <= 0.05


def test_smpls_tree_is_recognised(model):
    other = with_smpls_tree(model)
    assert other.joint_names[1] == "joint_1"
    poses, found = start_poses(model), start_poses(other)
    assert list(poses) == list(found)
    for name in poses:
        order = [model.joint_names.index(joint) for joint in SMPL_JOINTS]
        np.testing.assert_allclose(found[name], poses[name][order], atol=1e-9)
    np.testing.assert_allclose(joint_precisions(other), joint_precisions(model)[order])


def test_an_unknown_tree_starts_from_rest(model):
    ((name, pose),) = start_poses(with_other_names(model)).items()
    assert name == "rest"
    np.testing.assert_array_equal(pose, np.tile(np.eye(3), (model.n_joints, 1, 1)))
