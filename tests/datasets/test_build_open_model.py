"""Building the open model, as far as it goes without the packages it is built from."""

from types import SimpleNamespace

import build_open_model
import numpy as np
import pytest

from riemhuman.datasets import load_open_model
from riemhuman.errors import FileFormatError


def decimated(vertices, faces):
    """Return a stand-in for the package fast-simplification with this answer."""
    return SimpleNamespace(simplify=lambda *_, **__: (vertices, faces))


@pytest.fixture(scope="module")
def source():
    """Return bodies of the coarse model, on the bones the builder expects and a finger."""
    model = load_open_model("coarse")
    joints = build_open_model._joints()
    bones = [bone for joint in joints for bone in joint.bones]
    owner = [j for j, joint in enumerate(joints) for _ in joint.bones]
    finger, wrist = len(bones), model.joint_names.index("left_wrist")
    parents = [-1] * finger + [bones.index("wrist.L")]
    betas = np.random.default_rng(0).standard_normal((40, model.n_betas))
    weights = np.zeros((model.n_vertices, finger + 1))
    heads = np.zeros((40, finger + 1, 3))
    heads[:, :finger] = model.joints(betas)[:, owner]
    for bone, joint in enumerate(owner):
        weights[:, bone] = model.weights[:, joint] / owner.count(joint)
    weights[:, bones.index("wrist.L")] *= 0.25
    weights[:, finger] = 0.75 * model.weights[:, wrist]
    return build_open_model._Source(
        model(betas), heads, model.faces, weights, (*bones, "finger.L"), tuple(parents)
    )


def test_full_model_from_made_up_bodies(source, monkeypatch):
    monkeypatch.setattr(build_open_model, "_N_CANDIDATES_FULL", 60)
    shipped = load_open_model("coarse")
    model = build_open_model.build_full(source)
    assert model.joint_names == shipped.joint_names
    np.testing.assert_array_equal(model.parents, shipped.parents)
    np.testing.assert_allclose(model.weights, shipped.weights, rtol=0, atol=1e-3)
    np.testing.assert_allclose(model.template.vertices, source.vertices.mean(axis=0), atol=1e-6)
    # The components span the samples, and each has the samples' standard deviation.
    offsets = (source.vertices - model.template.vertices).reshape(40, -1)
    directions = model.shapedirs.reshape(-1, model.n_betas)
    betas, *_ = np.linalg.lstsq(directions, offsets.T, rcond=None)
    np.testing.assert_allclose(directions @ betas, offsets.T, rtol=0, atol=1e-4)
    np.testing.assert_allclose(np.cov(betas), np.eye(model.n_betas), rtol=0, atol=1e-2)
    joints = model.joints(betas.T)
    assert np.linalg.norm(joints - shipped.joints()[None], axis=-1).max() < 0.5
    own = source.heads[:, [source.bones.index(joint.head) for joint in build_open_model._joints()]]
    assert np.linalg.norm(joints - own, axis=-1).max() < 0.02


def test_rig_without_a_bone(source):
    bones = tuple("nose" if bone == "foot.R" else bone for bone in source.bones)
    spoilt = build_open_model._Source(
        source.vertices, source.heads, source.faces, source.weights, bones, source.parents
    )
    with pytest.raises(FileFormatError, match=r"rig lacks the bones .*foot\.R"):
        build_open_model.build_full(spoilt)


def test_coarse_model_that_ships_comes_from_the_full_one(monkeypatch):
    monkeypatch.setattr(build_open_model, "N_SAMPLES", 20)
    full, coarse = load_open_model("full"), load_open_model("coarse")
    model = build_open_model.build_coarse(full, decimated(coarse.template.vertices, coarse.faces))
    np.testing.assert_array_equal(model.template.vertices, coarse.template.vertices)
    np.testing.assert_array_equal(model.faces, coarse.faces)
    np.testing.assert_array_equal(model.shapedirs, coarse.shapedirs)
    np.testing.assert_array_equal(model.weights, coarse.weights)
    betas = np.random.default_rng(1).standard_normal((10, full.n_betas))
    for built in (model, coarse):
        gaps = np.linalg.norm(built.joints(betas) - full.joints(betas), axis=-1)
        assert gaps.max() < 0.02


def test_decimation_that_spoils_the_surface(monkeypatch):
    monkeypatch.setattr(build_open_model, "N_SAMPLES", 2)
    coarse = load_open_model("coarse")
    vertices, faces = coarse.template.vertices, coarse.faces
    with pytest.raises(FileFormatError, match="not a closed, consistently oriented surface"):
        build_open_model.build_coarse(coarse, decimated(vertices, faces[1:]))
    flipped = faces.copy()
    flipped[0] = flipped[0, ::-1]
    with pytest.raises(FileFormatError, match="not a closed, consistently oriented surface"):
        build_open_model.build_coarse(coarse, decimated(vertices, flipped))
    doubled = vertices.copy()
    doubled[1] = doubled[0]
    with pytest.raises(FileFormatError, match="two vertices beside the same vertex"):
        build_open_model.build_coarse(coarse, decimated(doubled, faces))


def test_sampled_people():
    with pytest.raises(FileFormatError, match="anny offers the phenotypes .*'tail'"):
        build_open_model.adult_phenotypes(["gender", "tail"])
    labels = ["gender", "age", "muscle", "weight", "height", "proportions", "cupsize", "firmness"]
    labels += ["african", "asian", "caucasian"]
    values = build_open_model.adult_phenotypes(labels)
    assert values.shape == (build_open_model.N_SAMPLES, 11)
    assert values.min() >= 0
    assert values.max() <= 1
    np.testing.assert_allclose(values[:, -3:].sum(axis=1), 1.0)
    assert np.mean(values[:, 0] > 0.5) == 0.5
