"""Joints are found by the names of the studios, else by the shape of the skeleton."""

import warnings
from dataclasses import replace

import numpy as np
import pytest
from recorded_people import RECORDING, recording_of
from scipy.spatial.transform import Rotation

from riemhuman.datasets import load_bvh, load_open_motions, retarget
from riemhuman.errors import ArgumentError
from riemhuman.mocap._joint_names import find_joints, model_joints

PARTS = ("hip", "knee", "ankle", "toes", "collar", "shoulder", "elbow", "wrist")
TRUNK = {"pelvis": "Hips", "middle_spine": "Spine", "chest": "Spine1", "neck": "Neck"}
TRUNK |= {"head": "Head"}
MIXAMO = ("UpLeg", "Leg", "Foot", "ToeBase", "Shoulder", "Arm", "ForeArm", "Hand")
BIPED = ("Thigh", "Calf", "Foot", "Toe0", "Clavicle", "UpperArm", "Forearm", "Hand")
JOINTS = ("Hip", "Knee", "Ankle", "Toe", "Collar", "Shoulder", "Elbow", "Wrist")
# How a limb's joint is named, with words for the sides, names of parts, and of the trunk.
STUDIOS = {
    "Mixamo": ("mixamorig:{side}{part}", "Left Right", MIXAMO, "mixamorig:{}"),
    "Biped": ("Bip01 {side} {part}", "L R", BIPED, "Bip01 {}"),
    "MVN, 100STYLE, MHAD": ("{side}{part}", "Left Right", JOINTS, "{}"),
    "Maya": ("{part}_{side}", "L R", (*JOINTS[:4], "Scapula", *JOINTS[5:]), "{}_M"),
    "Bandai-Namco": (
        "{part}_{side}",
        "L R",
        ("UpperLeg", "LowerLeg", "Foot", "Toes", "Shoulder", "UpperArm", "LowerArm", "Hand"),
        "{}",
    ),
    "Acclaim": (
        "{side}{part}",
        "l r",
        ("femur", "tibia", "foot", "toes", "clavicle", "humerus", "radius", "wrist"),
        "lower{}",
    ),
    "OptiTrack": (
        "Skeleton 001:{side}{part}",
        "L R",
        ("Thigh", "Shin", "Foot", "Toe", "Shoulder", "UArm", "FArm", "Hand"),
        "Skeleton 001:{}",
    ),
    "Blender": (
        "DEF-{part}.{side}.001",
        "L R",
        ("thigh", "shin", "foot", "toe", "shoulder", "upper_arm", "forearm", "hand"),
        "DEF-{}",
    ),
    "DAZ": (
        "{side}{part}",
        "l r",
        ("ThighBend", "Shin", "Foot", "Toe", "Collar", "ShldrBend", "ForearmBend", "Hand"),
        "{}",
    ),
    "joints": (
        "{side}_{part}_jnt",
        "L R",
        ("upLeg", "lowLeg", "foot", "toe", "clavicle", "upArm", "lowArm", "hand"),
        "{}_jnt",
    ),
}


def renamed(names, studio):
    """Return the names of the open model's joints as a studio gives them."""
    pattern, sides, parts, other = STUDIOS[studio]
    sided = {
        f"{ours}_{part}": pattern.format(side=side, part=theirs)
        for ours, side in zip(("left", "right"), sides.split(), strict=True)
        for part, theirs in zip(PARTS, parts, strict=True)
    }
    return tuple(sided.get(name, other.format(TRUNK.get(name, "Extra"))) for name in names)


@pytest.fixture(scope="module")
def person(model):
    motion = load_open_motions("coarse", "lean runner", "knees", 5)[0]
    return motion.betas, recording_of(
        model, motion.betas, motion.pose_vectors, motion.translations, 5.0
    )


@pytest.fixture(scope="module")
def frames(model, person):
    betas, recording = person
    return retarget(recording, model, betas=betas)[:]


def test_names_of_studios(model):
    """And other spellings, with names of people before them."""
    expected = model_joints(model)
    for studio in STUDIOS:
        names = renamed(model.joint_names, studio)
        assert find_joints(names, model.parents) == expected, studio
    for spelling in (str.upper, str.lower, "Actor_R:{}".format):
        names = [spelling(name) for name in renamed(model.joint_names, "Mixamo")]
        assert find_joints(names, model.parents) == expected, names[0]


def test_collars_are_above_shoulders(model):
    names = list(renamed(model.joint_names, "Mixamo"))
    collar, neck = (model.joint_names.index(name) for name in ("left_collar", "neck"))
    names[collar], names[neck] = "Extra", names[collar]
    found = find_joints(names, model.parents)
    assert "left_collar" not in found
    assert "right_collar" in found


@pytest.mark.parametrize("order", ["as it is", "right first"])
def test_joints_without_names_are_found_by_the_shape(model, person, frames, order):
    betas, recording = person
    names = tuple(f"joint {number}" for number in range(model.n_joints))
    numbers = np.arange(model.n_joints)
    if order == "right first":
        numbers = np.concatenate([[0], numbers[19:], numbers[1:7], numbers[15:19], numbers[7:15]])
    place = np.argsort(numbers)
    other = replace(
        recording,
        joint_names=names,
        parents=np.where(recording.parents < 0, -1, place[recording.parents])[numbers],
        offsets=recording.offsets[numbers],
        rotations=recording.rotations[:, numbers],
        translations=recording.translations[:, numbers],
    )
    with pytest.warns(UserWarning, match="names of joints do not identify left_hip.*Pass joints="):
        motion = retarget(other, model, betas=betas)
    assert np.linalg.norm(motion[:] - frames, axis=-1).max() < 0.02


