"""Limbs that something else explains almost as well are not trusted."""

from dataclasses import replace

import numpy as np
import pytest
from people_who_touch import any_person, scan_of_touching, touching_pose
from scanned_people import fit_body
from scipy.spatial import cKDTree

import riemhuman as rh
from riemhuman.kernels.surface import vertex_normals
from riemhuman.registration import Scan, _limb_rivals
from riemhuman.registration._arms_and_hands import BodyFit
from riemhuman.registration._constants import SAME_METRES
from riemhuman.registration._crossed_limbs import exchanged_limbs
from riemhuman.registration._dense_fit import LimbFit, fit_densely
from riemhuman.registration._elastic_step import leave_model
from riemhuman.registration._posed_body import Pose, pose_body
from riemhuman.registration._registration_model import RegistrationModel
from riemhuman.registration._scan_preparation import prepare_scan
from riemhuman.registration._start_search import Candidate

UP = np.array([0.0, 1.0, 0.0])


def find_limb_doubts(body, excess=1.0):
    joints, vertices = len(body.task.body.parts.names), np.ones(len(body.fit.points), dtype=bool)
    return _limb_rivals.find_limb_doubts(body, vertices, np.broadcast_to(excess, joints))


def find_hand_doubts(body, arm, matched=True):
    vertices = np.broadcast_to(matched, len(body.fit.points))
    return _limb_rivals._other_hand(body, arm, vertices, np.ones(len(body.task.body.parts.names)))


@pytest.fixture(scope="module")
def fitter(model):
    return RegistrationModel(model)


def fitted(model, fitter, posture, seed=3):
    """Return a fit to a scan from the true pose, and the body."""
    rng = np.random.default_rng(seed)
    person = any_person(model, rng)
    body = person.body(model)
    pose = touching_pose(model, body, posture, rng)
    surface = body(pose=pose)
    points = scan_of_touching(model, surface, rng, n_points=6000)
    betas = np.append(person.betas, np.zeros(model.hand_directions.shape[2]))
    start = Pose(rh.bodies.rotation_matrix(pose), betas, np.zeros(3))
    best = Candidate(start, fitter.prior(start), 0.0, UP)
    prepared = prepare_scan(Scan(points))
    outward = vertex_normals(surface, model.faces)[cKDTree(surface).query(prepared.points)[1]]
    inward = np.einsum("nx,nx->n", prepared.normals, outward) < 0.0
    normals = np.where(inward[:, np.newaxis], -prepared.normals, prepared.normals)
    return fit_body(fitter, best, replace(prepared, normals=normals)), surface


@pytest.fixture(scope="module")
def clasped(model, fitter):
    """Return the fit of a body whose hands are clasped."""
    return fitted(model, fitter, "hands clasped")[0]


@pytest.mark.slow
def test_clasped_hands_hide_each_others_fingers(clasped, fitter):
    for arm, doubt in hands_that_touch(clasped).items():
        assert 0.2 < doubt.vertices[arm.on_hand].mean() < 1.0
        assert fitter.parts.on_hands[doubt.vertices].all()


@pytest.mark.slow
def test_hands_that_touch_are_not_trusted_where_poses_of_fingers_differ(clasped, fitter):
    for arm, doubt in hands_that_touch(clasped).items():
        now, *others = clasped.hand_fits[arm]
        apart = [np.linalg.norm(fit.surface - now.surface, axis=1) for fit in others]
        near = np.max(apart, axis=0) < SAME_METRES
        assert near[np.isin(arm.vertices, arm.on_hand)].any()
        assert not doubt.vertices[arm.vertices[near]].any()
    # Nothing is known of hands without points of their own.
    for arm, doubt in hands_that_touch(replace(clasped, hand_fits={})).items():
        assert doubt.vertices[arm.on_hand].all()


def hands_that_touch(body):
    """Return the doubts about both hands."""
    doubts = {}
    for arm in body.task.body.arm_surfaces:
        (doubts[arm],) = find_hand_doubts(body, arm)
        assert doubts[arm].reason == f"{arm.side} hand: it touches the other"
    return doubts


def exact_fit(model, fitter, name):
    """Return the fit to a scan without noise of a start pose."""
    pose = Pose(fitter.poses[name], np.zeros(len(fitter.betas_precisions)), np.zeros(3))
    scan = prepare_scan(Scan(fitter.surface(pose), model.faces))
    dense = fit_densely(fitter, Candidate(pose, fitter.prior(pose), 0.0, UP), scan)
    task, pose = dense.task, dense.pose
    return BodyFit(task, leave_model(task, pose), {}, {})


@pytest.fixture(scope="module")
def upright(model, fitter):
    """Return the fit of an upright body."""
    return exact_fit(model, fitter, "a")


@pytest.fixture(scope="module")
def akimbo(model, fitter):
    """Return the fit of a body whose hands are on the hips, with the hands' fits."""
    body = exact_fit(model, fitter, "hips")
    fits = {}
    for arm in fitter.arm_surfaces:
        surface = pose_body(arm.skin, body.fit.pose).points
        fits[arm] = [LimbFit(body.fit.pose, body.task.prior, surface, np.full(50, 0.001))]
    return replace(body, hand_fits=fits)


def test_elbows_and_hands_in_their_places_leave_no_doubt(akimbo):
    assert find_limb_doubts(akimbo) == []


