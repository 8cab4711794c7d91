"""Hostile files: small ones that ask for much memory or lead out of arrays."""

import tracemalloc
import zipfile
from collections import Counter
from contextlib import contextmanager

import h5py
import numpy as np
import pytest
from fuzzed_readers import surfaces, template
from fuzzing import array_header
from model_pickles import Call, Raw, ch, old_sparse, pickled, select, smpl_fields
from scipy import sparse

from riemhuman.bodies import BodyModel
from riemhuman.datasets import load_dfaust
from riemhuman.errors import FileFormatError
from riemhuman.io.arrays import load_array, load_arrays
from riemhuman.io.pickles import load_pickled_arrays


@contextmanager
def bounded(n_bytes=2**27):
    """Bound the memory that Python and NumPy take."""
    tracemalloc.start()
    try:
        yield
        assert tracemalloc.get_traced_memory()[1] < n_bytes
    finally:
        tracemalloc.stop()


@pytest.mark.parametrize("shape", [[10**12], [-1, -1], [2**62, 4]])
def test_no_memory_for_missing_data(shape, tmp_path):
    content = array_header(shape) + bytes(8)
    with zipfile.ZipFile(tmp_path / "a.npz", "w") as file:
        file.writestr("vectors.npy", content)
    (tmp_path / "a.npy").write_bytes(content)
    for read in (
        lambda: load_arrays(tmp_path / "a.npz", ["vectors"]),
        lambda: load_array(tmp_path / "a.npy"),
    ):
        with bounded(2**24), pytest.raises(FileFormatError):
            read()


def test_characters_beyond_unicode(tmp_path):
    text = np.array([0x110000, 65], np.uint32).view("<U2")
    np.savez(tmp_path / "a.npz", a=text)
    with pytest.raises(FileFormatError, match="invalid characters, such as code 0x110000"):
        load_arrays(tmp_path / "a.npz", ["a"])
    (tmp_path / "a.pkl").write_bytes(pickled({"joint_names": text}))
    with pytest.raises(FileFormatError, match="invalid characters"):
        load_pickled_arrays(tmp_path / "a.pkl", ["joint_names"])
    np.savez(tmp_path / "a.npz", a=np.array(["ä"], ">U1"))
    assert load_arrays(tmp_path / "a.npz", ["a"])["a"][0] == "ä"


def hdf5(path, put):
    with h5py.File(path, "w") as file:
        file["faces"] = template().faces
        file["50002_hips"] = surfaces(4).transpose(1, 2, 0)
        put(file)
    return path


OUTSIDE = "lies outside the file, or is larger than it can hold"


@pytest.mark.parametrize(
    "put",
    [
        lambda file, name: file.__setitem__(name, h5py.SoftLink(f"/{name}")),
        lambda file, name: file.__setitem__(name, h5py.ExternalLink("other.hdf5", "/faces")),
        lambda file, name: file.create_dataset(
            name, (6, 3, 4), "u1", external=[("/etc/passwd", 0, h5py.h5f.UNLIMITED)]
        ),
        lambda file, name: file.create_dataset(name, (6, 3, 10**11), "f8", chunks=(6, 3, 8)),
    ],
    ids=["circular", "external link", "external data", "oversize"],
)
def test_hdf5_data_that_are_not_in_the_file(put, tmp_path):
    hdf5(tmp_path / "other.hdf5", lambda file: None)
    for name in ("50002_knees", "faces"):

        def replace(file, name=name):
            file.pop(name, None)
            put(file, name)

        with pytest.raises(FileFormatError, match=OUTSIDE):
            load_dfaust(hdf5(tmp_path / "a.hdf5", replace))


def csc(changes):
    matrix = old_sparse(sparse.csc_matrix(np.eye(3)), **changes)
    return pickled({"J_regressor": matrix, "notes": "of old"})


@pytest.mark.parametrize(
    "starts",
    [[0, 2**63 - 1, -2, 3], [0, 2**62, -(2**62), 3], [0, 2**63 - 1, 2**63 - 1, 3], [0, 5, 1, 3]],
)
def test_starts_whose_differences_wrap_around(tmp_path, starts):
    # The first of these once wrote beyond a buffer and ended the interpreter.
    for kind in (np.int64, np.uint64):
        starts = np.array(starts, np.int64).astype(kind)
        (tmp_path / "m.pkl").write_bytes(csc({"indptr": starts}))
        with pytest.raises(FileFormatError, match="csc matrix whose indptr is malformed"):
            load_pickled_arrays(tmp_path / "m.pkl", ["J_regressor"])


