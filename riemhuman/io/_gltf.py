"""GLB files (glTF 2.0): paths of surfaces for viewers, game engines and Blender, and meshes.

A path is written as a mesh, its first surface, with the others as morph targets, which an animation
shows one after the other; between them, glTF interpolates the vertices linearly. The exporter of
trimesh knows no morph targets, and its importer allocates the sizes that a file declares.
"""

from __future__ import annotations

import json
import os
import struct
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from riemhuman.checks import real_array, real_number
from riemhuman.errors import ArgumentError, FileFormatError
from riemhuman.io.files import file_path, read_bytes, suffix_of, write_bytes
from riemhuman.io.mesh_arrays import check_mesh

_FLOAT, _BYTE, _SHORT, _INT = 5126, 5121, 5123, 5125  # component types of glTF
_TRIANGLES = 4  # mode of primitives
_LARGEST_STRIDE = 252  # bytes from a vertex to the next, by the specification
# Corners of triangles for each byte of arrays: primitives and nodes may share some.
_MOST_CORNERS = 4
_ARRAY_BUFFER, _ELEMENT_BUFFER = 34962, 34963
_SKIN = {
    "baseColorFactor": [0.80, 0.72, 0.66, 1.0],
    "metallicFactor": 0.0,
    "roughnessFactor": 0.75,
}


def save_glb(
    path: str | os.PathLike[str],
    surfaces: ArrayLike,
    faces: ArrayLike,
    *,
    seconds: float = 2.0,
    name: str = "path",
) -> None:
    """Write a path of surfaces to a GLB file that plays as an animation.

    Positions and normals are in single precision, as the format requires.

    Parameters
    ----------
    path : path_like
        The file, with the suffix ``.glb``; an existing file is replaced.
    surfaces : array_like, shape (n_times, V, 3)
        Surfaces at equally spaced times, in metres, y up. A single surface gives a still mesh.
    faces : array_like, shape (F, 3)
        Vertex indices of each triangle, counted from 0.
    seconds : float
        Duration of the animation.
    name : str
        Name of the mesh and of the animation.

    Examples
    --------
    >>> bodies = rh.datasets.load_open_bodies("coarse")
    >>> rh.save_glb("path.glb", bodies.points[:3], bodies.template.faces, seconds=1.5)
    """
    file = file_path(path)
    suffix_of(file, (".glb",))
    seconds = real_number(seconds, "seconds", minimum=0, strict=True)
    shape = ("n_times", "n_vertices", 3)
    points = np.asarray(real_array(surfaces, "surfaces", shape, batched=False))
    if len(points) == 0:
        raise ArgumentError(f"surfaces holds no surface; found shape {points.shape}")
    _, triangles = check_mesh(points[0], faces)
    write_bytes(file, _glb(points, triangles, seconds, name))


def read_glb(file: Path) -> tuple[np.ndarray, np.ndarray]:
    """Return the vertices and triangles of the meshes in a file's scene, placed by its nodes."""
    document, binary = _chunks(read_bytes(file))
    scenes = document.get("scenes") or [{"nodes": range(len(document.get("nodes", ())))}]
    roots = scenes[document.get("scene", 0)].get("nodes", ())
    vertices, faces, n_vertices, n_corners = [], [], 0, 0
    for mesh, matrix in _placed_meshes(document, roots):
        starts: dict[int, int] = {}  # primitives may share vertices
        for primitive in mesh["primitives"]:
            if primitive.get("mode", _TRIANGLES) != _TRIANGLES:
                continue
            number = primitive["attributes"]["POSITION"]
            if number not in starts:
                positions = _accessor(document, binary, number, 3).astype(float)
                starts[number] = n_vertices
                n_vertices += len(positions)
                vertices.append(positions @ matrix[:3, :3].T + matrix[:3, 3])
            if "indices" in primitive:
                corners = _accessor(document, binary, primitive["indices"], 1)
            else:
                corners = np.arange(len(_accessor(document, binary, number, 3)))
            n_corners += corners.size
            # Nodes may share a mesh, and primitives their corners, any number of times.
            if n_vertices > len(binary) or n_corners > _MOST_CORNERS * len(binary):
                raise FileFormatError("its nodes and primitives repeat its meshes too often")
            faces.append(corners.reshape(-1, 3).astype(np.int64) + starts[number])
    if not faces:
        raise FileFormatError("the GLB file holds no triangles")
    return np.concatenate(vertices), np.concatenate(faces)


def _chunks(content: bytes) -> tuple[dict[str, Any], bytes]:
    """Return the JSON and the binary part of a file."""
    magic, version, length = struct.unpack_from("<4sII", content)
    if magic != b"glTF" or version != 2 or length > len(content):
        raise FileFormatError("not a whole GLB file of version 2")
    size, _ = struct.unpack_from("<I4s", content, 12)
    document = json.loads(content[20 : 20 + size])
    return document, content[28 + size : length]


def _placed_meshes(
    document: dict[str, Any], roots: Sequence[int]
) -> Iterator[tuple[dict[str, Any], np.ndarray]]:
    """Yield the meshes of nodes and of those below them, each with its homogeneous matrix."""
    from scipy.spatial.transform import Rotation  # takes long

    waiting, seen = [(number, np.eye(4)) for number in reversed(roots)], set()
    while waiting:
        number, parent = waiting.pop()
        # The specification asks for trees. Shared nodes could be reached in 2^100 ways.
        if number in seen:
            raise FileFormatError(f"its node {number} has more than one parent")
        seen.add(number)
        node = document["nodes"][number]
        matrix = np.eye(4)
        if "matrix" in node:
            matrix = np.reshape(node["matrix"], (4, 4)).T
        else:
            x, y, z, w = node.get("rotation", (0, 0, 0, 1))
            rotation = Rotation.from_quat([x, y, z, w]).as_matrix()
            matrix[:3, :3] = rotation * np.asarray(node.get("scale", (1, 1, 1)))
            matrix[:3, 3] = node.get("translation", (0, 0, 0))
        matrix = parent @ matrix
        if "mesh" in node:
            yield document["meshes"][node["mesh"]], matrix
        waiting += [(child, matrix) for child in reversed(node.get("children", ()))]


