"""The body model against linear blend skinning written out vertex by vertex."""

import os

import autograd
import autograd.numpy as anp
import numpy as np
import pytest
from oracles import taylor_slope
from scipy.spatial.transform import Rotation

from riemhuman.bodies import BodyModel
from riemhuman.datasets import load_open_model
from riemhuman.errors import ArgumentError, ArgumentTypeError, FileFormatError

N_VERTICES, N_JOINTS, N_BETAS = 9, 4, 2


def small_fields(**changes):
    """Return the fields of a made-up model: a chain of three joints with a branch."""
    rng = np.random.default_rng(11)
    weights = rng.uniform(size=(N_VERTICES, N_JOINTS))
    regressor = rng.uniform(size=(N_JOINTS, N_VERTICES))
    fields = {
        "v_template": rng.normal(size=(N_VERTICES, 3)),
        "f": np.array([[0, 1, 2], [2, 1, 3], [4, 5, 6], [6, 7, 8]]),
        "shapedirs": 0.3 * rng.normal(size=(N_VERTICES, 3, N_BETAS)),
        "J_regressor": regressor / regressor.sum(axis=1, keepdims=True),
        "weights": weights / weights.sum(axis=1, keepdims=True),
        "kintree_table": np.array([[-1, 0, 1, 0], [0, 1, 2, 3]]),
        "posedirs": 0.1 * rng.normal(size=(N_VERTICES, 3, 9 * (N_JOINTS - 1))),
    }
    fields.update(changes)
    return {name: value for name, value in fields.items() if value is not None}


def model_of(fields):
    fields = dict(fields)
    fields["faces"] = fields.pop("f")
    fields["joint_regressor"] = fields.pop("J_regressor")
    return BodyModel(**fields)


def small_model(**changes):
    return model_of(small_fields(**changes))


MODELS = {
    "open": lambda: load_open_model("coarse"),
    "pose-dependent": small_model,
    "skinning alone": lambda: small_model(posedirs=None),
    # Joint 3 is the root, and joint 0 comes before its parent, joint 2.
    "children first": lambda: small_model(
        kintree_table=[[17, 12, 15, -1], [12, 10, 17, 15]], posedirs=None
    ),
    # The pose feature leaves out the root, which is not joint 0.
    "root last": lambda: small_model(kintree_table=[[3, 0, 3, -1], [0, 1, 2, 3]]),
    "root between": lambda: small_model(kintree_table=[[1, -1, 1, 2], [0, 1, 2, 3]]),
    "hands": lambda: small_model(
        hand_directions=np.random.default_rng(12).normal(size=(N_VERTICES, 3, 4)),
        hand_poses=("fist", "open"),
    ),
}


@pytest.fixture(params=MODELS)
def model(request):
    return MODELS[request.param]()


def parameters(model, lead=(), rng=0):
    rng = np.random.default_rng(rng)
    betas = rng.normal(size=(*lead, model.n_betas))
    pose = rng.normal(scale=0.7, size=(*lead, model.n_joints, 3))
    return betas, pose, rng.normal(size=(*lead, 3))


def skinned(model, betas, pose, trans, hands=None):
    """Return one surface and its joints by the published formula, one vertex at a time."""
    shaped = model.template.vertices.copy()
    for b in range(model.n_betas):
        shaped += betas[b] * model.shapedirs[:, :, b]
    joints = [sum(w * x for w, x in zip(row, shaped, strict=True)) for row in model.joint_regressor]
    for k, value in enumerate(() if hands is None else hands):
        shaped += value * model.hand_directions[:, :, k]
    turns = [Rotation.from_rotvec(vector).as_matrix() for vector in pose]
    if model.posedirs is not None:
        feature = [t - np.eye(3) for t, p in zip(turns, model.parents, strict=True) if p >= 0]
        feature = np.concatenate([entries.ravel() for entries in feature])
        for k, value in enumerate(feature):
            shaped = shaped + value * model.posedirs[:, :, k]

    def world(joint):
        parent = model.parents[joint]
        local = np.eye(4)
        local[:3, :3] = turns[joint]
        local[:3, 3] = joints[joint] - (joints[parent] if parent >= 0 else 0.0)
        return local if parent < 0 else world(parent) @ local

    worlds = [world(joint) for joint in range(model.n_joints)]
    motions = []
    for joint in range(model.n_joints):
        to_rest = np.eye(4)
        to_rest[:3, 3] = -joints[joint]
        motions.append(worlds[joint] @ to_rest)
    points = np.empty_like(shaped)
    for v in range(model.n_vertices):
        blended = sum(model.weights[v, j] * motions[j] for j in range(model.n_joints))
        points[v] = (blended @ np.append(shaped[v], 1.0))[:3] + trans
    return points, np.stack([w[:3, 3] for w in worlds]) + trans


