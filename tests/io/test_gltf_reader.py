"""GLB files of every kind that glTF 2.0 allows, written by hand; trimesh reads what it can."""

import base64
import json
import struct
import tracemalloc

import numpy as np
import pytest
import trimesh

from riemhuman.errors import FileFormatError
from riemhuman.io import load_mesh
from riemhuman.surfaces import signed_volume

VERTICES = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1.0]], dtype="<f4")
FACES = np.array([[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]], dtype="<u2")
TYPES = {"i1": 5120, "u1": 5121, "i2": 5122, "u2": 5123, "u4": 5125, "f4": 5126}
KINDS = {1: "SCALAR", 3: "VEC3", 4: "VEC4", 16: "MAT4"}
QUANTIZED = {"extensionsRequired": ["KHR_mesh_quantization"]}


class Document:
    """A GLB file in the making: a tetrahedron of one node, unless it is changed."""

    def __init__(self, positions=VERTICES, faces=FACES, normalized=False, **extra):
        self.binary = bytearray()
        self.json = {"asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": [0]}]}
        self.json |= {"nodes": [{"mesh": 0}], "accessors": [], "bufferViews": []}
        self.json |= {"meshes": [{"primitives": [{"attributes": {}}]}], **extra}
        self.primitive["attributes"]["POSITION"] = self.add(positions, normalized=normalized)
        if faces is not None:
            self.primitive["indices"] = self.add(np.ravel(faces))

    @property
    def primitive(self):
        return self.json["meshes"][0]["primitives"][0]

    def view(self, array, **fields):
        view = {"buffer": 0, "byteOffset": len(self.binary), "byteLength": array.nbytes, **fields}
        self.json["bufferViews"].append(view)
        self.binary += array.tobytes() + b"\0" * (-array.nbytes % 4)
        return len(self.json["bufferViews"]) - 1

    def add(self, array, *, normalized=False, stride=None, **fields):
        """Add an array as an accessor, its rows padded to a stride, and return its number."""
        width = 1 if array.ndim == 1 else array.shape[1]
        accessor = {"componentType": TYPES[array.dtype.str[1:]], "count": len(array)}
        accessor |= {"type": KINDS[width], "normalized": normalized, **fields}
        if stride:
            rows = array.view("u1").reshape(len(array), -1)
            padding = np.full((len(array), stride - rows.shape[1]), 77, "u1")
            rows = np.concatenate([rows, padding], axis=1)
            accessor["bufferView"] = self.view(rows, byteStride=stride)
        else:
            accessor["bufferView"] = self.view(array)
        self.json["accessors"].append(accessor)
        return len(self.json["accessors"]) - 1

    def content(self):
        self.json.setdefault("buffers", [{"byteLength": len(self.binary)}])
        text = json.dumps(self.json).encode()
        text += b" " * (-len(text) % 4)
        parts = struct.pack("<I4s", len(text), b"JSON") + text
        if self.binary:
            parts += struct.pack("<I4s", len(self.binary), b"BIN\0") + bytes(self.binary)
        return struct.pack("<4sII", b"glTF", 2, 12 + len(parts)) + parts


@pytest.fixture
def read(tmp_path):
    def read(document):
        file = tmp_path / "made.glb"
        file.write_bytes(document.content())
        return load_mesh(file)

    return read


def assert_tetrahedron(mesh, scale=1.0, atol=1e-6):
    vertices, faces = mesh
    np.testing.assert_allclose(vertices, scale * VERTICES, atol=atol)
    np.testing.assert_array_equal(faces, FACES)


