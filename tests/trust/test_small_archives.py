"""Small files that would take much memory, or time, or lead out of an array."""

import time
import tracemalloc
import zipfile
from contextlib import contextmanager

import h5py
import numpy as np
import pytest
from model_pickles import Call, Ch, Raw, Select, Sparse, pickled, smpl_fields
from scipy import sparse

from riemhuman.bodies import BodyModel
from riemhuman.datasets import load_amass, load_dfaust
from riemhuman.descriptors.latent_vectors import LatentVectors
from riemhuman.errors import FileFormatError, RiemhumanError
from riemhuman.io.arrays import load_array, load_arrays, save_arrays
from riemhuman.io.pickles import load_pickled_arrays
from riemhuman.report._storage import ResultStore
from riemhuman.surfaces.deformation_basis import DeformationBasis

EDGES = [-(2**63), -(2**31) - 1, -2, -1, 2**31, 2**32, 2**62, 2**63 - 1]


@contextmanager
def bounded(n_bytes=2**27, seconds=5):
    """Bound the memory that Python and NumPy take, and the time."""
    started = time.process_time()
    tracemalloc.start()
    try:
        yield
        assert tracemalloc.get_traced_memory()[1] < n_bytes
    finally:
        tracemalloc.stop()
    assert time.process_time() - started < seconds


def csc(changes):
    matrix = Sparse(sparse.csc_matrix(np.eye(3)), changes=changes)
    return pickled({"J_regressor": matrix, "notes": "of old"})


@pytest.mark.parametrize("number", EDGES)
@pytest.mark.parametrize("place", range(4))
@pytest.mark.parametrize("name", ["indptr", "indices"])
def test_indices_of_sparse_matrices_are_checked_before_arithmetic(tmp_path, name, place, number):
    valid = np.array([0, 1, 2, 3] if name == "indptr" else [0, 1, 2], np.int64)
    changed = valid.copy()
    changed[min(place, len(valid) - 1)] = number
    (tmp_path / "m.pkl").write_bytes(csc({name: changed}))
    with pytest.raises(FileFormatError, match="csc matrix"):
        load_pickled_arrays(tmp_path / "m.pkl", ["J_regressor"])


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


@pytest.mark.parametrize("number", EDGES)
def test_chosen_entries_at_the_edges_of_their_type(tmp_path, number):
    select = Select(Ch(np.arange(4.0)), np.array([0, number, 1]), None)
    (tmp_path / "m.pkl").write_bytes(pickled({"shapedirs": select}))
    with pytest.raises(FileFormatError, match="indices outside its array"):
        load_pickled_arrays(tmp_path / "m.pkl", ["shapedirs"])


def test_a_sparse_matrix_of_any_shape_stays_sparse(tmp_path):
    huge = {"_shape": (10**6, 10**6), "indptr": np.zeros(10**6 + 1, np.int8)}
    empty = Sparse(sparse.csc_matrix((3, 3)), changes=huge)
    fields = smpl_fields(n_vertices=20) | {"weights": empty, "J_regressor": empty}
    (tmp_path / "m.pkl").write_bytes(pickled(fields))
    with bounded(), pytest.raises(FileFormatError, match="weights must not be a sparse matrix"):
        BodyModel.from_file(tmp_path / "m.pkl")


def test_choices_out_of_choices_are_counted(tmp_path):
    zeros = np.zeros(20_000, np.int8)
    (tmp_path / "m.pkl").write_bytes(with_memo(zeros, depth=6))
    with bounded(2**25, 2), pytest.raises(FileFormatError, match="more often than its size"):
        load_pickled_arrays(tmp_path / "m.pkl", ["shapedirs"])


def with_memo(zeros, depth):
    """Return a pickle in which each choice is made by the one before, out of the one before."""
    content = b"\x80\x02}(U\x09shapedirs" + pickled(Select(Ch(zeros), zeros, None))[2:-1] + b"q\x00"
    for number in range(depth):
        before = Raw(b"h" + bytes([number]))
        chosen = pickled(Select(before, before, None))[2:-1]
        content += b"U\x09shapedirs" + chosen + b"q" + bytes([number + 1])
    return content + b"u."


def test_long_texts_are_not_multiplied(tmp_path):
    long = np.array([b"x" * 4000])
    chosen = Select(Ch(long), np.zeros(200_000, np.int8), None)
    scalar = Call("numpy.core.multiarray scalar", (dtype_of("S4000"), b"x" * 4000))
    listed = Raw(b"](" + pickled(scalar)[2:-1] + b"q\x07" + b"h\x07" * 40_000 + b"e")
    for value in (chosen, listed):
        (tmp_path / "m.pkl").write_bytes(pickled({"shapedirs": value}))
        with bounded(2**25), pytest.raises(FileFormatError):
            load_pickled_arrays(tmp_path / "m.pkl", ["shapedirs"])


