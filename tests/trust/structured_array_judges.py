"""What the library reads of archives, pickles and HDF5 files, and what their makers read."""

import pickle
import re
from collections.abc import Mapping

import h5py
import numpy as np
from model_pickles import smpl_fields
from trust.judging import expect, mesh

from riemhuman.bodies import BodyModel
from riemhuman.datasets import load_amass, load_dfaust
from riemhuman.datasets.bodies import Bodies
from riemhuman.geometry import AlignedSurfaces, ElasticMetric
from riemhuman.retrieval.neighbors import NearestNeighbors
from riemhuman.surfaces.deformation_basis import DeformationBasis
from riemhuman.surfaces.template import Template


class Archive(Mapping):
    """The arrays of an archive, each read when it is asked for."""

    def __init__(self, file):
        self.file = file
        with np.load(file) as archive:
            self.names = [name for name in archive.zip.namelist() if name.endswith(".npy")]

    def __getitem__(self, name):
        if f"{name}.npy" not in self.names:
            raise KeyError(name)
        with np.load(self.file) as archive:
            return archive[f"{name}.npy"]

    def __iter__(self):
        return (name.removesuffix(".npy") for name in self.names)

    def __len__(self):
        return len(self.names)


MODEL = {"v_template": "v_template", "f": "faces", "shapedirs": "shapedirs", "weights": "weights"}
MODEL |= {"J_regressor": "joint_regressor"}


def read_model(file):
    model = BodyModel.from_file(file)
    arrays = {"v_template": model.template.vertices, "parents": model.parents}
    arrays |= {name: getattr(model, attribute) for name, attribute in MODEL.items()
               if name != "v_template"}  # fmt: skip
    return arrays if model.posedirs is None else arrays | {"posedirs": model.posedirs}


class _Plain:
    """Stands for objects of chumpy and of old modules of SciPy."""

    def __setstate__(self, state):
        self.__dict__.update(state)


class _Unpickler(pickle.Unpickler):
    """Python's own reader, with classes that hold their state and do nothing."""

    def find_class(self, module, name):
        if module.startswith(("chumpy", "scipy.sparse")):
            return type(name, (_Plain,), {})
        if module == "__builtin__":
            module = "builtins"
        return super().find_class(module, name)


def _unpickled(value):
    kind = type(value).__name__
    if kind == "Ch":
        return _unpickled(value.x)
    if kind == "Select":
        chosen = _unpickled(value.a).ravel()[np.asarray(_unpickled(value.idxs)).ravel()]
        shape = value.preferred_shape
        return chosen if shape is None else chosen.reshape(_unpickled(shape))
    if kind.endswith(("_matrix", "_array")):
        return _sparse(value)
    return value


def _sparse(value):
    """Fill a sparse matrix entry by entry."""
    shape = value.__dict__["_shape"]
    found = np.zeros(shape)
    if hasattr(value, "row"):
        triples = zip(value.row.tolist(), value.col.tolist(), value.data.tolist(), strict=True)
    else:
        starts, indices = value.indptr.tolist(), value.indices.tolist()
        in_columns = type(value).__name__.startswith("csc")
        expect(len(starts) == shape[in_columns] + 1 and starts[0] == 0, "starts")
        expect(starts == sorted(starts) and starts[-1] <= len(indices), "starts")
        pairs = [(major, k) for major in range(len(starts) - 1)
                 for k in range(starts[major], starts[major + 1])]  # fmt: skip
        triples = [
            (indices[k], major, value.data[k]) if in_columns else (major, indices[k], value.data[k])
            for major, k in pairs
        ]
    for row, column, number in triples:
        expect(0 <= row < shape[0] and 0 <= column < shape[1], "outside")
        found[row, column] += number
    return found


def judge_model(file):
    if file.suffix == ".npz":
        fields = Archive(file)
    else:
        with open(file, "rb") as stream:
            fields = _Unpickler(stream, encoding="latin1").load()
        fields = {name: _unpickled(value) for name, value in fields.items()}
    arrays = {name: np.asarray(fields[name], np.float64) for name in MODEL if name != "f"}
    found = mesh(fields["v_template"], fields["f"])
    n_vertices, n_joints = len(found["vertices"]), len(arrays["J_regressor"])
    parents, numbers = np.asarray(fields["kintree_table"]).tolist()
    expect(len(parents) == n_joints == len(set(numbers)), "joints")
    places = {number: place for place, number in enumerate(numbers)} | {-1: -1, 2**32 - 1: -1}
    arrays |= {"f": found["faces"], "parents": np.array([places[number] for number in parents])}
    expect(arrays["weights"].shape == (n_vertices, n_joints), "weights")
    expect(arrays["J_regressor"].shape == (n_joints, n_vertices), "regressor")
    expect(arrays["shapedirs"].shape[:2] == (n_vertices, 3), "shapedirs")
    if "posedirs" in fields:
        posedirs, n_entries = np.asarray(fields["posedirs"], np.float64), 9 * (n_joints - 1)
        if posedirs.shape == (n_vertices, 3, n_entries):
            arrays["posedirs"] = posedirs
        elif posedirs.shape == (3 * n_vertices, n_entries):
            arrays["posedirs"] = posedirs.reshape(n_vertices, 3, n_entries)
        else:
            flat = posedirs.reshape(n_entries, 3 * n_vertices)
            arrays["posedirs"] = flat.T.reshape(n_vertices, 3, n_entries)
    return arrays


