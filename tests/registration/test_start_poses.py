"""Start poses are known for models whose joints hang together as SMPL's, whatever their names."""

import numpy as np

import riemhuman as rh
from riemhuman.registration.start_poses import _SMPL_TREE, joint_precisions, start_poses


def with_smpls_tree(model):
    """Return the open model with SMPL's joints in SMPL's order, without names."""
    order = [model.joint_names.index(name) for name in _SMPL_TREE]
    weights = model.weights[:, order].copy()
    chest, upper = model.joint_names.index("chest"), list(_SMPL_TREE).index("upper_spine")
    weights[:, upper] += model.weights[:, chest]
    return rh.BodyModel(
        model.template.vertices,
        model.faces,
        model.shapedirs,
        model.joint_regressor[order],
        weights / weights.sum(axis=1, keepdims=True),
        np.stack([list(_SMPL_TREE.values()), np.arange(len(order))]),
    )


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
    names = [f"bone_{k}" for k in range(model.n_joints)]
    other = rh.BodyModel(
        model.template.vertices,
        model.faces,
        model.shapedirs,
        model.joint_regressor,
        model.weights,
        np.stack([model.parents, np.arange(model.n_joints)]),
        joint_names=names,
    )
    ((name, pose),) = start_poses(other).items()
    assert name == "rest"
    np.testing.assert_array_equal(pose, np.tile(np.eye(3), (model.n_joints, 1, 1)))
