"""Animated skeletons with a skin in GLB files (glTF 2.0), which Blender and game engines open."""

from __future__ import annotations

import json
import struct
from dataclasses import dataclass, field

import numpy as np

from riemhuman.arrays import JSONRecord
from riemhuman.kernels.surface import vertex_normals

_FLOAT, _BYTE, _INT = 5126, 5121, 5125  # component types of glTF
_ARRAY_BUFFER, _ELEMENT_BUFFER = 34962, 34963
_WIDTHS = {1: "SCALAR", 3: "VEC3", 4: "VEC4", 16: "MAT4"}
_MATERIAL = {
    "name": "skin",
    "pbrMetallicRoughness": {
        "baseColorFactor": [0.80, 0.72, 0.66, 1.0],
        "metallicFactor": 0.0,
        "roughnessFactor": 0.75,
    },
}
# A vertex has so many joints in a set of weights. Readers need to know one set; most know more.
_JOINTS_IN_SET = 4
# Smaller weights move no vertex by as much as a tenth of a millimetre.
_SMALLEST_WEIGHT = 1e-5


@dataclass(frozen=True)
class SkinnedAnimation:
    """A surface that moves with the joints of a skeleton.

    `rotations` (n_frames, J, 4) are unit quaternions x, y, z, w relative to the parents, and
    `root_places` (n_frames, 3) positions of the root; in the rest pose nothing is rotated, and the
    joints are at `joints` (J, 3). `weights` (V, J) say how far each vertex moves with each joint.
    """

    vertices: np.ndarray
    faces: np.ndarray
    joints: np.ndarray
    parents: np.ndarray
    joint_names: tuple[str, ...]
    weights: np.ndarray
    rotations: np.ndarray
    root_places: np.ndarray
    frames_per_second: float
    name: str


@dataclass
class _Buffer:
    """The binary part of a file, and the list of the arrays in it."""

    data: bytearray = field(default_factory=bytearray)
    views: list[JSONRecord] = field(default_factory=list)
    accessors: list[JSONRecord] = field(default_factory=list)

    def add(self, array: np.ndarray, target: int | None = None) -> int:
        """Append an array, a row an entry, and return its number."""
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
                "componentType": {"f4": _FLOAT, "u1": _BYTE, "u4": _INT}[array.dtype.str[1:]],
                "count": len(array),
                "type": _WIDTHS[rows.shape[1]],
                "min": rows.min(axis=0).tolist(),
                "max": rows.max(axis=0).tolist(),
            }
        )
        self.views.append(view)
        self.data += array.tobytes() + b"\0" * (-array.nbytes % 4)
        return len(self.accessors) - 1


def skinned_glb(animation: SkinnedAnimation) -> bytes:
    """Return a GLB file in which a skeleton moves its skin."""
    buffer = _Buffer()
    n_joints = len(animation.joints)
    nodes, roots = _joint_nodes(animation)
    mesh_node = len(nodes)
    nodes.append({"name": animation.name, "mesh": 0, "skin": 0})
    # Each joint at its place in the rest pose, backwards; matrices are stored by columns.
    backwards = np.tile(np.eye(4), (n_joints, 1, 1))
    backwards[:, 3, :3] = -animation.joints
    document = {
        "asset": {"version": "2.0", "generator": "riemhuman"},
        "scene": 0,
        "scenes": [{"nodes": [*roots, mesh_node]}],
        "nodes": nodes,
        "meshes": [{"name": animation.name, "primitives": [_primitive(animation, buffer)]}],
        "materials": [_MATERIAL],
        "skins": [
            {
                "joints": list(range(n_joints)),
                "skeleton": roots[0],
                "inverseBindMatrices": buffer.add(backwards.astype("<f4")),
            }
        ],
        "animations": [_animation(animation, roots[0], buffer)],
        "accessors": buffer.accessors,
        "bufferViews": buffer.views,
        "buffers": [{"byteLength": len(buffer.data)}],
    }
    return _chunks(document, bytes(buffer.data))