def dtype_of(code):
    state = (3, "|", None, None, None, -1, -1, 0)
    return Raw(pickled(Call("numpy dtype", (code, 0, 1)))[2:-1] + pickled(state)[2:-1] + b"b")


@pytest.mark.parametrize("kind", [np.int8, np.bool_, np.float16, np.uint16, "S1", "U1"])
def test_memory_is_counted_in_the_type_that_arrays_will_have(tmp_path, kind):
    n = 2**27 // (8 if kind not in ("S1", "U1") else 64)
    np.savez_compressed(tmp_path / "a.npz", vectors=np.zeros(n + 100_000 * 8, kind))
    assert (tmp_path / "a.npz").stat().st_size < 2**17
    with bounded(2**24), pytest.raises(FileFormatError, match="far more room"):
        load_arrays(tmp_path / "a.npz", ["vectors"])


def test_a_model_of_bytes_is_counted_as_one_of_numbers(tmp_path):
    fields = smpl_fields(n_vertices=20)
    fields["posedirs"] = np.zeros((100_000, 3, 207), np.int8)
    np.savez_compressed(tmp_path / "m.npz", **fields)
    assert (tmp_path / "m.npz").stat().st_size < 2**20
    with bounded(2**25), pytest.raises(FileFormatError, match="far more room"):
        BodyModel.from_file(tmp_path / "m.npz")


def hdf5(path, **sequences):
    with h5py.File(path, "w") as file:
        file["faces"] = np.array([[0, 1, 2], [1, 2, 3]])
        for name, options in sequences.items():
            file.create_dataset(name.removeprefix("s"), **options)
    return path


OUTSIDE = "larger than it can hold"


def test_chunks_larger_than_their_data(tmp_path):
    options = {"shape": (4, 3, 5), "maxshape": (None, None, None), "dtype": "f4"}
    for chunks in ((4, 3, 4_000_000), (40_000, 1, 1000), (2**20, 2**5, 1)):
        file = hdf5(
            tmp_path / "a.hdf5",
            s50002_hips=options | {"chunks": chunks, "compression": "gzip"},
        )
        with pytest.raises(FileFormatError, match=OUTSIDE):
            load_dfaust(file)
    file = hdf5(tmp_path / "a.hdf5", s50002_hips=options | {"chunks": (40, 3, 1000)})
    assert load_dfaust(file)[0][:].shape == (5, 4, 3)


@pytest.mark.parametrize("n_frames", [2**62, 2**61 + 1, 10**9])
def test_shapes_whose_product_wraps_around(tmp_path, n_frames):
    chunks = {"chunks": (4, 3, 64), "dtype": "f8"}
    file = hdf5(tmp_path / "a.hdf5", s50002_hips={"shape": (4, 3, n_frames)} | chunks)
    with pytest.raises(FileFormatError, match=OUTSIDE):
        load_dfaust(file)


def test_bytes_of_frames_are_counted_as_numbers(tmp_path):
    options = {"shape": (4, 3, 2**22), "dtype": "i1", "chunks": (4, 3, 2**16)}
    with pytest.raises(FileFormatError, match=OUTSIDE):
        load_dfaust(hdf5(tmp_path / "a.hdf5", s50002_hips=options))


def test_frames_that_an_archive_claims_only(tmp_path):
    n_frames = 10**12
    header = {"descr": "<f8", "fortran_order": False, "shape": (n_frames, 3)}
    with zipfile.ZipFile(tmp_path / "a.npz", "w", zipfile.ZIP_DEFLATED) as archive:
        for name, width in (("trans", 3), ("poses", 156), ("betas", 16)):
            with archive.open(f"{name}.npy", "w", force_zip64=True) as member:
                shape = header | {"shape": (n_frames, width)}
                np.lib.format.write_array_header_1_0(member, shape)
            info = archive.getinfo(f"{name}.npy")
            info.file_size += n_frames * width * 8
        with archive.open("mocap_framerate.npy", "w") as member:
            np.lib.format.write_array(member, np.array(60.0))
    model = BodyModel(**model_arguments())
    with bounded(2**25), pytest.raises(FileFormatError, match="far more room"):
        load_amass(tmp_path / "a.npz", model)


