"""Errors of performances, and when they are warned of, in recordings of all kinds."""

import warnings
from dataclasses import replace

import numpy as np
import pytest
from recorded_people import RECORDING, joints_in_space, recording_of
from scipy.spatial.transform import Rotation

from riemhuman.datasets import (
    load_bvh,
    load_open_motions,
    load_recording,
    motion_from_arrays,
    retarget,
)
from riemhuman.mocap import _limbs, _standing, motions, performances

LEG = {"hip": "UpLeg", "knee": "Leg", "ankle": "Foot", "toes": "ToeBase"}
LINES = (("left_hip", "right_hip"), ("left_shoulder", "right_shoulder"))


def of_skeleton(wrong):
    """Return a real recording; wrong names of joints take one leg for the other."""
    swapped = {
        f"{ours}_{part}": f"{theirs}{name}"
        for ours, theirs in (("left", "Right"), ("right", "Left"))
        for part, name in LEG.items()
    }
    return load_recording(RECORDING, joints=swapped if wrong else None, frames_per_second=5)


def of_arrays(wrong):
    poses = np.zeros((4, 24, 3))
    if wrong:
        # The spine of nobody turns by half a turn.
        poses[:, 3, 1] = np.pi
    return motion_from_arrays(poses, np.zeros((4, 3)), 30.0, up="y")


KINDS = {"bvh": of_skeleton, "arrays": of_arrays}


@pytest.mark.parametrize("kind", KINDS)
def test_errors_tell_of_lines_and_parts(kind):
    with warnings.catch_warnings():
        warnings.filterwarnings("error", "(?s).*the body differs from the recording")
        errors = KINDS[kind](False).errors
    assert set(LINES) <= set(errors.bones)
    assert errors.parts[:3] == ("pelvis", "chest", "head")
    assert errors.directions.mean(axis=0).max() < 4.0
    assert errors.rotations.mean(axis=0).max() < 15.0


@pytest.mark.parametrize("kind", KINDS)
def test_bodies_far_from_recordings_are_warned_of(kind):
    motion = KINDS[kind](True)
    sides = "" if kind == "arrays" else "the hips face away from the shoulders.*pass joints="
    with pytest.warns(UserWarning, match=f"the body differs from the recording.*{sides}") as warned:
        motion.errors  # noqa: B018
    assert {warning.filename for warning in warned} == {__file__}


def test_people_who_stand_on_tiptoe_are_told(model):
    poses = np.zeros((12, model.n_joints, 3))
    ankles = [model.joint_names.index(f"{side}_ankle") for side in ("left", "right")]
    poses[:, ankles, 0] = np.radians(50.0)
    recording = recording_of(model, np.zeros(model.n_betas), poses, np.zeros((12, 3)))
    with pytest.warns(UserWarning, match="feet that stand still point down by (4|5). degrees"):
        retarget(recording, model).errors  # noqa: B018


def punching_file(folder):
    """Return the skeleton of a person who punches, as BVH has it, centimetres."""
    (motion,) = load_open_motions("coarse", "average man", "punching", 15.0)
    motion.save(folder / "a.bvh")
    return load_bvh(folder / "a.bvh")


def test_a_joint_below_the_ankle_is_no_toe(tmp_path):
    """The end site of a foot that goes straight down is where its toes are."""
    recording = punching_file(tmp_path)
    offsets, steps = recording.offsets.copy(), recording.translations.copy()
    for side in ("left", "right"):
        toes = recording.joint_names.index(f"{side}_toes")
        end = recording.joint_names.index(f"{side}_toes end")
        down = np.array([0.0, -1.4, 0.0])
        offsets[end] = offsets[toes] - down
        offsets[toes] = down
        steps[:, [toes, end]] = offsets[[toes, end]]
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        performed = retarget(replace(recording, offsets=offsets, translations=steps))
        assert {"left_foot", "right_foot"} <= set(performed.errors.parts)
    names = performed.model.joint_names
    joints = performed.model.joints(performed.betas, performed.pose_vectors)
    drop = joints[:, names.index("left_ankle"), 1] - joints[:, names.index("left_toes"), 1]
    assert np.median(drop) < 0.09
    assert np.median(drop) > 0.03


