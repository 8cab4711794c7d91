"""Skinned animations in GLB files, played by the specification."""

import json
import struct

import numpy as np
from recorded_people import seven_frames
from scipy.spatial.transform import Rotation, Slerp

from riemhuman.io import load_mesh

TYPES = {5121: "u1", 5125: "<u4", 5126: "<f4"}
WIDTHS = {"SCALAR": (), "VEC3": (3,), "VEC4": (4,), "MAT4": (4, 4)}


class GlbAnimation:
    """An independent player of a GLB file: a skeleton with a skin, by the specification."""

    def __init__(self, path):
        content = path.read_bytes()
        (size,) = struct.unpack_from("<I", content, 12)
        self.document, self.binary = json.loads(content[20 : 20 + size]), content[28 + size :]

    def array(self, number):
        accessor = self.document["accessors"][number]
        view = self.document["bufferViews"][accessor["bufferView"]]
        shape = (accessor["count"], *WIDTHS[accessor["type"]])
        dtype = TYPES[accessor["componentType"]]
        array = np.frombuffer(self.binary, dtype, int(np.prod(shape)), view["byteOffset"])
        return array.reshape(shape)

    def vertices(self, seconds):
        nodes = self.document["nodes"]
        local = np.tile(np.eye(4), (len(nodes), 1, 1))
        for node, matrix in zip(nodes, local, strict=True):
            matrix[:3, 3] = node.get("translation", (0, 0, 0))
        (animation,) = self.document["animations"]
        for channel in animation["channels"]:
            sampler = animation["samplers"][channel["sampler"]]
            times, values = self.array(sampler["input"]), self.array(sampler["output"])
            node = channel["target"]["node"]
            if channel["target"]["path"] == "rotation":
                turned = Slerp(times, Rotation.from_quat(values))(seconds)
                local[node, :3, :3] = turned.as_matrix()
            else:
                local[node, :3, 3] = [np.interp(seconds, times, values[:, k]) for k in range(3)]
        matrices = local.copy()
        waiting = list(self.document["scenes"][0]["nodes"])
        while waiting:
            number = waiting.pop()
            for child in nodes[number].get("children", ()):
                matrices[child] = matrices[number] @ local[child]
                waiting.append(child)
        (skin,) = self.document["skins"]
        backwards = np.swapaxes(self.array(skin["inverseBindMatrices"]), 1, 2)
        joints = matrices[skin["joints"]] @ backwards
        attributes = self.document["meshes"][0]["primitives"][0]["attributes"]
        rest = self.array(attributes["POSITION"])
        moved = np.zeros((len(rest), 3))
        for number in range(sum(name.startswith("JOINTS") for name in attributes)):
            numbers = self.array(attributes[f"JOINTS_{number}"])
            weights = self.array(attributes[f"WEIGHTS_{number}"])
            for k in range(4):
                joint = joints[numbers[:, k]]
                moved += weights[:, k, None] * (
                    np.einsum("vij,vj->vi", joint[:, :3, :3], rest) + joint[:, :3, 3]
                )
        return moved


def test_skinned_glb(tmp_path):
    knees = seven_frames()
    knees.save(tmp_path / "a.glb")
    vertices, faces = load_mesh(tmp_path / "a.glb")
    np.testing.assert_allclose(vertices, knees.model(knees.betas), atol=1e-6)
    np.testing.assert_array_equal(faces, knees.faces)
    played = GlbAnimation(tmp_path / "a.glb")
    for frame in (0, 3, 6):
        vertices = played.vertices(frame / knees.frames_per_second)
        # Four joints move a vertex: a few vertices follow others a little.
        np.testing.assert_allclose(vertices, knees[frame], atol=8e-3)
        assert np.abs(vertices - knees[frame]).mean() < 1e-4
    # Half-way between frames, every joint is half-way too.
    between = played.vertices(2.5 / knees.frames_per_second)
    first, second = (Rotation.from_rotvec(knees.pose_vectors[frame]) for frame in (2, 3))
    half = first * Rotation.from_rotvec(0.5 * (first.inv() * second).as_rotvec())
    place = knees.translations[2:4].mean(axis=0)
    expected = knees.model(knees.betas, half.as_rotvec(), place)
    np.testing.assert_allclose(between, expected, atol=8e-3)
    assert np.abs(between - expected).mean() < 1e-4
    # The four weights that every program reads sum to one.
    attributes = played.document["meshes"][0]["primitives"][0]["attributes"]
    assert "WEIGHTS_1" not in attributes
    sums = played.array(attributes["WEIGHTS_0"]).sum(axis=1)
    np.testing.assert_allclose(sums, 1.0, atol=1e-6)
