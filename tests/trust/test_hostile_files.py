"""Hostile files that were once read, waited for or stumbled over: each is refused now."""

import io
import json
import os
import struct
import tracemalloc
import warnings
import zipfile
import zlib

import h5py
import numpy as np
import pytest
from model_pickles import pickled
from trust.fuzzed_readers import (
    READERS,
    amass_file,
    amass_model,
    index_file,
    latent,
    metric,
    model_fields,
    ply,
    read_job,
    read_store,
    surfaces,
    template,
)
from trust.fuzzing import archive, array_file, array_header

from riemhuman.bodies import BodyModel
from riemhuman.checks import integer_array, real_number
from riemhuman.datasets import load_amass, load_bodies, load_dfaust
from riemhuman.datasets.shrec import load_shrec14, read_classes
from riemhuman.descriptors.latent_vectors import LatentVectors
from riemhuman.errors import (
    ArgumentError,
    ArgumentTypeError,
    DamagedFileWarning,
    FileError,
    FileFormatError,
    RiemhumanError,
)
from riemhuman.io.arrays import load_array, load_arrays
from riemhuman.io.meshes import load_mesh
from riemhuman.io.pickles import load_pickled_arrays
from riemhuman.retrieval import pairwise_job
from riemhuman.retrieval.neighbors import NearestNeighbors
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
def test_pipes_and_devices_are_not_waited_for(valid, put):
    reader, folder = valid
    target = folder / reader.targets[0]
    target.unlink()
    put(target)
    if reader.read is read_store and not target.is_symlink():
        reader.read(folder)  # what is no step is computed again, but through no link
        return
    with pytest.raises(RiemhumanError):
        reader.read(folder)


def zip_of_zeros(name, header, n_bytes):
    """Return an archive of an array of zeros, compressed a thousand times over."""
    block = bytes(2**20)
    squeezer = zlib.compressobj(9, zlib.DEFLATED, -15)
    first = squeezer.compress(header) + squeezer.flush(zlib.Z_FULL_FLUSH)
    one = squeezer.compress(block) + squeezer.flush(zlib.Z_FULL_FLUSH)
    n_blocks = n_bytes // len(block)
    data = first + one * n_blocks + squeezer.flush()
    crc = zlib.crc32(header)
    for _ in range(n_blocks):
        crc = zlib.crc32(block, crc)
    size = len(header) + n_bytes
    local = b"PK\3\4" + struct.pack(
        "<HHHHHIIIHH", 20, 0, 8, 0, 0x21, crc, len(data), size, len(name), 0
    )
    central = b"PK\1\2" + struct.pack(
        "<HHHHHHIIIHHHHHII",
        20,
        20,
        0,
        8,
        0,
        0x21,
        crc,
        len(data),
        size,
        len(name),
        0,
        0,
        0,
        0,
        0,
        0,
    )
    body = local + name + data
    entry = central + name
    end = b"PK\5\6" + struct.pack("<HHHHIIH", 0, 0, 1, 1, len(entry), len(body), 0)
    return body + entry + end