def read_basis(file):
    basis = DeformationBasis.load(file)
    names = ("vertex_weights", "explained_variance", "explained_variance_ratio", "mean")
    arrays = {name: getattr(basis, name) for name in names}
    return {"vectors": basis.vectors} | {k: v for k, v in arrays.items() if v is not None}


def judge_basis(file):
    found = Archive(file)
    expect(found["format_version"].tolist() == 1, "version")
    names = ("vectors", "vertex_weights", "explained_variance", "explained_variance_ratio", "mean")
    fields = {name: found[name].astype(np.float64) for name in names if name in found}
    flat, weights = fields["vectors"].reshape(len(fields["vectors"]), -1), 1.0
    if "vertex_weights" in fields:
        expect((fields["vertex_weights"] > 0).all(), "weights")
        fields["vertex_weights"] = fields["vertex_weights"] / fields["vertex_weights"].mean()
        weights = np.repeat(fields["vertex_weights"], 3)
    expect(np.allclose(flat * weights @ flat.T, np.eye(len(flat)), atol=1e-7), "not orthonormal")
    return fields


BODIES = ("points", "subject", "pose", "betas", "subject_names", "pose_names")


def read_bodies(file):
    bodies = Bodies.load(file)
    arrays = {name: np.asarray(getattr(bodies, name)) for name in BODIES
              if getattr(bodies, name) is not None}  # fmt: skip
    arrays |= {"template_vertices": bodies.template.vertices}
    return arrays | {"template_faces": bodies.template.faces}


def judge_bodies(file):
    fields = Archive(file)
    expect(fields["format_version"].tolist() == 1, "version")
    found = mesh(fields["template_vertices"], fields["template_faces"])
    arrays = {name: np.asarray(fields[name]) for name in BODIES if name in fields}
    for name in ("points", "betas"):
        if name in arrays:
            expect(
                np.isfinite(arrays[name]).all() and len(arrays[name]) == len(arrays["points"]), ""
            )
    for name in ("subject", "pose"):
        names = arrays[f"{name}_names"] = np.array(
            [str(k) for k in fields[f"{name}_names"].tolist()]
        )
        expect(all(0 <= k < len(names) for k in arrays[name].tolist()), "labels")
    expect(arrays["points"].shape[1:] == found["vertices"].shape, "points")
    return arrays | {f"template_{name}": array for name, array in found.items()}


def _arguments(fields):
    names = {"f": "faces", "J_regressor": "joint_regressor"}
    return {names.get(name, name): array for name, array in fields.items()}


AMASS_MODEL = BodyModel(**_arguments(smpl_fields(22, n_vertices=6, n_betas=4)))


def read_amass(file):
    (motion,) = load_amass(file, AMASS_MODEL, up="z")
    found = {"betas": motion.betas, "poses": motion.pose_vectors, "trans": motion.translations}
    return found | {"rate": np.array(motion.frames_per_second)}


def judge_amass(file):
    fields = Archive(file)
    rate = fields["mocap_framerate" if "mocap_framerate" in fields else "mocap_frame_rate"]
    expect(rate.ndim == 0 and np.isfinite(rate) and rate > 0, "rate")
    trans = fields["trans"].astype(np.float64)
    if "poses" in fields and "root_orient" not in fields and "pose_body" not in fields:
        poses = fields["poses"].astype(np.float64)
    else:
        poses = np.concatenate([fields["root_orient"], fields["pose_body"]], axis=1)
    poses = poses.astype(np.float64)[:, :66].reshape(len(trans), 22, 3)
    betas = np.zeros(4)
    given = fields["betas"].astype(np.float64).ravel()[:4]
    betas[: len(given)] = given
    expect(np.isfinite(poses).all() and np.isfinite(trans).all(), "not finite")
    return {"betas": betas, "poses": poses, "trans": trans, "rate": rate.astype(np.float64)}


def metric_of_index():
    template = Template(np.insert(np.eye(3), 0, 0.0, axis=0), [[0, 1, 2], [1, 2, 3]])
    return ElasticMetric(AlignedSurfaces(template), a=1.0, lam=0.1)


METRIC = metric_of_index()
INDEX = ("points", "pivots", "to_pivots", "coordinates")


def read_index(file):
    found = NearestNeighbors.load(file, METRIC)
    found.kneighbors(METRIC.space.template.vertices[None])
    arrays = {name: np.asarray(getattr(found._index, name)) for name in INDEX}
    return arrays | {"n_neighbors": np.array(found.n_neighbors)}


def judge_index(file):
    fields = Archive(file)
    expect(all(0 <= k < len(fields["points"]) for k in fields["pivots"].tolist()), "pivots")
    return {name: fields[name] for name in (*INDEX, "n_neighbors")}


def read_motion(file):
    motions = load_dfaust(file)
    found = {f"{each.subject}_{each.sequence}": each[:] for each in motions}
    return found | {"faces": motions[0].faces}


def judge_motion(file):
    with h5py.File(file) as contents:
        faces = contents["faces"][...]
        names = [k for k in contents if isinstance(k, str) and re.fullmatch(r"[0-9]+_\w+", k)]
        found = {name: np.moveaxis(contents[name][...], -1, 0) for name in names}
    expect(faces.min() >= 0, "faces")
    for frames in found.values():
        expect(frames.ndim == 3 and frames.shape[1:] == (int(faces.max()) + 1, 3), "shape")
        expect(np.isfinite(frames).all(), "not finite")
    return found | {"faces": faces}
