"""Writing of GLB files (glTF 2.0): paths of surfaces for viewers, game engines and Blender.

A path is written as a mesh, its first surface, with the others as morph targets, which an animation
shows one after the other; between them, glTF interpolates the vertices linearly. The exporter of
trimesh knows no morph targets.
"""

from __future__ import annotations

import json
import os
import struct
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike

from riemhuman.arrays import Array, JSONRecord, Triangles
from riemhuman.checks import checked, instance, positive, real_array, values_of
from riemhuman.errors import ArgumentError
from riemhuman.io.files import file_path, suffix_of, write_bytes
from riemhuman.io.mesh_arrays import check_mesh

# Numbers by which glTF names types, by NumPy's names for them, and uses of arrays.
_COMPONENT_TYPES = {"u1": 5121, "u2": 5123, "u4": 5125, "f4": 5126}
_WIDTHS = {1: "SCALAR", 3: "VEC3", 4: "VEC4", 16: "MAT4"}
VERTEX_ARRAY = 34962
INDEX_ARRAY = 34963
# Surfaces more than this many extents from the origin are written near it and moved by their node.
_FAR = 50.0
SKIN_MATERIAL = {
    "name": "skin",
    "pbrMetallicRoughness": {
        "baseColorFactor": [0.80, 0.72, 0.66, 1.0],
        "metallicFactor": 0.0,
        "roughnessFactor": 0.75,
    },
}


@dataclass
class GlbBuffer:
    """The binary part of a file, and the list of the arrays in it."""

    data: bytearray = field(default_factory=bytearray)
    views: list[JSONRecord] = field(default_factory=list)
    accessors: list[JSONRecord] = field(default_factory=list)

    def add(self, array: Array, target: int | None = None) -> int:
        """Append an array, whose rows are entries, and return its number."""
        rows = array.reshape(len(array), -1)
        view: JSONRecord = {
            "buffer": 0,
            "byteOffset": len(self.data),
            "byteLength": array.nbytes,
        }
        if target is not None:
            view["target"] = target
        self.accessors.append(
            {
                "bufferView": len(self.views),
                "componentType": _COMPONENT_TYPES[array.dtype.str[1:]],
                "count": len(array),
                "type": _WIDTHS[rows.shape[1]],
                "min": rows.min(axis=0).tolist(),
                "max": rows.max(axis=0).tolist(),
            }
        )
        self.views.append(view)
        self.data += _padded(array.tobytes(), b"\0")
        return len(self.accessors) - 1


def glb_file(roots: list[int], document: JSONRecord, buffer: GlbBuffer) -> bytes:
    """Return a GLB file: a header, the document of a scene as JSON, and the arrays."""
    arrays: JSONRecord = {
        "asset": {"version": "2.0", "generator": "riemhuman"},
        "scene": 0,
        "scenes": [{"nodes": roots}],
        "accessors": buffer.accessors,
        "bufferViews": buffer.views,
        "buffers": [{"byteLength": len(buffer.data)}],
    }
    text = _padded(json.dumps(document | arrays, separators=(",", ":")).encode(), b" ")
    # A chunk begins with its size (uint32) and its kind (four letters); the file with four letters,
    # the version and the size of all (uint32 each), 12 bytes.
    chunks = struct.pack("<I4s", len(text), b"JSON") + text
    chunks += struct.pack("<I4s", len(buffer.data), b"BIN\0") + buffer.data
    return struct.pack("<4sII", b"glTF", 2, 12 + len(chunks)) + chunks


def _padded(content: bytes, filler: bytes) -> bytes:
    """Return content filled up to a multiple of four bytes, as glTF requires."""
    return content + filler * (-len(content) % 4)


@checked(seconds=positive, name=instance(str, "a text"))
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
    surfaces : array_like, shape (n_times, V, 3) or (V, 3)
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
    shape = ("n_times", "n_vertices", 3)
    surfaces = values_of(surfaces, "surfaces")
    if surfaces.ndim == 2:
        surfaces = surfaces[np.newaxis]
    points = real_array(surfaces, "surfaces", shape, batched=False)
    if len(points) == 0:
        raise ArgumentError(f"surfaces holds no surface; found shape {points.shape}")
    _, triangles = check_mesh(points[0], faces)
    write_bytes(file, _glb(points, triangles, seconds, name))


def write_glb(vertices: Array, faces: Triangles) -> bytes:
    """Return a still mesh as a GLB file."""
    return _glb(vertices[np.newaxis], faces, 1.0, "mesh")


def _glb(points: Array, triangles: Triangles, seconds: float, name: str) -> bytes:
    offset = _offset(points)
    positions = (points - offset).astype("<f4")
    normals = unit_normals(points, triangles).astype("<f4")
    buffer = GlbBuffer()
    n_times, n_vertices = points.shape[:2]
    # glTF reserves the largest number of each type for restarting strips.
    index_type = "<u2" if n_vertices < 65535 else "<u4"
    primitive: JSONRecord = {
        "attributes": {
            "POSITION": buffer.add(positions[0], VERTEX_ARRAY),
            "NORMAL": buffer.add(normals[0], VERTEX_ARRAY),
        },
        "indices": buffer.add(triangles.astype(index_type).ravel(), INDEX_ARRAY),
        "material": 0,
    }
    mesh: JSONRecord = {"name": name, "primitives": [primitive]}
    node: JSONRecord = {"mesh": 0, "name": name}
    if any(offset):
        node["translation"] = offset
    document: JSONRecord = {
        "nodes": [node],
        "meshes": [mesh],
        "materials": [SKIN_MATERIAL | {"doubleSided": True}],
    }
    if n_times > 1:
        primitive["targets"] = [
            {
                "POSITION": buffer.add(positions[time] - positions[0], VERTEX_ARRAY),
                "NORMAL": buffer.add(normals[time] - normals[0], VERTEX_ARRAY),
            }
            for time in range(1, n_times)
        ]
        mesh["weights"] = [0.0] * (n_times - 1)
        mesh["extras"] = {"targetNames": [f"time {time}" for time in range(1, n_times)]}
        # Target i has weight 1 at time i and 0 at all other times.
        sampler = {
            "input": buffer.add(np.linspace(0.0, seconds, n_times).astype("<f4")),
            "output": buffer.add(np.eye(n_times)[:, 1:].astype("<f4").ravel()),
            "interpolation": "LINEAR",
        }
        channel = {"sampler": 0, "target": {"node": 0, "path": "weights"}}
        document["animations"] = [{"name": name, "samplers": [sampler], "channels": [channel]}]
    return glb_file([0], document, buffer)


def _offset(points: Array) -> list[float]:
    """Return the place of surfaces far from the origin, where single precision is too coarse."""
    low, high = points.min(axis=(0, 1)), points.max(axis=(0, 1))
    if np.abs(points).max() <= _FAR * (high - low).max():
        return [0.0, 0.0, 0.0]
    middle: list[float] = np.round(0.5 * (low + high)).tolist()
    return middle


def unit_normals(points: Array, faces: Triangles) -> Array:
    """Return normals of the vertices of all surfaces, pointing up where there is no area."""
    from riemhuman.kernels.surface import vertex_normals  # takes long, as autograd does

    normals = np.stack([vertex_normals(f, faces) for f in points])
    normals[~normals.any(axis=-1)] = (0.0, 1.0, 0.0)
    return normals
