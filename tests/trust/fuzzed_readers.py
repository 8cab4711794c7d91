"""Every reader of the library with a small valid file, and what holds of all it may return."""

from __future__ import annotations

import contextlib
import io
import pickle
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any
from unittest import mock

import h5py
import numpy as np
from model_pickles import smpl_fields, smpl_pickle
from trust.fuzzing import ARCHIVES, BYTES, PICKLES, Mutation, archive

import riemhuman as rh
from riemhuman.bodies import BodyModel, convert_model
from riemhuman.datasets import load_amass, load_dfaust
from riemhuman.io.job_folder import JobFolder
from riemhuman.io.meshes import load_mesh, save_mesh
from riemhuman.retrieval import pairwise_job

Files = dict[str, bytes]


@dataclass(frozen=True)
class Reader:
    """A reader: its valid files, which of them are damaged, how, and how it is called."""

    files: Callable[[], Files]
    targets: tuple[str, ...]
    read: Callable[[Path], None]
    mutations: tuple[Mutation, ...] = BYTES


def finite(array: Any, shape: tuple[int | None, ...]) -> None:
    """Assert that an array holds finite numbers in this shape, None standing for any length."""
    values = np.asarray(array)
    assert values.dtype.kind in "fiu", values.dtype
    assert values.ndim == len(shape), values.shape
    assert all(e in (None, n) for e, n in zip(shape, values.shape, strict=True)), values.shape
    assert np.isfinite(values).all(), "not finite"


def check_mesh(vertices: Any, faces: Any) -> None:
    finite(vertices, (None, 3))
    finite(faces, (None, 3))
    assert faces.size
    assert faces.min() >= 0
    assert faces.max() < len(vertices)


@cache
def template() -> rh.Template:
    """Return an octahedron, its corners moved a little."""
    corners = np.concatenate([np.eye(3), -np.eye(3)])
    corners += np.random.default_rng(1).uniform(-0.1, 0.1, (6, 3))
    faces = [[0, 1, 2], [1, 3, 2], [3, 4, 2], [4, 0, 2], [1, 0, 5], [3, 1, 5], [4, 3, 5], [0, 4, 5]]
    return rh.Template(corners, faces)


def surfaces(n_surfaces: int) -> np.ndarray:
    noise = np.random.default_rng(2).uniform(-0.2, 0.2, (n_surfaces, 6, 3))
    return template().vertices + noise


@cache
def metric() -> rh.ElasticMetric:
    return rh.ElasticMetric(rh.AlignedSurfaces(template(), equip=False), a=1.0, lam=0.1, c=0.5)


def written(folder: Path) -> Files:
    """Return the content of every file in a folder."""
    return {
        str(file.relative_to(folder)): file.read_bytes()
        for file in sorted(folder.rglob("*"))
        if file.is_file()
    }


def mesh_file(name: str) -> Files:
    vertices, faces = template().vertices, template().faces
    save_mesh(Path(name), vertices, faces)
    return _content_of(name)


def ply(order: str) -> Files:
    """Return a PLY file with colours, as text or binary."""
    vertices, faces = template().vertices, template().faces
    header = (
        f"ply\nformat {order} 1.0\ncomment made up\nelement vertex 6\nproperty float x\n"
        "property float y\nproperty float z\nproperty uchar red\nelement face 8\n"
        "property list uchar int vertex_indices\nend_header\n"
    )
    if order == "ascii":
        lines = [" ".join(f"{x:.6f}" for x in row) + " 7" for row in vertices]
        lines += ["3 " + " ".join(map(str, face)) for face in faces]
        return {"a.ply": header.encode() + "\n".join(lines).encode() + b"\n"}
    rows = np.zeros(6, [("x", "<f4", 3), ("red", "u1")])
    rows["x"] = vertices
    triangles = np.zeros(8, [("n", "u1"), ("i", "<i4", 3)])
    triangles["n"], triangles["i"] = 3, faces
    return {"a.ply": header.encode() + rows.tobytes() + triangles.tobytes()}


