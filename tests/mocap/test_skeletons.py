"""Frames of the body's parts, as positions of joints show them."""

from pathlib import Path

import numpy as np
import pytest
from marker_files import centres, write_trc
from recorded_people import RECORDING, joints_in_space
from scipy.spatial.transform import Rotation

from riemhuman.datasets import load_amc, load_open_motions, load_recording
from riemhuman.mocap._joint_axes import mean_axes
from riemhuman.mocap._recorded_skeletons import read_skeleton
from riemhuman.mocap._skeletons import body_frame, pelvis_frame


def deviation(rotations, seen):
    """Return how much a recorded rotation differs from one that positions show, degrees."""
    axes = mean_axes(rotations, seen, np.ones(len(seen)))
    apart = np.swapaxes(rotations @ axes, -1, -2) @ seen
    return np.degrees(np.sqrt(np.mean(Rotation.from_matrix(apart).magnitude() ** 2)))


def test_the_pelvis_leans_less_than_the_trunk_in_a_real_jump():
    # recordings/cmu_01_01.amc is of the CMU Graphics Lab Motion Capture Database, see its README.
    folder = Path(RECORDING).parent
    source = read_skeleton(load_amc(folder / "cmu_01_01.amc", folder / "cmu_01.asf"), None, "y")
    rotations = source.rotation("pelvis")
    line = deviation(rotations, body_frame(source.positions, source.joints, "hip"))
    assert deviation(rotations, pelvis_frame(source.positions, source.joints)) < 0.5 * line


def performed_markers(model, betas, poses, translations, path):
    """Return the motion of a person who performs the centres of his own joints."""
    positions = np.moveaxis(model.joints(betas, poses) + translations[:, None], 1, 0)
    joints = dict(zip(model.joint_names, positions, strict=True))
    return load_recording(write_trc(path, centres(joints)), model, betas=betas)


def chest_angles(model, made, true):
    """Return the angles between the rotations of two chests in space, degrees."""
    number = model.joint_names.index("chest")
    made, true = (
        Rotation.from_matrix(joints_in_space(model, None, vectors)[0][:, number])
        for vectors in (made, true)
    )
    return np.degrees((true.inv() * made).magnitude())


def test_a_spine_that_bends_is_not_all_the_pelvis(tmp_path):
    (truth,) = load_open_motions("coarse", "lean runner", "shake_shoulders", 20)
    poses, translations = truth.pose_vectors, truth.translations
    motion = performed_markers(truth.model, truth.betas, poses, translations, tmp_path / "bend.trc")
    made, true = (Rotation.from_rotvec(vectors[:, 0]) for vectors in (motion.pose_vectors, poses))
    angles = np.degrees((true.inv() * made).magnitude())
    assert angles.mean() < 6.0
    assert angles.max() < 13.0


@pytest.mark.parametrize("side", ["left", "right"])
def test_one_shrugged_shoulder_does_not_tilt_the_chest(side, tmp_path):
    (standing,) = load_open_motions("coarse", "average man", "chicken_wings", 20)
    model, n_frames = standing.model, 40
    poses = np.tile(standing.pose_vectors[:1], (n_frames, 1, 1))
    translations = np.tile(standing.translations[:1], (n_frames, 1))
    angles = np.radians(25.0) * np.clip(np.sin(np.linspace(0.0, 12.0, n_frames)), 0.0, 1.0)
    collar = model.joint_names.index(f"{side}_collar")
    axis = np.array([0.0, 0.0, 1.0 if side == "left" else -1.0])
    lifted = Rotation.from_rotvec(angles[:, None] * axis)
    poses[:, collar] = (Rotation.from_rotvec(poses[:, collar]) * lifted).as_rotvec()
    motion = performed_markers(model, standing.betas, poses, translations, tmp_path / "shrug.trc")
    assert chest_angles(model, motion.pose_vectors, poses).max() < 7.0
