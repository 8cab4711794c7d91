"""Motions from arrays in SMPL's joint order: every shape, one person, and the direction up."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from riemhuman.datasets import motion_from_arrays
from riemhuman.errors import ArgumentError
from riemhuman.surfaces.procrustes import make_upright

N_FRAMES = 12


@pytest.fixture(scope="module")
def poses():
    vectors = 0.2 * np.random.default_rng(1).normal(size=(N_FRAMES, 24, 3))
    vectors[:, 0] = 0.1
    return vectors


@pytest.fixture(scope="module")
def translations():
    return np.random.default_rng(2).normal(size=(N_FRAMES, 3))


def test_vectors_rows_and_matrices(smpl, poses, translations):
    matrices = Rotation.from_rotvec(poses.reshape(-1, 3)).as_matrix().reshape(N_FRAMES, 24, 3, 3)
    expected = smpl(np.zeros(10), poses, translations)
    for given in (poses, poses.reshape(N_FRAMES, -1), matrices, matrices.astype(np.float32)):
        motion = motion_from_arrays(given, translations, 30.0, up="y", model=smpl, name="a")
        atol = 1e-6 if given.dtype == np.float32 else 1e-12
        np.testing.assert_allclose(motion[:], expected, atol=atol)
    assert (motion.frames_per_second, motion.sequence) == (30.0, "a")


@pytest.mark.parametrize("up", ["x", "y", "z", "-x", "-y", "-z"])
def test_bodies_stand_upright(smpl, poses, translations, up):
    given = motion_from_arrays(poses, translations, 30.0, up=up, model=smpl)
    expected = make_upright(smpl(np.zeros(10), poses, translations), up=up)
    np.testing.assert_allclose(given[:], expected, atol=1e-12)


def person_at_home(n_frames=40):
    """Return poses and places of a person who sways on the spot, y up, feet near height 0."""
    rng = np.random.default_rng(5)
    poses = 0.05 * rng.normal(size=(1, 24, 3)) + 0.003 * rng.normal(size=(n_frames, 24, 3))
    poses[:, 0] = 0.0
    places = np.tile([0.4, 1.15, -3.0], (n_frames, 1)) + 0.01 * rng.normal(size=(n_frames, 3))
    return poses, places


def turned(poses, places, rotation):
    """Return the same person in other axes."""
    poses = poses.copy()
    poses[:, 0] = (rotation * Rotation.from_rotvec(poses[:, 0])).as_rotvec()
    return poses, rotation.apply(places)


@pytest.mark.parametrize(("up", "n_frames"), [("y", 40), ("z", 40), ("-y", 40), ("-y", 1)])
@pytest.mark.filterwarnings("ignore:recording. z was taken:UserWarning")
def test_up_is_where_people_stand(smpl, up, n_frames):
    rotation = Rotation.from_matrix(make_upright(np.eye(3), up=up))
    arrays = turned(*person_at_home(n_frames), rotation)
    guessed = motion_from_arrays(*arrays, 30.0, model=smpl)
    told = motion_from_arrays(*arrays, 30.0, up=up, model=smpl)
    np.testing.assert_array_equal(guessed.pose_vectors, told.pose_vectors)


@pytest.mark.parametrize("axis", ["x", "z"])
@pytest.mark.filterwarnings("ignore:sleep:UserWarning")
def test_a_person_who_lies_on_the_floor_stays_there(smpl, axis):
    poses, places = person_at_home()
    lying = turned(poses, places, Rotation.from_euler(axis, 90.0, degrees=True))
    lying[1][:, 1] = 0.32  # the pelvis of the rest pose is 0.22 below
    motion = motion_from_arrays(*lying, 30.0, model=smpl, name="sleep")
    told = motion_from_arrays(*lying, 30.0, up="y", model=smpl)
    np.testing.assert_array_equal(motion.pose_vectors, told.pose_vectors)


def test_one_person(smpl, poses, translations):
    rng = np.random.default_rng(3)
    person = rng.normal(size=10)
    differing = person + 0.3 * rng.normal(size=(N_FRAMES, 10))
    motion = motion_from_arrays(poses, translations, 30.0, up="y", betas=person, model=smpl)
    np.testing.assert_array_equal(motion.betas, person)
    with pytest.warns(UserWarning, match=r"dance: betas differ between frames.*their mean"):
        motion = motion_from_arrays(
            poses, translations, 30.0, up="y", betas=differing, model=smpl, name="dance"
        )
    np.testing.assert_allclose(motion.betas, differing.mean(axis=0))
    rounded = np.tile(person, (N_FRAMES, 1)).astype(np.float32)
    motion = motion_from_arrays(poses, translations, 30.0, up="y", betas=rounded, model=smpl)
    np.testing.assert_allclose(motion.betas, person, atol=1e-6)
    other = motion.performed_by(np.zeros(10))
    np.testing.assert_array_equal(other.pose_vectors, motion.pose_vectors)
    assert np.abs(other[0] - motion[0]).max() > 1e-3


def test_the_open_model_performs_them():
    poses, translations = np.zeros((4, 22, 3)), np.zeros((4, 3))
    poses[:, 16, 2] = -1.2  # the left arm hangs down from a T-pose
    with pytest.warns(UserWarning, match="betas belong to SMPL's models"):
        motion = motion_from_arrays(poses, translations, 30.0, up="y", betas=np.ones(10))
    # Its arms are found where the left one hangs and the right one is held out.
    extent = motion[0][:, 0]
    assert -extent.min() > 1.5 * extent.max()


@pytest.mark.everyday
@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"poses": np.zeros((N_FRAMES, 23, 3))}, "found 23: put the rotation of the root first"),
        ({"poses": np.zeros((N_FRAMES, 70))}, r"\(n_frames, 3 J\).*found \(12, 70\)"),
        ({"poses": np.zeros((N_FRAMES, 24, 3, 3))}, r"poses\[0, 0\] is not one, the first of 288"),
        ({"poses": np.zeros((0, 24, 3))}, "at least one frame"),
        ({"betas": np.zeros((11, 10))}, r"\(12, B\), one row per frame; found \(11, 10\)"),
    ],
)
def test_wrong_arguments(smpl, changes, message):
    right = {
        "poses": np.zeros((N_FRAMES, 24, 3)),
        "translations": np.zeros((N_FRAMES, 3)),
        "frames_per_second": 30.0,
        "up": "y",
        "model": smpl,
    }
    with pytest.raises(ArgumentError, match=message):
        motion_from_arrays(**(right | changes))
