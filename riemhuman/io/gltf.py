"""Paths of surfaces as animated GLB files (glTF 2.0), for viewers, game engines and Blender.

The first surface is the mesh and the others are its morph targets, which an animation shows one
after the other. Between them, glTF interpolates the vertices linearly.
"""

from __future__ import annotations

import json
import os
import struct
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from riemhuman.checks import real_array, real_number
from riemhuman.errors import ArgumentError, FileFormatError
from riemhuman.io.files import atomic_file, file_path
from riemhuman.io.mesh_arrays import check_mesh
from riemhuman.kernels.vertex_normals import vertex_normals

_FLOAT, _SHORT, _INT = 5126, 5123, 5125  # component types of glTF
_ARRAY_BUFFER, _ELEMENT_BUFFER = 34962, 34963
_COLOR = (0.80, 0.72, 0.66, 1.0)


def save_glb(
    path: str | os.PathLike[str],
    surfaces: ArrayLike,
    faces: ArrayLike,
    *,
    seconds: float = 2.0,
    name: str = "path",
) -> None:
    """Write a path of surfaces to a GLB file that plays as an animation.

    Positions and normals are in single precision, as the format requires. The file appears whole
    or not at all.

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

    Raises
    ------
    ArgumentTypeError
        If an array does not hold numbers of the right kind, or `path` is not a path.
    ArgumentError
        If a shape is wrong, there is no surface, a position is not finite, or a triangle refers
        to a vertex that does not exist.
    FileError
        If the file cannot be written.
    FileFormatError
        If the suffix is not ``.glb``.

    Examples
    --------
    >>> import riemhuman as rh
    >>> bodies = rh.datasets.load_open_bodies("coarse")
    >>> rh.save_glb("path.glb", bodies.points[:3], bodies.template.faces, seconds=1.5)
    """
    file = file_path(path)
    if file.suffix.lower() != ".glb":
        raise FileFormatError(f"{file}: the ending must be .glb")
    content = _glb(surfaces, faces, real_number(seconds, "seconds", minimum=0, strict=True), name)
    with atomic_file(file) as neighbour:
        neighbour.write_bytes(content)


class _Chunk:
    """The binary part of a GLB file, with the glTF objects that describe its layout."""

    def __init__(self) -> None:
        self._parts: list[bytes] = []
        self._size = 0
        self.views: list[dict[str, Any]] = []
        self.accessors: list[dict[str, Any]] = []

    def add(self, array: np.ndarray, kind: str, target: int | None = None) -> int:
        """Append an array and return the index of its accessor."""
        content = array.tobytes()
        content += b"\0" * (-len(content) % 4)
        view = {"buffer": 0, "byteOffset": self._size, "byteLength": array.nbytes}
        self.views.append(view if target is None else view | {"target": target})
        component = {"f4": _FLOAT, "u2": _SHORT, "u4": _INT}[array.dtype.str[1:]]
        accessor: dict[str, Any] = {
            "bufferView": len(self.views) - 1,
            "componentType": component,
            "count": len(array) if kind == "VEC3" else array.size,
            "type": kind,
        }
        if component == _FLOAT:
            rows = array.reshape(accessor["count"], -1)
            accessor["min"] = rows.min(axis=0).tolist()
            accessor["max"] = rows.max(axis=0).tolist()
        self.accessors.append(accessor)
        self._parts.append(content)
        self._size += len(content)
        return len(self.accessors) - 1

    @property
    def content(self) -> bytes:
        return b"".join(self._parts)


def _glb(surfaces: ArrayLike, faces: ArrayLike, seconds: float, name: str) -> bytes:
    shape = ("n_times", "n_vertices", 3)
    points = np.asarray(real_array(surfaces, "surfaces", shape, batched=False))
    if len(points) == 0:
        raise ArgumentError(f"surfaces holds no surface; found shape {points.shape}")
    _, triangles = check_mesh(points[0], faces)
    positions = points.astype("<f4")
    normals = _unit_normals(points, triangles).astype("<f4")

    chunk = _Chunk()
    n_vertices = points.shape[1]
    # glTF reserves the largest number of each type for restarting strips.
    index_type = "<u2" if n_vertices < 65535 else "<u4"
    indices = chunk.add(triangles.astype(index_type).ravel(), "SCALAR", _ELEMENT_BUFFER)
    primitive: dict[str, Any] = {
        "attributes": {
            "POSITION": chunk.add(positions[0], "VEC3", _ARRAY_BUFFER),
            "NORMAL": chunk.add(normals[0], "VEC3", _ARRAY_BUFFER),
        },
        "indices": indices,
        "material": 0,
    }
    mesh: dict[str, Any] = {"name": name, "primitives": [primitive]}
    document: dict[str, Any] = {
        "asset": {"version": "2.0", "generator": "riemhuman"},
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0, "name": name}],
        "meshes": [mesh],
        "materials": [
            {
                "name": "skin",
                "doubleSided": True,
                "pbrMetallicRoughness": {
                    "baseColorFactor": list(_COLOR),
                    "metallicFactor": 0.0,
                    "roughnessFactor": 0.75,
                },
            }
        ],
    }
    if len(points) > 1:
        primitive["targets"] = [
            {
                "POSITION": chunk.add(positions[time] - positions[0], "VEC3", _ARRAY_BUFFER),
                "NORMAL": chunk.add(normals[time] - normals[0], "VEC3", _ARRAY_BUFFER),
            }
            for time in range(1, len(points))
        ]
        mesh["weights"] = [0.0] * (len(points) - 1)
        mesh["extras"] = {"targetNames": [f"time {time}" for time in range(1, len(points))]}
        document["animations"] = [_animation(chunk, len(points), seconds, name)]
    document |= {
        "accessors": chunk.accessors,
        "bufferViews": chunk.views,
        "buffers": [{"byteLength": len(chunk.content)}],
    }
    return _joined(document, chunk.content)


def _animation(chunk: _Chunk, n_times: int, seconds: float, name: str) -> dict[str, Any]:
    """Return the animation in which target i has weight 1 at time i and 0 at all other times."""
    times = np.linspace(0.0, seconds, n_times).astype("<f4")
    weights = np.eye(n_times)[:, 1:].astype("<f4")
    sampler = {
        "input": chunk.add(times, "SCALAR"),
        "output": chunk.add(weights.ravel(), "SCALAR"),
        "interpolation": "LINEAR",
    }
    channel = {"sampler": 0, "target": {"node": 0, "path": "weights"}}
    return {"name": name, "samplers": [sampler], "channels": [channel]}


def _joined(document: dict[str, Any], binary: bytes) -> bytes:
    """Return header, JSON and binary part as one file; every part is a multiple of 4 bytes."""
    text = json.dumps(document, separators=(",", ":")).encode()
    text += b" " * (-len(text) % 4)
    parts = struct.pack("<I4s", len(text), b"JSON") + text
    parts += struct.pack("<I4s", len(binary), b"BIN\0") + binary
    return struct.pack("<4sII", b"glTF", 2, 12 + len(parts)) + parts


def _unit_normals(points: np.ndarray, faces: np.ndarray) -> np.ndarray:
    """Return normals of the vertices of all surfaces, pointing up where there is no area."""
    normals = np.stack([vertex_normals(f, faces) for f in points])
    normals[~normals.any(axis=-1)] = (0.0, 1.0, 0.0)
    return normals
