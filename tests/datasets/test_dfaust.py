"""The Dynamic FAUST reader, on made-up files in the layout of its makers."""

import h5py
import numpy as np
import pytest

from riemhuman.datasets import Motion, load_dfaust
from riemhuman.errors import (
    ArgumentError,
    FileError,
    FileFormatError,
    FrameIndexError,
)

MEN, WOMEN = "registrations_m.hdf5", "registrations_f.hdf5"
FACES = np.array([[0, 1, 2], [0, 2, 3], [0, 3, 4], [0, 4, 1], [1, 3, 2], [1, 4, 3]])
N_VERTICES = 5
LENGTHS = {
    MEN: {"50002_hips": 150, "50002_light_hopping_loose": 12, "50009_hips": 31},
    WOMEN: {"50004_hips": 25, "50004_knees": 40},
}


def write(path, sequences, faces=FACES):
    """Write arrays as they are under their keys, and the triangles."""
    with h5py.File(path, "w") as file:
        if faces is not None:
            file["faces"] = faces
        for key, values in sequences.items():
            file[key] = values
    return path


@pytest.fixture(scope="module")
def truth():
    """Return the frames of every sequence, (n_frames, V, 3)."""
    rng = np.random.default_rng(7)
    keys = {key: n for lengths in LENGTHS.values() for key, n in lengths.items()}
    return {key: rng.normal(size=(n, N_VERTICES, 3)) for key, n in keys.items()}


@pytest.fixture
def folder(tmp_path, truth):
    for name, lengths in LENGTHS.items():
        write(tmp_path / name, {key: truth[key].transpose(1, 2, 0) for key in lengths})
    return tmp_path


def keys(motions):
    return [f"{motion.subject}_{motion.sequence}" for motion in motions]


def test_a_folder_is_both_files(folder, truth):
    motions = load_dfaust(folder)
    assert sorted(keys(motions)) == sorted(truth)
    assert [motion.subject for motion in motions] == ["50002", "50002", "50009", "50004", "50004"]
    for motion in motions:
        frames = truth[f"{motion.subject}_{motion.sequence}"]
        assert isinstance(motion, Motion)
        assert motion.frames_per_second == 60
        assert motion.path == folder / (WOMEN if motion.subject == "50004" else MEN)
        np.testing.assert_array_equal(motion.faces, FACES)
        assert not motion.faces.flags.writeable
        np.testing.assert_array_equal(motion[:], frames)
        np.testing.assert_array_equal(np.stack(list(motion)), frames)


PARTS = [(None,), (3, 5), (None, None, 70), (None, None, -1), (140, 3, -9), (100, 1000), (9, 9)]


@pytest.mark.parametrize("step", [1, 7])
def test_slices_at_all_frame_rates(folder, truth, step):
    (motion,) = load_dfaust(folder, 50002, "hips", frames_per_second=60 / step)
    frames = truth["50002_hips"][::step]
    assert motion.frames_per_second == pytest.approx(60 / step)
    assert len(motion) == len(frames)
    for part in (slice(*ends) for ends in PARTS):
        assert motion[part].dtype == np.float64
        np.testing.assert_array_equal(motion[part], frames[part], err_msg=str(part))
    np.testing.assert_array_equal(motion[-1], frames[-1])
    with pytest.raises(FrameIndexError, match="'hips' of '50002'.* has no frame"):
        motion[len(frames)]


def test_choosing(folder):
    assert keys(load_dfaust(folder, [50004, "50002"], "hips")) == ["50004_hips", "50002_hips"]
    assert keys(load_dfaust(folder, 50004, ["knees", "hips"])) == ["50004_knees", "50004_hips"]
    # People not asked for by name are left out where they lack a motion.
    assert keys(load_dfaust(folder, sequences=["knees"])) == ["50004_knees"]


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ((50001,), r"subjects .*50002, 50009, 50004 in .*registrations_m.*; unknown: '50001'"),
        (([50002, "50002"],), "subjects must be one or more different names"),
        ((None, "flying"), r"sequences .*hips, knees, light_hopping_loose in .*unknown: 'flying'"),
        (([50002, 50009], ["hips", "knees"]), "missing: 50002_knees, 50009_knees"),
    ],
)
def test_unknown_names(folder, arguments, message):
    with pytest.raises(ArgumentError, match=message):
        load_dfaust(folder, *arguments)