@pytest.mark.parametrize(("dtype", "normalized"), [("u1", True), ("u2", False), ("i2", True)])
def test_quantized_positions(read, dtype, normalized):
    whole = np.zeros((4, 3), dtype)
    largest = np.iinfo(dtype).max if normalized else 1
    whole[:] = VERTICES * largest
    document = Document(normalized=normalized, **QUANTIZED)
    attributes = document.primitive["attributes"]
    stride = 4 * -(-3 * np.dtype(dtype).itemsize // 4)
    attributes["POSITION"] = document.add(whole, normalized=normalized, stride=stride)
    index = "<u4" if dtype == "u2" else "<u1"
    document.primitive["indices"] = document.add(FACES.ravel().astype(index))
    assert_tetrahedron(read(document))
    if dtype == "i2":
        whole[3] = -np.iinfo(dtype).max - 1  # the same as one above it
        attributes["POSITION"] = document.add(whole, normalized=True, stride=stride)
        np.testing.assert_array_equal(read(document)[0][3], -1.0)


def test_no_indices(read):
    document = Document(VERTICES[FACES.ravel()], faces=None)
    vertices, faces = read(document)
    np.testing.assert_array_equal(vertices[faces], VERTICES[FACES])


def test_interleaved_rows(read):
    document = Document()
    rows = np.concatenate([VERTICES + 9, VERTICES], axis=1).astype("<f4")
    document.json["accessors"][0]["bufferView"] = document.view(rows, byteStride=24)
    document.json["accessors"][0]["byteOffset"] = 12
    assert_tetrahedron(read(document))


@pytest.mark.parametrize("from_zeros", [False, True])
def test_sparse_accessors(read, from_zeros):
    wrong = VERTICES + np.array([[0], [3], [0], [0]], dtype="<f4")
    document = Document(0 * VERTICES if from_zeros else wrong)
    places = np.array([1, 2, 3] if from_zeros else [1], dtype="<u1")
    accessor = document.json["accessors"][0]
    if from_zeros:
        del accessor["bufferView"]
    accessor["sparse"] = {
        "count": len(places),
        "indices": {"bufferView": document.view(places), "componentType": 5121},
        "values": {"bufferView": document.view(VERTICES[places])},
    }
    assert_tetrahedron(read(document))
    accessor["sparse"]["count"] = 9
    with pytest.raises(FileFormatError, match="mesh 0, primitive 0: 9 rows need 9 bytes"):
        read(document)


MIRRORS = {
    "three axes": [{"mesh": 0, "scale": [-1, -1, -1]}],
    "matrix": [{"mesh": 0, "matrix": [1, 0, 0, 0, 0, -2, 0, 0, 0, 0, 1, 0, 3, 0, 0, 1]}],
    "parent": [{"children": [1], "scale": [1, 1, -1]}, {"mesh": 0, "translation": [1, 2, 3]}],
    "twice": [{"children": [1], "scale": [1, 1, -1]}, {"mesh": 0, "scale": [1, -1, 1]}],
}


@pytest.mark.parametrize("name", MIRRORS)
def test_mirrored_nodes_stay_outside_out(read, tmp_path, name):
    document = Document(nodes=MIRRORS[name])
    vertices, faces = read(document)
    assert signed_volume(vertices, faces) > 0
    by_trimesh = trimesh.load(tmp_path / "made.glb", process=False).to_mesh()
    np.testing.assert_allclose(vertices, by_trimesh.vertices, atol=1e-6)


def test_strips_and_fans_beside_triangles(read):
    square = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0, 2, 0]], dtype="<f4")
    document = Document(square, np.array([[0, 1, 2], [0, 2, 3]], dtype="<u2"))
    indices = {
        5: np.array([0, 1, 3, 2, 2, 2, 4], dtype="<u2"),  # joined by triangles without area
        6: np.array([0, 1, 2, 3, 4], dtype="<u2"),
        1: np.array([0, 1], dtype="<u2"),
    }
    primitives = document.json["meshes"][0]["primitives"]
    primitives += [
        {"attributes": {"POSITION": 0}, "mode": mode, "indices": document.add(corners)}
        for mode, corners in indices.items()
    ]
    vertices, faces = read(document)
    assert len(vertices) == 5  # the primitives share them
    strip, fan = [[0, 1, 3], [1, 2, 3]], [[1, 2, 0], [2, 3, 0], [3, 4, 0]]
    assert faces.tolist() == [[0, 1, 2], [0, 2, 3], *strip, *fan]
    corners = vertices[faces]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    assert (normals[:-1, 2] > 0).all()