def _joint_nodes(animation: SkinnedAnimation) -> tuple[list[JSONRecord], list[int]]:
    """Return a node for each joint, in the rest pose, and the numbers of the roots."""
    nodes: list[JSONRecord] = []
    for joint, parent in enumerate(animation.parents):
        start = animation.joints[parent] if parent >= 0 else np.zeros(3)
        children = np.flatnonzero(animation.parents == joint).tolist()
        node = {
            "name": animation.joint_names[joint],
            "translation": (animation.joints[joint] - start).tolist(),
        }
        nodes.append(node | ({"children": children} if children else {}))
    return nodes, np.flatnonzero(animation.parents < 0).tolist()


def _primitive(animation: SkinnedAnimation, buffer: _Buffer) -> JSONRecord:
    """Return the surface with the weights of its vertices."""
    vertices = animation.vertices.astype("<f4")
    normals = vertex_normals(animation.vertices, animation.faces)
    normals[~normals.any(axis=-1)] = (0.0, 1.0, 0.0)
    attributes = {
        "POSITION": buffer.add(vertices, _ARRAY_BUFFER),
        "NORMAL": buffer.add(normals.astype("<f4"), _ARRAY_BUFFER),
    }
    joints, weights = _sorted_weights(animation.weights)
    for number in range(joints.shape[1] // _JOINTS_IN_SET):
        columns = slice(number * _JOINTS_IN_SET, (number + 1) * _JOINTS_IN_SET)
        attributes[f"JOINTS_{number}"] = buffer.add(
            np.ascontiguousarray(joints[:, columns]), _ARRAY_BUFFER
        )
        attributes[f"WEIGHTS_{number}"] = buffer.add(
            np.ascontiguousarray(weights[:, columns]), _ARRAY_BUFFER
        )
    corners = animation.faces.astype("<u4").reshape(-1)
    return {
        "attributes": attributes,
        "indices": buffer.add(corners, _ELEMENT_BUFFER),
        "material": 0,
    }


def _sorted_weights(weights: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the joints of each vertex, the strongest first, and their weights, sets of four."""
    kept = np.where(weights >= _SMALLEST_WEIGHT, weights, 0.0)
    n_joints = max(1, int((kept > 0.0).sum(axis=1).max()))
    n_columns = -(-n_joints // _JOINTS_IN_SET) * _JOINTS_IN_SET
    order = np.argsort(-kept, axis=1, kind="stable")[:, :n_columns]
    strongest = np.take_along_axis(kept, order, axis=1)
    # The specification asks for joint 0 where there is no weight.
    joints = np.where(strongest > 0.0, order, 0)
    missing = n_columns - order.shape[1]
    joints, strongest = (np.pad(array, ((0, 0), (0, missing))) for array in (joints, strongest))
    strongest = strongest / strongest.sum(axis=1, keepdims=True)
    return joints.astype("u1"), strongest.astype("<f4")


def _animation(animation: SkinnedAnimation, root: int, buffer: _Buffer) -> JSONRecord:
    """Return the rotations of all joints, and the places of the root, over time."""
    n_frames = len(animation.rotations)
    times = buffer.add((np.arange(n_frames) / animation.frames_per_second).astype("<f4"))
    samplers = [{"input": times, "output": buffer.add(animation.root_places.astype("<f4"))}]
    channels: list[JSONRecord] = [{"sampler": 0, "target": {"node": root, "path": "translation"}}]
    for joint in range(len(animation.joints)):
        quaternions = _continuous(animation.rotations[:, joint]).astype("<f4")
        channels.append({"sampler": len(samplers), "target": {"node": joint, "path": "rotation"}})
        samplers.append({"input": times, "output": buffer.add(quaternions)})
    return {"name": animation.name, "samplers": samplers, "channels": channels}


def _continuous(quaternions: np.ndarray) -> np.ndarray:
    """Return the same rotations by quaternions whose signs do not jump, as players interpolate."""
    products = np.sum(quaternions[1:] * quaternions[:-1], axis=-1)
    signs = np.cumprod(np.where(products < 0.0, -1.0, 1.0))
    return np.concatenate([quaternions[:1], signs[:, None] * quaternions[1:]])


def _chunks(document: JSONRecord, binary: bytes) -> bytes:
    text = json.dumps(document, separators=(",", ":")).encode()
    text += b" " * (-len(text) % 4)
    parts = struct.pack("<I4s", len(text), b"JSON") + text
    parts += struct.pack("<I4s", len(binary), b"BIN\0") + binary
    return struct.pack("<4sII", b"glTF", 2, 12 + len(parts)) + parts
