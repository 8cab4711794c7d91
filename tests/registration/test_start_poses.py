"""Start poses are known for models whose joints hang together as SMPL's, whatever their names."""

import numpy as np
from scanned_people import with_other_names, with_smpls_tree

import riemhuman as rh
from riemhuman.registration._start_poses import _SMPL_TREE, joint_precisions, start_poses


def test_smpls_tree_is_recognised():
    model = rh.datasets.load_open_model("coarse")
    other = with_smpls_tree(model)
    assert other.joint_names[1] == "joint_1"
    own, found = start_poses(model), start_poses(other)
    assert list(own) == list(found)
    for name in own:
        order = [model.joint_names.index(joint) for joint in _SMPL_TREE]
        np.testing.assert_allclose(found[name], own[name][order], atol=1e-9)
    np.testing.assert_allclose(joint_precisions(other), joint_precisions(model)[order])


def test_an_unknown_tree_starts_from_rest():
    model = rh.datasets.load_open_model("coarse")
    ((name, pose),) = start_poses(with_other_names(model)).items()
    assert name == "rest"
    np.testing.assert_array_equal(pose, np.tile(np.eye(3), (model.n_joints, 1, 1)))