def skinned(document, joints, matrices, weights):
    """Add a skin, with joints and weights of vertices as (4, 4) arrays."""
    attributes = document.primitive["attributes"]
    attributes["JOINTS_0"] = document.add(joints.astype("<u1"))
    attributes["WEIGHTS_0"] = document.add((weights * 255).round().astype("<u1"), normalized=True)
    by_columns = np.swapaxes(matrices, 1, 2).reshape(-1, 16).astype("<f4")
    skin = {"joints": [1, 2], "inverseBindMatrices": document.add(by_columns)}
    document.json["skins"] = [skin]


def test_skins_ignore_the_transform_of_their_node(read):
    nodes = [{"mesh": 0, "skin": 0, "scale": [0.01] * 3}, {}, {"translation": [0, 0, 5]}]
    document = Document(nodes=nodes, skins=[{"joints": [1]}])
    assert_tetrahedron(read(document))
    # An armature in centimetres, turned up, whose bind pose undoes it.
    nodes[0] = {"mesh": 0, "skin": 0, "children": [1]}
    nodes[1] = {"children": [2], "scale": [0.01] * 3}
    joints, weights = np.zeros((4, 4)), np.tile([1.0, 0.0, 0.0, 0.0], (4, 1))
    undone = np.diag([100.0, 100.0, 100.0, 1.0])
    skinned(document, joints, np.stack([undone, undone]), weights)
    assert_tetrahedron(read(document))


def test_skins_move_vertices_with_their_joints(read):
    nodes = [{"mesh": 0, "skin": 0}, {"children": [2]}, {"translation": [0, 0, 5]}]
    document = Document(nodes=nodes)
    joints = np.tile([0, 1, 0, 0], (4, 1))
    share = np.array([0.0, 0.2, 0.4, 1.0])
    weights = np.stack([1 - share, share, 0 * share, 0 * share], axis=1)
    skinned(document, joints, np.stack([np.eye(4), np.eye(4)]), weights)
    vertices, _ = read(document)
    expected = VERTICES + 5 * share[:, None] * [0, 0, 1]
    np.testing.assert_allclose(vertices, expected, atol=1e-6)
    document.json["skins"][0]["joints"] = [1]
    with pytest.raises(FileFormatError, match="index 1 is out of bounds"):
        read(document)


def test_morph_targets_at_the_weights_of_mesh_or_node(read):
    document = Document()
    document.primitive["targets"] = [
        {"POSITION": document.add(np.full_like(VERTICES, 1.0))},
        {"POSITION": document.add(np.full_like(VERTICES, 10.0))},
    ]
    assert_tetrahedron(read(document))
    document.json["meshes"][0]["weights"] = [0.5, 0.0]
    np.testing.assert_allclose(read(document)[0], VERTICES + 0.5, atol=1e-6)
    document.json["nodes"][0]["weights"] = [0.0, 0.25]
    np.testing.assert_allclose(read(document)[0], VERTICES + 2.5, atol=1e-6)
    document.json["nodes"][0]["weights"] = [1.0]
    with pytest.raises(FileFormatError, match="damaged, or not a mesh"):
        read(document)


def test_few_bytes_take_little_memory_and_time(read):
    doubled = [{"children": [i + 1] * 2} for i in range(60)] + [{"mesh": 0}]

    def targets_without_end(mesh):
        mesh["primitives"][0]["targets"] = [{"POSITION": 0}] * 2000
        mesh["weights"] = [1.0] * 2000

    for change in (
        lambda j: j["accessors"][0].update(count=60_000_000),
        lambda j: j["meshes"][0].update(primitives=3000 * j["meshes"][0]["primitives"]),
        lambda j: j.update(nodes=doubled),
        lambda j: j.update(nodes=[{"mesh": 0, "skin": 0}], skins=[{"joints": [0] * 1000}]),
        lambda j: targets_without_end(j["meshes"][0]),
        lambda j: j["bufferViews"][0].update(byteStride=2**62),
    ):
        document = Document()
        change(document.json)
        tracemalloc.start()
        with pytest.raises(FileFormatError):
            read(document)
        assert tracemalloc.get_traced_memory()[1] < 2**24
        tracemalloc.stop()