def test_damaged_sparse_matrices_are_refused_or_lie_within_their_shapes(tmp_path):
    """SciPy's own full check of such matrices writes outside its memory."""
    rng = np.random.default_rng(0)
    numbers = np.array([-(2**63), -1, 0, 1, 2, 3, 5, 9, 2**31, 2**61, 2**63 - 1])
    ends = Counter()
    for _ in range(120):
        matrix = sparse.random(*rng.integers(1, 5, 2), 0.6, rng=rng).asformat("csc")
        name = str(rng.choice(["indices", "indptr", "indptr"]))
        indices = getattr(matrix, name).astype(rng.choice([np.int64, np.uint64, np.int32, np.int8]))
        for place in rng.integers(len(indices), size=int(rng.integers(3))) if len(indices) else ():
            indices[place] = rng.choice(numbers).astype(indices.dtype)
        hostile = old_sparse(matrix, **{name: indices})
        (tmp_path / "m.pkl").write_bytes(pickled({"J": hostile}))
        try:
            found = load_pickled_arrays(tmp_path / "m.pkl", ["J"])["J"]
            ends["read"] += 1
            assert np.isfinite(found.toarray()).all()
        except FileFormatError:
            ends["refused"] += 1
    assert min(ends.values()) > 12


def test_a_sparse_matrix_of_any_shape_stays_sparse(tmp_path):
    huge = {"_shape": (10**6, 10**6), "indptr": np.zeros(10**6 + 1, np.int8)}
    empty = old_sparse(sparse.csc_matrix((3, 3)), **huge)
    fields = smpl_fields(n_vertices=20) | {"weights": empty, "J_regressor": empty}
    (tmp_path / "m.pkl").write_bytes(pickled(fields))
    with bounded(), pytest.raises(FileFormatError, match="weights must not be a sparse matrix"):
        BodyModel.from_file(tmp_path / "m.pkl")


def test_long_texts_are_not_multiplied(tmp_path):
    long = np.array([b"x" * 4000])
    chosen = select(ch(long), np.zeros(200_000, np.int8), None)
    scalar = Call("numpy.core.multiarray scalar", (dtype_of("S4000"), b"x" * 4000))
    listed = Raw(b"](" + pickled(scalar)[2:-1] + b"q\x07" + b"h\x07" * 40_000 + b"e")
    for value in (chosen, listed):
        (tmp_path / "m.pkl").write_bytes(pickled({"shapedirs": value}))
        with bounded(2**25), pytest.raises(FileFormatError):
            load_pickled_arrays(tmp_path / "m.pkl", ["shapedirs"])


def dtype_of(code):
    state = (3, "|", None, None, None, -1, -1, 0)
    return Raw(pickled(Call("numpy dtype", (code, 0, 1)))[2:-1] + pickled(state)[2:-1] + b"b")


@pytest.mark.parametrize("kind", [np.int8, "U1"])
def test_memory_is_counted_in_the_type_that_arrays_will_have(tmp_path, kind):
    n = 2**27 // (8 if kind not in ("S1", "U1") else 64)
    np.savez_compressed(tmp_path / "a.npz", vectors=np.zeros(n + 100_000 * 8, kind))
    assert (tmp_path / "a.npz").stat().st_size < 2**17
    with bounded(2**24), pytest.raises(FileFormatError, match="far more memory"):
        load_arrays(tmp_path / "a.npz", ["vectors"])


def test_chunks_larger_than_their_data(tmp_path):
    options = {"shape": (6, 3, 5), "maxshape": (None, None, None), "dtype": "f4"}

    def read(**chunks):
        def put(file):
            del file["50002_hips"]
            file.create_dataset("50002_hips", **options, **chunks)

        return load_dfaust(hdf5(tmp_path / "a.hdf5", put))

    for chunks in ((4, 3, 4_000_000), (40_000, 1, 1000), (2**20, 2**5, 1)):
        with pytest.raises(FileFormatError, match=OUTSIDE):
            read(chunks=chunks, compression="gzip")
    assert read(chunks=(40, 3, 1000))[0][:].shape == (5, 6, 3)