def obj() -> Files:
    content = mesh_file("a.obj")["a.obj"].decode().replace("f 1 2 3", "f 1/1/1 2//2 -4/3")
    return {"a.obj": ("# made up\nmtllib x.mtl\nvt 0 0\no body\n" + content).encode()}


def read_mesh(name: str) -> Callable[[Path], None]:
    return lambda folder: check_mesh(*load_mesh(folder / name))


def basis_file() -> Files:
    rh.DeformationBasis.from_laplacian(template(), 4).save("basis.npz")
    with np.load(io.BytesIO(_content_of("basis.npz")["basis.npz"])) as found:
        arrays = dict(found)
    extra = {"explained_variance": np.ones(4), "explained_variance_ratio": np.full(4, 0.2)}
    return {"basis.npz": archive(arrays | extra)}


def read_basis(folder: Path) -> None:
    basis = rh.DeformationBasis.load(folder / "basis.npz")
    finite(basis.vectors, (len(basis), basis.n_vertices, 3))
    gram = basis.flat @ basis.flat.T
    assert np.abs(gram - np.eye(len(basis))).max() < 1e-6
    for name, shape in (
        ("explained_variance", (len(basis),)),
        ("explained_variance_ratio", (len(basis),)),
        ("mean", (basis.n_vertices, 3)),
    ):
        if getattr(basis, name) is not None:
            finite(getattr(basis, name), shape)


@cache
def model_fields() -> dict[str, Any]:
    """Return a model of three joints in a row."""
    fields = smpl_fields(22, n_vertices=8, n_betas=2)
    weights, regressor = fields["weights"][:, :3], fields["J_regressor"][:3]
    return fields | {
        "weights": weights / weights.sum(axis=1, keepdims=True),
        "J_regressor": regressor,
        "kintree_table": np.array([[2**32 - 1, 0, 1], [0, 1, 2]], dtype=np.uint32),
        "posedirs": fields["posedirs"][..., :18],
    }


def check_model(model: BodyModel) -> None:
    n_vertices, n_joints = model.n_vertices, model.n_joints
    finite(model.faces, (None, 3))
    assert model.faces.max() < n_vertices
    finite(model.weights, (n_vertices, n_joints))
    finite(model.template.vertices, (n_vertices, 3))
    finite(model.shapedirs, (n_vertices, 3, model.n_betas))


def read_model(name: str) -> Callable[[Path], None]:
    return lambda folder: check_model(BodyModel.from_file(folder / name))


def read_and_convert(folder: Path) -> None:
    check_model(convert_model(folder / "model.pkl", folder / "converted.npz"))
    check_model(BodyModel.from_file(folder / "converted.npz"))


def hdf5_file() -> Files:
    stream = io.BytesIO()
    frames = surfaces(5).transpose(1, 2, 0)
    with h5py.File(stream, "w") as file:
        file["faces"] = template().faces
        file["50002_hips"] = frames
        file.create_dataset("50002_knees", data=frames, chunks=(6, 3, 2), compression="gzip")
    return {"a.hdf5": stream.getvalue()}


def read_hdf5(folder: Path) -> None:
    for motion in load_dfaust(folder / "a.hdf5"):
        last = len(motion)
        finite(motion[: min(last, 5)], (min(last, 5), int(motion.faces.max()) + 1, 3))
        finite(motion[last - 1], (None, 3))


@cache
def amass_model() -> BodyModel:
    fields = smpl_fields(22, n_vertices=8, n_betas=3)
    fields["faces"], fields["joint_regressor"] = fields.pop("f"), fields.pop("J_regressor")
    return BodyModel(**fields)


