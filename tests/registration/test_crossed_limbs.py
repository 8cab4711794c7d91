"""Arms and legs that cross are exchanged where the scan tells which is which, or not trusted."""

from dataclasses import replace

import numpy as np
import pytest
from people_who_touch import any_person, scan_of_touching, touching_pose

import riemhuman as rh
from riemhuman.registration import Scan
from riemhuman.registration._crossed_limbs import crossing_joints, exchanged_limbs, uncross_limbs
from riemhuman.registration._dense_fit import fit_densely
from riemhuman.registration._posed_body import Pose
from riemhuman.registration._registration_model import RegistrationModel
from riemhuman.registration._scan_preparation import prepare_scan
from riemhuman.registration._start_search import Candidate

UP = np.array([0.0, 1.0, 0.0])


@pytest.fixture(scope="module")
def fitter(model):
    return RegistrationModel(model)


@pytest.fixture(
    scope="module",
    params=[pytest.param("feet crossed", marks=pytest.mark.slow), "wrists crossed"],
)
def crossed(model, fitter, request):
    """Return the joint above the crossing, the dense fit from the true pose, and the body."""
    rng = np.random.default_rng(5)
    person = any_person(model, rng)
    body = person.body(model)
    pose = touching_pose(model, body, request.param, rng)
    surface = body(pose=pose)
    scan = prepare_scan(Scan(scan_of_touching(model, surface, rng, n_points=6000), None))
    betas = np.append(person.betas, np.zeros(model.hand_directions.shape[2]))
    start = Pose(rh.bodies.rotation_matrix(pose), betas, np.zeros(3))
    dense = fit_densely(fitter, Candidate(start, fitter.prior(start), 0.0, UP), scan)
    return {"feet": "knee", "wrists": "elbow"}[request.param.split()[0]], dense, surface


def farthest(fitter, pose, surface):
    return np.linalg.norm(fitter.surface(pose) - surface, axis=1).max()


def test_limbs_in_each_others_place_are_put_right(fitter, crossed):
    joint, dense, surface = crossed
    task, pose = dense.task, dense.pose
    wrong, _ = exchanged_limbs(task, pose, joint)[-1]
    right = farthest(fitter, pose, surface)
    if joint == "knee":
        assert farthest(fitter, wrong, surface) > 3.0 * right
    found = uncross_limbs(replace(dense, pose=wrong)).pose
    assert farthest(fitter, found, surface) < 1.1 * right


def test_right_limbs_stay(fitter, crossed):
    _, dense, surface = crossed
    found = uncross_limbs(dense).pose
    assert farthest(fitter, found, surface) <= farthest(fitter, dense.pose, surface)


def test_limbs_that_a_scan_does_not_show_stay(crossed):
    _, dense, _ = crossed
    elsewhere = replace(dense.task.scan, points=dense.task.scan.points + 10.0)
    unseen = replace(dense, task=replace(dense.task, scan=elsewhere))
    assert uncross_limbs(unseen).pose is dense.pose


def test_limbs_that_do_not_touch_are_no_crossing(crossed):
    joint, dense, _ = crossed
    assert crossing_joints(dense.task.body, dense.pose) == [joint]