def test_a_zip_bomb_is_not_unpacked(tmp_path):
    n_bytes = 5 * 2**28
    file = tmp_path / "bomb.npz"
    file.write_bytes(zip_of_zeros(b"vectors.npy", array_header([n_bytes // 8]), n_bytes))
    assert file.stat().st_size < 10_000_000
    with zipfile.ZipFile(file) as found:
        assert found.getinfo("vectors.npy").file_size > n_bytes
    tracemalloc.start()
    try:
        with pytest.raises(FileFormatError, match="far more room than a file of its size"):
            load_arrays(file, ["vectors"])
        assert tracemalloc.get_traced_memory()[1] < 2**26
    finally:
        tracemalloc.stop()


def test_zeros_that_compress_well_are_read(tmp_path):
    np.savez_compressed(tmp_path / "a.npz", a=np.zeros((2000, 2000)))
    assert load_arrays(tmp_path / "a.npz", ["a"])["a"].shape == (2000, 2000)


@pytest.mark.parametrize("shape", [[10**12], [10**6, 10**6, 10**6], [-1, -1], [2**62, 4]])
def test_no_memory_for_data_that_are_not_there(shape, tmp_path):
    content = array_header(shape) + bytes(8)
    with zipfile.ZipFile(tmp_path / "a.npz", "w") as file:
        file.writestr("ids.npy", content)
        file.writestr("vectors.npy", content)
    (tmp_path / "a.npy").write_bytes(content)
    tracemalloc.start()
    try:
        with pytest.raises(FileFormatError):
            load_arrays(tmp_path / "a.npz", ["vectors"])
        with pytest.raises(FileFormatError):
            load_array(tmp_path / "a.npy")
        for ending in ("npz", "npy"):
            with pytest.raises(FileFormatError):
                LatentVectors.from_file(tmp_path / f"a.{ending}")
        assert tracemalloc.get_traced_memory()[1] < 2**24
    finally:
        tracemalloc.stop()


def test_no_memory_for_a_header_that_is_not_there(tmp_path):
    content = array_header([3])
    (tmp_path / "a.npy").write_bytes(content[:8] + b"\xff\xff\xff\x7f" + content[12:] + bytes(24))
    with pytest.raises(FileFormatError, match="its header claims 2147483647 bytes"):
        load_array(tmp_path / "a.npy")


def test_entries_of_no_size_are_not_counted_in_billions(tmp_path):
    with zipfile.ZipFile(tmp_path / "a.npz", "w") as file:
        file.writestr("a.npy", array_header([10**15], "<U0"))
    with pytest.raises(FileFormatError, match="takes 0 bytes"):
        load_arrays(tmp_path / "a.npz", ["a"])


def test_members_that_are_no_arrays_are_none(tmp_path):
    with zipfile.ZipFile(tmp_path / "a.npz", "w") as file:
        file.writestr("ids", b"not an array")
        file.writestr("../../escaped.npy", array_file(np.ones(2)))
    with pytest.raises(FileFormatError, match="lacks the fields ids"):
        load_arrays(tmp_path / "a.npz", ["ids"])
    assert load_arrays(tmp_path / "a.npz", []).keys() == {"../../escaped"}
    assert os.listdir(tmp_path) == ["a.npz"]
    assert not (tmp_path.parent.parent / "escaped.npy").exists()


@pytest.mark.parametrize("method", [zipfile.ZIP_BZIP2, zipfile.ZIP_LZMA])
def test_packers_that_know_no_bound_are_refused(method, tmp_path):
    with zipfile.ZipFile(tmp_path / "a.npz", "w", method) as file:
        file.writestr("a.npy", array_file(np.zeros(1000)))
    with pytest.raises(FileFormatError, match="another method than deflate"):
        load_arrays(tmp_path / "a.npz", ["a"])


def test_characters_that_do_not_exist(tmp_path):
    text = np.array([0x110000, 65], np.uint32).view("<U2")
    np.savez(tmp_path / "a.npz", a=text)
    with pytest.raises(FileFormatError, match="characters that do not exist, as 0x110000"):
        load_arrays(tmp_path / "a.npz", ["a"])
    np.savez(tmp_path / "a.npz", a=np.array(["ä"], ">U1"))
    assert load_arrays(tmp_path / "a.npz", ["a"])["a"][0] == "ä"


def test_whole_numbers_that_do_not_fit():
    for array in ([2.0**63], np.array([2**63], np.uint64), [-1e300]):
        with pytest.raises(ArgumentError, match="at most 64 bits"):
            integer_array(array, "faces", ("n",))
    assert integer_array([2.0**62, -(2.0**63)], "faces", ("n",)).tolist() == [2**62, -(2**63)]


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


def test_numbers_of_thousands_of_digits(tmp_path):
    digits = "1" * 5000
    content = ply("ascii")["a.ply"].replace(b"vertex 6", b"vertex " + digits.encode())
    (tmp_path / "0.ply").write_bytes(content)
    with pytest.raises(FileFormatError, match="is not valid: 'element vertex 111"):
        load_mesh(tmp_path / "0.ply")
    (tmp_path / "a.cla").write_text(f"PSB 1 1 2 Ann 0 2 000 {digits}")
    with pytest.raises(FileError, match="lacks 1 of the 2 meshes"):
        load_shrec14(tmp_path)
    assert load_shrec14(tmp_path, allow_missing=True).ids == ("000",)
    (tmp_path / "a.cla").write_text(f"PSB 1 {digits} 2")
    with pytest.raises(FileFormatError, match="number of classes"):
        read_classes(tmp_path / "a.cla")


def test_subjects_of_thousands_of_digits_are_sorted(tmp_path):
    reader = READERS["labels"]
    for name, content in reader.files().items():
        (tmp_path / name).write_bytes(content)
    larger = "2" * 5000
    rows = f"file,subject,pose\nb_0.off,{larger},a\nb_1.off,10,a\nb_2.off,9,a\n"
    (tmp_path / "labels.csv").write_text(rows)
    assert load_bodies(tmp_path).subject_names == ("9", "10", larger)


def test_coordinates_whose_areas_overflow(tmp_path):
    (tmp_path / "a.off").write_text("OFF\n3 1 0\n0 0 0\n1e300 0 0\n0 1e300 0\n3 0 1 2\n")
    with pytest.raises(FileFormatError, match="beyond 1e\\+50"):
        load_mesh(tmp_path / "a.off")
    np.savez(tmp_path / "m.npz", **model_fields() | {"v_template": np.full((8, 3), 1e300)})
    with pytest.raises(FileFormatError, match="beyond 1e\\+50"):
        BodyModel.from_file(tmp_path / "m.npz")


def test_a_basis_whose_products_overflow(tmp_path):
    np.savez(tmp_path / "a.npz", format_version=1, vectors=np.full((2, 4, 3), 1e300))
    with pytest.raises(FileFormatError, match="orthonormal"):
        DeformationBasis.load(tmp_path / "a.npz")


@pytest.mark.parametrize("name", ["poses", "trans", "betas"])
def test_motions_of_no_body(name, tmp_path):
    with np.load(io.BytesIO(amass_file()["a/b_poses.npz"])) as found:
        fields = dict(found)
    fields[name] = np.full_like(fields[name], 1e308)
    (tmp_path / "b.npz").write_bytes(archive(fields))
    with pytest.raises(FileFormatError, match=r"must be angles|beyond 1e\+50"):
        load_amass(tmp_path / "b.npz", amass_model())[0][:]


def test_an_escape_that_there_is_none_of(tmp_path):
    (tmp_path / "a.pkl").write_bytes(b"(dS'\\hello'\nI1\ns.")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        with pytest.raises(FileFormatError, match="malformed or cut off"):
            load_pickled_arrays(tmp_path / "a.pkl", [])


def test_text_of_a_pickle_that_does_not_exist(tmp_path):
    value = np.array([0x110000], np.uint32).view("<U1")
    (tmp_path / "a.pkl").write_bytes(pickled({"joint_names": value}))
    with pytest.raises(FileFormatError, match="do not exist"):
        load_pickled_arrays(tmp_path / "a.pkl", ["joint_names"])


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
def test_hdf5_that_leads_elsewhere(put, name, tmp_path):
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
    with pytest.raises(FileFormatError, match="is damaged"):
        load_dfaust(tmp_path / "a.hdf5")


def test_latent_files_of_another_kind(tmp_path):
    (tmp_path / "v.npy").write_bytes(array_header([3])[:10] + b"(" * 118 + bytes(24))
    with pytest.raises(FileFormatError, match="not an .npy file"):
        LatentVectors.from_file(tmp_path / "v.npy")
    content = latent("npz")["v.npz"].replace(b"ids.npy", b"ids.npx")
    (tmp_path / "v.npz").write_bytes(content)
    with pytest.raises(FileFormatError, match="lacks the fields ids"):
        LatentVectors.from_file(tmp_path / "v.npz")


@pytest.fixture
def index(tmp_path, monkeypatch):
    """Return the arrays of an index, and what reads others in their place."""
    monkeypatch.chdir(tmp_path)
    with np.load(io.BytesIO(index_file()["index.npz"])) as found:
        arrays = dict(found)

    def load(**changes):
        (tmp_path / "index.npz").write_bytes(archive(arrays | changes))
        return NearestNeighbors.load(tmp_path / "index.npz", metric())

    return arrays, load


@pytest.mark.parametrize(
    ("name", "change"),
    [
        ("pivots", lambda a: a[:0]),
        ("pivots", lambda a: a.astype(float)),
        ("pivots", lambda a: a + 1000),
        ("pivots", lambda a: -1 - a),
        ("pivots", lambda a: np.concatenate([a, a])),
        ("points", lambda a: a[0, 0, 0]),
        ("points", lambda a: a.astype("U5")),
        ("points", lambda a: np.where(np.arange(6)[:, None, None] == 5, np.nan, a)),
        ("coordinates", lambda a: a.astype("M8[s]")),
        ("coordinates", lambda a: a * np.nan),
        ("coordinates", lambda a: a + 1e300),
        ("features_0", lambda a: a[:1]),
        ("to_pivots", lambda a: a.T[:1]),
        ("to_pivots", lambda a: a[:, :1]),
        ("to_pivots", lambda a: a.astype(complex)),
        ("to_pivots", lambda a: np.where(a > 0, np.inf, a)),
        ("features_0", lambda a: a.astype(np.float64)),
        ("features_0", lambda a: a[..., :-1]),
        ("features_0", lambda a: a.astype(np.int8)),
        ("probe_distances", lambda a: a.astype("m8[s]")),
        ("probe_distances", lambda a: a[0]),
        ("mean", lambda a: a[:-1]),
        ("components", lambda a: a[:, :-1]),
        ("components", lambda a: 2 * a),
        ("n_neighbors", lambda a: np.float64(np.nan)),
        ("n_neighbors", lambda a: np.arange(3)),
        ("n_neighbors", lambda a: np.array(-2)),
        ("n_patches", lambda a: np.array("text")),
        ("n_patches", lambda a: np.array(np.inf)),
    ],
)
def test_an_index_whose_arrays_do_not_fit(name, change, index):
    arrays, load = index
    assert load().kneighbors(surfaces(2), 1)[0].shape == (2, 1)
    with pytest.raises(RiemhumanError):
        load(**{name: change(arrays[name])})


def test_an_index_with_pivots_of_another_type(index):
    arrays, load = index
    neighbors = load(pivots=arrays["pivots"].astype(np.uint64))
    expected = load().kneighbors(surfaces(2), 2)
    np.testing.assert_array_equal(neighbors.kneighbors(surfaces(2), 2), expected)


def test_features_of_a_job_that_lead_nowhere_are_computed_again(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    files = READERS["job"].files()
    (tmp_path / "job").mkdir(exist_ok=True)
    for file, content in files.items():
        (tmp_path / file).write_bytes(content)
    features = np.load(tmp_path / "job" / "features_0.npy")
    np.save(tmp_path / "job" / "features_0.npy", features.byteswap())
    with pytest.warns(DamagedFileWarning, match=r"features_0.npy is damaged.*points\[0:"):
        distances = pairwise_job(metric(), surfaces(4), tmp_path / "job")
    np.testing.assert_array_equal(distances, metric().dist_pairwise(surfaces(4)))


@pytest.mark.parametrize(
    ("name", "content"),
    [
        ("D.npy", array_file(np.zeros((3, 4)))),
        ("D.npy", array_file(np.zeros((4, 4), np.float32))),
        ("D.npy", array_header([4, 4])[:10] + b"(" * 118 + bytes(128)),
        ("D.npy", array_header([10**11, 10**11]) + bytes(128)),
        ("digests.npy", array_header([2**62, 4]) + bytes(32)),
        ("manifest.json", b"[" * 100_000),
        ("manifest.json", b'{"layout": {"tile": 0, "block": 0}}'),
    ],
)
def test_a_job_whose_files_are_not_its_own(name, content, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "job").mkdir()
    for file, valid_content in READERS["job, complete"].files().items():
        (tmp_path / "job").mkdir(exist_ok=True)
        (tmp_path / file).write_bytes(valid_content)
    (tmp_path / "job" / name).write_bytes(content)
    with pytest.raises(RiemhumanError):
        read_job(tmp_path)


@pytest.mark.parametrize("layout", [{}, {"tile": 0, "block": 1}, {"tile": 2.5, "block": "x"}])
def test_a_job_with_a_layout_that_is_none(layout, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    files = READERS["job"].files()
    (tmp_path / "job").mkdir(exist_ok=True)
    for file, content in files.items():
        (tmp_path / file).write_bytes(content)
    manifest = json.loads(files["job/manifest.json"]) | {"layout": layout}
    (tmp_path / "job" / "manifest.json").write_text(json.dumps(manifest))
    with pytest.raises(FileFormatError, match="manifest"):
        read_job(tmp_path)


def test_a_result_with_an_array_missing_is_computed_anew(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    content = READERS["store"].files()["step.npz"].replace(b"distances.npy", b"distances.npx")
    (tmp_path / "step.npz").write_bytes(content)
    read_store(tmp_path)
