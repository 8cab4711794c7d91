"""Animated skeletons with a skin in GLB files (glTF 2.0), which Blender and game engines open."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from riemhuman.arrays import Array, Integers, JSONRecord, Triangles
from riemhuman.io._gltf import (
    INDEX_ARRAY,
    SKIN_MATERIAL,
    VERTEX_ARRAY,
    GlbBuffer,
    glb_file,
    unit_normals,
)
from riemhuman.kernels.rotations import with_continuous_signs

# Joints of a vertex. Readers must support one set of four, and many read no other. Of the open
# model's vertices, 0.5 % follow other joints by more than 2 %: they are off by at most 10 mm.
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

    vertices: Array
    faces: Triangles
    joints: Array
    parents: Integers
    joint_names: tuple[str, ...]
    weights: Array
    rotations: Array
    root_places: Array
    frames_per_second: float
    name: str


def skinned_glb(animation: SkinnedAnimation) -> bytes:
    """Return a GLB file in which a skeleton moves its skin."""
    buffer = GlbBuffer()
    n_joints = len(animation.joints)
    nodes, roots = _joint_nodes(animation)
    mesh_node = len(nodes)
    nodes.append({"name": animation.name, "mesh": 0, "skin": 0})
    # The inverse of each joint's translation in the rest pose; matrices are stored by columns.
    inverse_rest = np.tile(np.eye(4), (n_joints, 1, 1))
    inverse_rest[:, 3, :3] = -animation.joints
    document: JSONRecord = {
        "nodes": nodes,
        "meshes": [{"name": animation.name, "primitives": [_primitive(animation, buffer)]}],
        "materials": [SKIN_MATERIAL],
        "skins": [
            {
                "joints": list(range(n_joints)),
                "skeleton": roots[0],
                "inverseBindMatrices": buffer.add(inverse_rest.astype("<f4")),
            }
        ],
        "animations": [_animation(animation, roots[0], buffer)],
    }
    return glb_file([*roots, mesh_node], document, buffer)


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


def _primitive(animation: SkinnedAnimation, buffer: GlbBuffer) -> JSONRecord:
    """Return the surface with the weights of its vertices."""
    vertices = animation.vertices.astype("<f4")
    (normals,) = unit_normals(animation.vertices[np.newaxis], animation.faces)
    attributes = {
        "POSITION": buffer.add(vertices, VERTEX_ARRAY),
        "NORMAL": buffer.add(normals.astype("<f4"), VERTEX_ARRAY),
    }
    joints, weights = _sorted_weights(animation.weights)
    attributes["JOINTS_0"] = buffer.add(joints, VERTEX_ARRAY)
    attributes["WEIGHTS_0"] = buffer.add(weights, VERTEX_ARRAY)
    corners = animation.faces.astype("<u4").reshape(-1)
    return {
        "attributes": attributes,
        "indices": buffer.add(corners, INDEX_ARRAY),
        "material": 0,
    }


def _sorted_weights(weights: Array) -> tuple[Array, Array]:
    """Return the four joints that move each vertex most, the strongest first, and their weights."""
    large = np.where(weights >= _SMALLEST_WEIGHT, weights, 0.0)
    order = np.argsort(-large, axis=1, kind="stable")[:, :_JOINTS_IN_SET]
    strongest = np.take_along_axis(large, order, axis=1)
    # The specification asks for joint 0 where there is no weight.
    joints = np.where(strongest > 0.0, order, 0)
    missing = _JOINTS_IN_SET - order.shape[1]
    joints, strongest = (np.pad(array, ((0, 0), (0, missing))) for array in (joints, strongest))
    strongest = strongest / strongest.sum(axis=1, keepdims=True)
    return joints.astype("u1"), strongest.astype("<f4")


def _animation(animation: SkinnedAnimation, root: int, buffer: GlbBuffer) -> JSONRecord:
    """Return the rotations of all joints, and the places of the root, over time."""
    n_frames = len(animation.rotations)
    times = buffer.add((np.arange(n_frames) / animation.frames_per_second).astype("<f4"))
    samplers = [{"input": times, "output": buffer.add(animation.root_places.astype("<f4"))}]
    channels: list[JSONRecord] = [{"sampler": 0, "target": {"node": root, "path": "translation"}}]
    # Players interpolate between quaternions.
    rotations = with_continuous_signs(animation.rotations)
    for joint in range(len(animation.joints)):
        quaternions = np.ascontiguousarray(rotations[:, joint]).astype("<f4")
        channels.append({"sampler": len(samplers), "target": {"node": joint, "path": "rotation"}})
        samplers.append({"input": times, "output": buffer.add(quaternions)})
    return {"name": animation.name, "samplers": samplers, "channels": channels}
