"""Archives, pickles and HDF5 files of arrays, their headers written from a grammar."""

import io
import math
import pickle
import tempfile
import zipfile
from functools import cache

import h5py
import numpy as np
from model_pickles import Call, Ch, Raw, Select, Sparse, pickled, smpl_fields
from scipy import sparse
from trust.structured_fields import DTYPES, NAMES

from riemhuman.geometry import AlignedSurfaces, ElasticMetric
from riemhuman.retrieval.neighbors import NearestNeighbors
from riemhuman.surfaces.template import Template


def npy(array, fields):
    """Return an array as .npy, its header written here."""
    array = fields.array(array)
    columns = array.flags.f_contiguous and array.ndim > 1
    shape = tuple(fields.whole(length) for length in array.shape)
    if fields.of(False, [True]):
        shape = fields.rng.choice([(10**18, 0), (0, 2**62), (), (*shape, 1), shape[:-1]])
    said = fields.of(array.dtype.str, DTYPES)
    text = f"{{'descr': {said!r}, 'fortran_order': {fields.of(columns, [not columns])}, "
    text = fields.of(text, [text.replace(":", " "), text * 2, "{" * 500]) + f"'shape': {shape}, }}"
    version = fields.of((1, 0), [(2, 0), (3, 0), (0, 0), (255, 1)])
    wide = version[0] in (2, 3)
    text += " " * (-(len(text) + 11 + 2 * wide) % 64) + "\n"
    size = 4 if wide else 2
    length = (fields.whole(len(text)) % 256**size).to_bytes(size, "little")
    return b"\x93NUMPY" + bytes(version) + length + text.encode() + array.tobytes("A")


def npz(arrays, rng, fields):
    stream = io.BytesIO()
    method = fields.of(rng.choice([0, 8]), [zipfile.ZIP_BZIP2])
    with zipfile.ZipFile(stream, "w", method) as archive:
        for name, array in fields.some(arrays.items()):
            name = fields.of(name, [*NAMES, "../a", name + ".npy"]) + fields.of(
                ".npy", ["", ".NPY"]
            )
            if name and name not in archive.NameToInfo:
                # By its own record, which has no date of today.
                archive.writestr(zipfile.ZipInfo(name), npy(array, fields), method)
    content = bytearray(stream.getvalue())
    # Sizes and offsets in the table of contents, each of four bytes.
    place = content.find(b"PK\1\2")
    for offset in (16, 20, 24, 42):
        found = int.from_bytes(content[place + offset : place + offset + 4], "little")
        content[place + offset : place + offset + 4] = (fields.whole(found) % 2**32).to_bytes(
            4, "little"
        )
    return bytes(content)


def write_npy(rng, fields):
    numbers = np.random.default_rng(rng.randrange(10**9))
    array = numbers.normal(size=rng.choice([(), (4,), (3, 2), (2, 3, 2), (0, 3), (5, 1)]))
    array = (10 * array).astype(rng.choice(["f8", ">f8", "f4", "i1", "u2", "i8", "c16", "?", "U4"]))
    return {"a.npy": npy(np.asarray(array), fields)}


def write_npz(rng, fields):
    arrays = {name: np.arange(rng.randint(0, 6), dtype=rng.choice(["f8", "i2"])) for name in "abc"}
    return {"a.npz": npz(arrays, rng, fields)}


def write_vectors_npz(rng, fields):
    n = rng.randint(1, 5)
    ids = np.array([f"b{k}" for k in range(n)]) if rng.random() < 0.5 else np.arange(n)
    return {"a.npz": npz({"ids": ids, "vectors": np.ones((n, 2)) * rng.random()}, rng, fields)}


def write_vectors_npy(rng, fields):
    return {"a.npy": npy(np.full((rng.randint(1, 5), 2), rng.random()), fields)}


def _model_arrays(rng):
    n_joints = rng.choice([22, 24])
    return smpl_fields(n_joints, n_vertices=6, n_betas=2, rng=rng.randrange(1000))


def write_model_npz(rng, fields):
    return {"a.npz": npz(_model_arrays(rng), rng, fields)}


def write_model_pickle(rng, fields):
    arrays = _model_arrays(rng)
    changed = {name: fields.array(array) for name, array in arrays.items()}
    regressor = sparse.csc_matrix(arrays["J_regressor"])
    layout = rng.choice(["csc", "csr", "coo"])
    regressor = regressor.asformat(layout)
    names = ("row", "col") if layout == "coo" else ("indices", "indptr")
    parts = {name: np.array(getattr(regressor, name), rng.choice([np.int32, np.int64]))
             for name in names}  # fmt: skip
    for array in parts.values():
        for place in rng.sample(range(len(array)), 4):
            value = fields.whole(int(array[place])) % 2 ** (8 * array.itemsize)
            array[place] = np.array(value, np.uint64).astype(array.dtype)
    shape = tuple(fields.whole(length) for length in regressor.shape)
    changes = {name: fields.array(array) for name, array in parts.items()}
    changes |= {"data": fields.array(regressor.data), "_shape": shape}
    module = f"scipy.sparse.{layout}"
    changed["J_regressor"] = Sparse(regressor, module, f"{layout}_matrix", changes)
    entries = arrays["shapedirs"].ravel()
    chosen = np.arange(entries.size)
    for place in rng.sample(range(entries.size), 3):
        chosen[place] = np.array(fields.whole(place) % 2**64, np.uint64).astype(np.int64)
    where = tuple(fields.whole(length) for length in arrays["shapedirs"].shape)
    changed["shapedirs"] = Select(Ch(entries), fields.array(chosen), where)
    changed["v_template"] = Ch(changed["v_template"])
    changed = dict(fields.some(changed.items()))
    if rng.random() < 0.2:
        # As Python writes it today.
        plain = {name: fields.array(array) for name, array in arrays.items()}
        return {"a.pkl": pickle.dumps(plain, rng.randrange(6))}
    changed["notes"] = fields.of("a", [Call("os system", ("true",)), Raw(b"\x85"), Raw(b"q\xff")])
    return {"a.pkl": pickled(changed, fields.of(2, [0]))}


