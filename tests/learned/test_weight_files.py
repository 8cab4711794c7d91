"""A file of a network is data: what does not fit is refused by name."""

import zipfile

import numpy as np
import pytest

from riemhuman.errors import FileError, FileFormatError, MissingDependencyError
from riemhuman.io.arrays import load_arrays, save_arrays
from riemhuman.learned import IntrinsicExtrinsicCodes, ShapePoseCodes
from riemhuman.learned._codes import FOLDER

FILE = FOLDER / "shape_pose_codes.npz"
KINDS = {"shape_pose_codes": ShapePoseCodes, "intrinsic_extrinsic_codes": IntrinsicExtrinsicCodes}


@pytest.fixture(scope="module")
def arrays():
    return load_arrays(FILE, [])


@pytest.mark.parametrize("name", KINDS)
def test_shipped_files_are_small_and_written_again_the_same(name, tmp_path):
    file = FOLDER / f"{name}.npz"
    assert file.stat().st_size <= 2e6
    codes = KINDS[name](file)
    codes.save(tmp_path / "again.npz")
    assert entries(tmp_path / "again.npz") == entries(file)
    # Releases of zlib, and libraries in its place, compress a little better or worse.
    assert (tmp_path / "again.npz").stat().st_size < 1.1 * file.stat().st_size


def entries(file):
    """Return what a file holds, bit by bit; Python and zlib write it in more or fewer bytes."""
    with zipfile.ZipFile(file) as archive:
        return [
            (entry.filename, entry.date_time, entry.compress_type, archive.read(entry))
            for entry in archive.infolist()
        ]


def nan(array):
    array = array.copy()
    array.flat[0] = np.nan
    return array


def circle(parents):
    parents = parents.copy()
    child = np.flatnonzero(parents == np.flatnonzero(parents < 0)[0])[0]
    parents[child] = child
    return parents


BAD = {
    "format_version": (lambda a: np.array(99), "format_version must be 1; found 99"),
    "kind": (lambda a: np.array("OtherCodes"), "kind must be 'ShapePoseCodes'; found 'OtherCodes'"),
    "n_shape": (lambda a: np.array(-1), "n_shape must hold whole numbers from 1"),
    "shape.A": (nan, "shape.A holds 1 NaN"),
    "pose.L": (lambda a: a[1:], "pose.L must have shape"),
    "scale": (lambda a: np.zeros_like(a), "scale must be positive"),
    "part_of": (lambda a: a + 1, "part_of must hold whole numbers from 0"),
    "part_parents": (circle, "part_parents must be a tree"),
    "template_faces": (lambda a: a + 5000, "shape_pose_codes|vertices"),
    "template_vertices": (nan, "finite"),
}


@pytest.mark.everyday
@pytest.mark.parametrize("name", BAD)
def test_what_does_not_fit_is_refused(name, arrays, tmp_path):
    change, message = BAD[name]
    file = tmp_path / "bad.npz"
    save_arrays(file, arrays | {name: change(arrays[name])})
    with pytest.raises(FileFormatError, match=message) as refused:
        ShapePoseCodes(file)
    assert "bad.npz" in str(refused.value)


def test_missing_fields_and_files_are_refused(arrays, tmp_path):
    file = tmp_path / "bad.npz"
    save_arrays(file, {name: array for name, array in arrays.items() if name != "shape.C"})
    with pytest.raises(FileFormatError, match=r"lacks the fields shape\.C"):
        ShapePoseCodes(file)
    with pytest.raises(FileError):
        ShapePoseCodes(tmp_path / "none.npz")


def test_training_names_the_extra_that_it_needs(monkeypatch):
    monkeypatch.setitem(__import__("sys").modules, "torch", None)
    from training import Training, train

    with pytest.raises(MissingDependencyError, match=r"\.\[learned\]"):
        train({}, {}, lambda *_: 0.0, Training(n_steps=1))