def test_scenes(read):
    nodes = [{"mesh": 0}, {"mesh": 0, "translation": [5, 0, 0]}, {"children": [1, 0]}]
    document = Document(nodes=nodes, scenes=[{"nodes": [0]}, {"nodes": [2]}], scene=1)
    vertices, _ = read(document)
    np.testing.assert_allclose(vertices, np.concatenate([VERTICES + [5, 0, 0], VERTICES]))
    del document.json["scene"]
    with pytest.raises(FileFormatError, match="its node 0 has more than one parent"):
        read(document)  # the first scene lists a node that is below another
    del document.json["scenes"]
    assert len(read(document)[0]) == 8
    document.json["nodes"][1]["children"] = [2]
    with pytest.raises(FileFormatError, match="no triangles"):
        read(document)  # a ring of nodes has no root


def test_data_within_the_text(read):
    document = Document()
    text = base64.b64encode(bytes(document.binary)).decode()
    uri = f"data:application/octet-stream;base64,{text}"
    document.json["buffers"] = [{"byteLength": len(document.binary), "uri": uri}]
    document.binary = bytearray()
    assert_tetrahedron(read(document))
    document.json["buffers"][0]["uri"] = "body.bin"
    with pytest.raises(FileFormatError, match=r"buffer 0 is in another file, 'body\.bin'"):
        read(document)
    document.json["buffers"][0]["uri"] = uri[:-5] + "%"
    with pytest.raises(FileFormatError, match="buffer 0 is damaged"):
        read(document)


def test_compressed_parts_are_named(read):
    with pytest.raises(FileFormatError, match="compressed .*meshopt"):
        read(Document(extensionsRequired=["EXT_meshopt_compression"]))
    assert_tetrahedron(read(Document(extensionsUsed=["KHR_draco_mesh_compression"])))
    assert_tetrahedron(read(Document(extensionsRequired=["KHR_materials_unlit"])))
    document = Document()
    document.primitive["extensions"] = {"KHR_draco_mesh_compression": {"bufferView": 0}}
    assert_tetrahedron(read(document))  # with what readers without it can read
    del document.json["accessors"][0]["bufferView"]
    with pytest.raises(FileFormatError, match="compressed .*draco"):
        read(document)
    document = Document()
    document.json["bufferViews"][0] |= {"buffer": 1, "extensions": {"EXT_meshopt_compression": {}}}
    document.json["buffers"] = [{"byteLength": len(document.binary)}, {"byteLength": 48}]
    with pytest.raises(FileFormatError, match="compressed .*meshopt"):
        read(document)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda j, p: j["nodes"][0].update(mesh=1), r"meshes\[1\] of 1"),
        (lambda j, p: j["nodes"][0].update(mesh=-1), r"meshes\[-1\] of 1"),
        (lambda j, p: j.update(extensionsRequired=["EXT_new"]), "needs the extension EXT_new"),
        (lambda j, p: p["attributes"].pop("POSITION"), "primitive 0 has no positions"),
        (lambda j, p: p.update(indices=0), "SCALAR numbers expected, found VEC3"),
        (lambda j, p: p["attributes"].update(POSITION=1), "VEC3 numbers expected, found SCALAR"),
        (lambda j, p: j["accessors"][0].update(count=5), "5 rows need 60 bytes; found 48"),
        (lambda j, p: j["accessors"][0].update(count=3), "refers to vertex 3 of 3"),
        (
            lambda j, p: j["accessors"][1].update(count=11),
            "damaged, or not a mesh .* 11 into shape",
        ),
        (lambda j, p: p.update(mode=0), "holds no triangles: 1 sets of points or lines"),
        (lambda j, p: j["nodes"][0].pop("mesh"), "holds no triangles$"),
        (lambda j, p: j["bufferViews"][0].update(byteOffset=-4), "rows need 48 bytes"),
        (lambda j, p: j["bufferViews"][0].update(byteStride=8), "8 bytes apart, not from 12"),
        (lambda j, p: j["nodes"][0].update(children=[0]), "more than one parent"),
        (
            lambda j, p: j["nodes"][0].update(extensions={"EXT_mesh_gpu_instancing": {}}),
            "node 0 uses EXT_mesh_gpu_instancing",
        ),
    ],
)
def test_errors_name_the_part(read, change, message):
    document = Document()
    change(document.json, document.primitive)
    with pytest.raises(FileFormatError, match=rf"made\.glb: .*{message}"):
        read(document)
