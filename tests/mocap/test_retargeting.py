"""Recordings performed by bodies: real ones, and skeletons of other makers with a known truth.

recordings/cmu_01_01.bvh is of the CMU Graphics Lab Motion Capture Database, see its README.
"""

import warnings
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from riemhuman.bodies import joint_motions, rotation_matrix
from riemhuman.datasets import (
    load_bvh,
    load_open_motions,
    pose_vectors,
    retarget,
)
from riemhuman.errors import ArgumentError, ArgumentTypeError

RECORDING = Path(__file__).parent / "recordings" / "cmu_01_01.bvh"

PARTS = ("collar", "shoulder", "elbow", "wrist", "hip", "knee", "ankle", "toes")


def sided(pattern, *parts, sides=("Left", "Right")):
    """Return names of the joints on both sides by their names in the open model."""
    return {
        f"{side}_{ours}": pattern.format(side=theirs, part=part)
        for side, theirs in zip(("left", "right"), sides, strict=True)
        for ours, part in zip(PARTS, parts, strict=True)
    }


TRUNK = {
    "pelvis": "Hips",
    "middle_spine": "Spine",
    "chest": "Spine1",
    "neck": "Neck",
    "head": "Head",
}
MIXAMO = ("Shoulder", "Arm", "ForeArm", "Hand", "UpLeg", "Leg", "Foot", "ToeBase")
BIPED = ("Clavicle", "UpperArm", "Forearm", "Hand", "Thigh", "Calf", "Foot", "Toe0")
# Names, metres per unit, rest pose, axes of rotation, axis that points up.
MAKERS = {
    "Mixamo": (
        {
            ours: f"mixamorig:{name}"
            for ours, name in (TRUNK | sided("{side}{part}", *MIXAMO)).items()
        },
        *(0.01, "T", "ZYX", "y"),
    ),
    "Biped": (
        {
            "pelvis": "Bip01 Pelvis",
            "lower_spine": "Bip01 Spine",
            "chest": "Bip01 Spine1",
            "neck": "Bip01 Neck",
            "head": "Bip01 Head",
            **sided("Bip01 {side} {part}", *BIPED, sides="LR"),
        },
        *(0.0254, "x", "XYZ", "z"),
    ),
    "SMPL": (
        {"pelvis": "Pelvis", "lower_spine": "Spine1", "middle_spine": "Spine2", "chest": "Spine3"}
        | {"neck": "Neck", "head": "Head"}
        | sided(
            "{side}_{part}",
            *("Collar", "Shoulder", "Elbow", "Wrist", "Hip", "Knee", "Ankle", "Foot"),
            sides="LR",
        ),
        *(1.0, "T", "XYZ", "z"),
    ),
}
TO_Z_UP = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]])


@pytest.fixture(scope="module")
def truth(model):
    """A person who raises the knees and one who shakes the arms, one after the other."""
    motions = load_open_motions("coarse", "lean runner", ["knees", "shake_arms"], 30)
    betas = motions[0].betas
    poses = np.concatenate([motion.pose_vectors[:60:2] for motion in motions])
    translations = np.concatenate([motion.translations[:60:2] for motion in motions])
    return betas, poses, translations


def joint_frames(model, rest_pose):
    """Return the frame of each joint in the model's rest pose, where that of others is the unit."""
    joints, names = model.joints(), list(model.joint_names)
    frames = np.tile(np.eye(3), (len(names), 1, 1))
    if rest_pose == "T":
        angles = pose_vectors(np.tile(np.eye(3), (len(names), 1, 1)), model)
        space, _ = joint_motions(joints, rotation_matrix(angles), model.parents, model.joint_order)
        return np.swapaxes(space, -1, -2)
    # Bones lie along x, as in files where joints have axes along their bones.
    for joint, name in enumerate(names):
        children = np.flatnonzero(model.parents == joint)
        if name.startswith(("left", "right")):
            bone = joints[children[0]] - joints[joint] if len(children) else frames[joint][:, 0]
            if not len(children):
                frames[joint] = frames[model.parents[joint]]
                continue
        else:
            bone = np.array([0.0, 1.0, 0.0])
        first = bone / np.linalg.norm(bone)
        third = np.cross(first, [0.0, 0.0, 1.0] if abs(first[2]) < 0.9 else [0.0, 1.0, 0.0])
        third /= np.linalg.norm(third)
        frames[joint] = np.stack([first, np.cross(third, first), third], axis=1)
    return frames


