"""Recorded skeletons: joints along the bones, and frames at lower rates."""

import numpy as np
import pytest

from riemhuman.errors import ArgumentError
from riemhuman.mocap.skeleton_motion import SkeletonMotion, nearest_frames

QUARTER = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])  # about z


def test_rotations_of_parents_carry_joints_along():
    """A quarter of a turn at the hip and one at the knee: the foot is above the knee."""
    offsets = np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [2.0, 0.0, 0.0]])
    rotations = np.array([[np.eye(3)] * 3, [QUARTER, QUARTER, np.eye(3)]])
    motion = SkeletonMotion(
        ("hip", "knee", "foot"),
        np.array([-1, 0, 1]),
        offsets,
        rotations,
        np.stack([offsets] * 2),
        1.0,
    )
    np.testing.assert_allclose(motion.positions[0], [[0, 1, 0], [1, 1, 0], [3, 1, 0]])
    np.testing.assert_allclose(motion.positions[1], [[0, 1, 0], [0, 2, 0], [-2, 2, 0]], atol=1e-15)
    np.testing.assert_allclose(motion.global_rotations[1, 2], QUARTER @ QUARTER)


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
