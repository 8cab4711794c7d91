"""Bodies stand on the floor, whatever was lost in the recording, and crawl on it."""

from dataclasses import replace

import numpy as np
import pytest
from recorded_people import recording_of

from riemhuman.datasets import load_open_motions, retarget
from riemhuman.errors import ArgumentError


@pytest.fixture(scope="module")
def knees(model):
    motion = load_open_motions("coarse", "lean runner", "knees", 30)[0]
    poses, translations = motion.pose_vectors[:60], motion.translations[:60]
    return motion.betas, recording_of(model, motion.betas, poses, translations)


@pytest.fixture(scope="module")
def whole(model, knees):
    betas, recording = knees
    return retarget(recording, model, betas=betas)


def lowest_points(motion):
    return motion[:][..., 1].min(axis=1)


@pytest.mark.parametrize("lost", [[0], list(range(25, 40)), [5, 20, 41, 59]])
def test_lost_frames_do_not_lift_the_motion(model, knees, whole, lost):
    betas, recording = knees
    translations = recording.translations.copy()
    translations[lost, 0] = 0.0
    motion = retarget(replace(recording, translations=translations), model, betas=betas)
    lows = lowest_points(motion)
    assert lows.min() > -0.006
    assert lows.max() < lowest_points(whole).max() + 0.03
    others = np.setdiff1d(np.arange(len(lows)), [k + d for k in lost for d in range(-8, 9)])
    heights = [performed.translations[others, 1] for performed in (motion, whole)]
    np.testing.assert_allclose(*heights, atol=0.02)


def test_an_end_site_in_one_place_with_the_ankle_is_no_toe(model, knees):
    betas, recording = knees
    translations, offsets = recording.translations.copy(), recording.offsets.copy()
    toes = [model.joint_names.index(f"{side}_toes") for side in ("left", "right")]
    translations[:, toes], offsets[toes] = 0.0, 0.0
    motion = retarget(
        replace(recording, translations=translations, offsets=offsets), model, betas=betas
    )
    lows = lowest_points(motion)
    assert -0.006 < lows.min() < 0.01
    assert motion.errors.directions.mean(axis=0).max() < 5.0


def test_joints_in_one_place_are_named(model, knees):
    _, recording = knees
    translations = recording.translations.copy()
    translations[:, model.joint_names.index("left_ankle")] = 0.0
    with pytest.raises(ArgumentError, match=r"left_knee \('left_knee_jnt'\) and left_ankle"):
        retarget(replace(recording, translations=translations), model)


def crawling_poses(model, n_frames=30):
    """Return poses on hands and knees, which move forward and backward by turns."""
    names = list(model.joint_names)
    poses = np.zeros((n_frames, len(names), 3))
    swing = 0.25 * np.sin(np.linspace(0.0, 4.0 * np.pi, n_frames))
    poses[:, names.index("pelvis"), 0] = np.pi / 2
    for sign, side in ((1.0, "left"), (-1.0, "right")):
        poses[:, names.index(f"{side}_hip"), 0] = -np.pi / 2 + sign * swing
        poses[:, names.index(f"{side}_knee"), 0] = np.pi / 2
        poses[:, names.index(f"{side}_shoulder"), 0] = -np.pi / 2 - sign * swing
        poses[:, names.index(f"{side}_shoulder"), 2] = -sign * 0.7
    return poses


@pytest.mark.parametrize("betas", ["zeros", "heavy", "recorded"])
def test_people_crawl_on_the_floor(model, betas):
    poses = crawling_poses(model)
    person = load_open_motions("coarse", "lean runner", "knees", 30)[0].betas
    translations = np.zeros((len(poses), 3))
    lows = model(person, poses, translations)[..., 1].min(axis=1)
    translations[:, 1] = -lows
    translations[:, 2] = np.linspace(0.0, 1.0, len(poses))
    recording = recording_of(model, person, poses, translations)
    chosen = {"zeros": None, "heavy": -1.5 * person, "recorded": "recorded"}[betas]
    found = lowest_points(retarget(recording, model, betas=chosen))
    assert found.min() > -0.006
    assert found.max() < 0.05