def write_recording(path, model, truth, maker, rate=30.0):
    """Write a motion of the model as a recording of another maker."""
    names, unit, rest_pose, order, up = MAKERS[maker]
    betas, poses, translations = truth
    known = list(model.joint_names)
    rest = model.joints(betas)
    space, positions = joint_motions(rest, rotation_matrix(poses), model.parents, model.joint_order)
    positions = (positions + translations[:, None]) / unit
    frames = joint_frames(model, rest_pose)
    rotations = space @ frames
    world = TO_Z_UP if up == "z" else np.eye(3)
    lines, channels = ["HIERARCHY"], []

    def visit(name, parent):
        joint = known.index(name)
        above = known.index(parent) if parent else None
        bone = rest[joint] - rest[above] if parent else np.zeros(3)
        offset = frames[above].T @ bone / unit if parent else bone
        lines.append(f"{'JOINT' if parent else 'ROOT'} {names[name]}\n{{")
        lines.append("OFFSET " + " ".join(f"{x:.9f}" for x in offset))
        turns = " ".join(f"{axis}rotation" for axis in order)
        if parent:
            lines.append(f"CHANNELS 3 {turns}")
            local = np.swapaxes(rotations[:, above], -1, -2) @ rotations[:, joint]
        else:
            lines.append(f"CHANNELS 6 {turns} Xposition Yposition Zposition")
            local = world @ rotations[:, joint]
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", UserWarning)  # where the second angle is 90 degrees
            channels.append(Rotation.from_matrix(local).as_euler(order, degrees=True))
        if not parent:
            channels.append(positions[:, joint] @ world.T)
        below = [child for child in names if nearest(child) == name]
        for child in below:
            visit(child, name)
        if not below:
            lines.append(f"End Site\n{{\nOFFSET {' '.join(map(str, [0.05 / unit, 0, 0]))}\n}}")
        lines.append("}")

    def nearest(name):
        joint = model.parents[known.index(name)]
        while joint >= 0 and known[joint] not in names:
            joint = model.parents[joint]
        return known[joint] if joint >= 0 else None

    visit("pelvis", None)
    rows = np.concatenate(channels, axis=1)
    lines += ["MOTION", f"Frames: {len(rows)}", f"Frame Time: {1.0 / rate:.8f}"]
    lines += [" ".join(f"{x:.6f}" for x in row) for row in rows]
    path.write_text("\n".join(lines) + "\n")
    return path


def joint_errors(model, motion, truth):
    """Return angles of bones, degrees, and distances of joints relative to the hips, metres."""
    names = list(model.joint_names)
    hips = [names.index(f"{side}_hip") for side in ("left", "right")]
    found, expected = (
        positions - positions[:, hips].mean(axis=1, keepdims=True)
        for positions in (
            model.joints(motion.betas, motion.pose_vectors, motion.translations),
            model.joints(*truth),
        )
    )
    angles, places = [], []
    for name in names:
        part = name.split("_")[-1]
        if part in ("knee", "ankle", "elbow", "wrist"):
            joint, above = names.index(name), model.parents[names.index(name)]
            a, b = (p[:, joint] - p[:, above] for p in (found, expected))
            sines = np.linalg.norm(np.cross(a, b), axis=1)
            angles.append(np.degrees(np.arctan2(sines, np.sum(a * b, axis=1))))
            places.append(np.linalg.norm(found[:, joint] - expected[:, joint], axis=1))
    return np.stack(angles, axis=1), np.stack(places, axis=1)


@pytest.mark.parametrize("maker", MAKERS)
def test_recordings_of_any_maker(tmp_path, model, truth, maker):
    recording = load_bvh(write_recording(tmp_path / "a.bvh", model, truth, maker))
    motion = retarget(recording, model, betas=truth[0])
    angles, places = joint_errors(model, motion, truth)
    assert angles.max() < 5.0
    assert places.mean() < 0.015
    assert np.percentile(places, 95) < 0.03
    errors = motion.errors
    np.testing.assert_allclose(errors.directions[:, :8].max(), angles.max(), atol=0.1)
    # Limbs are not rotated about themselves: surfaces are those of the person.
    apart = motion[:] - model(*truth)
    apart -= apart.mean(axis=1, keepdims=True)
    distances = np.linalg.norm(apart, axis=-1)
    assert distances.mean() < 0.02
    assert np.percentile(distances, 99) < 0.06


