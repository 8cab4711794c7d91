"""Hostile files: small ones that ask for much memory, lead out of arrays, or never end."""

import io
import os
import time
import tracemalloc
import zipfile
from contextlib import contextmanager

import h5py
import numpy as np
import pytest
from model_pickles import Call, Ch, Raw, Select, Sparse, pickled, smpl_fields
from scipy import sparse
from trust.fuzzed_readers import (
    READERS,
    amass_file,
    amass_model,
    ply,
    surfaces,
    template,
)
from trust.fuzzing import archive, array_file, array_header

from riemhuman.bodies import BodyModel
from riemhuman.checks import real_number
from riemhuman.datasets import load_amass, load_bodies, load_dfaust
from riemhuman.datasets.shrec import load_shrec14
from riemhuman.descriptors.latent_vectors import LatentVectors
from riemhuman.errors import (
    ArgumentTypeError,
    FileFormatError,
    RiemhumanError,
)
from riemhuman.io.arrays import load_array, load_arrays
from riemhuman.io.meshes import load_mesh
from riemhuman.io.pickles import load_pickled_arrays
from riemhuman.surfaces.deformation_basis import DeformationBasis

SHORT = 700


@pytest.fixture(params=[name for name in READERS if name != "careless"])
def valid(request, tmp_path, monkeypatch):
    """Return a reader, and a folder with its valid files."""
    monkeypatch.chdir(tmp_path)
    reader = READERS[request.param]
    for name, content in reader.files().items():
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).write_bytes(content)
    return reader, tmp_path


def test_valid_files_are_read(valid):
    reader, folder = valid
    reader.read(folder)


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="there are no pipes")
@pytest.mark.parametrize("put", [os.mkfifo, lambda path: os.symlink("/dev/zero", path)])
def test_pipes_and_devices_are_refused(valid, put):
    reader, folder = valid
    target = folder / reader.targets[0]
    target.unlink()
    put(target)
    with pytest.raises(RiemhumanError):
        reader.read(folder)


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


@pytest.mark.parametrize("shape", [[10**12], [10**6, 10**6, 10**6], [-1, -1], [2**62, 4]])
def test_no_memory_for_missing_data(shape, tmp_path):
    content = array_header(shape) + bytes(8)
    with zipfile.ZipFile(tmp_path / "a.npz", "w") as file:
        file.writestr("ids.npy", content)
        file.writestr("vectors.npy", content)
    (tmp_path / "a.npy").write_bytes(content)
    for read in (
        lambda: load_arrays(tmp_path / "a.npz", ["vectors"]),
        lambda: load_array(tmp_path / "a.npy"),
        lambda: LatentVectors.from_file(tmp_path / "a.npz"),
        lambda: LatentVectors.from_file(tmp_path / "a.npy"),
    ):
        with bounded(2**24), pytest.raises(FileFormatError):
            read()


def test_members_that_are_no_arrays_are_ignored(tmp_path):
    with zipfile.ZipFile(tmp_path / "a.npz", "w") as file:
        file.writestr("ids", b"not an array")
        file.writestr("../../escaped.npy", array_file(np.ones(2)))
    with pytest.raises(FileFormatError, match="lacks the fields ids"):
        load_arrays(tmp_path / "a.npz", ["ids"])
    assert load_arrays(tmp_path / "a.npz", []).keys() == {"../../escaped"}
    assert os.listdir(tmp_path) == ["a.npz"]
    assert not (tmp_path.parent.parent / "escaped.npy").exists()


@pytest.mark.parametrize("method", [zipfile.ZIP_BZIP2, zipfile.ZIP_LZMA])
def test_other_compressions_are_refused(method, tmp_path):
    with zipfile.ZipFile(tmp_path / "a.npz", "w", method) as file:
        file.writestr("a.npy", array_file(np.zeros(1000)))
    with pytest.raises(FileFormatError, match="another method than deflate"):
        load_arrays(tmp_path / "a.npz", ["a"])