@pytest.mark.parametrize(
    ("farther", "displaced", "trusted"),
    [(0.9, 0.06, False), (1.2, 0.06, False), (1.6, 0.06, True), (1.2, 0.01, True)],
)
def test_a_rival_nearly_as_near_and_elsewhere_leaves_its_limb_in_doubt(
    upright, farther, displaced, trusted
):
    arm = upright.task.body.arm_surfaces[0]
    pose = upright.fit.pose
    aside = pose._replace(trans=pose.trans + [displaced, 0.0, 0.0])
    fits = [
        LimbFit(
            rival,
            upright.task.prior,
            pose_body(arm.skin, rival).points,
            np.full(50, distance),
        )
        for rival, distance in ((pose, 0.002), (aside, 0.002 * farther))
    ]
    doubts = find_limb_doubts(replace(upright, arm_fits={arm: fits}))
    reason = "left forearm: its rotation is ambiguous"
    assert [doubt.reason for doubt in doubts] == [reason] * (not trusted)
    for doubt in doubts:
        np.testing.assert_array_equal(np.flatnonzero(doubt.vertices), arm.vertices)


def hand_fits(model, upright, distances):
    """Return fits of the left hand in several poses, at distances from 50 points, metres."""
    arm = upright.task.body.arm_surfaces[0]
    fits = [
        LimbFit(
            upright.fit.pose,
            upright.task.prior,
            model(hands=model.hand_pose(name))[arm.vertices],
            np.full(50, distance),
        )
        for name, distance in zip(model.hand_poses, distances, strict=True)
    ]
    return replace(upright, hand_fits={arm: fits})


@pytest.mark.parametrize(("farther", "trusted"), [(1.05, False), (1.4, True)])
def test_another_pose_of_a_hand_leaves_its_fingers_in_doubt(model, upright, farther, trusted):
    arm = upright.task.body.arm_surfaces[0]
    doubts = find_hand_doubts(
        hand_fits(model, upright, (0.003, 0.003 * farther, 0.006, 0.006)), arm
    )
    assert len(doubts) == (0 if trusted else 1)
    for doubt in doubts:
        assert "left hand" in doubt.reason
        assert "fingers may be open or bent" in doubt.reason
        assert np.isin(np.flatnonzero(doubt.vertices), arm.on_hand).all()


@pytest.mark.parametrize("noise", [0.0, 0.001])
@pytest.mark.parametrize(("share", "trusted"), [(0.6, True), (0.9, False)])
def test_fingers_are_trusted_if_one_pose_is_much_nearer_than_others(
    model, upright, share, trusted, noise
):
    """Which pose is right is told by the others, however badly the model fits the person."""
    distances = np.array([share, 1.0, 1.0, 1.0]) * (0.003 + noise)
    doubts = find_hand_doubts(
        hand_fits(model, upright, distances), upright.task.body.arm_surfaces[0]
    )
    assert len(doubts) == (0 if trusted else 1)


def test_fingers_of_which_a_scan_shows_little_are_not_trusted(model, upright):
    arm = upright.task.body.arm_surfaces[0]
    body = hand_fits(model, upright, (0.002, 0.005, 0.005, 0.005))
    matched = np.ones(len(upright.fit.points), dtype=bool)
    assert find_hand_doubts(body, arm, matched) == []
    matched[arm.on_hand[len(arm.on_hand) // 10 :]] = False
    (doubt,) = find_hand_doubts(body, arm, matched)
    assert doubt.reason == "left hand: the scan shows little of it"


def test_limbs_that_fit_worse_than_the_rest_are_not_trusted(model, upright):
    body, parts = hand_fits(model, upright, (0.002, 0.005, 0.005, 0.005)), upright.task.body.parts
    reasons = {
        "left_knee": (2.04, "left shin: it fits 2.0 times worse than the rest of the body"),
        "left_elbow": (2.2, "left forearm: it fits 2.2 times worse"),
        "left_wrist": (3.5, "left hand: no pose of its fingers fits the scan"),
        "right_shoulder": (2.5, "right upper arm: it fits 2.5 times worse"),
    }
    joints, factors = parts.numbers(*reasons), np.ones(len(parts.names))
    factors[joints] = 1.6
    assert find_limb_doubts(body, factors) == []
    factors[joints] = [excess for excess, _ in reasons.values()]
    doubts = find_limb_doubts(body, factors)
    assert len(doubts) == len(reasons)
    for joint, (_, reason) in reasons.items():
        (doubt,) = [candidate for candidate in doubts if candidate.reason.startswith(reason)]
        assert parts.vertices(parts.numbers(joint))[doubt.vertices].all()


def test_a_head_that_another_turn_explains_better_is_not_trusted(fitter, upright):
    fit = upright.fit
    head = fitter.parts.numbers("head")
    turned = fit.pose.local.copy()
    turned[head] = turned[head] @ rh.bodies.rotation_matrix(np.radians([0.0, 70.0, 0.0]))
    elsewhere = replace(fit, pose=fit.pose._replace(local=turned))
    (doubt,) = _limb_rivals._turned_head(replace(upright, fit=elsewhere))
    assert doubt.reason.startswith("head: it may be turned")
    assert fitter.parts.vertices(head)[doubt.vertices].all()


@pytest.mark.parametrize("joint", ["elbow", "knee"])
def test_exchanged_limbs_fit_the_scan(fitter, upright, joint):
    """Of a body that is the same on both sides, exchanging its limbs changes nothing."""
    mirrored, _ = exchanged_limbs(upright.task, upright.fit.pose, joint)[0]
    exchanged = fitter.surface(mirrored)
    assert np.linalg.norm(exchanged - upright.fit.model_points, axis=1).mean() < 0.005
