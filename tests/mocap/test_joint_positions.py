"""Positions of joints as arrays and tables: layouts, gaps, files and other arrays."""

import csv

import numpy as np
import pytest
from marker_files import RATE

from riemhuman.datasets import load_recording, skeleton_from_positions
from riemhuman.errors import ArgumentError, FileFormatError
from riemhuman.mocap.joint_positions import LAYOUTS

# Joints of the layouts that the open model has, by its names.
PARTS = {
    "Hip": "hip", "Knee": "knee", "Ankle": "ankle", "Shoulder": "shoulder", "Elbow": "elbow",
    "Wrist": "wrist", "BigToe": "toes", "Toe": "toes", "Toes": "toes", "FootIndex": "toes",
}  # fmt: skip
NEEDED = [f"{side}_{part}" for side in ("left", "right") for part in list(PARTS.values())[:6]]


def arranged(joints, layout):
    """Return positions in the order of a layout; joints that the model lacks are elsewhere."""
    columns = []
    for name in LAYOUTS[layout]:
        side, part = {"L": "left", "R": "right"}.get(name[0], ""), PARTS.get(name[1:])
        columns.append(
            joints.get(f"{side}_{part}", joints["neck"] + [0.0, 0.1, 0.02 * len(columns)])
        )
    return np.stack(columns, axis=1)


def test_layouts_are_guessed_and_said(joints):
    for layout, names in LAYOUTS.items():
        positions = arranged(joints, layout)
        with pytest.warns(UserWarning, match=f"{len(names)} joints .* order of '{layout}'"):
            recording = skeleton_from_positions(positions, RATE)
        for role in NEEDED:
            found = recording.positions[:, recording.joint_names.index(role)]
            np.testing.assert_allclose(found, joints[role], atol=1e-9)


def test_files(joints, jump, tmp_path):
    positions = arranged(joints, "smpl")
    np.save(tmp_path / "a.npy", positions)
    np.savez(tmp_path / "b.npz", joints3d=positions, score=np.ones(len(positions)))
    names = [
        f"body_{side}_{part}" for side in ("left", "right") for part in list(PARTS.values())[:6]
    ]
    rows = np.stack([joints[name.removeprefix("body_")] for name in names], axis=1)
    with (tmp_path / "c.csv").open("w", newline="") as file:
        table = csv.writer(file)
        table.writerow(["frame", *(f"{name}_{axis}" for name in names for axis in "xyz")])
        for number, row in enumerate(1000.0 * rows.reshape(len(rows), -1)):
            table.writerow([number, *row])
    np.savetxt(tmp_path / "d.csv", positions.reshape(len(positions), -1), delimiter=",")
    for name, choice in {"a.npy": {"layout": "smpl"}, "b.npz": {"layout": "smpl"},
                         "c.csv": {"unit": "mm"}, "d.csv": {"layout": "smpl"}}.items():  # fmt: skip
        motion = load_recording(
            tmp_path / name, jump.model, betas=jump.betas, frames_per_second=RATE, **choice
        )
        assert motion.errors.positions.mean() < 0.01, name
        assert motion.frames_per_second == RATE
        with pytest.raises(FileFormatError, match="does not state its frame rate"):
            load_recording(tmp_path / name)
    for text in ("frame,joint,x,y,z\n0,hip,1,2,3\n", "hip_x;hip_y;hip_z\n1;2;3\n", "1,2\n"):
        (tmp_path / "e.csv").write_text(text)
        with pytest.raises(FileFormatError, match="must have columns such as left_hip_x"):
            load_recording(tmp_path / "e.csv", frames_per_second=RATE)


def test_joints_that_were_not_seen(joints):
    positions = arranged(joints, "coco")
    positions[4, LAYOUTS["coco"].index("LKnee")] = 0.0
    positions[5, LAYOUTS["coco"].index("RWrist")] = np.nan
    with pytest.warns(UserWarning, match=r"left_knee up to 1, right_wrist up to 1"):
        recording = skeleton_from_positions(positions, RATE, layout="coco")
    found = recording.positions[:, recording.joint_names.index("left_knee")]
    assert np.abs(found - joints["left_knee"]).max() < 0.02


def test_other_arrays_and_layouts(joints):
    for shape, message in (
        ((5, 17, 2), "places in a picture"),
        ((5, 263), "HumanML3D's features"),
        ((2, 5, 17, 3), "those of one person"),
        ((5, 19, 3), "must be of 22 .*; found 19"),
    ):
        with pytest.raises(ArgumentError, match=message):
            skeleton_from_positions(np.ones(shape), RATE)
    with pytest.raises(ArgumentError, match="layout must be that of 22 joints .*; found 'coco'"):
        skeleton_from_positions(arranged(joints, "smpl"), RATE, layout="coco")


@pytest.mark.parametrize("ending", [".fbx", ".mvnx", ".mot"])
def test_files_of_other_programs_say_how_to_export(ending, tmp_path):
    (tmp_path / f"a{ending}").write_bytes(b"")
    with pytest.raises(FileFormatError, match=f"{ending} files are not read; .*(BVH|TRC)"):
        load_recording(tmp_path / f"a{ending}")


def test_tables_of_motive_say_how_to_export(tmp_path):
    file = tmp_path / "take.csv"
    file.write_text("Format Version,1.23,Take Name,Walk,Capture Frame Rate,120\n,,Marker,Marker\n")
    with pytest.raises(FileFormatError, match="in Motive, export C3D or BVH"):
        load_recording(file)