def test_characters_beyond_unicode(tmp_path):
    text = np.array([0x110000, 65], np.uint32).view("<U2")
    np.savez(tmp_path / "a.npz", a=text)
    with pytest.raises(FileFormatError, match="characters that do not exist, as 0x110000"):
        load_arrays(tmp_path / "a.npz", ["a"])
    (tmp_path / "a.pkl").write_bytes(pickled({"joint_names": text}))
    with pytest.raises(FileFormatError, match="do not exist"):
        load_pickled_arrays(tmp_path / "a.pkl", ["joint_names"])
    np.savez(tmp_path / "a.npz", a=np.array(["ä"], ">U1"))
    assert load_arrays(tmp_path / "a.npz", ["a"])["a"][0] == "ä"


def test_messages_do_not_quote_all_of_a_file(tmp_path):
    long = "x" * 10_000
    with pytest.raises(ArgumentTypeError) as caught:
        real_number(long, "rate")
    messages = [str(caught.value)]
    (tmp_path / "a.ply").write_bytes(b"ply\n" + b"(" * 10_000 + ply("ascii")["a.ply"][3:])
    (tmp_path / "a.cla").write_text(f"PSB 1 1 1 {long} 0 1 {long}")
    (tmp_path / "0.off").write_text("OFF\n")
    (tmp_path / "labels.csv").write_text(f"file,subject,pose\n{long},a,b\n")
    (tmp_path / "v.csv").write_text(f"id,x\n{long},1\n{long},2\n")
    np.savez(tmp_path / "a.npz", format_version=np.array(long), vectors=np.ones(3))
    for read in (
        lambda: load_mesh(tmp_path / "a.ply"),
        lambda: load_shrec14(tmp_path),
        lambda: load_bodies(tmp_path),
        lambda: LatentVectors.from_file(tmp_path / "v.csv"),
        lambda: DeformationBasis.load(tmp_path / "a.npz"),
    ):
        with pytest.raises(RiemhumanError) as caught:
            read()
        messages.append(str(caught.value))
    assert max(map(len, messages)) < SHORT


@pytest.mark.parametrize("name", ["poses", "trans", "betas"])
def test_motions_that_overflow(name, tmp_path):
    with np.load(io.BytesIO(amass_file()["a/b_poses.npz"])) as found:
        fields = dict(found)
    fields[name] = np.full_like(fields[name], 1e308)
    (tmp_path / "b.npz").write_bytes(archive(fields))
    with pytest.raises(FileFormatError, match=r"must be angles|beyond 1e\+50"):
        load_amass(tmp_path / "b.npz", amass_model())[0][:]


def hdf5(path, put):
    with h5py.File(path, "w") as file:
        file["faces"] = template().faces
        file["50002_hips"] = surfaces(4).transpose(1, 2, 0)
        put(file)
    return path


OUTSIDE = "lies outside the file, or is larger than it can hold"


@pytest.mark.parametrize("name", ["50002_knees", "faces"])
@pytest.mark.parametrize(
    "put",
    [
        lambda file, name: file.__setitem__(name, h5py.SoftLink("/nowhere")),
        lambda file, name: file.__setitem__(name, h5py.SoftLink(f"/{name}")),
        lambda file, name: file.__setitem__(name, h5py.ExternalLink("other.hdf5", "/faces")),
        lambda file, name: file.create_dataset(
            name, (6, 3, 4), "u1", external=[("/etc/passwd", 0, h5py.h5f.UNLIMITED)]
        ),
        lambda file, name: file.create_dataset(name, (6, 3, 10**11), "f8", chunks=(6, 3, 8)),
    ],
    ids=["dangling", "circular", "external link", "external data", "oversize"],
)
def test_hdf5_links_out_of_the_file(put, name, tmp_path):
    def replace(file):
        if name in file:
            del file[name]
        put(file, name)

    hdf5(tmp_path / "other.hdf5", lambda file: None)
    with pytest.raises(FileFormatError, match=OUTSIDE):
        load_dfaust(hdf5(tmp_path / "a.hdf5", replace))