def test_joints_without_names_in_one_place():
    """As programs add where a forearm or shin rotates about itself."""
    recording = load_bvh(RECORDING)
    expected = retarget(recording, frames_per_second=3)
    bent = [
        recording.joint_names.index(f"{side}{bone}")
        for side in ("Left", "Right")
        for bone in ("Leg", "ForeArm")
    ]
    order = np.sort([*range(len(recording.parents)), *bent])
    is_twin = np.append(False, order[1:] == order[:-1])
    last = {joint: place for place, joint in enumerate(order)}  # the twin of a joint that has one
    parents = np.array([last.get(recording.parents[joint], -1) for joint in order])
    parents[is_twin] = np.flatnonzero(is_twin) - 1
    still = np.where(is_twin[:, np.newaxis, np.newaxis], np.eye(3), recording.rotations[:, order])
    moved = np.where(is_twin[:, np.newaxis], 0.0, recording.translations[:, order])
    other = replace(
        recording,
        joint_names=tuple(f"joint {number}" for number in range(len(order))),
        parents=parents,
        offsets=np.where(is_twin[:, np.newaxis], 0.0, recording.offsets[order]),
        rotations=still,
        translations=moved,
    )
    with pytest.warns(UserWarning, match="names of joints do not identify"):
        motion = retarget(other, frames_per_second=3)
    assert np.linalg.norm(motion[:] - expected[:], axis=-1).max() < 0.08


def test_a_real_recording_without_names():
    recording = load_bvh(RECORDING)
    expected = retarget(recording, frames_per_second=3)
    names = tuple(f"joint {number}" for number in range(len(recording.parents)))
    with pytest.warns(UserWarning, match="left_hip='joint 2'.*right_elbow='joint 31'") as warned:
        motion = retarget(replace(recording, joint_names=names), frames_per_second=3)
    assert {warning.filename for warning in warned} == {__file__}
    assert np.linalg.norm(motion[:] - expected[:], axis=-1).max() < 0.08


def test_collars_in_two_parts(model, person):
    betas, recording = person
    names = list(renamed(model.joint_names, "Mixamo"))
    for side in ("left", "right"):
        names[model.joint_names.index(f"{side}_collar")] = f"{side.title()}Shoulder2"
    names[model.joint_names.index("upper_spine")] = "LeftShoulder1"
    motion = retarget(replace(recording, joint_names=tuple(names)), model, betas=betas)
    assert motion.errors.directions.mean(axis=0).max() < 4.0


@pytest.mark.parametrize(
    ("part", "is_below"), [("hip", True), ("shoulder", False), ("elbow", True), ("collar", False)]
)
def test_joints_in_two_parts(model, person, frames, part, is_below):
    # A joint is followed by another in the same place, and the two share its rotation.
    betas, recording = person
    joint = model.joint_names.index(f"left_{part}")
    n_frames, n_joints = recording.rotations.shape[:2]
    share = Rotation.from_rotvec(np.linspace(0, 1, n_frames)[:, None] * [0.3, 0.5, 0.2])
    rotations = np.concatenate([recording.rotations, np.zeros((n_frames, 1, 3, 3))], axis=1)
    rotations[:, joint] = share.as_matrix()
    rotations[:, -1] = share.inv().as_matrix() @ recording.rotations[:, joint]
    parents = np.append(recording.parents, joint)
    parents[np.flatnonzero(recording.parents == joint)] = n_joints
    names = [*renamed(model.joint_names, "MVN, 100STYLE, MHAD"), ""]
    name = names[joint]
    names[joint], names[-1] = (name, f"{name}Twist") if is_below else (f"{name}Joint", name)
    order = [*range(joint + 1), n_joints, *range(joint + 1, n_joints)]
    place = np.argsort(order)
    split = replace(
        recording,
        joint_names=tuple(names[number] for number in order),
        parents=np.where(parents < 0, -1, place[parents])[order],
        offsets=np.concatenate([recording.offsets, np.zeros((1, 3))])[order],
        translations=np.concatenate([recording.translations, np.zeros((n_frames, 1, 3))], axis=1)[
            :, order
        ],
        rotations=rotations[:, order],
    )
    motion = retarget(split, model, betas=betas)
    np.testing.assert_allclose(motion[:], frames, atol=1e-6)


def test_joints_have_the_last_word(model, person, frames):
    betas, recording = person
    names = tuple(f"joint {number}" for number in range(model.n_joints))
    table = dict(zip(model.joint_names, names, strict=True))
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        motion = retarget(replace(recording, joint_names=names), model, betas=betas, joints=table)
    np.testing.assert_allclose(motion[:], frames, atol=1e-6)


def test_what_is_no_person_is_refused(model, person):
    _, recording = person
    n_joints = model.n_joints
    chain = replace(
        recording,
        joint_names=tuple(f"bone {number}" for number in range(n_joints)),
        parents=np.arange(n_joints) - 1,
    )
    with pytest.raises(ArgumentError, match="joints must name left_hip, .*the skeleton has bone 0"):
        retarget(chain, model)
