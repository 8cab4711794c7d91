"""A skeleton in the layout of SMPL's family."""

from dataclasses import replace

import numpy as np
import pytest

from riemhuman.bodies.skinning import SMPL_JOINTS
from riemhuman.mocap._smpl_layout import smpl_offsets, smpl_skeleton

N_FRAMES = 12


@pytest.fixture(scope="module")
def poses():
    vectors = 0.2 * np.random.default_rng(1).normal(size=(N_FRAMES, 24, 3))
    vectors[:, 0] = 0.1
    return vectors


def test_scaled_skeletons_keep_their_joints(poses):
    """Joints of long recordings are computed once, before the legs get their length."""
    # The legs swing over a foot that stands, of someone smaller than SMPL's mean.
    swings = np.linspace(0.0, 1.0, N_FRAMES)[:, None, None] * poses[:1]
    still = smpl_skeleton(swings, np.zeros((N_FRAMES, 3)), 30.0, "", "y")
    places = -0.9 * still.positions[:, SMPL_JOINTS.index("left_toes")]
    skeleton = smpl_skeleton(swings, places, 30.0, "", "y")
    assert np.abs(skeleton.offsets).max() < 0.95 * np.abs(smpl_offsets()).max()
    assert {"positions", "global_rotations"} <= set(vars(skeleton))
    np.testing.assert_allclose(skeleton.positions, replace(skeleton).positions, atol=1e-12)
