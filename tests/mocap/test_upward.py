"""The axis that points up: people lie, crawl and stand on their hands as they were recorded."""

import warnings

import numpy as np
import pytest
from recorded_people import lying, turned
from scipy.spatial.transform import Rotation

from riemhuman.bodies.skinning import SMPL_JOINTS
from riemhuman.datasets import load_amass, load_open_motions, retarget


def heights(recording, up=None):
    motion = retarget(recording, up=up, frames_per_second=3)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)  # the direction up is in doubt
        return motion[:][..., 1]


@pytest.mark.parametrize(("tilt", "heading"), [(90, 0), (90, 180), (-90, 270)])
def test_people_lie_on_the_floor(recording, tilt, heading):
    laid = lying(recording, tilt, heading)
    found = heights(laid)
    np.testing.assert_allclose(found, heights(laid, "y"), atol=1e-9)
    assert np.ptp(found, axis=1).mean() < 0.7


def test_people_lie_on_beds(recording):
    laid = lying(recording, -90, 30, 0.5 / 0.0546)
    np.testing.assert_allclose(heights(laid), heights(laid, "y"), atol=1e-9)


def test_doubt_is_said(recording):
    laid = lying(recording, 90, 0, 0.4 / 0.0546)
    motion = retarget(laid, frames_per_second=3)
    said = r"y was taken to point up, .* Pass up='y' or up='z'"
    with pytest.warns(UserWarning, match=said) as warned:
        motion.pose_vectors  # noqa: B018
    assert {warning.filename for warning in warned} == {__file__}
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        retarget(laid, up="y", frames_per_second=3).pose_vectors  # noqa: B018


def test_the_posture_does_not_depend_on_how_the_whole_recording_is_turned(recording):
    standing = retarget(recording, frames_per_second=3)
    cartwheel = turned(recording, Rotation.from_euler("z", 180, degrees=True))
    upside_down = retarget(cartwheel, frames_per_second=3, up="y")
    # The pelvis is turned; all that hangs from it is not, but for feet on the floor.
    arms = [standing.model.joint_names.index(f"left_{part}") for part in ("elbow", "wrist")]
    np.testing.assert_allclose(
        upside_down.pose_vectors[:, arms], standing.pose_vectors[:, arms], atol=0.02
    )


def write_amass(path, up, n_frames=32):
    """Write a walk on the spot in the layout of AMASS, with y or z up."""
    motion = load_open_motions("coarse", "lean runner", "knees", 30)[0]
    names = list(motion.model.joint_names)
    poses = np.zeros((n_frames, 52, 3))
    for number, name in enumerate(SMPL_JOINTS):
        if name in names and name.endswith(("hip", "knee")):
            poses[:, number] = motion.pose_vectors[:n_frames, names.index(name)]
    trans = np.zeros((n_frames, 3))
    trans[:, 1] = 1.15
    trans[:, 2] = np.linspace(0.0, 0.6, n_frames)
    if up == "z":
        to_z = Rotation.from_euler("x", 90, degrees=True)
        poses[:, 0] = to_z.as_rotvec()
        root = np.array([0.0, -0.22, 0.03])
        trans = to_z.apply(trans + root) - root
    np.savez(
        path,
        poses=poses.reshape(n_frames, 156),
        trans=trans,
        betas=np.zeros(16),
        gender="neutral",
        mocap_framerate=30.0,
    )
    return path


@pytest.mark.parametrize("up", ["y", "z"])
def test_files_in_the_layout_of_amass_are_upright(tmp_path, up):
    path = write_amass(tmp_path / "a_poses.npz", up)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)  # betas are ignored
        motions = [load_amass(path)[0], load_amass(path, up=up)[0]]
        found, told = (np.ptp(motion[::20][..., 1], axis=1) for motion in motions)
    np.testing.assert_allclose(found, told)
    assert told.min() > 1.4
