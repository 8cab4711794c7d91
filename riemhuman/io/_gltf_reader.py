"""Reading of GLB files (glTF 2.0): what the default scene shows at rest, as one triangle mesh.

The importer of trimesh leaves out strips, fans, skins and morph targets, lists nodes in reverse
order, and allocates the sizes that a file declares. What no exporter writes ends in an error of
Python, which `format_errors` names.
"""

from __future__ import annotations

import base64
import binascii
import json
import struct
from collections.abc import Container, Iterator, Sequence
from typing import NamedTuple

import numpy as np

from riemhuman.arrays import DType, JSONRecord, JSONValue, Triangles, Values
from riemhuman.errors import FileFormatError
from riemhuman.io.polygons import Polygons

_Json = JSONRecord

_COMPONENTS = {5120: "<i1", 5121: "<u1", 5122: "<i2", 5123: "<u2", 5125: "<u4", 5126: "<f4"}
_WIDTHS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT4": 16}
# Modes of primitives; smaller ones are points and lines, 6 are fans.
_TRIANGLES = 4
_STRIP = 5
_LARGEST_STRIDE = 252  # bytes from a vertex to the next, by the specification
# Rows that are read for each byte of arrays: primitives and nodes may share some.
_MOST_ROWS = 4

# Extensions that change no positions, beside those of materials, textures, lights and metadata.
_QUANTIZATION = "KHR_mesh_quantization"
_HARMLESS = (
    *("KHR_materials_", "KHR_texture_", "EXT_texture_", "MSFT_texture_", "KHR_lights_", "KHR_xmp"),
    *("EXT_lights_", "KHR_animation_pointer", "KHR_techniques_webgl", "VRM", "ADOBE_materials_"),
)
_DRACO, _MESHOPT = "KHR_draco_mesh_compression", "EXT_meshopt_compression"
_INSTANCES = "EXT_mesh_gpu_instancing"


class _Vertices(NamedTuple):
    """The source of vertices; primitives of a mesh with equal sources share them."""

    positions: int
    targets: tuple[int | None, ...]
    joints: tuple[int, ...]
    weights: tuple[int, ...]


def read_glb(content: bytes) -> tuple[Values, Polygons]:
    """Return the vertices and triangles of the meshes in a file's scene, placed by its nodes."""
    document, binary = _chunks(content)
    _check_extensions(document)
    vertices, faces = _Reader(document, binary).mesh()
    return vertices, Polygons.of_triangles(faces)


def _chunks(content: bytes) -> tuple[_Json, bytes | None]:
    """Return the JSON and the binary part of a file; some have none."""
    # Four letters, the version and the size of the file (uint32 each); then chunks. Each of them
    # begins with its size (uint32) and its kind (four letters).
    magic, version, length = struct.unpack_from("<4sII", content)
    if magic != b"glTF" or version != 2 or length > len(content):
        raise FileFormatError("not a complete GLB file of version 2")
    parts: dict[bytes, bytes] = {}
    start = 12
    while start + 8 <= length:
        size, kind = struct.unpack_from("<I4s", content, start)
        if start + 8 + size > length:
            raise FileFormatError("truncated: a part is longer than the rest of the file")
        parts.setdefault(kind, content[start + 8 : start + 8 + size])
        start += 8 + size
    document: _Json = json.loads(parts[b"JSON"])
    return document, parts.get(b"BIN\0")


def _check_extensions(document: _Json) -> None:
    for name in document.get("extensionsRequired", ()):
        if name in (_DRACO, _MESHOPT):
            raise _compressed(name)
        if name != _QUANTIZATION and not str(name).startswith(_HARMLESS):
            raise FileFormatError(
                f"it needs the extension {str(name)[:60]}, which is not supported"
            )


def _compressed(name: str) -> FileFormatError:
    return FileFormatError(f"it is compressed ({name}); save it without compression")


