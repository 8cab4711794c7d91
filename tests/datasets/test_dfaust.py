"""The Dynamic FAUST reader, on made-up files in the layout of its makers."""

import sys

import h5py
import numpy as np
import pytest

from riemhuman.datasets import Motion, load_dfaust
from riemhuman.errors import (
    ArgumentError,
    ArgumentTypeError,
    FileError,
    FileFormatError,
    FrameIndexError,
    MissingDependencyError,
)
from riemhuman.surfaces.deformation_basis import DeformationBasis

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


@pytest.fixture
def read(monkeypatch):
    """Return the list of the (key, index) that were read from sequences."""
    asked = []
    getitem = h5py.Dataset.__getitem__

    def watching(dataset, index, **options):
        asked.append((dataset.name.strip("/"), index))
        return getitem(dataset, index, **options)

    monkeypatch.setattr(h5py.Dataset, "__getitem__", watching)
    return asked


def keys(motions):
    return [f"{motion.subject}_{motion.sequence}" for motion in motions]


def spans(read):
    return [(key, index[-1].start, index[-1].stop) for key, index in read if key != "faces"]


def test_a_folder_is_both_files(folder, truth):
    motions = load_dfaust(folder)
    assert sorted(keys(motions)) == sorted(truth)
    assert [motion.subject for motion in motions] == ["50002", "50002", "50009", "50004", "50004"]
    for motion in motions:
        frames = truth[f"{motion.subject}_{motion.sequence}"]
        assert isinstance(motion, Motion)
        assert motion.frames_per_second == 60
        assert len(motion) == motion.n_frames == len(frames)
        assert motion.path == folder / (WOMEN if motion.subject == "50004" else MEN)
        np.testing.assert_array_equal(motion.faces, FACES)
        assert motion.faces.dtype == np.int64
        assert not motion.faces.flags.writeable
        np.testing.assert_array_equal(motion[:], frames)


@pytest.mark.parametrize("name", [MEN, WOMEN])
def test_one_file_or_a_folder_with_one(folder, name):
    (folder / (MEN if name == WOMEN else WOMEN)).unlink()
    assert sorted(keys(load_dfaust(folder))) == sorted(LENGTHS[name])
    assert sorted(keys(load_dfaust(str(folder / name)))) == sorted(LENGTHS[name])


def test_a_file_may_have_any_name(folder):
    (folder / MEN).rename(folder / "mine.h5")
    assert len(load_dfaust(folder / "mine.h5")) == 3


def test_nothing_is_read_before_it_is_asked_for(folder, read):
    motion = load_dfaust(folder, 50002, "hips")[0]
    assert spans(read) == []
    motion[17]
    assert spans(read) == [("50002_hips", 17, 18)]
    read.clear()
    motion[-1]
    assert spans(read) == [("50002_hips", 149, 150)]
    read.clear()
    assert motion[::100].shape == (2, N_VERTICES, 3)
    assert spans(read) == [("50002_hips", 0, 1), ("50002_hips", 100, 101)]


@pytest.mark.parametrize(
    "part",
    [
        slice(None),
        slice(3, 5),
        slice(None, None, 10),
        slice(None, None, 70),
        slice(None, None, -1),
        slice(140, 3, -9),
        slice(100, 1000),
        slice(9, 9),
    ],
)
def test_slices_are_frames(folder, truth, part):
    motion = load_dfaust(folder, 50002, "hips")[0]
    frames = motion[part]
    assert frames.dtype == np.float64
    assert frames.shape == truth["50002_hips"][part].shape
    np.testing.assert_array_equal(frames, truth["50002_hips"][part])


@pytest.mark.parametrize("part", [slice(None), slice(3, 9), slice(40, 2, -3), slice(1, None, 7)])
@pytest.mark.parametrize("step", [1, 2, 7, 60])
def test_lower_frame_rates(folder, truth, part, step):
    (motion,) = load_dfaust(folder, 50002, "hips", frames_per_second=60 / step)
    frames = truth["50002_hips"][::step]
    assert motion.frames_per_second == pytest.approx(60 / step)
    assert len(motion) == len(frames)
    np.testing.assert_array_equal(motion[part], frames[part])
    np.testing.assert_array_equal(motion[-1], frames[-1])


@pytest.mark.parametrize("rate", [120, 50, 0.7, 59])
def test_frame_rates_there_are_not(folder, rate):
    message = f"frames_per_second must be 60 divided by a whole number; found {rate:g}"
    with pytest.raises(ArgumentError, match=message):
        load_dfaust(folder, frames_per_second=rate)


