"""Paths stand on the ground, on a foot that stays in place, and recordings on the floor."""

from itertools import pairwise

import numpy as np
from open_bodies import coarse_bodies

import riemhuman as rh
from riemhuman.plots.standing import ground_height, on_the_ground
from riemhuman.plots.viewed_bodies import ViewedBody

BODIES = coarse_bodies()
(KNEES,) = rh.datasets.load_open_motions("coarse", "average man", "knees")


def test_translations_of_a_path_do_not_matter():
    path = KNEES[:6]
    shifts = np.random.default_rng(0).normal(size=(6, 1, 3))
    shifts[0] = 0.0
    np.testing.assert_allclose(on_the_ground(path + shifts), on_the_ground(path), atol=1e-12)


def test_the_standing_foot_stays_in_place():
    floating = np.linspace(BODIES[0], BODIES[1], 5)
    path = on_the_ground(floating)
    np.testing.assert_array_equal(path[0], BODIES[0])
    np.testing.assert_allclose(path[..., 1].min(axis=1), BODIES[0][:, 1].min(), atol=1e-12)
    for before, after in pairwise(path):
        lowest = (before + after)[:, 1].argmin()
        assert np.linalg.norm((after - before)[lowest]) < 0.01


def test_a_transferred_jump_is_as_high_as_the_recorded_one():
    jump = KNEES[:5].copy()
    jump[2, :, 1] += 0.3
    jump[2:, :, 2] += 0.5
    heights = jump[..., 1].min(axis=1)
    moved = on_the_ground(jump - jump.mean(axis=1, keepdims=True), like=jump)
    np.testing.assert_allclose(
        moved[..., 1].min(axis=1) - moved[0, :, 1].min(), heights - heights[0]
    )
    np.testing.assert_allclose(moved - moved[0, 0], jump - jump[0, 0], atol=1e-9)


def test_a_recording_stands_on_its_floor_though_some_frames_sink():
    lowest = np.full(100, 0.02)
    lowest[10:15] = -0.08
    lowest[60:90] = 0.4
    assert ground_height(lowest) == 0.02


def test_a_motion_of_bones_and_its_frames_have_one_ground():
    frames = ViewedBody("", KNEES[:])
    assert abs(ViewedBody("", KNEES).ground - frames.ground) < 0.005


def test_a_view_that_follows_keeps_the_body_in_place():
    travel = np.linspace([0.0, 0.0], [3.0, -1.0], 5)
    frames = KNEES[:5].copy()
    frames[..., [0, 2]] += travel[:, np.newaxis]
    body = ViewedBody("", frames, track=travel)
    for number in range(5):
        np.testing.assert_allclose(body.surface(number), KNEES[number], atol=1e-12)