def _accessor(document: dict[str, Any], binary: bytes, number: int, width: int) -> np.ndarray:
    """Return the numbers of an accessor, shape (n, width); NumPy checks that they are there."""
    accessor = document["accessors"][number]
    if "bufferView" not in accessor or "sparse" in accessor:
        raise FileFormatError("the GLB file is compressed; save it without compression")
    view = document["bufferViews"][accessor["bufferView"]]
    dtype = np.dtype(
        {_FLOAT: "<f4", _BYTE: "<u1", _SHORT: "<u2", _INT: "<u4"}[accessor["componentType"]]
    )
    stride = max(view.get("byteStride", 0), width * dtype.itemsize)
    if stride > _LARGEST_STRIDE:  # NumPy's own check of huge strides overflows
        raise FileFormatError(f"its vertices are {stride} bytes apart, more than {_LARGEST_STRIDE}")
    offset = view.get("byteOffset", 0) + accessor.get("byteOffset", 0)
    return np.ndarray((accessor["count"], width), dtype, binary, offset, (stride, dtype.itemsize))


def _glb(points: np.ndarray, triangles: np.ndarray, seconds: float, name: str) -> bytes:
    positions = points.astype("<f4")
    normals = _unit_normals(points, triangles).astype("<f4")
    arrays: list[np.ndarray] = []

    def add(array: np.ndarray) -> int:
        arrays.append(array)
        return len(arrays) - 1

    def difference(time: int) -> dict[str, int]:
        return {
            "POSITION": add(positions[time] - positions[0]),
            "NORMAL": add(normals[time] - normals[0]),
        }

    n_times, n_vertices = points.shape[:2]
    # glTF reserves the largest number of each type for restarting strips.
    index_type = "<u2" if n_vertices < 65535 else "<u4"
    primitive: dict[str, Any] = {
        "attributes": {"POSITION": add(positions[0]), "NORMAL": add(normals[0])},
        "indices": add(triangles.astype(index_type).ravel()),
        "material": 0,
    }
    mesh: dict[str, Any] = {"name": name, "primitives": [primitive]}
    document: dict[str, Any] = {
        "asset": {"version": "2.0", "generator": "riemhuman"},
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0, "name": name}],
        "meshes": [mesh],
        "materials": [{"name": "skin", "doubleSided": True, "pbrMetallicRoughness": _SKIN}],
    }
    if n_times > 1:
        primitive["targets"] = [difference(time) for time in range(1, n_times)]
        mesh["weights"] = [0.0] * (n_times - 1)
        mesh["extras"] = {"targetNames": [f"time {time}" for time in range(1, n_times)]}
        # Target i has weight 1 at time i and 0 at all other times.
        sampler = {
            "input": add(np.linspace(0.0, seconds, n_times).astype("<f4")),
            "output": add(np.eye(n_times)[:, 1:].astype("<f4").ravel()),
            "interpolation": "LINEAR",
        }
        channel = {"sampler": 0, "target": {"node": 0, "path": "weights"}}
        document["animations"] = [{"name": name, "samplers": [sampler], "channels": [channel]}]
    binary = _describe_arrays(arrays, document)
    text = json.dumps(document, separators=(",", ":")).encode()
    text += b" " * (-len(text) % 4)
    parts = struct.pack("<I4s", len(text), b"JSON") + text
    parts += struct.pack("<I4s", len(binary), b"BIN\0") + binary
    return struct.pack("<4sII", b"glTF", 2, 12 + len(parts)) + parts


def _describe_arrays(arrays: list[np.ndarray], document: dict[str, Any]) -> bytes:
    """Return arrays as the binary part of a file, and write their layout into its document."""
    binary = bytearray()
    views: list[dict[str, Any]] = []
    accessors: list[dict[str, Any]] = []
    for array in arrays:
        is_vertices, is_float = array.ndim == 2, array.dtype.kind == "f"
        view = {"buffer": 0, "byteOffset": len(binary), "byteLength": array.nbytes}
        accessor = {
            "bufferView": len(views),
            "componentType": {"f4": _FLOAT, "u2": _SHORT, "u4": _INT}[array.dtype.str[1:]],
            "count": len(array),
            "type": "VEC3" if is_vertices else "SCALAR",
        }
        if is_vertices or not is_float:
            view["target"] = _ARRAY_BUFFER if is_vertices else _ELEMENT_BUFFER
        if is_float:
            rows = array.reshape(len(array), -1)
            accessor |= {"min": rows.min(axis=0).tolist(), "max": rows.max(axis=0).tolist()}
        views.append(view)
        accessors.append(accessor)
        binary += array.tobytes() + b"\0" * (-array.nbytes % 4)
    buffers = [{"byteLength": len(binary)}]
    document |= {"accessors": accessors, "bufferViews": views, "buffers": buffers}
    return bytes(binary)


def _unit_normals(points: np.ndarray, faces: np.ndarray) -> np.ndarray:
    """Return normals of the vertices of all surfaces, pointing up where there is no area."""
    from riemhuman.kernels.surface import vertex_normals  # takes long, as autograd does

    normals = np.stack([vertex_normals(f, faces) for f in points])
    normals[~normals.any(axis=-1)] = (0.0, 1.0, 0.0)
    return normals