def test_frames_and_iteration(folder, truth):
    motion = load_dfaust(folder, 50004, "knees")[0]
    for number in (0, 39, -1, -40):
        np.testing.assert_array_equal(motion[number], truth["50004_knees"][number])
    np.testing.assert_array_equal(np.stack(list(motion)), truth["50004_knees"])
    with pytest.raises(FrameIndexError, match="'knees' of '50004', 40 frames.* has no frame 40"):
        motion[40]


def test_single_precision_becomes_double(tmp_path):
    stored = np.linspace(0, 1, N_VERTICES * 3 * 4, dtype="f4").reshape(N_VERTICES, 3, 4)
    path = write(tmp_path / "f.h5", {"50002_hips": stored}, FACES.astype("u4"))
    frames = load_dfaust(path)[0][:]
    assert frames.dtype == np.float64
    np.testing.assert_array_equal(frames, stored.transpose(2, 0, 1))


def test_the_file_is_closed_between_readings(folder):
    motion = load_dfaust(folder, 50009)[0]
    motion[0]
    with h5py.File(folder / MEN, "r+") as file:
        file["50009_hips"][..., 3] = 2.5
    np.testing.assert_array_equal(motion[3], 2.5)


@pytest.mark.parametrize("subjects", [50004, "50004", [50004], np.array([50004]), np.int64(50004)])
def test_subjects_are_numbers_or_names(folder, subjects):
    assert {motion.subject for motion in load_dfaust(folder, subjects)} == {"50004"}


def test_choosing(folder):
    assert keys(load_dfaust(folder, [50004, "50002"], "hips")) == ["50004_hips", "50002_hips"]
    assert keys(load_dfaust(folder, 50004, ["knees", "hips"])) == ["50004_knees", "50004_hips"]
    # People not asked for by name are passed over where they lack a motion.
    assert keys(load_dfaust(folder, sequences=["knees"])) == ["50004_knees"]
    name = "light_hopping_loose"
    assert keys(load_dfaust(folder, sequences=name)) == [f"50002_{name}"]


def test_a_basis_reads_every_tenth_frame_alone(folder, truth, read):
    motions = load_dfaust(folder, [50002, 50004], "hips")
    basis = DeformationBasis.from_motions(motions, n_components=5, step=10)
    expected = DeformationBasis.from_motions([truth["50002_hips"], truth["50004_hips"]], 5)
    np.testing.assert_allclose(basis.vectors, expected.vectors, rtol=0, atol=1e-12)
    assert spans(read) == [
        (key, number, number + 1)
        for key, n in [("50002_hips", 150), ("50004_hips", 25)]
        for number in range(0, n, 10)
    ]


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ((50001,), r"subjects .*50002, 50009, 50004 in .*registrations_m.*; unknown: '50001'"),
        (([],), "subjects must be different names, at least one"),
        (([50002, "50002"],), "subjects must be different names"),
        ((None, "flying"), r"sequences .*hips, knees, light_hopping_loose in .*unknown: 'flying'"),
        ((50002, "knees"), r"50002 lacks knees and has hips, light_hopping_loose$"),
        (([50002, 50009], ["hips", "knees"]), r"50002 lacks knees .*; 50009 lacks knees and has"),
    ],
)
def test_names_there_are_not(folder, arguments, message):
    with pytest.raises(ArgumentError, match=message):
        load_dfaust(folder, *arguments)


def test_arguments_of_another_type(folder):
    with pytest.raises(ArgumentTypeError, match="path must be the path of a file or folder"):
        load_dfaust(3)
    with pytest.raises(ArgumentTypeError, match=r"subjects must be a list of names; found 2\.5"):
        load_dfaust(folder, 2.5)
    with pytest.raises(ArgumentTypeError, match="sequences must be a list of names; found 7"):
        load_dfaust(folder, 50002, 7)


def test_no_file(tmp_path):
    with pytest.raises(FileError, match=r"no file or folder .*nowhere"):
        load_dfaust(tmp_path / "nowhere")
    with pytest.raises(FileError, match=f"holds neither {MEN} nor {WOMEN}"):
        load_dfaust(tmp_path)


def test_not_hdf5(folder):
    (folder / WOMEN).write_bytes(b"<html>please register</html>")
    with pytest.raises(FileFormatError, match=rf"{WOMEN} is not an HDF5 file"):
        load_dfaust(folder)


def test_truncated(folder):
    path = folder / MEN
    path.write_bytes(path.read_bytes()[:600])
    with pytest.raises(FileFormatError, match=rf"cannot read .*{MEN}"):
        load_dfaust(folder)


def test_no_triangles(tmp_path):
    path = write(tmp_path / MEN, {"50002_hips": np.zeros((N_VERTICES, 3, 4))}, faces=None)
    with pytest.raises(FileFormatError, match="no dataset 'faces' of triangles; found 50002_hips"):
        load_dfaust(path)
    with pytest.raises(FileFormatError, match="found nothing"):
        load_dfaust(write(tmp_path / MEN, {}, faces=None))


