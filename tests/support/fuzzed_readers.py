"""Every reader of the library with a small valid file."""

import io
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import h5py
import numpy as np
from fuzzing import ARCHIVES, BYTES, archive
from model_pickles import smpl_fields, smpl_model, smpl_pickle

import riemhuman as rh
from riemhuman.bodies import BodyModel, convert_model
from riemhuman.datasets import load_amass, load_dfaust


@dataclass(frozen=True)
class Reader:
    """A reader: its valid files, and how it returns arrays of finite numbers from their folder.

    All files are damaged, each by all mutations.
    """

    files: Callable
    read: Callable
    mutations: tuple = BYTES


@cache
def template():
    """Return an octahedron, its corners moved a little."""
    corners = np.concatenate([np.eye(3), -np.eye(3)])
    corners += np.random.default_rng(1).uniform(-0.1, 0.1, (6, 3))
    faces = [[0, 1, 2], [1, 3, 2], [3, 4, 2], [4, 0, 2], [1, 0, 5], [3, 1, 5], [4, 3, 5], [0, 4, 5]]
    return rh.Template(corners, faces)


def surfaces(n_surfaces):
    noise = np.random.default_rng(2).uniform(-0.2, 0.2, (n_surfaces, 6, 3))
    return template().vertices + noise


def written(name, write):
    """Return the content of a file that is written under a name."""
    write(name)
    content = Path(name).read_bytes()
    Path(name).unlink()
    return {name: content}


def mesh_file(name):
    return written(name, lambda file: rh.save_mesh(file, template().vertices, template().faces))


def ply(order):
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


def obj():
    content = mesh_file("a.obj")["a.obj"].decode().replace("f 1 2 3", "f 1/1/1 2//2 -4/3")
    return {"a.obj": ("# made up\nmtllib x.mtl\nvt 0 0\no body\n" + content).encode()}


def mesh_reader(files):
    """Return the reader of a mesh file, of which every index must be that of a vertex."""

    def read(folder):
        (file,) = folder.iterdir()
        vertices, faces = rh.load_mesh(file)
        assert faces.size
        assert faces.min() >= 0
        return vertices, vertices[faces]

    return Reader(files, read)


def model_pickle():
    """Return a model of three joints in a row."""
    fields = smpl_fields(22, n_vertices=8, n_betas=2)
    weights = fields["weights"][:, :3]
    fields |= {
        "weights": weights / weights.sum(axis=1, keepdims=True),
        "J_regressor": fields["J_regressor"][:3],
        "kintree_table": np.array([[2**32 - 1, 0, 1], [0, 1, 2]], dtype=np.uint32),
        "posedirs": fields["posedirs"][..., :18],
    }
    return {"model.pkl": smpl_pickle(fields)}


def read_model(folder):
    models = [convert_model(folder / "model.pkl", folder / "converted.npz")]
    models.append(BodyModel.from_file(folder / "converted.npz"))
    return [part for m in models for part in (m.template.vertices[m.faces], m.weights, m.shapedirs)]


def hdf5_file():
    stream = io.BytesIO()
    frames = surfaces(5).transpose(1, 2, 0)
    with h5py.File(stream, "w") as file:
        file["faces"] = template().faces
        file["50002_hips"] = frames
        file.create_dataset("50002_knees", data=frames, chunks=(6, 3, 2), compression="gzip")
    return {"a.hdf5": stream.getvalue()}


def read_hdf5(folder):
    motions = load_dfaust(folder / "a.hdf5")
    return [frames for m in motions for frames in (m[:5][:, m.faces], m[len(m) - 1])]


def amass_file():
    rng = np.random.default_rng(3)
    fields = {
        "trans": 0.01 * rng.normal(size=(4, 3)),
        "poses": 0.3 * rng.normal(size=(4, 156)),
        "gender": np.array("female"),
        "mocap_framerate": np.array(60.0),
        "betas": rng.normal(size=5),
    }
    return {"a/b_poses.npz": archive(fields, compressed=True)}


def read_amass(folder):
    (motion,) = load_amass(folder / "a" / "b_poses.npz", smpl_model(22, n_betas=3))
    return motion.betas, motion[:10]


READERS = {
    "ply text": mesh_reader(lambda: ply("ascii")),
    "ply binary": mesh_reader(lambda: ply("binary_little_endian")),
    "obj": mesh_reader(obj),
    "off": mesh_reader(lambda: mesh_file("a.off")),
    "glb": mesh_reader(
        lambda: written("a.glb", lambda file: rh.save_glb(file, surfaces(2), template().faces))
    ),
    "model pickle": Reader(model_pickle, read_model),
    "dynamic faust": Reader(hdf5_file, read_hdf5),
    "amass": Reader(amass_file, read_amass, ARCHIVES),
}