def test_feet_straight_down_without_an_end_show_no_direction(tmp_path):
    recording = punching_file(tmp_path)
    offsets, steps = recording.offsets.copy(), recording.translations.copy()
    for side in ("left", "right"):
        toes = [recording.joint_names.index(f"{side}_toes{end}") for end in ("", " end")]
        offsets[toes] = [0.0, -12.0, 0.0], np.zeros(3)
        steps[:, toes] = offsets[toes]
    performed = retarget(replace(recording, offsets=offsets, translations=steps))
    assert not {"left_foot", "right_foot"} & set(performed.errors.parts)


def test_joints_that_are_placed_without_rotations(tmp_path):
    """The pelvis and the chest turn as hips and shoulders do."""
    recording = punching_file(tmp_path)
    places = recording.positions
    steps = places - places[:, recording.parents] * (recording.parents >= 0)[:, np.newaxis]
    turned = Rotation.from_rotvec(np.linspace([0.0, 0.0, 0.0], [0.0, np.pi, 0.0], len(steps)))
    still = np.broadcast_to(np.eye(3), recording.rotations.shape)
    steps = turned.as_matrix()[:, np.newaxis] @ steps[..., np.newaxis]
    performed = retarget(replace(recording, rotations=still, translations=steps[..., 0]))
    with pytest.warns(UserWarning, match="on average: head by"):  # it turns with the chest
        errors = performed.errors
    assert errors.parts[:2] == ("pelvis", "chest")
    assert errors.rotations[:, :2].mean(axis=0).max() < 2.0


def test_elephants_are_no_people(tmp_path):
    recording = punching_file(tmp_path)
    shape = np.where(
        [
            name in ("upper_spine", "left_elbow", "right_elbow", "left_wrist", "right_wrist")
            for name in recording.joint_names
        ],
        2.2,
        1.0,
    )
    elephant = replace(
        recording, offsets=recording.offsets * shape[:, None],
        translations=recording.translations * shape[:, None],
    )  # fmt: skip
    with pytest.warns(UserWarning, match="the recorded proportions are not those of the body"):
        retarget(elephant).errors  # noqa: B018
    assert "cm off" not in retarget(recording).message


@pytest.mark.parametrize("lean", [11.0, -11.0])
def test_chests_do_not_pitch_where_joints_lean_at_rest(lean, tmp_path):
    """In an upright rest pose, the line from hips to shoulders may lean all the same."""
    recording = punching_file(tmp_path)
    names = list(recording.joint_names)
    offsets, steps = recording.offsets.copy(), recording.translations.copy()
    # The rest pose of a T-pose: straight legs, and shoulders that are placed ahead of the hips.
    number = names.index("upper_spine")
    ahead = 50.0 * np.tan(np.radians(lean)) * np.array([0.0, 0.0, 1.0])
    offsets[number] += ahead
    steps[:, number] += ahead
    for side in ("left", "right"):
        for joint in ("knee", "ankle"):
            k = names.index(f"{side}_{joint}")
            straight = -np.linalg.norm(offsets[k]) * np.array([0.0, 1.0, 0.0])
            offsets[k], steps[:, k] = straight, straight
    leaning = replace(recording, offsets=offsets, translations=steps)
    performed = retarget(leaning)
    pitches = []
    for motion in (performed, retarget(recording)):
        rotations, _ = joints_in_space(motion.model, motion.betas, motion.pose_vectors)
        chest = rotations[:, motion.model.joint_names.index("chest")]
        pitches.append(np.degrees(np.arcsin(np.clip(-chest[:, 1, 2], -1.0, 1.0))).mean())
    assert abs(pitches[0] - pitches[1]) < 5.0


def test_runs_of_frames_do_not_change_them(monkeypatch):
    recording = load_bvh(RECORDING)
    at_once = retarget(recording)
    poses, places, bodies = at_once.pose_vectors, at_once.translations, at_once[:]
    for module in (_limbs, _standing, performances):
        monkeypatch.setattr(module, "RUN", 7)
    monkeypatch.setattr(motions, "_FRAMES_AT_A_TIME", 9)
    in_runs = retarget(recording)
    np.testing.assert_allclose(in_runs.pose_vectors, poses, rtol=0.0, atol=1e-12)
    np.testing.assert_allclose(in_runs.translations, places, rtol=0.0, atol=1e-12)
    np.testing.assert_allclose(in_runs[:], bodies, rtol=0.0, atol=1e-12)
    np.testing.assert_allclose(in_runs[40], bodies[40], rtol=0.0, atol=1e-12)
