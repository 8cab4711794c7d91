"""Errors of performances, and when they are warned of, in recordings of all kinds."""

import warnings
from pathlib import Path

import numpy as np
import pytest
from marker_files import write_c3d, write_trc
from recorded_people import RECORDING

from riemhuman.datasets import (
    load_open_motions,
    load_recording,
    motion_from_arrays,
)

FOLDER = Path(RECORDING).parent
LEG = ("hip", "knee", "ankle", "toes")
LINES = (("left_hip", "right_hip"), ("left_shoulder", "right_shoulder"))
PARTS = {"hip": "HJC", "knee": "KJC", "ankle": "AJC", "toes": "TOE"}
PARTS |= {"shoulder": "SJC", "elbow": "EJC", "wrist": "WJC"}


def swapped_legs(left, right):
    """Return names of joints that take one leg for the other."""
    sides = {"left": right, "right": left}
    return {
        f"{side}_{part}": name
        for side, names in sides.items()
        for part, name in zip(LEG, names, strict=True)
    }


def centres():
    """Return centres of the joints of a person as markers, with a head that has axes."""
    (motion,) = load_open_motions("coarse", "average man", "knees", 20)
    poses, translations = motion._parameters(np.arange(len(motion)))
    positions = motion.model.joints(motion.betas, poses) + translations[:, None]
    joints = dict(zip(motion.model.joint_names, np.moveaxis(positions, 1, 0), strict=True))
    markers = {
        f"{side[0].upper()}{centre}": joints[f"{side}_{part}"]
        for side in ("left", "right")
        for part, centre in PARTS.items()
    }
    return markers | {"Head": joints["head"]}


def of_skeleton(ending, names):
    def perform(wrong, folder):
        joints = swapped_legs(*names) if wrong else None
        path = FOLDER / f"cmu_01_01{ending}"
        return load_recording(path, joints=joints, frames_per_second=5)

    return perform


def of_markers(write, ending):
    def perform(wrong, folder):
        left, right = ([f"{side}{PARTS[part]}" for part in LEG] for side in "LR")
        path = write(folder / f"knees{ending}", centres())
        return load_recording(path, joints=swapped_legs(left, right) if wrong else None)

    return perform


def of_arrays(wrong, folder):
    poses = np.zeros((4, 24, 3))
    if wrong:
        # The spine of nobody turns by half a turn.
        poses[:, 3, 1] = np.pi
    return motion_from_arrays(poses, np.zeros((4, 3)), 30.0, up="y")


KINDS = {
    "bvh": of_skeleton(
        ".bvh",
        [
            [f"{side}{part}" for part in ("UpLeg", "Leg", "Foot", "ToeBase")]
            for side in ("Left", "Right")
        ],
    ),
    "amc": of_skeleton(
        ".amc", [[f"{side}{part}" for part in ("femur", "tibia", "foot", "toes")] for side in "lr"]
    ),
    "trc": of_markers(write_trc, ".trc"),
    "c3d": of_markers(write_c3d, ".c3d"),
    "arrays": of_arrays,
}


@pytest.mark.parametrize("kind", KINDS)
def test_errors_tell_of_lines_and_parts(kind, tmp_path):
    with warnings.catch_warnings():
        warnings.filterwarnings("error", "(?s).*the body differs from the recording")
        errors = KINDS[kind](False, tmp_path).errors
    assert set(LINES) <= set(errors.bones)
    assert errors.parts == ("pelvis", "chest", "head")
    assert errors.directions.mean(axis=0).max() < 4.0
    assert errors.rotations.mean(axis=0).max() < 15.0


@pytest.mark.parametrize("kind", KINDS)
def test_bodies_far_from_recordings_are_warned_of(kind, tmp_path):
    motion = KINDS[kind](True, tmp_path)
    with pytest.warns(UserWarning, match="the body differs from the recording") as warned:
        motion.errors  # noqa: B018
    assert {warning.filename for warning in warned} == {__file__}
