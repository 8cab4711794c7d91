"""Scans of people with flesh and habits, whose skin touches skin: right, or refused by name."""

import numpy as np
import pytest

import riemhuman as rh
from riemhuman.registration import simulated_scan
from riemhuman.registration._trust import LARGEST_OVERLAP, find_overlaps
from riemhuman.registration.scans import as_scan

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
    template, on_hands = registration.model.template, registration._parts.on_hands
    whole = np.ones(template.n_vertices, dtype=bool)
    poses = [k for k in range(100) if bodies.pose_names[bodies.pose[k]] == "hands_on_head"]
    shares = [find_overlaps(template, bodies[k], whole).mean() for k in poses]
    assert max(shares) > LARGEST_OVERLAP
    for k in poses:
        assert not find_overlaps(template, bodies[k], ~on_hands).any()


@pytest.mark.slow
def test_hands_on_hips(registration, bodies):
    scan = scan_of(bodies, HANDS_ON_HIPS)
    result = registration.solve(scan.points)
    assert result.trusted, result.message
    assert error(result, scan) < 0.02


def test_a_hand_on_the_ear(registration, bodies, monkeypatch):
    """No start pose has one hand on the ear and the other arm hanging: arms are tried alone."""
    search, names = registration._fitter, ("a", "down", "head", "elbows")
    monkeypatch.setattr(search, "poses", {name: search.poses[name] for name in names})
    scan = scan_of(bodies, HAND_ON_EAR)
    result = registration.solve(scan.points)
    assert result.trusted, result.message
    assert error(result, scan) < 0.01
    assert np.linalg.norm(result.points - scan.body, axis=1).max() < 0.05


@pytest.mark.slow
def test_a_wrong_arm_is_not_trusted(registration, bodies, monkeypatch):
    """From one start pose alone, an arm is not found, and missed."""
    search = registration._fitter
    monkeypatch.setattr(search, "arms", [])
    monkeypatch.setattr(search, "poses", {"hips": search.poses["hips"]})
    scan = scan_of(bodies, HAND_ON_EAR)
    prepared = registration._prepare(as_scan(scan.points), {})
    result = registration._solve(registration._fitter, prepared)
    assert error(result, scan) > FAR
    assert not result.trusted
    assert "its right elbow matches hardly anything in the scan" in result.message


@pytest.mark.slow
def test_landmarks_bring_the_arm_where_it_is(registration, bodies, monkeypatch):
    monkeypatch.setattr(registration._fitter, "arms", [])
    scan = scan_of(bodies, HAND_ON_EAR)
    joints = registration.model.joint_regressor @ scan.body
    names = list(registration.model.joint_names)
    known = {name: joints[names.index(name)] for name in ("left_elbow", "left_wrist")}
    result = registration.solve(scan.points, landmarks=known)
    assert result.trusted, result.message
    assert error(result, scan) < 0.02
