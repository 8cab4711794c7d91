"""Motions in pages: bones that the page poses agree with the library's bodies."""

import numpy as np
import pytest
from open_bodies import model_with

import riemhuman as rh
from riemhuman.datasets import ArrayMotion
from riemhuman.plots import ViewedBody, Viewer, view_path

KNEES = rh.datasets.load_open_motions("coarse", sequences="knees")[0]
SHOWN = """
const viewer = document.querySelector('.viewer').viewer;
const [body] = viewer.bodies();
viewer.seek(arguments[0]);
return [...body.positions].map((value, i) => value + body.frames.centre[i % 3]);
"""


def with_correctives(model):
    """Return the model with pose correctives of centimetres, smooth along the surface."""
    rng = np.random.default_rng(3)
    n_entries = 9 * (model.n_joints - 1)
    bends = 0.01 * rng.normal(size=(model.n_joints, 3, n_entries))
    return model_with(model, posedirs=np.einsum("vj,jce->vce", model.weights, bends))


@pytest.fixture(scope="module")
def corrected():
    poses, translations = KNEES.pose_vectors[::4], KNEES.translations[::4]
    model = with_correctives(KNEES.model)
    return ArrayMotion(("a", "b"), 15.0, model, KNEES.betas, poses, translations)


@pytest.mark.everyday("corrected")
@pytest.mark.parametrize("kind", ["open", "corrected"])
def test_the_page_poses_bodies_as_the_library_does(browser, tmp_path, corrected, kind):
    motion = KNEES if kind == "open" else corrected
    rh.view(motion).save(tmp_path / "motion.html")
    browser.open_viewer(tmp_path / "motion.html", 500, 600)
    for frame in (0, len(motion) // 3, len(motion) - 1):
        shown = browser.run(SHOWN, frame / (len(motion) - 1))
        apart = np.linalg.norm(np.reshape(shown, (-1, 3)) - motion[frame], axis=-1)
        assert apart.mean() < 3e-4
        assert apart.max() < 2e-3
    # Between two frames, bones turn: the surface does not shrink as a mean of two would.
    between = browser.run(SHOWN, 1.5 / (len(motion) - 1))
    halfway = (motion[1] + motion[2]) / 2
    assert np.abs(np.reshape(between, (-1, 3)) - halfway).max() < 1e-2
    assert browser.console() == []


def test_correctives_have_an_effect(corrected):
    without = ArrayMotion(
        ("a", "b"),
        15.0,
        KNEES.model,
        KNEES.betas,
        corrected.pose_vectors,
        corrected.translations,
    )
    assert np.linalg.norm(corrected[9] - without[9], axis=-1).mean() > 3e-3


@pytest.mark.slow
def test_a_motion_by_bones_is_small_and_the_still_shows_it():
    whole = Viewer(KNEES.faces, {"": [ViewedBody("", KNEES[:])]})
    bones = Viewer(KNEES.faces, {"": [ViewedBody("", KNEES)]})
    texts = [viewer.fragment("a") for viewer in (whole, bones)]
    sizes = [len(text.split('data-part="data">')[1]) for text in texts]
    assert sizes[1] < sizes[0] / 8
    assert np.array_equal(*(viewer._picture(viewer.choices[""], 100) for viewer in (whole, bones)))


def test_motions_that_are_no_models_travel_as_coordinates(tmp_path):
    folder = tmp_path / "knees"
    ArrayMotion(
        ("a", "knees"), 30.0, KNEES.model, KNEES.betas,
        KNEES.pose_vectors[:3], KNEES.translations[:3],
    ).save(folder)  # fmt: skip
    (motion,) = rh.datasets.load_mesh_motions(folder, 30.0)
    (bodies,) = view_path(motion).choices.values()
    assert bodies[0].frames.shape == (3, 1202, 3)
