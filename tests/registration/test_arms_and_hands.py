"""Arms in other ways: where they start, which bends count against them."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import riemhuman as rh
from riemhuman.registration import Scan, _arms_and_hands
from riemhuman.registration._arms_and_hands import pose_hands
from riemhuman.registration._constants import FOREARM_ANGLES, WRIST_ANGLES
from riemhuman.registration._dense_fit import fit_densely
from riemhuman.registration._posed_body import Pose, pose_body
from riemhuman.registration._registration_model import RegistrationModel
from riemhuman.registration._scan_preparation import prepare_scan
from riemhuman.registration._start_search import Candidate


@pytest.fixture(scope="module")
def fitter(model):
    return RegistrationModel(model)


def test_rotating_a_forearm_moves_no_joint(fitter):
    body, n_betas = fitter.samples(250), len(fitter.betas_precisions)
    pose = Pose(fitter.poses["hips"], np.zeros(n_betas), np.array([0.1, 0.2, 0.3]))
    for arm in fitter.arm_surfaces:
        elbow, wrist = arm.joints[-2:]
        turns, bends = [], []
        for forearm in FOREARM_ANGLES:
            for angle in WRIST_ANGLES:
                rotated = pose._replace(local=arm.rotated(pose.local, forearm, angle))
                np.testing.assert_array_equal(
                    np.delete(rotated.local, [elbow, wrist], 0),
                    np.delete(pose.local, [elbow, wrist], 0),
                )
                places = [pose_body(body, posture).motions.positions for posture in (pose, rotated)]
                np.testing.assert_allclose(*places, atol=1e-12)
                turns.append(pose.local[elbow].T @ rotated.local[elbow])
                bends.append(rotated.local[wrist])
        angles = np.degrees(Rotation.from_matrix(np.stack(turns)).magnitude())
        np.testing.assert_allclose(np.sort(angles), np.repeat([0, 60, 60, 120, 120, 180], 3))
        # About one axis.
        np.testing.assert_allclose(
            np.linalg.svd(np.stack(turns) - np.eye(3))[1][:, 2], 0.0, atol=1e-12
        )
        bent = np.degrees(Rotation.from_matrix(np.stack(bends)).magnitude())
        np.testing.assert_allclose(np.sort(bent), np.repeat([0, 50], [6, 12]), atol=1e-6)


def strains(model, fitter, angles):
    rotations = rh.datasets.joint_rotations(angles, model)
    local = rh.bodies.rotation_matrix(rh.datasets.pose_vectors(rotations, model))
    return [arm.strain(local) for arm in fitter.arm_surfaces]


@pytest.mark.parametrize(
    ("angles", "strain"),
    [
        ({}, 1.0),
        ({"elbow": ("y", -90)}, 1.0),  # as elbows bend
        ({"elbow": ("z", -30)}, 1.0),  # inward, as where the upper arm is rotated
        ({"elbow": ("z", 30)}, 2.0),  # outward
        ({"elbow": ("x", 80)}, 1.0),  # the forearm about itself
        ({"wrist": ("z", 60)}, 1.0),  # the hand about its hinge
        ({"wrist": ("z", -60)}, 1.0),
        ({"wrist": ("y", 60)}, 2.0),
        ({"wrist": ("x", -120)}, 5.0),
    ],
)
def test_bends_that_no_arm_has_count_against_it(model, fitter, angles, strain):
    angles = {"shoulder": ("xz", 10, -50)} | angles
    np.testing.assert_allclose(strains(model, fitter, angles), strain, rtol=1e-6)


def test_arms_of_people_are_hardly_strained(fitter, natural_bodies):
    rotations = rh.bodies.rotation_matrix(natural_bodies.pose_vectors)
    found = [arm.strain(local) for arm in fitter.arm_surfaces for local in rotations]
    assert np.max(found) < 1.9


def test_an_arm_that_fits_worse_alone_stays_as_it_is(fitter, monkeypatch):
    pose = Pose(fitter.poses["a"], np.zeros(len(fitter.betas_precisions)), np.zeros(3))
    scan = prepare_scan(Scan(fitter.surface(pose), fitter.model.faces))
    best = Candidate(pose, fitter.prior(pose), 0.0, np.array([0.0, 1.0, 0.0]))
    dense = fit_densely(fitter, best, scan)
    task, pose = dense.task, dense.pose
    offsets = iter(np.tile([0.03, 0.02, 0.02, 0.02, 0.02], 2))

    def astray(task, joints, samples, scales, start):
        return start._replace(trans=start.trans + [next(offsets), 0.0, 0.0])

    monkeypatch.setattr(_arms_and_hands, "fit_joints", astray)
    monkeypatch.setattr(_arms_and_hands, "mapped", lambda fit, starts, _: map(fit, starts))
    assert pose_hands(task, pose)[1] is pose
