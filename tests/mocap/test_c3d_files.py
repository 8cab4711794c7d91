"""C3D files in the layouts of several makers, beside what ezc3d reads or wrote."""

import contextlib
import struct

import numpy as np
import pytest
from marker_files import RATE, c3d_bytes, write_c3d

from riemhuman.errors import FileFormatError
from riemhuman.mocap._c3d_files import read_points

NAMES = ("LASI", "RASI", "LKNE")


@pytest.fixture
def points():
    """Return positions of three markers in seven frames, millimetres, some unseen."""
    positions = np.random.default_rng(3).integers(-2000, 2000, (7, 3, 3)).astype(float)
    positions[2, 1] = positions[3, 1] = np.nan
    return positions


LAYOUTS = {
    "intel": {}, "whole numbers": {"scale": 0.5}, "big-endian": {"processor": 86},
    "big-endian, whole numbers": {"processor": 86, "scale": 0.5}, "dec": {"processor": 85},
    "dec, whole numbers": {"processor": 85, "scale": 0.5}, "analog": {"n_analog": 24},
    "more labels": {"labels": (*NAMES, "LHipAngles", "LHipMoment")},
    "fewer labels": {"labels": NAMES[:2]},
    "real count": {"extra": {"POINT:FRAMES": np.float32(7.0)}},
    "wrong header": {"last": 0, "extra": {"POINT:FRAMES": np.int16(7)}},
    "long recording": {"first": 65535, "last": 65535, "extra": {
        "TRIAL:ACTUAL_START_FIELD": np.array([-6, 0], "i2"),  # 65530, which looks negative
        "TRIAL:ACTUAL_END_FIELD": np.array([0, 1], "i2")}},
    "groups last": {"groups_last": True},
}  # fmt: skip


@pytest.mark.parametrize("name", LAYOUTS)
def test_layouts(name, points, tmp_path):
    layout = LAYOUTS[name]
    (tmp_path / "a.c3d").write_bytes(c3d_bytes(points, **{"labels": NAMES, **layout}))
    read = read_points(tmp_path / "a.c3d")
    np.testing.assert_allclose(read.positions, points, atol=0.25 if "scale" in layout else 1e-3)
    expected = NAMES if name != "fewer labels" else (*NAMES[:2], "*2")
    assert (read.names, read.rate, read.unit) == (expected, RATE, "mm")


@pytest.mark.parametrize("name", ["intel", "whole numbers", "dec"])
def test_our_layouts_are_those_of_ezc3d(name, points, tmp_path):
    ezc3d = pytest.importorskip("ezc3d")
    file = tmp_path / "a.c3d"
    file.write_bytes(c3d_bytes(points, labels=NAMES, **LAYOUTS[name]))
    other = ezc3d.c3d(str(file))["data"]["points"][:3].transpose(2, 1, 0)
    np.testing.assert_allclose(read_points(file).positions, other, atol=1e-4)


def test_files_of_ezc3d(points, tmp_path):
    names = [f"M{number}" for number in range(300)]  # those after the 255th are in LABELS2
    markers = {name: 0.001 * points[:, number % 3] for number, name in enumerate(names)}
    read = read_points(write_c3d(tmp_path / "a.c3d", markers))
    assert read.names == tuple(names)
    np.testing.assert_allclose(read.positions[:, 3:6], points, atol=1e-3)


def test_points_that_are_no_markers_are_left_out(points, tmp_path):
    angles = np.array([["LKNE"]], dtype="S4")
    content = c3d_bytes(points, labels=NAMES, extra={"POINT:ANGLES": angles})
    (tmp_path / "a.c3d").write_bytes(content)
    assert read_points(tmp_path / "a.c3d").names == NAMES[:2]


@pytest.mark.parametrize(
    ("extra", "message"),
    [
        ({"ANALOG:USED": np.int16(16)}, "holds 16 analog signals and no points"),
        ({"ROTATION:USED": np.int16(19)}, "holds rotations of 19 segments and no points"),
    ],
)
def test_files_without_points_say_what_they_hold(extra, message, tmp_path):
    content = c3d_bytes(np.zeros((7, 0, 3)), labels=(), n_analog=16, extra=extra)
    (tmp_path / "a.c3d").write_bytes(content)
    with pytest.raises(FileFormatError, match=message):
        read_points(tmp_path / "a.c3d")


@pytest.mark.everyday
@pytest.mark.parametrize("size", [0, 1, 100, 511, 512, 600, 900, 1100])
def test_cut_files_are_refused(size, points, tmp_path):
    (tmp_path / "a.c3d").write_bytes(c3d_bytes(points, labels=NAMES)[:size])
    with pytest.raises(FileFormatError, match=r"a\.c3d: (damaged|cut off|holds no)"):
        read_points(tmp_path / "a.c3d")


def test_damaged_files_end(points, tmp_path):
    """Any byte may be wrong: the file is read, or refused, in its own time and memory."""
    content = c3d_bytes(points, labels=NAMES, n_analog=4)
    rng = np.random.default_rng(0)
    for _ in range(100):
        damaged = bytearray(content)
        for place in rng.integers(0, 1024, 4):
            damaged[place] = rng.integers(256)
        (tmp_path / "a.c3d").write_bytes(bytes(damaged))
        with contextlib.suppress(FileFormatError):
            assert read_points(tmp_path / "a.c3d").positions.size < 1e6


def test_other_files(tmp_path):
    (tmp_path / "a.c3d").write_bytes(struct.pack("<512H", *range(512)))
    with pytest.raises(FileFormatError, match="not a C3D file"):
        read_points(tmp_path / "a.c3d")