def test_wrong_arguments(folder, tmp_path):
    (folder / WOMEN).rename(folder / "mine.h5")
    assert len(load_dfaust(folder / "mine.h5")) == 2
    (tmp_path / "empty").mkdir()
    for arguments, error, message in (
        ((tmp_path / "nowhere",), FileError, "no file .*nowhere"),
        ((tmp_path / "empty",), FileError, f"holds neither {MEN} nor {WOMEN}"),
        ((folder, None, None, 61), ArgumentError, "must be at most .* 60; found 61"),
    ):
        with pytest.raises(error, match=message):
            load_dfaust(*arguments)


def test_damaged_files(folder):
    whole = (folder / MEN).read_bytes()
    for content, message in ((b"<html>", "not an HDF5 file"), (whole[:600], "truncated")):
        (folder / MEN).write_bytes(content)
        with pytest.raises(FileFormatError, match=rf"{MEN}.*{message}"):
            load_dfaust(folder)


@pytest.mark.parametrize(
    ("faces", "message"),
    [
        (None, "holds no dataset 'faces' of triangles; found 50002_hips"),
        (FACES + 0.5, "whole numbers"),
        (FACES - 1, "counted from 0"),
    ],
)
def test_wrong_triangles(tmp_path, faces, message):
    values = {"50002_hips": np.zeros((N_VERTICES, 3, 4))}
    with pytest.raises(FileFormatError, match=rf"{MEN}.*{message}"):
        load_dfaust(write(tmp_path / MEN, values, faces))


def test_both_files_have_the_same_triangles(folder):
    with h5py.File(folder / WOMEN, "r+") as file:
        file["faces"][...] = FACES[::-1]
    with pytest.raises(FileFormatError, match=rf"{WOMEN}: triangles must be those of {MEN}"):
        load_dfaust(folder)
    write(folder / WOMEN, {"notes": np.zeros(3)})
    with pytest.raises(FileFormatError, match="holds no sequence, such as 50002_hips"):
        load_dfaust(folder / WOMEN)


@pytest.mark.parametrize(
    ("values", "problem"),
    [
        (np.zeros((4, N_VERTICES, 3)), r"must have shape \(5, 3, n_frames\).* found \(4, 5, 3\)"),
        (np.zeros((N_VERTICES, 3, 0)), r"found \(5, 3, 0\)"),
        (np.full((N_VERTICES, 3, 4), b"a"), "does not hold numbers"),
    ],
)
def test_malformed_sequences(tmp_path, values, problem):
    path = write(tmp_path / MEN, {"50002_hips": np.zeros((N_VERTICES, 3, 4))})
    with h5py.File(path, "r+") as file:
        file["50002_knees"] = values
    with pytest.raises(FileFormatError, match=rf"50002_knees of .*{MEN} .*{problem}"):
        load_dfaust(path)
    assert keys(load_dfaust(path, 50002, "hips")) == ["50002_hips"]  # the other does not matter


def test_frames_that_are_not_finite_are_named(folder):
    with h5py.File(folder / MEN, "r+") as file:
        file["50002_hips"][2, 1, 20] = np.nan
        file["50002_hips"][2, 1, 40] = np.inf
        file["50009_hips"][...] = np.nan
    motion, other = load_dfaust(folder, [50002, 50009], "hips")
    assert np.isfinite(motion[:20]).all()
    with pytest.raises(FileFormatError, match=r"NaN .* frames 40, 20 of 50002_hips"):
        motion[40::-20]
    with pytest.raises(FileFormatError, match=r"frames 0, 1, .*, 9 and 21 more of 50009_hips"):
        other[:]
