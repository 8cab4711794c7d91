"""Scans of people with flesh and habits, whose skin touches skin: right, or refused by name."""

import re

import numpy as np
import pytest
from scanned_people import result_of_one_search, settings_with

import riemhuman as rh
from riemhuman.registration import ScanRegistration, simulated_scan
from riemhuman.registration._start_poses import BodyParts
from riemhuman.registration._trust import find_overlaps
from riemhuman.registration.settings import TrustSettings

SETTINGS = TrustSettings()

HANDS_ON_HIPS, HAND_ON_EAR = 4, 6
FAR = 0.03


@pytest.fixture(scope="module")
def bodies():
    return rh.datasets.load_open_bodies("coarse", variant="natural", people=777)


def scan_of(bodies, number):
    faces = bodies.template.faces
    return simulated_scan(bodies[number], faces, number, n_points=12_000, missing=0.1)


def error(result, scan):
    return np.linalg.norm(result.points - scan.body, axis=1).mean()


def test_hands_on_the_head_are_no_overlap(registration, bodies):
    """A finger is so thin that the skin beneath it counts as matched; other parts are not."""
    template, on_hands = registration.model.template, BodyParts(registration.model).on_hands
    whole = np.ones(template.n_vertices, dtype=bool)
    poses = [k for k in range(100) if bodies.pose_names[bodies.pose[k]] == "hands_on_head"]
    shares = [find_overlaps(template, bodies[k], whole, SETTINGS).near.mean() for k in poses]
    assert max(shares) > SETTINGS.largest_overlap
    for k in poses:
        assert not find_overlaps(template, bodies[k], ~on_hands, SETTINGS).near.any()


@pytest.mark.slow
def test_hands_on_hips(registration, bodies):
    scan = scan_of(bodies, HANDS_ON_HIPS)
    result = registration.solve(scan.points)
    assert result.trusted, result.message
    assert error(result, scan) < 0.02


def test_a_hand_on_the_ear(model, bodies):
    """No start pose has one hand on the ear and the other arm hanging: arms are tried alone."""
    settings = settings_with(poses=("a", "down", "head", "elbows"))
    registration = ScanRegistration(model, up="y", settings=settings)
    scan = scan_of(bodies, HAND_ON_EAR)
    result = registration.solve(scan.points)
    assert result.trusted, result.message
    assert error(result, scan) < 0.01
    assert np.linalg.norm(result.points - scan.body, axis=1).max() < 0.05


@pytest.mark.slow
def test_a_wrong_arm_is_not_trusted(registration_from, bodies):
    """From one start pose alone, an arm is not found, and missed."""
    scan = scan_of(bodies, HAND_ON_EAR)
    result = result_of_one_search(registration_from("hips"), scan.points)
    assert error(result, scan) > FAR
    assert not result.trusted
    assert re.search("its right (forearm|hand) matches hardly anything", result.message)


@pytest.mark.slow
def test_landmarks_bring_the_arm_where_it_is(model, bodies):
    registration = ScanRegistration(model, up="y", settings=settings_with(tries_arms=False))
    scan = scan_of(bodies, HAND_ON_EAR)
    joints = registration.model.joint_regressor @ scan.body
    names = list(registration.model.joint_names)
    known = {name: joints[names.index(name)] for name in ("left_elbow", "left_wrist")}
    result = registration.solve(scan.points, landmarks=known)
    assert result.trusted, result.message
    assert error(result, scan) < 0.02
