"""Lengths of recordings: units, people of any size, and the model's own people."""

import numpy as np
import pytest
from recorded_people import recording_of, scaled

from riemhuman.datasets import (
    load_open_model,
    load_open_motions,
    load_recording,
    retarget,
)

CMU = 0.0254 / 0.45


def stature(motion):
    return np.ptp(motion.model(motion.betas)[:, 1])


def travel(motion):
    return np.ptp(motion.translations[:, 2])


@pytest.mark.parametrize("betas", [None, "recorded"])
def test_recorded_lengths_are_kept(recording, betas):
    motions = [
        retarget(scaled(recording, size), unit=CMU, betas=betas, frames_per_second=3)
        for size in (0.6, 1.0)
    ]
    for size, motion in zip((0.6, 1.0), motions, strict=True):
        assert stature(motion) == pytest.approx(size * stature(motions[1]), rel=1e-3)
        assert travel(motion) == pytest.approx(size * travel(motions[1]), rel=0.05)
        assert motion.errors.scale == pytest.approx(CMU, rel=1e-9)
        assert "The recorded lengths were kept" in motion.message
    assert 1.4 < stature(motions[1]) < 2.1


def test_by_default_an_average_adult_performs(recording):
    motions = [retarget(scaled(recording, size), frames_per_second=3) for size in (0.6, 1.0)]
    for motion in motions:
        assert motion.model is load_open_model("coarse")
        assert not motion.betas.any()
        assert "an average adult" in motion.message
    child, adult = motions
    assert child.errors.scale == pytest.approx(adult.errors.scale / 0.6, rel=1e-9)
    np.testing.assert_allclose(child[:], adult[:], atol=1e-9)


def test_other_performers_keep_their_own_size(recording):
    child = retarget(scaled(recording, 0.6), unit=CMU, frames_per_second=3)
    adult = child.performed_by(np.zeros(child.model.n_betas))
    assert stature(child) < 0.7 * stature(adult)
    assert adult.model is load_open_model("coarse")


def test_the_own_skeleton_of_the_model_is_played():
    motion = load_open_motions("coarse", "lean runner", "punching", 10)[0]
    for unit in (1.0, 0.01):
        recording = recording_of(
            motion.model, motion.betas, motion.pose_vectors, motion.translations, 10.0, "{}"
        )
        played = retarget(scaled(recording, 1.0 / unit), motion.model)
        np.testing.assert_allclose(played[:], motion[:], atol=1e-6)
        assert played.errors.positions.max() < 1e-6


def test_people_of_recorded_size_are_saved_and_read(recording, tmp_path):
    child = retarget(scaled(recording, 0.6), unit=CMU, betas="recorded", frames_per_second=3)
    for ending in ("bvh", "npz"):
        child.save(tmp_path / f"child.{ending}")
        read = load_recording(tmp_path / f"child.{ending}")
        np.testing.assert_allclose(read[:], child[:], atol=1e-4)
        assert stature(read) == pytest.approx(stature(child), rel=1e-4)
