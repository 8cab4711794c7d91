"""Random re-timings of the open motions."""

import numpy as np

from riemhuman.motions.motion_representations import random_places, retime_at_random


def test_random_re_timings(open_motions):
    places = random_places(100, 40, 3)
    assert len(places) == 40
    np.testing.assert_allclose(places[[0, -1]], [0.0, 99.0])
    steps = np.diff(places)
    assert steps.min() > 0
    assert 1.3 < steps.max() / steps.min() < 4.0 + 1e-9
    frames = retime_at_random(open_motions[0], np.random.default_rng(1))
    assert 24 <= len(frames) <= 60
    np.testing.assert_allclose(frames[[0, -1]], open_motions[0][:: len(open_motions[0]) - 1])
