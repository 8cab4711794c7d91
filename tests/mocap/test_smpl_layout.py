"""A skeleton in the layout of SMPL's family, and whether a person may move so."""

import numpy as np
import pytest

from riemhuman.bodies.skinning import SMPL_JOINTS
from riemhuman.errors import ArgumentError
from riemhuman.mocap._smpl_layout import check_units, smpl_offsets, smpl_skeleton

RATE = 30.0


def test_legs_get_the_length_with_which_feet_stand():
    # The legs swing over a foot that stands, of someone smaller than SMPL's mean.
    poses = 0.2 * np.random.default_rng(1).normal(size=(1, 24, 3))
    swings = np.linspace(0.0, 1.0, 12)[:, None, None] * poses
    still = smpl_skeleton(swings, np.zeros((12, 3)), RATE, "", "y")
    places = -0.9 * still.positions[:, SMPL_JOINTS.index("left_toes")]
    skeleton = smpl_skeleton(swings, places, RATE, "", "y")
    assert np.abs(skeleton.offsets).max() < 0.95 * np.abs(smpl_offsets()).max()


def swaying(seconds=4.0):
    """Return poses and places of someone who sways by two centimetres about standing feet."""
    times = np.arange(int(seconds * RATE)) / RATE
    angles = 0.02 * np.sin(2.0 * np.pi * 0.4 * times)
    poses = np.zeros((len(times), 24, 3))
    poses[:, 1:3, 2] = angles[:, None]  # the hips, by turns
    return poses, np.stack([-0.85 * angles, 0.9 + 0.0 * angles, 0.0 * angles], axis=1)


def walking(seconds=4.0):
    """Return a stiff body that moves by 1.3 metres in a second."""
    times = np.arange(int(seconds * RATE)) / RATE
    places = np.stack([0.0 * times, 0.9 + 0.0 * times, 1.3 * times], axis=1)
    return np.zeros((len(times), 24, 3)), places


@pytest.mark.parametrize("moving", [swaying, walking])
def test_metres_are_accepted(moving):
    poses, places = moving()
    np.testing.assert_array_equal(check_units(poses, places, RATE, None), places)


@pytest.mark.parametrize(("unit", "factor"), [("mm", 1000.0), ("cm", 100.0), ("inches", 39.37)])
def test_people_who_move_faster_than_anybody_are_in_another_unit(unit, factor):
    poses, places = walking()
    with pytest.raises(ArgumentError, match=r"the person moves .* m in 1 s, as if they were in"):
        check_units(poses, factor * places, RATE, None)
    given = check_units(poses, factor * places, RATE, unit)
    np.testing.assert_allclose(given, places, rtol=1e-4, atol=1e-12)


def test_feet_that_slide_are_told():
    poses, places = swaying()
    with pytest.warns(UserWarning, match="feet slide at .* if translations are in centimetres"):
        check_units(poses, 100.0 * places, RATE, None)


def test_degrees_are_no_radians():
    poses, places = swaying()
    poses[:, 4:6, 0] = 30.0
    with pytest.raises(ArgumentError, match="joints turn by 30, as if in degrees"):
        check_units(poses, places, RATE, None)