def model_arguments():
    fields = smpl_fields(n_vertices=20)
    names = {"f": "faces", "J_regressor": "joint_regressor"}
    return {names.get(name, name): array for name, array in fields.items()}


def test_a_billion_vectors_without_numbers(tmp_path):
    np.save(tmp_path / "v.npy", np.empty((10**18, 0)))
    with bounded(2**22, 1), pytest.raises(FileFormatError, match="n_vectors, n_numbers"):
        LatentVectors.from_file(tmp_path / "v.npy")


@pytest.mark.parametrize("ids", [np.zeros(2**21, np.int8), np.full(2**20, "a")])
def test_ids_are_compared_before_they_become_texts(tmp_path, ids):
    np.savez_compressed(tmp_path / "v.npz", ids=ids, vectors=np.zeros((len(ids), 1), np.int8))
    with bounded(2**26), pytest.raises(FileFormatError, match="ids must differ; repeated ids"):
        LatentVectors.from_file(tmp_path / "v.npz")


def test_a_name_that_is_there_twice(tmp_path):
    np.save(tmp_path / "a.npy", np.ones(3))
    with zipfile.ZipFile(tmp_path / "a.npz", "w") as archive:
        archive.write(tmp_path / "a.npy", "vectors.npy")
        with pytest.warns(UserWarning, match="Duplicate name"):
            archive.write(tmp_path / "a.npy", "vectors.npy")
    with pytest.raises(FileFormatError, match="holds vectors twice"):
        load_arrays(tmp_path / "a.npz", ["vectors"])


@pytest.mark.parametrize("names", [("vectors", "vectors.npy"), ("vectors.npy", "vectors")])
def test_a_name_with_and_without_its_ending(tmp_path, names):
    # NumPy takes the one, and this library would take the other.
    np.save(tmp_path / "a.npy", np.ones(3))
    with zipfile.ZipFile(tmp_path / "a.npz", "w") as archive:
        for name in names:
            archive.write(tmp_path / "a.npy", name)
    with pytest.raises(FileFormatError, match="holds vectors twice"):
        load_arrays(tmp_path / "a.npz", ["vectors"])


def test_nothing_stands_before_an_archive(tmp_path):
    np.savez(tmp_path / "a.npz", a=np.ones(3))
    content = (tmp_path / "a.npz").read_bytes()
    (tmp_path / "a.npz").write_bytes(b"#!/bin/sh\n" + content)
    with pytest.raises(FileFormatError, match="does not begin at the first byte"):
        load_arrays(tmp_path / "a.npz", ["a"])


@pytest.mark.parametrize("extra", [b"\0", b"\n", bytes(8), b"\x93NUMPY"])
def test_bytes_behind_an_array_are_noticed(tmp_path, extra):
    np.save(tmp_path / "v.npy", np.ones((3, 2)))
    content = (tmp_path / "v.npy").read_bytes()
    (tmp_path / "v.npy").write_bytes(content + extra)
    with zipfile.ZipFile(tmp_path / "v.npz", "w") as archive:
        archive.writestr("vectors.npy", content + extra)
    for read in (
        lambda: load_array(tmp_path / "v.npy"),
        lambda: load_array(tmp_path / "v.npy", mode="r"),
        lambda: load_arrays(tmp_path / "v.npz", ["vectors"]),
    ):
        with pytest.raises(FileFormatError, match="takes 48 bytes; found"):
            read()


def test_a_record_of_a_report_is_no_tower_of_lists(tmp_path):
    text = '{"fingerprint": [' + "[]," * 3_000_000 + "[]]}"
    save_arrays(tmp_path / "step.npz", {"about": np.array(text)}, compressed=True)
    assert (tmp_path / "step.npz").stat().st_size < 2**20
    store = ResultStore(tmp_path, {})
    with bounded(2**27):
        step = store.step("step", {}, lambda: ({}, {"computed": True}))
    assert step.record == {"computed": True}
    assert not step.is_reused


@pytest.mark.parametrize("name", ["vectors", "vertex_weights", "explained_variance", "mean"])
@pytest.mark.parametrize("shape", [(0,), (10**15, 0), (0, 10**15, 3), (1, 10**12, 0)])
def test_arrays_without_numbers_claim_nothing(tmp_path, name, shape):
    fields = {"format_version": np.array(1), "vectors": np.eye(3).reshape(3, 1, 3)}
    np.savez(tmp_path / "b.npz", **fields | {name: np.empty(shape)})
    with bounded(2**22, 1), pytest.raises(RiemhumanError):
        DeformationBasis.load(tmp_path / "b.npz")
