"""Random re-timings of the open motions."""

import numpy as np

from riemhuman.motions.comparison import random_places, retimed


def test_places_rise_from_the_first_frame_to_the_last():
    places = random_places(100, 40, 3)
    assert len(places) == 40
    assert places[0] == 0.0
    np.testing.assert_allclose(places[-1], 99.0)
    steps = np.diff(places)
    assert steps.min() > 0
    assert 1.3 < steps.max() / steps.min() < 4.0 + 1e-9


def test_frames_are_those_of_the_motion(open_motions):
    frames = retimed(open_motions[0], np.random.default_rng(1))
    assert 24 <= len(frames) <= 60
    np.testing.assert_allclose(frames[[0, -1]], open_motions[0][:: len(open_motions[0]) - 1])
