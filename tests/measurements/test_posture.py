"""Posture: angles follow known rotations of bodies and of their joints."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from riemhuman.datasets import joint_rotations, load_open_model, pose_vectors
from riemhuman.errors import ArgumentError
from riemhuman.measurements import Measurements, MeasurementSet, posture_angles

MODEL = load_open_model("coarse")
STANDING = {"shoulder": ("xz", 10, -58), "elbow": ("y", -18)}


@pytest.fixture(scope="module")
def measurements():
    return Measurements(MODEL)


def posed(**angles):
    rotations = joint_rotations({**STANDING, **angles}, MODEL)
    return MODEL(np.zeros(MODEL.n_betas), pose_vectors(rotations, MODEL))


def turned(points, axis, degrees):
    return points @ Rotation.from_euler(axis, degrees, degrees=True).as_matrix().T


def test_leaning_bodies(measurements):
    upright = posture_angles(measurements, posed())
    forward = posture_angles(measurements, turned(posed(), "x", 12.0))
    assert forward["trunk lean forward"] - upright["trunk lean forward"] == pytest.approx(12.0)
    # About z, the left side rises.
    sideways = posture_angles(measurements, turned(posed(), "z", 6.0))
    for name in ("head tilt", "shoulder tilt", "pelvis tilt"):
        assert sideways[name] - upright[name] == pytest.approx(6.0, abs=0.2)
    assert sideways["trunk lean to the left"] == pytest.approx(-6.0, abs=0.5)
    for name, angle in upright.items():
        if "knee" in name or "elbow" in name:
            assert forward[name] == pytest.approx(angle)


def test_no_heading_changes_an_angle(measurements):
    points = posed()
    straight = posture_angles(measurements, points)
    for degrees in (37.0, 170.0, -95.0):
        found = posture_angles(measurements, turned(points, "y", degrees) + [3.0, 1.0, -2.0])
        assert found == pytest.approx(straight)
    # z up, as in many scanners.
    lying = points[:, [2, 0, 1]]
    assert posture_angles(measurements, lying, up="z") == pytest.approx(straight)


def test_bent_joints(measurements):
    straight, bent = (
        posture_angles(measurements, posed()),
        posture_angles(measurements, posed(left_knee=("x", 50), right_elbow=("y", 70))),
    )
    assert bent["left knee bent"] - straight["left knee bent"] == pytest.approx(50.0, abs=9.0)
    assert bent["right knee bent"] == pytest.approx(straight["right knee bent"])
    assert bent["right elbow bent"] - straight["right elbow bent"] > 30.0
    raised = posture_angles(measurements, posed(left_shoulder=("z", -10)))
    assert raised["left arm from the trunk"] > straight["left arm from the trunk"] + 30.0


def test_feet_and_shoulders_that_turn(measurements):
    straight = posture_angles(measurements, posed())
    for side, opposite, sign in (("left", "right", 1.0), ("right", "left", -1.0)):
        found = posture_angles(measurements, posed(**{f"{side}_ankle": ("y", 20.0 * sign)}))
        name, other = f"{side} foot turned out", f"{opposite} foot turned out"
        assert found[name] - straight[name] == pytest.approx(20.0, abs=5.0)
        assert found[other] == pytest.approx(straight[other])
    points = posed()
    above = points[:, 1] > 0.5 * (points[:, 1].min() + points[:, 1].max()) + 0.2
    # About y, the left shoulder goes back.
    points[above] = turned(points[above], "y", 25.0)
    found = posture_angles(measurements, points)["shoulders turned to the left"]
    assert found - straight["shoulders turned to the left"] == pytest.approx(25.0, abs=2.0)


def test_landmarks_that_are_not_trusted_give_no_angle(measurements):
    points = posed()
    trusted = points[:, 1] > points[:, 1].min() + 0.3  # without feet
    found = posture_angles(measurements, points, trusted_vertices=trusted)
    unknown = {name for name, angle in found.items() if np.isnan(angle)}
    assert unknown == {
        f"{side} {name}" for side in ("left", "right") for name in ("knee bent", "foot turned out")
    }
    both = posture_angles(measurements, np.stack([points, points]))
    assert all(angle.shape == (2,) for angle in both.values())


def test_sets_need_the_landmarks(measurements):
    bare = Measurements(MeasurementSet(MODEL, measurements.definitions.measurements[-3:-2]))
    with pytest.raises(ArgumentError, match="it lacks cervicale and 24 more"):
        posture_angles(bare, posed())
