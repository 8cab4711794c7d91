"""Recorded skeletons: joints along the bones, and frames at lower rates."""

import numpy as np
import pytest

from riemhuman.errors import ArgumentError
from riemhuman.mocap.skeleton_motion import nearest_frames


@pytest.mark.parametrize("rate", [1, 23.976, 50, 60, 119.88, 120.0])
def test_frames_are_the_nearest_in_time(rate):
    numbers = nearest_frames(61, 120.0, rate)
    times = np.arange(len(numbers)) / rate
    assert np.abs(numbers / 120.0 - times).max() <= 0.5 / 120.0 + 1e-12
    # As many as fit into half a second.
    assert times[-1] <= 0.5 + 1e-9 < times[-1] + 1.0 / rate + 1e-6
    assert numbers[-1] <= 60


def test_frames_are_not_made_up():
    with pytest.raises(ArgumentError, match="frames_per_second must be at most .*120; found 121"):
        nearest_frames(61, 120.0, 121)
    with pytest.raises(ArgumentError, match="frames_per_second must be"):
        nearest_frames(61, 120.0, 0)
