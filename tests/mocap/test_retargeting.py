"""Recordings performed by bodies: real ones, and skeletons of other makers with a known truth.

recordings/cmu_01_01.bvh is of the CMU Graphics Lab Motion Capture Database, see its README.
"""

from dataclasses import replace

import numpy as np
import pytest
from recorded_people import RECORDING, lying, recording_of, scaled, turned, with_axes
from scipy.spatial.transform import Rotation

from riemhuman.datasets import load_bvh, load_open_motions, retarget
from riemhuman.errors import ArgumentError, ArgumentTypeError


@pytest.fixture(scope="module")
def truth(model):
    """A person who raises the knees and one who shakes the arms, one after the other."""
    motions = load_open_motions("coarse", "lean runner", ["knees", "shake_arms"], 30)
    betas = motions[0].betas
    poses = np.concatenate([motion.pose_vectors[:60:2] for motion in motions])
    translations = np.concatenate([motion.translations[:60:2] for motion in motions])
    return betas, poses, translations


def recorded_elsewhere(model, truth):
    """Return the recording of a motion whose joints have other axes, in another unit."""
    recording = recording_of(model, *truth)
    axes = Rotation.random(len(recording.parents), random_state=3).as_matrix()
    return scaled(with_axes(recording, axes), 1.0 / 0.0254)


def test_bones_and_surfaces_are_those_of_the_person(model, truth):
    motion = retarget(recorded_elsewhere(model, truth), model, betas=truth[0])
    errors = motion.errors
    assert errors.directions.max() < 5.0
    assert errors.positions.mean() < 0.015
    assert np.percentile(errors.positions, 95) < 0.03
    # Errors are those of the joints themselves.
    numbers = [model.joint_names.index(name) for name in errors.joints]
    found, expected = (
        model.joints(*person)[:, numbers]
        for person in ((motion.betas, motion.pose_vectors, motion.translations), truth)
    )
    found, expected = (
        joints - joints[:, [0, 3]].mean(axis=1)[:, None] for joints in (found, expected)
    )
    apart = np.linalg.norm(found - expected, axis=-1)
    np.testing.assert_allclose(errors.positions, apart, atol=1e-4)
    a, b = (joints[:, 1] - joints[:, 0] for joints in (found, expected))
    cosines = np.sum(a * b, axis=1) / np.linalg.norm(a, axis=1) / np.linalg.norm(b, axis=1)
    np.testing.assert_allclose(errors.directions[:, 0], np.degrees(np.arccos(cosines)), atol=0.01)
    # Limbs are not rotated about themselves: surfaces are those of the person.
    apart = motion[:] - model(*truth)
    apart -= apart.mean(axis=1, keepdims=True)
    distances = np.linalg.norm(apart, axis=-1)
    assert distances.mean() < 0.02
    assert np.percentile(distances, 99) < 0.06


def test_the_person_is_found(model, truth):
    recording = recorded_elsewhere(model, truth)
    errors = retarget(recording, model, betas="recorded").errors
    assert errors.directions.max() < 5.0
    assert errors.positions.mean() < 0.02
    average = retarget(recording, model).errors
    assert errors.positions.mean() < average.positions.mean()


@pytest.fixture(scope="module")
def jump():
    """Two seconds of a real recording, performed by the open model."""
    return retarget(load_bvh(RECORDING), betas="recorded")


@pytest.fixture(scope="module")
def slow_jump(jump):
    return retarget(jump.recording, betas=jump.betas, frames_per_second=10)


def test_a_real_recording(jump):
    assert (len(jump), jump.sequence, jump.frames_per_second) == (
        60,
        "cmu_01_01",
        pytest.approx(30, rel=1e-4),
    )
    assert jump.errors.directions.max() < 5.0
    assert jump.errors.positions.max() < 0.03
    lowest = jump[:][..., 1].min(axis=1)
    assert -0.006 < lowest.min() < 0.005
    assert 1.4 < jump[0][:, 1].max() < 2.1


def test_feet_stay_in_place(jump):
    for person in (jump, jump.performed_by(np.linspace(-1.0, 1.0, jump.model.n_betas))):
        names = list(person.model.joint_names)
        joints = person.model.joints(person.betas, person.pose_vectors, person.translations)
        recorded = dict(zip(jump.recording.joint_names, range(38), strict=True))
        for side in ("left", "right"):
            source = jump.recording.positions[:, recorded[f"{side.title()}ToeBase"]]
            speeds = np.linalg.norm(np.gradient(source, axis=0), axis=1) * 30.0 * 0.056
            still = speeds < 0.05
            assert still.sum() > 10
            foot = joints[:, names.index(f"{side}_toes")]
            moved = np.linalg.norm(np.diff(foot, axis=0), axis=1) * 30.0
            assert np.percentile(moved[still[1:] & still[:-1]], 90) < 0.1
        assert person[:][..., 1].min() > -0.006
        assert person.errors.directions.max() < 5.0


@pytest.mark.parametrize(("tilt", "top"), [(90, 0.4), (-90, 0.6), (180, 1.8)])
def test_people_lie_and_stand_on_their_hands_on_the_floor(jump, tilt, top):
    still = [np.tile(array[:1], (5, *[1] * (array.ndim - 1)))
             for array in (jump.recording.rotations, jump.recording.translations)]  # fmt: skip
    still = replace(jump.recording, rotations=still[0], translations=still[1])
    motion = retarget(lying(still, tilt, 0), betas=jump.betas)
    assert -0.04 < motion[:][..., 1].min() < 0.02
    assert 0.5 * top < motion[:][..., 1].max() < 1.1 * top


@pytest.mark.parametrize(
    ("axis", "vector"),
    [("x", [0, 0, -90]), ("-y", [180, 0, 0]), ("z", [90, 0, 0])],
)
def test_any_axis_may_point_up(slow_jump, axis, vector):
    other = turned(slow_jump.recording, Rotation.from_rotvec(vector, degrees=True))
    for up in (axis, None):
        motion = retarget(other, betas=slow_jump.betas, up=up)
        heights = motion[::5][..., 1]
        np.testing.assert_allclose(heights, slow_jump[::5][..., 1], atol=2e-3)


def test_recordings_are_thinned(jump, slow_jump):
    assert (len(slow_jump), slow_jump.frames_per_second) == (20, 10)
    np.testing.assert_allclose(slow_jump.recording.positions, jump.recording.positions[::3])


def test_wrong_tables_of_names(jump):
    for hip, message in (
        ("Bone18", r"joints\['left_hip'\] must be one of .*found 'Bone18'"),
        ("LeftFoot", "left_knee must be below left_hip; found 'LeftLeg'"),
    ):
        leg = {"left_hip": hip, "left_knee": "LeftLeg", "left_ankle": "LeftFoot"}
        with pytest.raises(ArgumentError, match=message):
            retarget(jump.recording, joints=leg | {"left_toes": "LeftToeBase"})


def test_wrong_arguments(jump):
    with pytest.raises(ArgumentTypeError, match="recording must be a SkeletonMotion; found str"):
        retarget("jump.bvh")
    with pytest.raises(ArgumentError, match="betas"):
        retarget(jump.recording, betas=np.zeros(3))
    with pytest.raises(ArgumentError, match="up must be one of 'x', 'y', .*; found 'w'"):
        retarget(jump.recording, up="w")
