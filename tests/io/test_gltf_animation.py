"""Animated skeletons in GLB files: our own, and those of other programs."""

import json
import struct

import numpy as np
import pytest
from recorded_people import seven_frames
from scipy.spatial.transform import Rotation

from riemhuman.datasets import load_open_motions, load_recording
from riemhuman.errors import FileFormatError
from riemhuman.io import save_glb


@pytest.fixture
def knees():
    return seven_frames()


def test_our_own_files_are_read_back(knees, tmp_path):
    knees.save(tmp_path / "a.glb")
    read = load_recording(tmp_path / "a.glb")
    np.testing.assert_allclose(read[:], knees[:], atol=1e-5)
    np.testing.assert_allclose(read.betas, knees.betas, atol=1e-6)
    assert read.frames_per_second == pytest.approx(knees.frames_per_second)
    assert read.recording.has_rest_pose  # no node is turned at rest


def changed(path, change):
    """Write the JSON part of a file anew."""
    content = path.read_bytes()
    (size,) = struct.unpack_from("<I", content, 12)
    document = json.loads(content[20 : 20 + size])
    change(document)
    text = json.dumps(document).encode()
    text += b" " * (-len(text) % 4)
    rest = content[20 + size :]
    header = struct.pack("<4sII", b"glTF", 2, 20 + len(text) + len(rest))
    path.write_bytes(header + struct.pack("<I4s", len(text), b"JSON") + text + rest)


def test_files_of_other_programs(tmp_path):
    """Other names, and a rotated node above the root."""
    (motion,) = load_open_motions("coarse", "average man", "punching", 30.0)
    motion.save(tmp_path / "a.glb")

    def change(document):
        nodes = document["nodes"]
        root = next(k for k, node in enumerate(nodes) if node["name"] == "pelvis")
        for node in nodes:
            side, _, part = node["name"].partition("_")
            if side in ("left", "right"):
                node["name"] = f"mixamorig:{side.title()}{part.title()}"
            node.pop("scale", None)
        turned = Rotation.from_euler("y", 90, degrees=True).as_quat().tolist()
        nodes.append({"name": "Armature", "children": [root], "rotation": turned})
        scene = document["scenes"][0]["nodes"]
        scene[scene.index(root)] = len(nodes) - 1

    changed(tmp_path / "a.glb", change)
    read = load_recording(tmp_path / "a.glb", motion.model, betas=motion.betas)
    assert read.errors.positions.mean() < 0.02
    turned = motion.translations[-1] - motion.translations[0]
    moved = read.translations[-1] - read.translations[0]
    np.testing.assert_allclose(np.linalg.norm(moved), np.linalg.norm(turned), atol=0.02)


def test_files_without_a_moving_skeleton_are_refused(knees, tmp_path):
    save_glb(tmp_path / "a.glb", knees[0], knees.faces)
    with pytest.raises(FileFormatError, match=r"a\.glb.*it holds no animation"):
        load_recording(tmp_path / "a.glb")
    knees.save(tmp_path / "b.glb")
    changed(tmp_path / "b.glb", lambda document: document["animations"][0].update(channels=[]))
    with pytest.raises(FileFormatError, match="moves no node"):
        load_recording(tmp_path / "b.glb")
