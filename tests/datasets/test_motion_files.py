"""Files of motions: what is written is read back, by our readers and by independent ones."""

import json
import struct

import numpy as np
import pytest
import trimesh
from model_pickles import smpl_fields
from scipy.spatial.transform import Rotation, Slerp

from riemhuman.bodies import BodyModel
from riemhuman.datasets import (
    ArrayMotion,
    load_amass,
    load_bvh,
    load_mesh_motions,
    load_open_motions,
    load_recording,
    motion_from_arrays,
)
from riemhuman.errors import FileError, FileFormatError
from riemhuman.io import load_mesh

N_FRAMES = 7


@pytest.fixture(scope="module")
def knees():
    (motion,) = load_open_motions("coarse", subjects="lean runner", sequences="knees")
    frames = slice(0, 70, 10)
    return ArrayMotion(
        ("ann", "knees"), 30.0, motion.model, motion.betas,
        motion.pose_vectors[frames], motion.translations[frames] + [0.3, 0.0, -0.2],
    )  # fmt: skip


def joints_of(motion):
    """Return the joints of a motion's body in all frames, from the model's definition."""
    model, joints = motion.model, motion.model.joints(motion.betas)
    rotations = Rotation.from_rotvec(motion.pose_vectors.reshape(-1, 3)).as_matrix()
    rotations = rotations.reshape(len(motion), -1, 3, 3).copy()
    places = np.tile(joints, (len(motion), 1, 1)) + motion.translations[:, None]
    for joint in model.joint_order:
        parent = model.parents[joint]
        if parent >= 0:
            step = rotations[:, parent] @ (joints[joint] - joints[parent])
            places[:, joint] = places[:, parent] + step
            rotations[:, joint] = rotations[:, parent] @ rotations[:, joint]
    return places, rotations


def test_bvh(knees, tmp_path):
    knees.save(tmp_path / "a.bvh")
    read = load_bvh(tmp_path / "a.bvh")
    assert (len(read), read.name) == (N_FRAMES, "a")
    assert read.frames_per_second == pytest.approx(30.0)
    numbers = [read.joint_names.index(name) for name in knees.model.joint_names]
    places, rotations = joints_of(knees)
    np.testing.assert_allclose(0.01 * read.positions[:, numbers], places, atol=1e-6)
    np.testing.assert_allclose(read.global_rotations[:, numbers], rotations, atol=1e-5)
    # Toes, hands and head have ends.
    ends = [name for name in read.joint_names if name.endswith(" end")]
    assert len(ends) == 5


def test_amass_of_the_open_model(knees, tmp_path):
    (tmp_path / "ann").mkdir()
    knees.save(tmp_path / "ann" / "a.npz")
    (read,) = load_amass(tmp_path / "ann" / "a.npz")
    np.testing.assert_allclose(read[:], knees[:], atol=1e-12)
    assert (read.subject, read.sequence, read.frames_per_second) == ("ann", "a", 30.0)
    np.testing.assert_array_equal(
        load_recording(tmp_path / "ann" / "a.npz", frames_per_second=15.0)[:], read[::2]
    )
    # Other programs find SMPL-H's layout, z up.
    fields = dict(np.load(tmp_path / "ann" / "a.npz"))
    assert fields["poses"].shape == (N_FRAMES, 156)
    assert fields["trans"].shape == (N_FRAMES, 3)
    assert np.ptp(knees.translations, axis=0)[1] == pytest.approx(np.ptp(fields["trans"][:, 2]))


def test_bones_in_amass_point_as_the_model_s(knees, tmp_path):
    knees.save(tmp_path / "a.npz")
    fields = dict(np.load(tmp_path / "a.npz"))
    motion = motion_from_arrays(fields["poses"], fields["trans"], 30.0, up="z")
    recorded, _ = joints_of(knees)
    skeleton = motion.recording
    up = np.array([[1, 0, 0], [0, 0, 1], [0, -1, 0]])
    for first, second in (
        ("left_hip", "left_knee"), ("right_knee", "right_ankle"), ("left_shoulder", "left_elbow"),
        ("right_elbow", "right_wrist"), ("left_ankle", "left_toes"),
    ):  # fmt: skip
        names = knees.model.joint_names
        bone = recorded[:, names.index(second)] - recorded[:, names.index(first)]
        names = skeleton.joint_names
        other = (
            skeleton.positions[:, names.index(second)] - skeleton.positions[:, names.index(first)]
        )
        bone, other = (v / np.linalg.norm(v, axis=-1, keepdims=True) for v in (bone, other @ up.T))
        np.testing.assert_allclose(other, bone, atol=1e-9)


