"""Arrays in .npz files: round trip, whole or not at all, and what damage leads to."""

import os

import numpy as np
import pytest

from riemhuman.errors import FileError, FileFormatError
from riemhuman.io.arrays import load_arrays, save_arrays

ARRAYS = {"a": np.arange(6.0).reshape(2, 3), "b": np.array(1)}


class Interrupted:
    """An array that cannot be had."""

    def __array__(self, dtype=None, copy=None):
        raise KeyboardInterrupt


@pytest.mark.parametrize("compressed", [False, True])
def test_interrupted_writing_keeps_the_old_file(tmp_path, compressed):
    save_arrays(tmp_path / "x.npz", ARRAYS)
    with pytest.raises(KeyboardInterrupt):
        save_arrays(
            tmp_path / "x.npz", {"a": np.zeros(3), "b": Interrupted()}, compressed=compressed
        )
    np.testing.assert_array_equal(load_arrays(tmp_path / "x.npz", ["a"])["a"], ARRAYS["a"])
    assert os.listdir(tmp_path) == ["x.npz"]


@pytest.mark.parametrize("compressed", [False, True])
def test_files_are_those_of_numpy(tmp_path, compressed):
    arrays = ARRAYS | {"names": np.array(["one", "two"]), "z": np.zeros((500, 2), np.float32).T}
    save_arrays(tmp_path / "ours.npz", arrays, compressed=compressed)
    write = np.savez_compressed if compressed else np.savez
    write(tmp_path / "theirs.npz", **arrays)
    assert (tmp_path / "ours.npz").read_bytes() == (tmp_path / "theirs.npz").read_bytes()
    # Names that `np.savez` has arguments of are legal.
    save_arrays(tmp_path / "ours.npz", {"file": ARRAYS["a"]}, compressed=compressed)
    np.testing.assert_array_equal(load_arrays(tmp_path / "ours.npz", [])["file"], ARRAYS["a"])


def test_refusals(tmp_path):
    save_arrays(tmp_path / "x.npz", ARRAYS)
    with pytest.raises(FileFormatError, match=r"lacks the fields c, d; found a, b"):
        load_arrays(tmp_path / "x.npz", ["a", "c", "d"])
    np.save(tmp_path / "x.npy", ARRAYS["a"])
    with pytest.raises(FileFormatError, match="not an .npz archive"):
        load_arrays(tmp_path / "x.npy", ["a"])
    with pytest.raises(FileError, match="cannot be written"):
        save_arrays(tmp_path / "nowhere" / "x.npz", ARRAYS)
    with pytest.raises(FileError, match=r"there is no file .*missing\.npz"):
        load_arrays(tmp_path / "missing.npz", [])


def test_only_the_fields_asked_for_are_read(tmp_path):
    np.savez(tmp_path / "x.npz", pickled=np.array([{}], dtype=object), **ARRAYS)
    assert load_arrays(tmp_path / "x.npz", ["a"], ["b", "c"]).keys() == {"a", "b"}
    with pytest.raises(FileFormatError, match="plain arrays"):
        load_arrays(tmp_path / "x.npz", ["pickled"])