@pytest.mark.parametrize(
    ("faces", "message"),
    [
        (FACES[:, :2], r"n_faces, 3"),
        (FACES + 0.5, "whole numbers"),
        (FACES - 1, "from 0 on; found -1"),
        (FACES[:0], "found none"),
        (np.bytes_(b"none"), "whole numbers"),
    ],
)
def test_wrong_triangles(tmp_path, faces, message):
    values = {"50002_hips": np.zeros((N_VERTICES, 3, 4))}
    with pytest.raises(FileFormatError, match=rf"faces of .*{MEN}.*{message}"):
        load_dfaust(write(tmp_path / MEN, values, faces))


def test_triangles_must_be_a_dataset(tmp_path):
    with h5py.File(tmp_path / MEN, "w") as file:
        file.create_group("faces")["inside"] = FACES
        file["50002_hips"] = np.zeros((N_VERTICES, 3, 4))
    with pytest.raises(FileFormatError, match=f"faces of .*{MEN}"):
        load_dfaust(tmp_path)


def test_both_files_have_the_same_triangles(folder):
    with h5py.File(folder / WOMEN, "r+") as file:
        file["faces"][...] = FACES[::-1]
    with pytest.raises(FileFormatError, match=rf"{WOMEN}: triangles must be those of {MEN}"):
        load_dfaust(folder)


def test_no_sequence(tmp_path):
    path = write(tmp_path / MEN, {"notes": np.zeros(3)})
    with pytest.raises(FileFormatError, match="holds no sequence, such as 50002_hips"):
        load_dfaust(path)


def test_wrong_shapes_are_all_named(tmp_path):
    path = write(
        tmp_path / MEN,
        {
            "50002_hips": np.zeros((N_VERTICES, 3, 4)),
            "50002_knees": np.zeros((4, N_VERTICES, 3)),
            "50002_none": np.zeros((N_VERTICES, 3, 0)),
            "50009_hips": np.zeros(4),
            "50009_knees": np.full((N_VERTICES, 3, 4), b"a"),
        },
    )
    with pytest.raises(FileFormatError, match=r"numbers of shape \(5, 3, n_frames\)") as caught:
        load_dfaust(path)
    for words in (
        r"50002_knees of .* has shape (4, 5, 3)",
        r"50002_none of .* has shape (5, 3, 0)",
        r"50009_hips of .* has shape (4,)",
        r"50009_knees of .* does not hold numbers",
    ):
        key, rest = words.split(" of .* ")
        assert f"{key} of {path} {rest}" in str(caught.value)
    assert "50002_hips" not in str(caught.value)
    assert keys(load_dfaust(path, 50002, "hips")) == ["50002_hips"]  # the others do not matter


def test_a_group_is_no_sequence(tmp_path):
    path = write(tmp_path / MEN, {"50002_hips/inside": np.zeros(3)})
    with pytest.raises(FileFormatError, match="50002_hips of .* does not hold numbers"):
        load_dfaust(path)


@pytest.mark.parametrize("value", [np.nan, np.inf])
def test_frames_with_nan_are_named(folder, value):
    with h5py.File(folder / MEN, "r+") as file:
        for number in (20, 40):
            file["50002_hips"][2, 1, number] = value
    motion = load_dfaust(folder, 50002, "hips")[0]
    with pytest.raises(FileFormatError, match=rf"{MEN}: NaN .* frames 20 of 50002_hips"):
        motion[20]
    with pytest.raises(FileFormatError, match=r"frames 40, 20 of 50002_hips"):
        motion[40::-20]
    assert np.isfinite(motion[:20]).all()


def test_many_frames_with_nan_are_counted(folder):
    with h5py.File(folder / MEN, "r+") as file:
        file["50002_hips"][...] = np.nan
    with pytest.raises(FileFormatError, match=r"frames 0, 1, .*, 9 and 140 more of"):
        load_dfaust(folder, 50002, "hips")[0][:]


def test_a_file_that_changes_or_goes(folder):
    motion = load_dfaust(folder, 50009)[0]
    with h5py.File(folder / MEN, "r+") as file:
        del file["50009_hips"]
    with pytest.raises(FileError, match=rf"{MEN} has changed: 50009_hips"):
        motion[0]
    (folder / MEN).unlink()
    with pytest.raises(FileError, match=f"{MEN} cannot be read"):
        motion[0]


def test_without_h5py_the_line_that_installs_it(folder, monkeypatch):
    monkeypatch.setitem(sys.modules, "h5py", None)
    with pytest.raises(MissingDependencyError, match=r"h5py.*pip install 'riemhuman\[data\]'"):
        load_dfaust(folder)
