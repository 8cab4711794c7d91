"""GLB files: read back by hand from the glTF 2.0 specification, and by trimesh."""

import json
import struct

import numpy as np
import pytest
import trimesh

from riemhuman.errors import ArgumentError, FileFormatError
from riemhuman.io import load_mesh, save_glb

TYPES = {5126: "<f4", 5123: "<u2", 5125: "<u4"}
WIDTHS = {"SCALAR": 1, "VEC3": 3}


@pytest.fixture
def path():
    rng = np.random.default_rng(3)
    sphere = trimesh.creation.icosphere(subdivisions=2)
    shapes = np.asarray(sphere.vertices) * [0.3, 0.9, 0.2]
    # An odd number of triangles, whose two-byte corners must be filled up.
    return shapes * rng.uniform(0.8, 1.2, (4, 1, 3)), np.asarray(sphere.faces)[:-1]


def read(file):
    """Return the document of a GLB file, and a function from accessors to arrays."""
    content = file.read_bytes()
    magic, version, length = struct.unpack_from("<4sII", content)
    assert (magic, version, length) == (b"glTF", 2, len(content))
    parts, start = [], 12
    while start < length:
        size, kind = struct.unpack_from("<I4s", content, start)
        assert size % 4 == 0
        parts.append((kind, content[start + 8 : start + 8 + size]))
        start += 8 + size
    (json_kind, text), (binary_kind, binary) = parts
    assert (json_kind, binary_kind) == (b"JSON", b"BIN\0")
    document = json.loads(text)
    assert document["buffers"] == [{"byteLength": len(binary)}]

    def array(index):
        accessor = document["accessors"][index]
        view = document["bufferViews"][accessor["bufferView"]]
        assert view["byteOffset"] % 4 == 0
        width = WIDTHS[accessor["type"]]
        values = np.frombuffer(
            binary,
            TYPES[accessor["componentType"]],
            accessor["count"] * width,
            view["byteOffset"],
        ).reshape(-1, width)
        assert values.nbytes == view["byteLength"]
        if "min" in accessor:
            np.testing.assert_array_equal(values.min(axis=0), np.float32(accessor["min"]))
            np.testing.assert_array_equal(values.max(axis=0), np.float32(accessor["max"]))
        return values

    return document, array


def test_every_time_of_the_animation_is_a_surface_of_the_path(path, tmp_path):
    surfaces, faces = path
    save_glb(tmp_path / "path.glb", surfaces, faces, seconds=6.0, name="bend")
    document, array = read(tmp_path / "path.glb")
    (mesh,) = document["meshes"]
    (primitive,) = mesh["primitives"]
    np.testing.assert_array_equal(array(primitive["indices"]).reshape(-1, 3), faces)
    rest = array(primitive["attributes"]["POSITION"])
    targets = np.stack([array(target["POSITION"]) for target in primitive["targets"]])
    (animation,) = document["animations"]
    (channel,), (sampler,) = animation["channels"], animation["samplers"]
    assert channel == {"sampler": 0, "target": {"node": 0, "path": "weights"}}
    assert sampler["interpolation"] == "LINEAR"
    np.testing.assert_allclose(array(sampler["input"]).ravel(), [0.0, 2.0, 4.0, 6.0])
    weights = array(sampler["output"]).reshape(4, 3)
    shown = rest + np.einsum("tk,kvi->tvi", weights, targets)
    np.testing.assert_allclose(shown, surfaces, atol=3e-7)
    rest_normals = array(primitive["attributes"]["NORMAL"])
    for surface, target in zip(surfaces, [None, *primitive["targets"]], strict=True):
        normals = rest_normals + (0.0 if target is None else array(target["NORMAL"]))
        np.testing.assert_allclose(np.linalg.norm(normals, axis=1), 1.0, atol=1e-6)
        # An ellipsoid's normals are known; those of its mesh are near.
        known = surface / np.abs(surface).max(axis=0) ** 2
        known /= np.linalg.norm(known, axis=1, keepdims=True)
        assert np.sum(normals * known, axis=1).min() > 0.97
    assert mesh["weights"] == [0.0, 0.0, 0.0]
    assert len(mesh["extras"]["targetNames"]) == 3
    assert mesh["name"] == animation["name"] == "bend"


def test_far_from_the_origin_no_digits_are_lost(path, tmp_path):
    surfaces, faces = path
    far = surfaces + [5e5, 0.0, 5e6]
    save_glb(tmp_path / "far.glb", far, faces)
    np.testing.assert_allclose(load_mesh(tmp_path / "far.glb")[0], far[0], atol=1e-6, rtol=0)
    by_trimesh = trimesh.load(tmp_path / "far.glb", process=False).to_mesh()
    np.testing.assert_allclose(by_trimesh.vertices, far[0], atol=1e-6, rtol=0)


def test_many_vertices_take_long_indices(tmp_path):
    vertices = np.zeros((65535, 3))
    vertices[-3:] = np.eye(3)
    save_glb(tmp_path / "large.glb", vertices[None], [[65532, 65533, 65534]])
    document, array = read(tmp_path / "large.glb")
    indices = document["meshes"][0]["primitives"][0]["indices"]
    assert document["accessors"][indices]["componentType"] == 5125
    assert array(indices).ravel().tolist() == [65532, 65533, 65534]
    # A vertex without triangles has a normal too, as the format asks for unit vectors.
    normals = array(document["meshes"][0]["primitives"][0]["attributes"]["NORMAL"])
    np.testing.assert_allclose(np.linalg.norm(normals, axis=1), 1.0, atol=1e-6)


def test_refusals(path, tmp_path):
    surfaces, faces = path
    with pytest.raises(FileFormatError, match=r"path.gltf: the ending must be .glb"):
        save_glb(tmp_path / "path.gltf", surfaces, faces)
    with pytest.raises(ArgumentError, match="holds no surface"):
        save_glb(tmp_path / "path.glb", surfaces[:0], faces)
    with pytest.raises(ArgumentError, match="out of range"):
        save_glb(tmp_path / "path.glb", surfaces, faces + 1)
    assert list(tmp_path.iterdir()) == []
