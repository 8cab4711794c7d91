"""Writing of GLB files (glTF 2.0): paths of surfaces for viewers, game engines and Blender.

A path is written as a mesh, its first surface, with the others as morph targets, which an animation
shows one after the other; between them, glTF interpolates the vertices linearly. The exporter of
trimesh knows no morph targets.
"""

from __future__ import annotations

import json
import os
import struct

import numpy as np
from numpy.typing import ArrayLike

from riemhuman.arrays import JSONRecord
from riemhuman.checks import real_array, real_number, values_of
from riemhuman.errors import ArgumentError
from riemhuman.io.files import file_path, suffix_of, write_bytes
from riemhuman.io.mesh_arrays import check_mesh

_FLOAT, _SHORT, _INT = 5126, 5123, 5125  # component types of glTF
# Surfaces more than this many extents from the origin are written near it and moved by their node.
_FAR = 50.0
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
    seconds = real_number(seconds, "seconds", minimum=0, strict=True)
    shape = ("n_times", "n_vertices", 3)
    surfaces = values_of(surfaces, "surfaces")
    if surfaces.ndim == 2:
        surfaces = surfaces[np.newaxis]
    points = real_array(surfaces, "surfaces", shape, batched=False)
    if len(points) == 0:
        raise ArgumentError(f"surfaces holds no surface; found shape {points.shape}")
    _, triangles = check_mesh(points[0], faces)
    write_bytes(file, _glb(points, triangles, seconds, name))


def write_glb(vertices: np.ndarray, faces: np.ndarray) -> bytes:
    """Return a still mesh as a GLB file."""
    return _glb(vertices[np.newaxis], faces, 1.0, "mesh")


def _glb(points: np.ndarray, triangles: np.ndarray, seconds: float, name: str) -> bytes:
    offset = _offset(points)
    positions = (points - offset).astype("<f4")
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
    primitive: JSONRecord = {
        "attributes": {"POSITION": add(positions[0]), "NORMAL": add(normals[0])},
        "indices": add(triangles.astype(index_type).ravel()),
        "material": 0,
    }
    mesh: JSONRecord = {"name": name, "primitives": [primitive]}
    document: JSONRecord = {
        "asset": {"version": "2.0", "generator": "riemhuman"},
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0, "name": name} | ({"translation": offset} if any(offset) else {})],
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


def _offset(points: np.ndarray) -> list[float]:
    """Return the place of surfaces far from the origin, where single precision is too coarse."""
    low, high = points.min(axis=(0, 1)), points.max(axis=(0, 1))
    if np.abs(points).max() <= _FAR * (high - low).max():
        return [0.0, 0.0, 0.0]
    return np.round(0.5 * (low + high)).tolist()


def _describe_arrays(arrays: list[np.ndarray], document: JSONRecord) -> bytes:
    """Return arrays as the binary part of a file, and write their layout into its document."""
    binary = bytearray()
    views: list[JSONRecord] = []
    accessors: list[JSONRecord] = []
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
