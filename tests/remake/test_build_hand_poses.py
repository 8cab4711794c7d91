"""Building the hand poses, as far as it goes without the package they are built from."""

import build_hand_poses
import numpy as np
import pytest
from build_hand_poses import HandRig
from scipy.spatial.transform import Rotation

from riemhuman.errors import FileError

BONES = ["wrist.L", *(f"metacarpal{k}.L" for k in range(1, 5))]
BONES += [f"finger{finger}-{joint}.L" for finger in range(1, 6) for joint in range(1, 4)]
FINGERS = range(2, 6)


def points_of(finger):
    """Return the joints and the tip of a straight finger that spreads to the side."""
    aside = np.radians(10.0 * (3.5 - finger))
    start = np.array([0.1, 0.02 * (3.5 - finger), 0.0])
    return start + np.outer([0.0, 0.04, 0.07, 0.09], [np.cos(aside), np.sin(aside), 0.0])


@pytest.fixture(scope="module")
def rig():
    """Return bones in the plane of a flat hand, palm up, each with a few points of skin."""
    heads = {"wrist.L": np.zeros(3)}
    heads |= {f"metacarpal{k}.L": [0.02, 0.02 * (2.5 - k), 0.0] for k in range(1, 5)}
    thumb = [[0.02, 0.03, 0.0], [0.04, 0.05, 0.0], [0.06, 0.07, 0.0], [0.08, 0.08, 0.0]]
    chains = {1: np.array(thumb)} | {finger: points_of(finger) for finger in FINGERS}
    skin, weights = [], []
    for finger, points in chains.items():
        for joint in range(1, 4):
            number = BONES.index(f"finger{finger}-{joint}.L")
            heads[BONES[number]] = points[joint - 1]
            # The end of the bone; its start and a point above, which belong to two bones.
            before = number - 1 if joint > 1 else max(finger - 1, 0)
            skin += [points[joint], points[joint - 1], points[joint - 1] + [0.0, 0.0, 0.005]]
            row, other = np.eye(len(BONES))[[number, before]]
            weights += [row, 0.6 * row + 0.4 * other, 0.6 * row + 0.4 * other]
    heads = np.array([heads[bone] for bone in BONES])
    return HandRig(np.array(skin), np.zeros((0, 3), int), tuple(BONES), heads, np.array(weights))


def bone_ends(skin, finger):
    return skin[9 * (finger - 1) :][[0, 3, 6]]


@pytest.mark.parametrize("closed", [0.0, 0.5, 1.0])
def test_fingers_bend_towards_the_palm(rig, closed):
    np.testing.assert_allclose(rig.axes, np.eye(3), atol=1e-12)
    skin = rig.posed(closed)
    for finger, degrees in zip(FINGERS, build_hand_poses._FIST, strict=True):
        ends = np.array([points_of(finger)[0], *bone_ends(skin, finger)])
        bones = np.diff(ends, axis=0)
        lengths = np.linalg.norm(np.diff(points_of(finger), axis=0), axis=1)
        np.testing.assert_allclose(np.linalg.norm(bones, axis=1), lengths, atol=1e-12)
        unit = bones / lengths[:, None]
        cosines = np.cos(np.radians(closed * np.array(degrees[1:])))
        np.testing.assert_allclose(np.sum(unit[1:] * unit[:-1], axis=1), cosines, atol=1e-12)
        raised = np.degrees(np.arcsin(unit[0, 2]))
        assert raised == pytest.approx(closed * degrees[0], abs=3.0)  # spread closes meanwhile
        if closed == 1.0:
            np.testing.assert_allclose(bones[:, 1], 0.0, atol=1e-12)  # side by side


def test_open_fingers_spread(rig):
    skin = rig.posed(-1.0)
    for finger in FINGERS:
        end = bone_ends(skin, finger)[-1] - points_of(finger)[0]
        assert np.degrees(np.arctan2(end[1], end[0])) == pytest.approx(16.0 * (3.5 - finger))
        assert abs(end[2]) < 1e-12


def test_bones_follow_another_body(rig):
    rotation = Rotation.from_rotvec([0.3, -0.5, 0.7])
    other = rig.moved_to(1.2 * rotation.apply(rig.skin) + [0.1, 0.2, 0.3])
    np.testing.assert_allclose(other.heads, 1.2 * rotation.apply(rig.heads) + [0.1, 0.2, 0.3])
    expected = 1.2 * rotation.apply(rig.posed(0.7)) + [0.1, 0.2, 0.3]
    np.testing.assert_allclose(other.posed(0.7), expected, atol=1e-9)


def test_folder_that_does_not_exist(tmp_path):
    with pytest.raises(FileError, match="must exist to receive the model"):
        build_hand_poses.main([str(tmp_path / "nowhere")])
