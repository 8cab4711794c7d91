"""Limbs that something else explains almost as well are not trusted."""

import numpy as np
import pytest
from people_who_touch import any_person, scan_of_touching, touching_pose
from scipy.spatial import cKDTree

import riemhuman as rh
from riemhuman.registration import Scan
from riemhuman.registration._arms_and_hands import fit_body
from riemhuman.registration._dense_fit import DenseFitter
from riemhuman.registration._limb_rivals import RivalSettings, _exchange, find_limb_doubts
from riemhuman.registration._posed_body import Pose
from riemhuman.registration._scan_preparation import prepare_scan
from riemhuman.registration._start_search import Candidate

UP = np.array([0.0, 1.0, 0.0])


@pytest.fixture(scope="module")
def fitter(model):
    return DenseFitter(model)


def fitted(model, fitter, posture, seed=3, without=()):
    """Return a fit from the true pose to a scan without the points on some joints, and the body."""
    rng = np.random.default_rng(seed)
    person = any_person(model, rng)
    own = person.body(model)
    pose = touching_pose(model, own, posture, rng)
    surface = own(pose=pose)
    points = scan_of_touching(model, surface, rng, n_points=6000)
    owners = model.weights.argmax(axis=1)[cKDTree(surface).query(points)[1]]
    points = points[~np.isin(owners, [model.joint_names.index(name) for name in without])]
    betas = np.append(person.betas, np.zeros(model.hand_directions.shape[2]))
    start = Pose(rh.bodies.rotation_matrix(pose), betas, np.zeros(3))
    best = Candidate(start, fitter._prior(start), 0.0, UP)
    return fit_body(fitter, best, prepare_scan(Scan(points))), surface


def test_hanging_arms_leave_no_doubt(model, fitter):
    body, surface = fitted(model, fitter, "arms hanging", seed=4)
    assert np.linalg.norm(body.fit.points - surface, axis=1).mean() < 0.015
    assert find_limb_doubts(body) == []


def test_clasped_hands_hide_each_others_fingers(model, fitter):
    body, _ = fitted(model, fitter, "hands clasped")
    doubt, *_ = find_limb_doubts(body)
    assert doubt.reason.startswith("hands: they touch")
    np.testing.assert_array_equal(doubt.vertices, fitter.parts.on_hands)


def test_a_rival_within_the_margin_leaves_its_limb_in_doubt(model, fitter):
    """Without its hand, a turned forearm fits less well, but not by much."""
    body, _ = fitted(model, fitter, "arms hanging", without=["left_wrist"])
    assert "left" in [arm.side for arm in body.doubtful_arms]
    (doubt,) = [
        doubt
        for doubt in find_limb_doubts(body, RivalSettings(least_margin=1.0, hand_margin=0.0))
        if "left" in doubt.reason
    ]
    assert doubt.reason.startswith("left hand: two explanations fit almost equally")
    hand = model.weights.argmax(axis=1) == model.joint_names.index("left_wrist")
    assert doubt.vertices[hand].mean() > 0.5
    arm = fitter.parts.vertices([model.joint_names.index("left_elbow")])
    assert not doubt.vertices[~arm].any()


@pytest.mark.parametrize("joint", ["elbow", "knee"])
def test_exchanged_limbs_fit_the_scan(model, fitter, joint):
    """Of a body that is the same on both sides, exchanging its limbs changes nothing."""
    rest = fitter.poses["a"]
    pose = Pose(rest, np.zeros(len(fitter.betas_precisions)), np.zeros(3))
    scan = prepare_scan(Scan(fitter.surface(pose), model.faces))
    best = Candidate(pose, fitter._prior(pose), 0.0, UP)
    body = fit_body(fitter, best, scan)
    exchanged = fitter.surface(_exchange(body.task, body.fit.pose, joint))
    gaps = np.linalg.norm(exchanged - body.fit.model_points, axis=1)
    assert gaps.mean() < 0.005
