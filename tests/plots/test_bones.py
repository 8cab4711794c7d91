"""Motions in pages: bones that the page poses agree with the library's bodies."""

import numpy as np
from open_bodies import model_with

import riemhuman as rh
from riemhuman.datasets import ArrayMotion
from riemhuman.plots import view_path

KNEES = rh.datasets.load_open_motions("coarse", sequences="knees")[0]
SHOWN = """
const viewer = document.querySelector('.viewer').viewer;
const [body] = viewer.bodies();
viewer.seek(arguments[0]);
return [...body.positions].map((value, i) => value + body.frames.centre[i % 3]);
"""


def test_the_page_poses_bodies_as_the_library_does(browser, tmp_path):
    """With pose correctives of centimetres, smooth along the surface."""
    poses, translations = KNEES.pose_vectors[::4], KNEES.translations[::4]
    bent = (KNEES.model.n_joints, 3, 9 * (KNEES.model.n_joints - 1))
    bends = 0.01 * np.random.default_rng(3).normal(size=bent)
    posedirs = np.einsum("vj,jce->vce", KNEES.model.weights, bends)
    model = model_with(KNEES.model, posedirs=posedirs)
    motion = ArrayMotion(("a", "b"), 15.0, model, KNEES.betas, poses, translations)
    without = KNEES.model(KNEES.betas, poses[9], translations[9])
    assert np.linalg.norm(motion[9] - without, axis=-1).mean() > 3e-3
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


def test_motions_that_are_no_models_travel_as_coordinates(tmp_path):
    folder = tmp_path / "knees"
    ArrayMotion(
        ("a", "knees"), 30.0, KNEES.model, KNEES.betas,
        KNEES.pose_vectors[:3], KNEES.translations[:3],
    ).save(folder)  # fmt: skip
    (motion,) = rh.datasets.load_mesh_motions(folder, 30.0)
    (bodies,) = view_path(motion).choices.values()
    assert bodies[0].frames.shape == (3, 1202, 3)
