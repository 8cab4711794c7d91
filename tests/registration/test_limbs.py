"""Limbs are brought elsewhere with the shoulder in its place and the hand as it points."""

import numpy as np
import pytest

from riemhuman.bodies.skinning import JointMotions
from riemhuman.registration._limbs import are_less, move_end
from riemhuman.registration._posed_body import Pose
from riemhuman.registration._registration_model import RegistrationModel


@pytest.fixture(scope="module", params=["left", "right"])
def arm(model, request):
    """Return the skeleton, the joints of an arm, and the pose of a hand on the hip."""
    fitter = RegistrationModel(model)
    pose = Pose(fitter.poses["hips"], np.zeros(len(fitter.betas_precisions)), np.zeros(3))
    (surface,) = (candidate for candidate in fitter.arm_surfaces if candidate.side == request.param)
    return surface.samples.skeleton, surface.joints, pose


def joints_of(skeleton, pose):
    return JointMotions(skeleton, pose.local, pose.betas)


@pytest.mark.parametrize("shift", [[0.05, 0.0, 0.0], [0.0, -0.06, 0.04], [0.0, 0.03, 0.1]])
def test_a_moved_hand_is_where_it_was_sent_and_not_rotated(arm, shift):
    skeleton, joints, pose = arm
    before = joints_of(skeleton, pose)
    after = joints_of(skeleton, move_end(skeleton, pose, joints[1:], np.array(shift)))
    _, shoulder, elbow, wrist = joints
    np.testing.assert_allclose(after.positions[wrist], before.positions[wrist] + shift, atol=1e-9)
    np.testing.assert_allclose(after.positions[shoulder], before.positions[shoulder], atol=1e-9)
    np.testing.assert_allclose(after.rotations[wrist], before.rotations[wrist], atol=1e-9)
    for first, second in ((shoulder, elbow), (elbow, wrist)):
        lengths = [
            np.linalg.norm(posture.positions[second] - posture.positions[first])
            for posture in (before, after)
        ]
        np.testing.assert_allclose(*lengths)


@pytest.mark.parametrize("side", ["left", "right"])
def test_a_moved_foot_is_where_it_was_sent(model, side):
    fitter = RegistrationModel(model)
    pose = Pose(fitter.poses["a"], np.zeros(len(fitter.betas_precisions)), np.zeros(3))
    skeleton = fitter.samples(None).skeleton
    joints = np.array(fitter.parts.numbers(*(f"{side}_{k}" for k in ("hip", "knee", "ankle"))))
    shift = np.array([0.05, 0.03, 0.1])
    before, after = (
        joints_of(skeleton, posture) for posture in (pose, move_end(skeleton, pose, joints, shift))
    )
    hip, _, ankle = joints
    np.testing.assert_allclose(after.positions[hip], before.positions[hip], atol=1e-9)
    np.testing.assert_allclose(after.positions[ankle], before.positions[ankle] + shift, atol=1e-9)
    np.testing.assert_allclose(after.rotations[ankle], before.rotations[ankle], atol=1e-9)


def test_a_hand_out_of_reach_is_moved_as_far_as_the_arm_is_long(arm):
    skeleton, joints, pose = arm
    far = joints_of(skeleton, move_end(skeleton, pose, joints[1:], np.array([0.0, 2.0, 0.0])))
    start, middle, end = far.positions[joints[1:]]
    length = np.linalg.norm(middle - start) + np.linalg.norm(end - middle)
    assert 0.99 * length < np.linalg.norm(end - start) < length
    assert (end - start)[1] > 0.8 * length


def test_a_gain_must_be_more_than_chance():
    """Gains of a tenth in the mean, which vary: among few points, they say nothing."""
    others = np.full(4000, 0.010)
    some = others - 0.001 + 0.008 * np.resize([1.0, -1.0], len(others))
    assert are_less(some, others)
    assert not are_less(some[:40], others[:40])
    assert not are_less(0.96 * others, others)  # surely, but by too little
