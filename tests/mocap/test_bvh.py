"""Motion capture in BVH files: rotations, positions, any layout, and damaged files by their lines.

recordings/cmu_01_01.bvh is of the CMU Graphics Lab Motion Capture Database, see its README.
"""

from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from riemhuman.datasets import load_bvh
from riemhuman.errors import FileError, FileFormatError

RECORDING = Path(__file__).parent / "recordings" / "cmu_01_01.bvh"

ARM = """HIERARCHY
ROOT Hips Of Ann {
  OFFSET 0 1 0
  CHANNELS 6 Yrotation Xposition Zrotation Yposition Xrotation Zposition
  JOINT mixamorig:Arm
  {
    CHANNELS 2 Xrotation Zrotation
    OFFSET 2 0 0
    End Site { OFFSET 0 3 0 }
    End Site of Arm
    {
      OFFSET 0 0 4
    }
    JOINT Fixed { OFFSET 0 0 1 }
  }
}
MOTION
Frames: 2
Frame Time: 0.04
90 5 0 6 0 7 0 90
30 0 40 0 50 0 60 70
"""


def write(folder, text):
    (folder / "arm.bvh").write_bytes(text.encode())
    return folder / "arm.bvh"


def test_channels_in_any_order(tmp_path):
    motion = load_bvh(write(tmp_path, "\ufeff" + ARM.replace("\n", "\r\n")))
    arm = "mixamorig:Arm"
    assert motion.joint_names == ("Hips Of Ann", arm, f"{arm} end", f"{arm} end", "Fixed")
    assert motion.parents.tolist() == [-1, 0, 1, 1, 1]
    assert motion.frames_per_second == pytest.approx(25.0)
    assert len(motion) == 2
    angles = [[90, 0, 0], [30, 40, 50]]
    expected = Rotation.from_euler("YZX", angles, degrees=True).as_matrix()
    np.testing.assert_allclose(motion.rotations[:, 0], expected, atol=1e-15)
    expected = Rotation.from_euler("XZ", [[0, 90], [60, 70]], degrees=True).as_matrix()
    np.testing.assert_allclose(motion.rotations[:, 1], expected, atol=1e-15)
    np.testing.assert_array_equal(motion.rotations[:, 4], np.tile(np.eye(3), (2, 1, 1)))
    # Positions replace the offset of the root. About y by 90°, x becomes −z; the arm's own rotation
    # about z then takes its y to −x, which is z in space.
    expected = [[5, 6, 7], [5, 6, 5], [5, 6, 8], [9, 6, 5], [6, 6, 5]]
    np.testing.assert_allclose(motion.positions[0], expected, atol=1e-12)


def test_two_roots_and_no_end_sites(tmp_path):
    text = "HIERARCHY\nROOT a {\nOFFSET 0 0 0\n}\nroot b\n{ offset 1 2 3\nchannels 1 XROTATION }\n"
    motion = load_bvh(write(tmp_path, text + "motion\nframes:1\nframe  time:1\n180\n"))
    assert motion.parents.tolist() == [-1, -1]
    np.testing.assert_allclose(motion.rotations[0, 1], np.diag([1, -1, -1]), atol=1e-15)


@pytest.mark.everyday
@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("HIERARCHY", "HIERACHY", "line 1: HIERARCHY expected; found 'HIERACHY'"),
        ("ROOT Hips Of Ann {", "ROOT {", "line 2: the joint has no name"),
        ("OFFSET 0 1 0", "OFFSET 0 nan 0", "line 3: every number must be finite"),
        ("OFFSET 2 0 0", "", "line 15: joint mixamorig:Arm has no OFFSET"),
        ("CHANNELS 2", "CHANNELS 3", "line 8: XPOSITION or .* expected; found 'OFFSET'"),
        ("Yposition", "Xposition", "line 4: a position channel is repeated"),
        ("JOINT mixamorig", "BONE mixamorig", "line 5: OFFSET or CHANNELS or JOINT"),
        ("}\nMOTION", "MOTION", "line 16: OFFSET or CHANNELS"),
        ("Frames: 2", "Frames: 2.5", "line 21: Frames says 2.5, but 2 follow"),
        ("Time: 0.04", "Time: 1e-300", "line 19: Frame Time must be above 1e-05"),
        ("90 5 0 6 0 7 0 90", "90 5 0 6 0 7 0", "line 20: 8 numbers expected; found 7"),
        ("90 5 0 6 0 7 0 90", "90 5 0 6 0 7 0 nan", r"arm\.bvh: rotations holds 9 NaN"),
    ],
)
def test_damaged_files(tmp_path, old, new, message):
    assert ARM.count(old) == 1
    with pytest.raises(FileFormatError, match=message):
        load_bvh(write(tmp_path, ARM.replace(old, new)))


def test_files_that_end_early(tmp_path):
    for length in range(0, len(ARM) - 4, 7):
        with pytest.raises(FileFormatError, match=r"arm\.bvh, line \d+: "):
            load_bvh(write(tmp_path, ARM[:length]))
    with pytest.raises(FileError):
        load_bvh(tmp_path / "missing.bvh")


def test_frame_times_that_no_recording_has_are_asked_about(tmp_path):
    text = RECORDING.read_text(encoding="utf-8")
    start = text.index("Frame Time:")
    lines = text[start:].split("\n", 1)
    (tmp_path / "a.bvh").write_text(text[:start] + "Frame Time: 60\n" + lines[1], encoding="utf-8")
    with pytest.raises(FileFormatError, match="Frame Time of 60 seconds.*pass frames_per_second="):
        load_bvh(tmp_path / "a.bvh")
    assert load_bvh(tmp_path / "a.bvh", frames_per_second=60).frames_per_second == 60.0