def test_agrees_with_the_formula_written_out(model):
    betas, pose, trans = parameters(model)
    points, joints = skinned(model, betas, pose, trans)
    np.testing.assert_allclose(model(betas, pose, trans), points, rtol=0, atol=1e-11)
    np.testing.assert_allclose(model.joints(betas, pose, trans), joints, rtol=0, atol=1e-11)


def test_arguments_may_be_left_out(model):
    betas, pose, trans = parameters(model)
    np.testing.assert_array_equal(model(), model.template.vertices)
    for function in (model, model.joints):
        still = function(0 * betas, 0 * pose, 0 * trans)
        np.testing.assert_allclose(function(), still, rtol=0, atol=1e-6)
        np.testing.assert_allclose(function(betas), function(betas, 0 * pose), atol=1e-6)
        np.testing.assert_allclose(function(trans=trans), function() + trans, atol=1e-13)


def test_leading_axes_broadcast(model):
    betas, pose, trans = parameters(model, (4, 3))
    flat = pose.reshape(4, 3, -1)
    np.testing.assert_array_equal(model(betas, flat, trans), model(betas, pose, trans))
    betas, pose, trans = betas[:, :1], pose[:1], trans[0, 0]
    for function in (model, model.joints):
        found = function(betas, pose, trans)
        assert found.shape[:-2] == (4, 3)
        for i, j in np.ndindex(4, 3):
            expected = function(betas[i, 0], pose[0, j], trans)
            np.testing.assert_allclose(found[i, j], expected, atol=1e-13)
        assert function(pose=pose[0]).shape[:-2] == (3,)
        assert function(betas, trans=np.zeros((3, 3))).shape[:-2] == (4, 3)
        assert function(np.zeros((0, model.n_betas)), pose[0, 0]).shape[:-2] == (0,)


def test_hands_are_posed_before_the_surface_is():
    model = MODELS["hands"]()
    arguments = parameters(model)
    hands = np.random.default_rng(5).normal(size=(2, 4))
    found = model(*arguments, hands)
    for surface, coefficients in zip(found, hands, strict=True):
        expected, joints = skinned(model, *arguments, coefficients)
        np.testing.assert_allclose(surface, expected, rtol=0, atol=1e-11)
        np.testing.assert_allclose(model.joints(*arguments), joints, rtol=0, atol=1e-11)
    np.testing.assert_array_equal(model(*arguments, 0.0 * hands[0]), model(*arguments))
    gradient = autograd.grad(lambda coefficients: anp.sum(model(*arguments, coefficients) ** 2))(
        hands[0]
    )
    step = 1e-6 * hands[1]
    ends = [np.sum(model(*arguments, hands[0] + s) ** 2) for s in (step, -step)]
    assert gradient @ step == pytest.approx((ends[0] - ends[1]) / 2, rel=1e-5)


def test_names_of_hand_poses():
    model = MODELS["hands"]()
    assert model.hand_pose("fist").tolist() == [1.0, 0.0, 1.0, 0.0]
    assert model.hand_pose("relaxed", "open").tolist() == [0.0, 0.0, 0.0, 1.0]
    with pytest.raises(ArgumentError, match="pose must be one of 'relaxed', 'fist', 'open'; found"):
        model.hand_pose("fist", "thumb up")
    with pytest.raises(ArgumentError, match=r"hands must have shape \(\.\.\., 4\); found \(2,\)"):
        model(hands=[1.0, 0.0])
    without = small_model()
    assert without.hand_directions.shape == (N_VERTICES, 3, 0)
    for refused in (lambda: without(hands=[1.0]), lambda: without.hand_pose("fist")):
        with pytest.raises(ArgumentError, match="the model has no hand poses"):
            refused()


@pytest.mark.parametrize(
    ("argument", "joints", "at_rest"),
    [(0, True, False), (1, False, True), (1, True, True), (2, False, False)],
)
def test_gradients(model, argument, joints, at_rest):
    rng = np.random.default_rng(3)
    values = list(parameters(model, (2,)))
    if at_rest:
        values[1] = np.zeros_like(values[1])
    evaluate = model.joints if joints else model
    coefficients = rng.normal(size=np.shape(evaluate(*values)))

    def function(value):
        points = evaluate(*values[:argument], value, *values[argument + 1 :])
        return anp.sum(coefficients * (points + 0.1 * points**2))

    direction = rng.normal(size=values[argument].shape)
    gradient = autograd.grad(function)(values[argument])
    assert gradient.shape == values[argument].shape
    assert np.isfinite(gradient).all()
    assert taylor_slope(function, values[argument], direction, gradient) > 1.9
    step = 1e-5 * direction
    central = (function(values[argument] + step) - function(values[argument] - step)) / 2e-5
    assert np.sum(gradient * direction) == pytest.approx(central, rel=1e-6, abs=1e-6)