def amass_file() -> Files:
    rng = np.random.default_rng(3)
    fields = {
        "trans": rng.normal(size=(4, 3)),
        "poses": 0.3 * rng.normal(size=(4, 156)),
        "gender": np.array("female"),
        "mocap_framerate": np.array(60.0),
        "betas": rng.normal(size=5),
    }
    return {"a/b_poses.npz": archive(fields, compressed=True)}


def read_amass(folder: Path) -> None:
    (motion,) = load_amass(folder / "a" / "b_poses.npz", amass_model())
    n_frames = min(len(motion), 10)
    finite(motion.betas, (3,))
    finite(motion[:n_frames], (n_frames, 8, 3))


def stl_file() -> Files:
    template().to_trimesh().export("a.stl")
    return _content_of("a.stl")


def glb_file() -> Files:
    rh.save_glb("a.glb", surfaces(2), template().faces)
    return _content_of("a.glb")


def _content_of(name: str) -> Files:
    content = {name: Path(name).read_bytes()}
    Path(name).unlink()
    return content


def points_file() -> Files:
    rows = "\n".join(" ".join(map(str, row)) for row in template().vertices)
    return {"a.xyz": f"# made up\n{rows}\n".encode()}


def read_points(folder: Path) -> None:
    points, faces, normals = rh.io.load_points(folder / "a.xyz")
    finite(points, (None, 3))
    assert faces is None
    assert normals is None or normals.shape == points.shape


class _StoppedError(Exception):
    pass


def job_files() -> Files:
    """Return the folder of a job that is all but done."""
    folder = Path("job")
    stop = mock.patch.object(JobFolder, "rename", side_effect=_StoppedError)
    with stop, contextlib.suppress(_StoppedError):
        pairwise_job(metric(), surfaces(4), folder)
    files = written(folder)
    for name in files:
        (folder / name).unlink()
    folder.rmdir()
    files.pop("job.lock", None)
    return {f"job/{name}": content for name, content in files.items()}


def read_job(folder: Path) -> None:
    distances = pairwise_job(metric(), surfaces(4), folder / "job")
    assert distances.shape == (4, 4)
    assert distances.dtype == np.float64


def read_without_care(folder: Path) -> None:
    """Run a file and ask for much memory, which must both be noticed."""
    content = (folder / "model.pkl").read_bytes()
    with contextlib.suppress(Exception):
        pickle.loads(content)
    if len(content) % 10 == 0:
        bytes(2**31)


READERS: dict[str, Reader] = {
    "ply text": Reader(lambda: ply("ascii"), ("a.ply",), read_mesh("a.ply")),
    "ply binary": Reader(lambda: ply("binary_little_endian"), ("a.ply",), read_mesh("a.ply")),
    "obj": Reader(obj, ("a.obj",), read_mesh("a.obj")),
    "off": Reader(lambda: mesh_file("a.off"), ("a.off",), read_mesh("a.off")),
    "stl": Reader(stl_file, ("a.stl",), read_mesh("a.stl")),
    "glb": Reader(glb_file, ("a.glb",), read_mesh("a.glb")),
    "points": Reader(points_file, ("a.xyz",), read_points),
    "basis": Reader(basis_file, ("basis.npz",), read_basis, ARCHIVES),
    "model pickle": Reader(
        lambda: {"model.pkl": smpl_pickle(model_fields())},
        ("model.pkl",),
        read_and_convert,
        PICKLES,
    ),
    "dynamic faust": Reader(hdf5_file, ("a.hdf5",), read_hdf5),
    "amass": Reader(amass_file, ("a/b_poses.npz",), read_amass, ARCHIVES),
    "job": Reader(
        job_files,
        (
            "job/manifest.json",
            "job/digests.npy",
            "job/done.npy",
            "job/features_0.npy",
            "job/points.npy",
            "job/D.unfinished.npy",
        ),
        read_job,
    ),
    "careless": Reader(
        lambda: {"model.pkl": pickle.dumps([1, "two", {"three": 3.0}], 2)},
        ("model.pkl",),
        read_without_care,
        PICKLES,
    ),
}
