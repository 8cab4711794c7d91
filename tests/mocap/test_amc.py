"""Motion capture in Acclaim files: joints, units and degrees of freedom, and damaged files.

recordings/cmu_01.asf and .amc are of the CMU Graphics Lab Motion Capture Database, see its README;
cmu_01_01.bvh is the same recording, converted by others, who left out the bone "thorax".
"""

from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from riemhuman.datasets import load_amc, load_bvh
from riemhuman.errors import ArgumentError, FileError, FileFormatError

FOLDER = Path(__file__).parent / "recordings"
RECORDING = FOLDER / "cmu_01_01.amc"

SKELETON = """# an arm
:version 1.10
:units
  mass 1.0
  length 0.5
  angle deg
:root
  order TX TY TZ RX RY RZ
  axis XYZ
  position 0 0 0
  orientation 0 0 0
:bonedata
  begin
    id 1
    name arm
    direction 0 2 0
    length 4
    axis 0 0 30 XYZ
    dof rx ry rz
    limits (-10 10)
           (-10 10)
           (-10 10)
  end
  begin
    name hand
    direction 1 0 0
    length 2
    axis 10 20 30 ZYX
    dof ry tx
  end
:hierarchy
  begin
    root arm
    arm hand
  end
"""
MOTION = """#!OML:ASF arm.ASF
:FULLY-SPECIFIED
:DEGREES
1
root 1 2 3 10 20 30
arm 40 50 60
hand 70 0.25
2
root 0 0 0 0 0 0
arm 0 0 0
hand 0 0
"""
METRES = 0.0254 / 0.5


def write(folder, skeleton=SKELETON, motion=MOTION):
    (folder / "arm.asf").write_bytes(skeleton.encode())
    (folder / "arm_1.amc").write_bytes(motion.encode())
    return folder / "arm_1.amc"


def turned(order, angles):
    return Rotation.from_euler(order, angles, degrees=True).as_matrix()


@pytest.mark.parametrize("ending", ["\n", "\r\n"])
def test_every_degree_of_freedom(tmp_path, ending):
    file = write(tmp_path, SKELETON.replace("\n", ending), MOTION.replace("\n", ending))
    recording = load_amc(file, frames_per_second=60.0)
    assert recording.joint_names == ("root", "arm", "hand", "hand end")
    assert recording.parents.tolist() == [-1, 0, 1, 2]
    assert (recording.frames_per_second, recording.name) == (60.0, "arm_1")
    # Bones start where their parents end: the arm at the root, the hand 4 units above it.
    rest = METRES * np.array([[0, 0, 0], [0, 0, 0], [0, 4, 0], [2, 4, 0]])
    np.testing.assert_allclose(recording.positions[1], rest, atol=1e-15)
    root = turned("xyz", [10, 20, 30])
    axes = turned("z", 30)
    arm = root @ axes @ turned("xyz", [40, 50, 60]) @ axes.T
    # The first number is the angle about x, in whatever order they are applied.
    axes = turned("zyx", [30, 20, 10])
    hand = arm @ axes @ turned("y", 70) @ axes.T
    place = METRES * np.array([1.0, 2.0, 3.0])
    elbow = place + METRES * (arm @ [0.0, 4.0, 0.0] + arm @ axes @ [0.25, 0.0, 0.0])
    tip = elbow + METRES * hand @ [2.0, 0.0, 0.0]
    np.testing.assert_allclose(recording.positions[0], [place, place, elbow, tip], atol=1e-15)


def test_radians(tmp_path):
    degrees = load_amc(write(tmp_path))
    skeleton = SKELETON.replace("angle deg", "angle rad").replace("10 20 30 ZYX", "0 0 0 ZYX")
    skeleton = skeleton.replace("0 0 30 XYZ", f"0 0 {np.radians(30)} XYZ")
    motion = MOTION.replace(":DEGREES", ":RADIANS").replace("arm 40 50 60", "arm 0 0 0.5")
    radians = load_amc(write(tmp_path, skeleton, motion))
    expected = turned("z", np.degrees(0.5))
    np.testing.assert_allclose(radians.rotations[0, 1], expected, atol=1e-15)
    np.testing.assert_allclose(radians.rotations[1], degrees.rotations[1], atol=1e-15)


