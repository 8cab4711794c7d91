"""Bodies follow the positions of joints, whatever the axes in which files rotate them."""

from dataclasses import replace

import numpy as np
import pytest
from recorded_people import joints_in_space, recording_of, with_axes
from scipy.spatial.transform import Rotation

from riemhuman.datasets import load_open_motions, retarget
from riemhuman.kernels.rotations import log


@pytest.fixture(scope="module")
def frames(recording):
    """Frames of a recording whose rest pose, scrambled by other axes, tells nothing of the head."""
    return retarget(replace(recording, has_rest_pose=False), frames_per_second=5)[:]


@pytest.mark.parametrize("share", [0.1, 1.0])
def test_axes_of_joints_do_not_matter(recording, frames, share):
    rng = np.random.default_rng(5)
    axes = Rotation.random(len(recording.parents), random_state=rng).as_matrix()
    axes[rng.random(len(axes)) > share] = np.eye(3)
    other = with_axes(recording, axes)
    np.testing.assert_allclose(other.positions, recording.positions, atol=1e-9)
    np.testing.assert_allclose(retarget(other, frames_per_second=5)[:], frames, atol=1e-6)


@pytest.mark.parametrize(
    ("recorded", "joint", "between", "rest"),
    [
        ("Head", "head", ["neck"], 0.1),
        ("LeftHand", "left_wrist", [], 0.1),
        ("RightToeBase", "right_toes", [], 1.0),  # whose leg keeps them above the floor
    ],
)
def test_parts_that_are_held_bent_throughout_stay_bent(recording, recorded, joint, between, rest):
    # Nothing but the rest pose, which both share, tells their axes.
    turn = Rotation.from_euler("x", 20, degrees=True).as_matrix()
    rotations = recording.rotations.copy()
    rotations[:, recording.joint_names.index(recorded)] @= turn
    motions = [
        retarget(one, frames_per_second=5)
        for one in (recording, replace(recording, rotations=rotations))
    ]
    model = motions[0].model
    (before, _), (after, _) = in_space(model, motions[0].betas, motions)
    moved = np.degrees(np.linalg.norm(log(before, after), axis=-1))
    numbers = [model.joint_names.index(name) for name in (joint, *between)]
    np.testing.assert_allclose(moved[:, numbers[0]], 20.0, atol=0.1)
    assert np.delete(moved, numbers, axis=1).max() < rest


def in_space(model, betas, motions):
    """Return the rotations of joints in space, and their places, of two motions."""
    return [joints_in_space(model, betas, motion.pose_vectors) for motion in motions]


def performed(model, subject, sequence):
    """Return an open motion, and what a body makes of it in other axes of joints."""
    motion = load_open_motions("coarse", subject, sequence, 15)[0]
    recording = recording_of(model, motion.betas, motion.pose_vectors, motion.translations, 15.0)
    axes = Rotation.random(len(recording.parents), random_state=1).as_matrix()
    return motion, retarget(with_axes(recording, axes), model, betas=motion.betas)


@pytest.mark.parametrize("sequence", ["punching", "hips"])
def test_parts_are_rotated_as_those_of_the_person(model, sequence):
    motion, found = performed(model, "lean runner", sequence)
    (made, _), (true, _) = in_space(model, motion.betas, (found, motion))
    angles = np.degrees(np.linalg.norm(log(made, true), axis=-1)).mean(axis=0)
    by_name = dict(zip(model.joint_names, angles, strict=True))
    limbs = ("collar", "shoulder", "elbow", "hip", "knee")
    for part in (
        "pelvis",
        "chest",
        "head",
        *(f"{s}_{p}" for s in ("left", "right") for p in limbs),
    ):
        assert by_name[part] < 8.0, part
    errors = found.errors
    lines = errors.directions[:, errors.bones.index(("left_hip", "right_hip"))]
    assert lines.mean() < 1.0
    assert errors.rotations[:, :3].mean(axis=0).max() < 1.0
    assert errors.parts[:3] == ("pelvis", "chest", "head")


@pytest.mark.parametrize(
    ("subject", "sequence", "limit"),
    # Soles of feet in the air are nowhere level, and heels of the last are always raised.
    [
        ("lean runner", "jumping_jacks", 8.0),
        ("older heavy man", "one_leg_jump", 8.0),
        ("lean runner", "jiggle_on_toes", 17.0),
    ],
)
def test_feet_in_the_air_and_raised_heels(model, subject, sequence, limit):
    motion, found = performed(model, subject, sequence)
    made, true = in_space(model, motion.betas, (found, motion))
    for side in ("left", "right"):
        feet = [model.joint_names.index(f"{side}_{part}") for part in ("ankle", "toes")]
        angles = np.degrees(np.linalg.norm(log(made[0][:, feet], true[0][:, feet]), axis=-1))
        assert angles.mean(axis=0).max() < limit
        heels = [places[:, feet[0]] - places[:, feet[1]] for _, places in (made, true)]
        np.testing.assert_allclose(*heels, atol=0.015)


@pytest.mark.parametrize(
    ("bent", "degrees"),
    [(["pelvis"], -90.0), (["pelvis"], 90.0), (["left_knee", "right_knee"], 100.0)],
)
@pytest.mark.filterwarnings("error")
def test_feet_of_people_who_lie_and_kneel_are_not_level(model, bent, degrees):
    poses = np.zeros((1, model.n_joints, 3))
    poses[:, [model.joint_names.index(name) for name in bent], 0] = np.radians(degrees)
    places = np.array([[0.0, -model(pose=poses[0])[:, 1].min(), 0.0]])
    recording = recording_of(model, np.zeros(model.n_betas), poses, places)
    motion = retarget(replace(recording, has_rest_pose=False), model, up="y")
    bodies = motion[0], model(None, poses[0], places[0])
    np.testing.assert_allclose(*bodies, atol=0.03)


def test_a_single_frame_and_straight_limbs(model):
    poses, translations = np.zeros((1, model.n_joints, 3)), np.zeros((1, 3))
    recording = recording_of(model, np.zeros(model.n_betas), poses, translations)
    body = retarget(recording, model)[0]
    apart = body - model()
    assert np.linalg.norm(apart - apart.mean(axis=0), axis=1).max() < 0.01


def test_feet_tell_of_swapped_sides(recording):
    names = [name.replace("Left", "Port") for name in recording.joint_names]
    names = [name.replace("Right", "Left").replace("Port", "Right") for name in names]
    motion = retarget(replace(recording, joint_names=tuple(names)), frames_per_second=5)
    with pytest.warns(UserWarning, match="feet point backward: left and right.*pass joints="):
        motion.errors  # noqa: B018


def test_files_that_place_joints_without_rotating_any(recording):
    n_joints = len(recording.parents)
    translations = recording.positions.copy()
    rotations = np.tile(np.eye(3), (len(recording), n_joints, 1, 1))
    for joint in range(1, n_joints):
        parent = recording.parents[joint]
        translations[:, joint] = recording.positions[:, joint] - recording.positions[:, parent]
    placed = replace(recording, rotations=rotations, translations=translations)
    np.testing.assert_allclose(placed.positions, recording.positions, atol=1e-9)
    errors = retarget(placed, frames_per_second=5).errors
    assert errors.directions.mean(axis=0).max() < 4.0
    assert errors.rotations.mean(axis=0).max() < 4.0
