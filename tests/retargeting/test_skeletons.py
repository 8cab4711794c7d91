"""Frames of the body's parts, as positions of joints show them."""

from pathlib import Path

import numpy as np
from marker_files import write_trc
from recorded_people import RECORDING
from scipy.spatial.transform import Rotation

from riemhuman.datasets import load_amc, load_open_motions, load_recording
from riemhuman.retargeting._recorded_skeletons import read_skeleton
from riemhuman.retargeting.joint_axes import mean_axes
from riemhuman.retargeting.skeletons import body_frame, pelvis_frame

PARTS = {"hip": "HJC", "knee": "KJC", "ankle": "AJC", "shoulder": "SJC", "elbow": "EJC"}
PARTS |= {"wrist": "WJC", "toes": "TOE"}


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


def test_a_spine_that_bends_is_not_all_the_pelvis(tmp_path):
    (truth,) = load_open_motions("coarse", "lean runner", "shake_shoulders", 20)
    poses, translations = truth._parameters(np.arange(len(truth)))
    positions = truth.model.joints(truth.betas, poses) + translations[:, None]
    centres = {
        f"{side[0].upper()}{centre}": positions[:, truth.model.joint_names.index(f"{side}_{part}")]
        for side in ("left", "right")
        for part, centre in PARTS.items()
    }
    motion = load_recording(
        write_trc(tmp_path / "bend.trc", centres), truth.model, betas=truth.betas
    )
    made, true = (Rotation.from_rotvec(vectors[:, 0]) for vectors in (motion.pose_vectors, poses))
    angles = np.degrees((true.inv() * made).magnitude())
    assert angles.mean() < 6.0
    assert angles.max() < 13.0