def test_hdf5_damaged_within(tmp_path):
    content = READERS["dynamic faust"].files()["a.hdf5"]
    position = content.index(b"HEAP")
    (tmp_path / "a.hdf5").write_bytes(content[:position] + b"\0\0" + content[position + 2 :])
    with pytest.raises(FileFormatError, match="is damaged|cannot read"):
        load_dfaust(tmp_path / "a.hdf5")


def csc(changes):
    matrix = Sparse(sparse.csc_matrix(np.eye(3)), changes=changes)
    return pickled({"J_regressor": matrix, "notes": "of old"})


@pytest.mark.parametrize("number", [-(2**63), -1, 2**31, 2**32, 2**62, 2**63 - 1])
@pytest.mark.parametrize("name", ["indptr", "indices"])
def test_indices_of_sparse_matrices_are_checked_before_arithmetic(tmp_path, name, number):
    for place in range(3):
        changed = np.array([0, 1, 2, 3] if name == "indptr" else [0, 1, 2], np.int64)
        changed[place] = number
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


def test_a_sparse_matrix_of_any_shape_stays_sparse(tmp_path):
    huge = {"_shape": (10**6, 10**6), "indptr": np.zeros(10**6 + 1, np.int8)}
    empty = Sparse(sparse.csc_matrix((3, 3)), changes=huge)
    fields = smpl_fields(n_vertices=20) | {"weights": empty, "J_regressor": empty}
    (tmp_path / "m.pkl").write_bytes(pickled(fields))
    with bounded(), pytest.raises(FileFormatError, match="weights must not be a sparse matrix"):
        BodyModel.from_file(tmp_path / "m.pkl")


def test_selections_of_selections_take_no_memory(tmp_path):
    zeros = np.zeros(20_000, np.int8)
    (tmp_path / "m.pkl").write_bytes(with_memo(zeros, depth=6))
    with bounded(2**25, 2):
        found = load_pickled_arrays(tmp_path / "m.pkl", ["shapedirs"])
    assert found["shapedirs"].nbytes == zeros.nbytes


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


def test_frames_that_an_archive_claims_only(tmp_path):
    with zipfile.ZipFile(tmp_path / "a.npz", "w", zipfile.ZIP_DEFLATED) as archive:
        for name, width in (("trans", 3), ("poses", 156), ("betas", 16)):
            archive.writestr(f"{name}.npy", array_header((10**12, width)))
            archive.getinfo(f"{name}.npy").file_size += 10**12 * width * 8
        archive.writestr("mocap_framerate.npy", array_file(np.array(60.0)))
    with bounded(2**25), pytest.raises(FileFormatError, match="far more memory"):
        load_amass(tmp_path / "a.npz", amass_model())


def test_a_name_that_is_there_twice(tmp_path):
    np.save(tmp_path / "a.npy", np.ones(3))
    with zipfile.ZipFile(tmp_path / "a.npz", "w") as archive:
        archive.write(tmp_path / "a.npy", "vectors.npy")
        with pytest.warns(UserWarning, match="Duplicate name"):
            archive.write(tmp_path / "a.npy", "vectors.npy")
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


@pytest.mark.parametrize("name", ["vectors", "vertex_weights", "explained_variance", "mean"])
def test_arrays_without_numbers_claim_nothing(tmp_path, name):
    fields = {"format_version": np.array(1), "vectors": np.eye(3).reshape(3, 1, 3)}
    for shape in ((0,), (10**15, 0), (0, 10**15, 3), (1, 10**12, 0)):
        np.savez(tmp_path / "b.npz", **fields | {name: np.empty(shape)})
        with bounded(2**22, 1), pytest.raises(RiemhumanError):
            DeformationBasis.load(tmp_path / "b.npz")