def test_round_trip(model, tmp_path):
    path = tmp_path / "body.npz"
    model.save(path)
    found = BodyModel.from_file(str(path))
    names = ("faces", "shapedirs", "joint_regressor", "weights", "parents", "hand_directions")
    for name in names:
        np.testing.assert_array_equal(getattr(found, name), getattr(model, name))
    assert (found.joint_names, found.hand_poses) == (model.joint_names, model.hand_poses)
    assert not found.weights.flags.writeable
    with pytest.raises(ArgumentError, match="parents of BodyModel cannot be changed"):
        found.parents = model.parents
    assert (found.posedirs is None) == (model.posedirs is None)
    np.testing.assert_array_equal(found(*parameters(model)), model(*parameters(model)))
    assert os.listdir(tmp_path) == ["body.npz"]


def spoilt(name, index, value):
    array = small_fields()[name].astype(np.float64)
    array[index] = value
    return {name: array}


REFUSED = {
    "v_template not finite": (spoilt("v_template", (2, 1), np.nan), "v_template holds 1 NaN"),
    "faces beyond the vertices": ({"f": [[0, 1, N_VERTICES]]}, "faces"),
    "J_regressor transposed": ({"J_regressor": small_fields()["J_regressor"].T}, "J_regressor"),
    "J_regressor off one": (
        {"J_regressor": 2 * small_fields()["J_regressor"]},
        "every row of J_regressor must sum to one; row . sums to 2",
    ),
    "weights off one": (
        {"weights": np.full((N_VERTICES, 4), 0.26)},
        "every row of weights must sum to one; row 0 sums to 1.04",
    ),
    "weights negative": (
        spoilt("weights", 4, [-0.5, 1.5, 0.0, 0.0]),
        "weights must not be negative; found -0.5",
    ),
    "tree with a cycle": (
        {"kintree_table": [[-1, 2, 3, 1], [0, 1, 2, 3]]},
        r"kintree_table has a cycle: joints \[1, 2, 3\]",
    ),
    "two roots": (
        {"kintree_table": [[-1, 0, 2**32 - 1, 0], [0, 1, 2, 3]]},
        r"kintree_table must have one root; found roots \[0, 2\]",
    ),
    "unknown parent": (
        {"kintree_table": [[-1, 0, 7, 0], [0, 1, 2, 3]]},
        "kintree_table names 7 as the parent of joint 2",
    ),
    "joint numbered twice": ({"kintree_table": [[-1, 0, 1, 0], [0, 1, 1, 3]]}, "joint twice"),
    "posedirs of the root too": (
        {"posedirs": np.zeros((N_VERTICES, 3, 36))},
        r"posedirs must have shape \(9, 3, 27\)",
    ),
    "hand poses without names": (
        {"hand_directions": np.zeros((N_VERTICES, 3, 2))},
        r"hand_directions must have shape \(9, 3, 0\); found \(9, 3, 2\)",
    ),
    "three names": ({"joint_names": list("abc")}, "joint_names must hold 4 different names"),
}


@pytest.mark.everyday
@pytest.mark.parametrize("case", REFUSED)
def test_malformed_fields(case, tmp_path):
    changes, message = REFUSED[case]
    with pytest.raises((ArgumentError, ArgumentTypeError), match=message):
        small_model(**changes)
    np.savez(tmp_path / "body.npz", **small_fields(**changes))
    with pytest.raises(FileFormatError, match=rf"body\.npz: .*{message}"):
        BodyModel.from_file(tmp_path / "body.npz")


@pytest.mark.parametrize("method", ["__call__", "joints"])
def test_wrong_arguments(method):
    model = small_model()
    evaluate = getattr(model, method)
    for arguments, message in [
        ({"betas": np.zeros(N_BETAS + 1)}, r"betas must have shape \(\.\.\., 2\); found \(3,\)"),
        ({"pose": np.zeros((3, 3))}, r"pose must have shape .*4, 3.* or .*12.*; found \(3, 3\)"),
        ({"trans": np.zeros(2)}, "trans must have shape"),
    ]:
        with pytest.raises(ArgumentError, match=message):
            evaluate(**arguments)