def test_the_person_is_found(tmp_path, model, truth):
    recording = load_bvh(write_recording(tmp_path / "a.bvh", model, truth, "Biped"))
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


def rotated(recording, vector, frames):
    """Return a frame of a recording again and again, rotated, with the lowest joint at height 0."""
    rotations, translations = (
        np.tile(array[:1], (frames, *[1] * (array.ndim - 1)))
        for array in (recording.rotations, recording.translations)
    )
    rotations[:, 0] = Rotation.from_rotvec(vector, degrees=True).as_matrix() @ rotations[:, 0]
    moved = replace(recording, rotations=rotations, translations=translations)
    translations[:, 0, 1] -= moved.positions[0, :, 1].min()
    return replace(recording, rotations=rotations, translations=translations)


@pytest.mark.parametrize(
    ("vector", "top"),
    [([90, 0, 0], 0.4), ([-90, 0, 0], 0.6), ([0, 0, 180], 1.8)],
)
def test_people_lie_and_stand_on_their_hands_on_the_floor(jump, vector, top):
    motion = retarget(rotated(jump.recording, vector, 5), betas=jump.betas)
    assert -0.04 < motion[:][..., 1].min() < 0.02
    assert 0.5 * top < motion[:][..., 1].max() < 1.1 * top


@pytest.mark.parametrize(
    ("axis", "vector"),
    [("x", [0, 0, -90]), ("-y", [180, 0, 0]), ("z", [90, 0, 0])],
)
def test_any_axis_may_point_up(slow_jump, axis, vector):
    recording, rotation = slow_jump.recording, Rotation.from_rotvec(vector, degrees=True)
    rotations, translations = recording.rotations.copy(), recording.translations.copy()
    rotations[:, 0] = rotation.as_matrix() @ rotations[:, 0]
    translations[:, 0] = rotation.apply(translations[:, 0])
    turned = replace(recording, rotations=rotations, translations=translations)
    for up in (axis, None):
        motion = retarget(turned, betas=slow_jump.betas, up=up)
        heights = motion[::5][..., 1]
        np.testing.assert_allclose(heights, slow_jump[::5][..., 1], atol=2e-3)


def test_a_minute_is_thinned(jump, slow_jump):
    motion = slow_jump
    assert (len(motion), motion.frames_per_second) == (20, 10)
    np.testing.assert_allclose(motion.recording.positions, jump.recording.positions[::3])


def test_tables_of_names(tmp_path, model, truth):
    path = write_recording(tmp_path / "a.bvh", model, truth, "Mixamo")
    text = path.read_text().replace("mixamorig:LeftUpLeg", "Bone17").replace("Left", "Port")
    path.write_text(text)
    recording = load_bvh(path)
    with pytest.warns(UserWarning, match=r"do not identify left_hip, .* left_hip='Bone17'"):
        motion = retarget(recording, model, betas=truth[0])
    assert joint_errors(model, motion, truth)[0].max() < 5.0
    parts = ("hip", "knee", "ankle", "toes", "collar", "shoulder", "elbow", "wrist")
    names = ("UpLeg", "Leg", "Foot", "ToeBase", "Shoulder", "Arm", "ForeArm", "Hand")
    table = {f"left_{a}": f"mixamorig:Port{b}" for a, b in zip(parts, names, strict=True)}
    table["left_hip"] = "Bone17"
    motion = retarget(recording, model, betas=truth[0], joints=table)
    assert joint_errors(model, motion, truth)[0].max() < 5.0
    with pytest.raises(
        ArgumentError, match=r"joints\['left_hip'\] must be one of .*found 'Bone18'"
    ):
        retarget(recording, model, joints=table | {"left_hip": "Bone18"})
    with pytest.raises(
        ArgumentError, match="left_knee must be below left_hip; found 'mixamorig:Por"
    ):
        retarget(recording, model, joints=table | {"left_hip": "mixamorig:PortFoot"})


def test_wrong_arguments(jump):
    with pytest.raises(ArgumentTypeError, match="recording must be a SkeletonMotion; found str"):
        retarget("jump.bvh")
    with pytest.raises(ArgumentTypeError, match="model must be a BodyModel; found str"):
        retarget(jump.recording, "open")
    with pytest.raises(ArgumentError, match="betas"):
        retarget(jump.recording, betas=np.zeros(3))
    with pytest.raises(ArgumentError, match="up must be one of 'x', 'y', .*; found 'w'"):
        retarget(jump.recording, up="w")