def write_basis(rng, fields):
    vectors = np.eye(6)[: rng.randint(1, 4)].reshape(-1, 2, 3)
    arrays = {"format_version": np.array(1), "vectors": vectors}
    arrays |= {"vertex_weights": np.ones(2), "explained_variance": np.arange(len(vectors))[::-1]}
    return {"a.npz": npz(arrays, rng, fields)}


def write_bodies(rng, fields):
    n = rng.randint(1, 3)
    points = (
        np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]])
        * np.arange(1, n + 1)[:, None, None]
    )
    arrays = {"format_version": np.array(1), "template_vertices": points[0], "points": points}
    arrays |= {"template_faces": np.array([[0, 1, 2], [1, 2, 3]]), "subject": np.arange(n) % 2}
    arrays |= {"pose": np.arange(n), "subject_names": np.array(["a", "b"])}
    arrays |= {"pose_names": np.array([f"p{k}" for k in range(n)]), "betas": np.ones((n, 2))}
    return {"a.npz": npz(arrays, rng, fields)}


def write_amass(rng, fields):
    n = rng.randint(1, 4)
    arrays = {"trans": np.arange(3.0 * n).reshape(n, 3), "betas": np.ones(rng.choice([2, 16]))}
    arrays |= {
        "mocap_framerate": np.array(60.0),
        "gender": np.array(rng.choice(["male", b"female"])),
    }
    if rng.random() < 0.5:
        arrays["poses"] = np.full((n, rng.choice([66, 72, 156])), 0.1)
    else:
        arrays |= {"root_orient": np.full((n, 3), 0.1), "pose_body": np.full((n, 63), 0.2)}
    return {"a.npz": npz(arrays, rng, fields)}


@cache
def _index_arrays(n_points, n_neighbors):
    template = Template(np.insert(np.eye(3), 0, 0.0, axis=0), [[0, 1, 2], [1, 2, 3]])
    metric = ElasticMetric(AlignedSurfaces(template), a=1.0, lam=0.1)
    noise = np.random.default_rng(n_points).normal(scale=0.1, size=(n_points, 4, 3))
    with tempfile.TemporaryDirectory() as folder:
        neighbors = NearestNeighbors(metric, n_neighbors, n_pivots=2, n_components=2)
        neighbors.fit(template.vertices + noise).save(f"{folder}/index.npz")
        with np.load(f"{folder}/index.npz") as archive:
            return dict(archive)


def write_index(rng, fields):
    return {"a.npz": npz(_index_arrays(rng.randint(3, 5), rng.randint(1, 3)), rng, fields)}


def write_motion(rng, fields):
    stream = io.BytesIO()
    n_frames = rng.randint(1, 5)
    with h5py.File(stream, "w") as file:
        faces = np.array([[0, 1, 2], [1, 2, 3]], rng.choice(["i4", "u4", "i8", "u1"]))
        _put(file, fields.of("faces", ["f", "triangles"]), fields.array(faces), {})
        for number in range(rng.randint(1, 2)):
            points = np.arange(12.0 * n_frames).reshape(4, 3, n_frames)
            points = fields.array(points.astype(rng.choice(["f8", "f4", ">f4", "i2"])))
            options = {"shape": tuple(abs(fields.whole(length)) for length in points.shape)}
            if rng.random() < 0.5 and points.ndim:
                chunks = (max(1, min(length, 3)) for length in points.shape)
                options["chunks"] = tuple(max(1, abs(fields.whole(length))) for length in chunks)
                options["maxshape"] = (None,) * points.ndim
                options["compression"] = fields.of(None, ["gzip", "lzf"])
            if points.dtype.kind in "fiub":
                options["fillvalue"] = fields.of(None, [7])
            name = fields.of(f"5000{number}_hips", [*NAMES[1:], "50002_hips", "5_"])
            _put(file, name, points, options)
    return {"a.hdf5": stream.getvalue()}


def _put(file, name, array, options):
    """Write a dataset, as far as HDF5 can hold it."""
    try:
        made = file.create_dataset(name, **({"shape": array.shape, "dtype": array.dtype} | options))
        # HDF5 itself does not survive the writing of chunks of any size.
        if made.shape == array.shape and math.prod(made.chunks or ()) < 2**20:
            made[...] = array
    except (OSError, OverflowError, RuntimeError, TypeError, ValueError):
        file.attrs[name] = "not to be written"