def test_amass_of_smpl(tmp_path):
    fields = smpl_fields(52, n_vertices=30, n_betas=16, rng=0)
    fields["faces"], fields["joint_regressor"] = fields.pop("f"), fields.pop("J_regressor")
    model, rng = BodyModel(**fields), np.random.default_rng(1)
    poses, places = 0.3 * rng.normal(size=(5, 52, 3)), rng.normal(size=(5, 3))
    betas = rng.normal(size=16)
    motion = motion_from_arrays(poses, places, 60.0, up="y", betas=betas, model=model)
    motion.save(tmp_path / "a.npz")
    (read,) = load_amass(tmp_path / "a.npz", model)
    np.testing.assert_allclose(read[:], motion[:], atol=1e-9)
    assert read.frames_per_second == 60.0


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
                each = joints[numbers[:, k]]
                moved += weights[:, k, None] * (
                    np.einsum("vij,vj->vi", each[:, :3, :3], rest) + each[:, :3, 3]
                )
        return moved


def test_skinned_glb(knees, tmp_path):
    knees.save(tmp_path / "a.glb")
    played = GlbAnimation(tmp_path / "a.glb")
    for frame in (0, 3, N_FRAMES - 1):
        vertices = played.vertices(frame / knees.frames_per_second)
        np.testing.assert_allclose(vertices, knees[frame], atol=1e-4)
    # Half-way between frames, every joint is half-way too.
    between = played.vertices(2.5 / knees.frames_per_second)
    first, second = (Rotation.from_rotvec(knees.pose_vectors[frame]) for frame in (2, 3))
    half = first * Rotation.from_rotvec(0.5 * (first.inv() * second).as_rotvec())
    place = knees.translations[2:4].mean(axis=0)
    expected = knees.model(knees.betas, half.as_rotvec(), place)
    np.testing.assert_allclose(between, expected, atol=1e-4)
    # The weights of a vertex sum to one, as the specification asks.
    attributes = played.document["meshes"][0]["primitives"][0]["attributes"]
    sums = sum(
        played.array(number).sum(axis=1)
        for name, number in attributes.items()
        if name.startswith("WEIGHTS")
    )
    np.testing.assert_allclose(sums, 1.0, atol=1e-6)


def test_other_programs_open_the_glb(knees, tmp_path):
    knees.save(tmp_path / "a.glb")
    scene = trimesh.load(tmp_path / "a.glb", process=False)
    (mesh,) = scene.geometry.values()
    rest = knees.model(knees.betas)
    np.testing.assert_array_equal(mesh.faces, knees.faces)
    np.testing.assert_allclose(mesh.vertices, rest, atol=1e-6)
    vertices, faces = load_mesh(tmp_path / "a.glb")
    np.testing.assert_allclose(vertices, rest, atol=1e-6)
    np.testing.assert_array_equal(faces, knees.faces)


def test_frames_as_meshes(knees, tmp_path):
    knees.save(tmp_path / "frames")
    (read,) = load_mesh_motions(tmp_path / "frames", 30.0)
    np.testing.assert_allclose(read[:], knees[:], atol=1e-6)
    with pytest.raises(FileError, match="frames exists; name a folder that does not exist yet"):
        knees.save(tmp_path / "frames")
    read.save(tmp_path / "again.glb")
    vertices, _ = load_mesh(tmp_path / "again.glb")
    np.testing.assert_allclose(vertices, knees[0], atol=1e-6)


def test_other_endings(knees, tmp_path):
    with pytest.raises(FileFormatError, match=r"one of \.bvh, \.npz, \.glb; found '\.fbx'"):
        knees.save(tmp_path / "a.fbx")
    knees.save(tmp_path / "frames")
    (meshes,) = load_mesh_motions(tmp_path / "frames")
    with pytest.raises(FileFormatError, match=r"the ending must be \.glb; found '\.bvh'"):
        meshes.save(tmp_path / "a.bvh")
    assert sorted(file.name for file in tmp_path.iterdir()) == ["frames"]