def test_joints_agree_with_the_same_recording_as_bvh():
    acclaim = load_amc(RECORDING, frames_per_second=30.0)
    converted = load_bvh(FOLDER / "cmu_01_01.bvh")
    names = {
        "root": "Hips", "lfemur": "LeftUpLeg", "ltibia": "LeftLeg", "lfoot": "LeftFoot",
        "ltoes": "LeftToeBase", "rfemur": "RightUpLeg", "rtoes": "RightToeBase",
        "upperback": "Spine", "thorax": "Spine1", "upperneck": "Neck1", "head": "Head",
        "lhumerus": "LeftArm", "lradius": "LeftForeArm", "lwrist": "LeftHand",
        "rhumerus": "RightArm", "rradius": "RightForeArm", "rwrist": "RightHand",
    }  # fmt: skip
    ours = acclaim.positions[:, [acclaim.joint_names.index(name) for name in names]]
    # Its first frame is a T-pose that was put before the others.
    frames = slice(1, 1 + len(acclaim))
    theirs = converted.positions[
        frames, [converted.joint_names.index(name) for name in names.values()]
    ]
    theirs = 0.0254 / 0.45 * theirs
    # The conversion starts neck and arms at the lower end of the thorax.
    thorax = acclaim.joint_names.index("thorax")
    bone = acclaim.offsets[acclaim.joint_names.index("lowerneck")]
    left_out = acclaim.global_rotations[:, thorax] @ bone
    above = list(names).index("upperneck")
    ours[:, above:] -= left_out[:, None]
    assert np.linalg.norm(ours - theirs, axis=-1).max() < 1e-5


@pytest.mark.parametrize(
    ("names", "chosen"),
    [
        (["HDM_bd.asf", "HDM_dg.asf"], "HDM_bd.asf"),
        (["HDM.asf", "HDM_bd.asf"], "HDM_bd.asf"),
        (["person.asf"], "person.asf"),
    ],
)
def test_the_skeleton_beside_it(tmp_path, names, chosen):
    file = write(tmp_path).rename(tmp_path / "HDM_bd_01-01_120.amc")
    (tmp_path / "arm.asf").unlink()
    for name in names:
        text = SKELETON if name == chosen else SKELETON.replace("length 4", "length 3")
        (tmp_path / name).write_text(text)
    assert load_amc(file).offsets[2, 1] == pytest.approx(4 * METRES)


def test_no_skeleton_or_several(tmp_path):
    file = write(tmp_path).rename(tmp_path / "walk.amc")
    (tmp_path / "leg.asf").write_text(SKELETON)
    with pytest.raises(FileError, match=r"arm\.asf, leg\.asf.*skeleton="):
        load_amc(file)
    assert len(load_amc(file, tmp_path / "leg.asf")) == 2
    (tmp_path / "arm.asf").unlink()
    (tmp_path / "leg.asf").unlink()
    with pytest.raises(FileError, match=r"has no \.asf file"):
        load_amc(file)
    with pytest.raises(ArgumentError, match="frames_per_second"):
        load_amc(file, frames_per_second=0.0)


@pytest.mark.everyday
@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("arm 40 50 60", "arm 40 50", r"amc, line 6: the values of arm must be 3 numbers; found 2"),
        ("arm 40 50 60", "leg 40 50 60", r"bone 'leg' does not move in .*arm\.asf"),
        ("arm 40 50 60\n", "", "frame 1 has no values of arm"),
        (
            "arm 40 50 60",
            "arm 40 50 60\narm 1 2 3",
            "damaged, or not an Acclaim recording",
        ),
        (MOTION, ":DEGREES\n", "the file holds no frames"),
        (":DEGREES\n1", ":DEGREES", "damaged, or not an Acclaim recording"),
    ],
)
def test_damaged_recordings(tmp_path, old, new, message):
    with pytest.raises(FileFormatError, match=message):
        load_amc(write(tmp_path, motion=MOTION.replace(old, new, 1)))


@pytest.mark.everyday
@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("arm hand", "arm hand arm", "bone arm has two parents"),
        ("arm hand", "arm hand thumb", "unknown bone 'thumb'"),
        ("length 0.5", "length 0", r"arm\.asf: damaged, or not an Acclaim skeleton"),
        ("angle deg", "angle turns", "damaged, .* 'turns'"),
        ("dof rx ry rz", "dof rx ry rw", "found 'rx ry rw'"),
        ("0 0 30 XYZ", "0 0 30 XYY", "damaged, .* axes to be different"),
    ],
)
def test_damaged_skeletons(tmp_path, old, new, message):
    with pytest.raises(FileFormatError, match=message):
        load_amc(write(tmp_path, SKELETON.replace(old, new, 1)))