class _Reader:
    def __init__(self, document: _Json, binary: bytes | None) -> None:
        self._document = document
        self._buffers: dict[int, bytes] = {}
        self._binary = binary
        self._parents = self._parents_of_nodes()
        self._matrices: dict[int, Values] = {}
        self._n_rows = 0
        buffers = document.get("buffers", ())
        # Nothing that is read is larger than a small multiple of these.
        self._n_bytes = len(binary or b"") + sum(len(str(b.get("uri", ""))) for b in buffers)

    def mesh(self) -> tuple[Values, Values]:
        """Return vertices and triangles, primitive by primitive."""
        vertices: list[Values] = []
        faces: list[Triangles] = []
        n_vertices = n_others = 0
        for number in self._shown_nodes():
            node = self._item("nodes", number)
            starts: dict[_Vertices, int] = {}
            joints = self._joint_matrices(number)
            is_mirrored = self._is_mirrored(number, joints)
            mesh = self._item("meshes", node["mesh"])
            for k, primitive in enumerate(mesh["primitives"]):
                if primitive.get("mode", _TRIANGLES) < _TRIANGLES:
                    n_others += 1
                    continue
                where = f"mesh {node['mesh']}, primitive {k}"
                source = self._vertices_of(primitive, where)
                n_new = self._item("accessors", source.positions)["count"]
                if source not in starts:
                    starts[source] = n_vertices
                    vertices.append(self._placed(number, joints, mesh, source, where))
                    n_vertices += n_new
                corners = self._triangles(primitive, n_new, where)
                if is_mirrored:
                    corners = corners[:, [0, 2, 1]]
                faces.append(corners + starts[source])
        if not faces:
            remark = f": {n_others} sets of points or lines" if n_others else ""
            raise FileFormatError(f"the scene of the GLB file holds no triangles{remark}")
        return np.concatenate(vertices), np.concatenate(faces)

    def _count_rows(self, count: int, where: str) -> None:
        """Refuse files whose nodes and primitives share arrays any number of times."""
        self._n_rows += count
        if self._n_rows > _MOST_ROWS * self._n_bytes:
            raise FileFormatError(f"{where}: its nodes and primitives repeat its arrays too often")

    def _item(self, kind: str, number: JSONValue) -> _Json:
        """Return a numbered part of the document."""
        items = self._document.get(kind, ())
        if not 0 <= number < len(items):
            raise FileFormatError(f"it refers to {kind}[{number}] of {len(items)}")
        item: _Json = items[number]
        return item

    def _parents_of_nodes(self) -> dict[int, int]:
        parents: dict[int, int] = {}
        for number, node in enumerate(self._document.get("nodes", ())):
            for child in node.get("children", ()):
                # The specification requires trees: shared nodes could be reached in 2^100 ways.
                if child in parents:
                    raise FileFormatError(f"its node {child} has more than one parent")
                parents[child] = number
        return parents

    def _shown_nodes(self) -> Iterator[int]:
        """Yield the nodes with meshes in the default scene, or in all if there is no scene."""
        if self._document.get("scenes"):
            roots = self._item("scenes", self._document.get("scene", 0)).get("nodes", ())
        else:
            count = len(self._document.get("nodes", ()))
            roots = [number for number in range(count) if number not in self._parents]
        placed = set(self._parents)
        for number in roots:
            if number in placed:
                raise FileFormatError(f"its node {number} has more than one parent")
            placed.add(number)
        waiting = list(reversed(roots))
        while waiting:
            number = waiting.pop()
            node = self._item("nodes", number)
            if _INSTANCES in node.get("extensions", ()):
                raise FileFormatError(
                    f"its node {number} uses {_INSTANCES}, which is not supported"
                )
            if "mesh" in node:
                yield number
            waiting += reversed(node.get("children", ()))

    def _way(self, number: int, known: Container[int] = ()) -> list[int]:
        """Return a node, the one above it, and so on up to a root or one that is known."""
        way = [number]
        while way[-1] in self._parents and way[-1] not in known:
            way.append(self._parents[way[-1]])
            if len(way) > len(self._document["nodes"]):
                raise FileFormatError(f"its node {number} is its own descendant")
        return way

    def _matrix(self, number: int) -> Values:
        """Return the matrix from a node to the scene."""
        for node in reversed(self._way(number, self._matrices)):
            if node not in self._matrices:
                above = self._matrices.get(self._parents.get(node, -1), np.eye(4))
                self._matrices[node] = above @ _local_matrix(self._item("nodes", node))
        return self._matrices[number]

    def _joint_matrices(self, number: int) -> Values | None:
        """Return the matrices of the joints of a skinned node, shape (J, 4, 4)."""
        node = self._item("nodes", number)
        if "skin" not in node:
            return None
        skin = self._item("skins", node["skin"])
        if len(skin["joints"]) > len(self._document["nodes"]):
            raise FileFormatError(f"skin {node['skin']} has more joints than there are nodes")
        matrices = np.stack([self._matrix(joint) for joint in skin["joints"]])
        if "inverseBindMatrices" in skin:
            where = f"skin {node['skin']}"
            inverse = self._accessor(skin["inverseBindMatrices"], "MAT4", where)
            # Matrices are stored by columns.
            inverse = inverse[: len(matrices)].reshape(-1, 4, 4).swapaxes(1, 2)
            matrices = matrices @ inverse
        return matrices

    def _is_mirrored(self, number: int, joints: Values | None) -> bool:
        """Return whether a node turns triangles inside out."""
        matrices = self._matrix(number)[None] if joints is None else joints
        with np.errstate(over="ignore"):  # of absurd scales, which are refused later
            return bool(np.median(np.linalg.det(matrices[:, :3, :3])) < 0)

    def _vertices_of(self, primitive: _Json, where: str) -> _Vertices:
        attributes = primitive["attributes"]
        if "POSITION" not in attributes:
            raise FileFormatError(f"{where} has no positions")
        accessor = self._item("accessors", attributes["POSITION"])
        if _DRACO in primitive.get("extensions", ()) and "bufferView" not in accessor:
            raise _compressed(_DRACO)
        sets = range(sum(name.startswith("JOINTS_") for name in attributes))
        joints = tuple(attributes[f"JOINTS_{k}"] for k in sets)
        weights = tuple(attributes[f"WEIGHTS_{k}"] for k in sets)
        targets = tuple(target.get("POSITION") for target in primitive.get("targets", ()))
        return _Vertices(attributes["POSITION"], targets, joints, weights)

    def _placed(
        self, number: int, joints: Values | None, mesh: _Json, source: _Vertices, where: str
    ) -> Values:
        """Return positions in the scene, with morph targets, and a skin or the node's matrix."""
        node = self._item("nodes", number)
        positions = self._accessor(source.positions, "VEC3", where)
        shares: Sequence[float] = node.get("weights") or mesh.get("weights") or ()
        for share, target in zip(shares, source.targets, strict=bool(shares)):
            if share and target is not None:
                positions = positions + float(share) * self._accessor(target, "VEC3", where)
        if joints is None:
            matrix = self._matrix(number)
            return positions @ matrix[:3, :3].T + matrix[:3, 3]
        if not source.joints:  # no joint moves it, and the node of a skinned mesh does not either
            return positions
        return self._skinned(positions, joints, source, where)

    def _skinned(self, positions: Values, joints: Values, source: _Vertices, where: str) -> Values:
        """Return positions moved by the joints, linearly blended."""
        moved, total = np.zeros_like(positions), np.zeros((len(positions), 1))
        for numbers, shares in zip(source.joints, source.weights, strict=True):
            indices = self._accessor(numbers, "VEC4", where).astype(np.int64)
            weights = self._accessor(shares, "VEC4", where)
            for index, weight in zip(indices.T, weights.T, strict=True):
                matrices = joints[index, :3]
                image = np.einsum("vij,vj->vi", matrices[:, :, :3], positions) + matrices[:, :, 3]
                moved += weight[:, None] * image
                total += weight[:, None]
        if len(total) and total.min() <= 0.0:
            raise FileFormatError(f"{where}: a vertex has no weight at any joint")
        return moved / total

    def _triangles(self, primitive: _Json, n_vertices: int, where: str) -> Values:
        if "indices" in primitive:
            corners = self._accessor(primitive["indices"], "SCALAR", where, whole=True)[:, 0]
        else:
            self._count_rows(n_vertices, where)
            corners = np.arange(n_vertices)
        if corners.size and corners.max() >= n_vertices:
            raise FileFormatError(
                f"{where}: it refers to vertex {corners.max()} of {n_vertices}, counted from 0"
            )
        mode = primitive.get("mode", _TRIANGLES)
        if mode == _TRIANGLES:
            return corners.reshape(-1, 3)
        first = np.arange(max(len(corners) - 2, 0))
        if mode == _STRIP:
            odd = first % 2
            triangles = np.stack([first, first + 1 + odd, first + 2 - odd], axis=1)
        else:
            triangles = np.stack([first + 1, first + 2, 0 * first], axis=1)
        triangles = corners[triangles]
        # Strips are joined by triangles without area, which repeat a corner.
        with_area: Triangles = triangles[(triangles != np.roll(triangles, 1, axis=1)).all(axis=1)]
        return with_area

    def _accessor(self, number: JSONValue, kind: str, where: str, *, whole: bool = False) -> Values:
        """Return the numbers of an accessor, shape (count, width), as floats or int64."""
        accessor = self._item("accessors", number)
        component = accessor.get("componentType")
        if accessor.get("type") != kind or component not in _COMPONENTS:
            stated = f"{str(accessor.get('type'))[:20]} of {str(component)[:20]}"
            raise FileFormatError(f"{where}: {kind} numbers expected, found {stated}")
        dtype, count = np.dtype(_COMPONENTS[component]), accessor["count"]
        if not isinstance(count, int) or not 0 <= count <= self._n_bytes:
            raise FileFormatError(f"{where}: {str(count)[:40]} rows are more than the file holds")
        self._count_rows(count, where)
        width = _WIDTHS[kind]
        if "bufferView" in accessor:
            offset = accessor.get("byteOffset", 0)
            values = self._view(accessor["bufferView"], offset, count, width, dtype, where)
        else:
            values = np.zeros((count, width), dtype)
        if "sparse" in accessor:
            values = self._with_sparse(values.copy(), accessor["sparse"], where)
        if whole:
            return values.astype(np.int64)
        numbers = values.astype(np.float64)
        if accessor.get("normalized") and dtype.kind != "f":
            numbers = np.maximum(numbers / np.iinfo(dtype).max, -1.0)
        return numbers

    def _with_sparse(self, values: Values, sparse: _Json, where: str) -> Values:
        """Return values of which some rows are replaced."""
        count = sparse["count"]
        places = sparse["indices"]
        rows = sparse["values"]
        dtype = np.dtype(_COMPONENTS[places["componentType"]])
        offset = places.get("byteOffset", 0)
        indices = self._view(places["bufferView"], offset, count, 1, dtype, where)[:, 0]
        offset = rows.get("byteOffset", 0)
        width = values.shape[1]
        values[indices] = self._view(rows["bufferView"], offset, count, width, values.dtype, where)
        return values

    def _view(
        self,
        number: JSONValue,
        offset: int,
        count: int,
        width: int,
        dtype: DType,
        where: str,
    ) -> Values:
        """Return rows of a buffer, shape (count, width), not copied."""
        view = self._item("bufferViews", number)
        buffer = self._buffer(view["buffer"], view)
        size = width * dtype.itemsize
        stride = view.get("byteStride", size)
        # NumPy's own check of huge strides overflows.
        if not size <= stride <= max(_LARGEST_STRIDE, size):
            raise FileFormatError(
                f"{where}: its rows are {stride} bytes apart, not from {size} to {_LARGEST_STRIDE}"
            )
        start = view.get("byteOffset", 0)
        end = start + view.get("byteLength", len(buffer) - start)
        start += offset
        needed = (count - 1) * stride + size if count else 0
        if not 0 <= start <= start + needed <= min(end, len(buffer)):
            raise FileFormatError(
                f"{where}: {count} rows need {needed} bytes; found {max(end - start, 0)}"
            )
        return np.ndarray((count, width), dtype, buffer, start, (stride, dtype.itemsize))

    def _buffer(self, number: JSONValue, view: _Json) -> bytes:
        buffer = self._item("buffers", number) if "buffers" in self._document else {}
        uri = buffer.get("uri")
        if uri is None and number == 0 and self._binary is not None:
            return self._binary
        if _MESHOPT in view.get("extensions", ()) or _MESHOPT in buffer.get("extensions", ()):
            raise _compressed(_MESHOPT)
        if uri is None:
            raise FileFormatError(f"the data of its buffer {number} are missing")
        header, comma, text = str(uri).partition(",")
        if not (header.startswith("data:") and header.endswith(";base64") and comma):
            raise FileFormatError(
                f"its buffer {number} is in another file, {str(uri)[:60]!r}; save all in one .glb"
            )
        if number not in self._buffers:
            try:
                self._buffers[number] = base64.b64decode(text, validate=True)
            except binascii.Error as error:
                raise FileFormatError(f"its buffer {number} is damaged: {error}") from error
        return self._buffers[number]


def _local_matrix(node: _Json) -> Values:
    """Return the matrix from a node to its parent."""
    from scipy.spatial.transform import Rotation  # takes long

    if "matrix" in node:
        return np.reshape(np.asarray(node["matrix"], dtype=float), (4, 4)).T
    rotation: Sequence[float] = node.get("rotation", (0.0, 0.0, 0.0, 1.0))
    matrix = np.eye(4)
    matrix[:3, :3] = Rotation.from_quat(rotation).as_matrix() * np.asarray(
        node.get("scale", (1, 1, 1))
    )
    matrix[:3, 3] = node.get("translation", (0, 0, 0))
    return matrix
