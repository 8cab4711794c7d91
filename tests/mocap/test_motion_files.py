"""Files of motions: what is written is read back, by our readers and by independent ones."""

import numpy as np
import pytest
from model_pickles import smpl_model
from recorded_people import joints_in_space, seven_frames

from riemhuman.bodies.skinning import SMPL_JOINTS
from riemhuman.datasets import (
    load_amass,
    load_bvh,
    load_mesh_motions,
    load_recording,
    motion_from_arrays,
)
from riemhuman.errors import FileError, FileFormatError
from riemhuman.io import load_mesh


@pytest.fixture
def knees():
    return seven_frames()


def joints_of(motion):
    """Return the places and the rotations of the joints of a motion's body in all frames."""
    rotations, places = joints_in_space(motion.model, motion.betas, motion.pose_vectors)
    return places + motion.translations[:, None], rotations


def test_bvh(knees, tmp_path):
    knees.save(tmp_path / "a.bvh")
    read = load_bvh(tmp_path / "a.bvh")
    assert (len(read), read.name) == (7, "a")
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
    assert fields["poses"].shape == (7, 156)
    assert fields["trans"].shape == (7, 3)
    assert np.ptp(knees.translations, axis=0)[1] == pytest.approx(np.ptp(fields["trans"][:, 2]))


@pytest.mark.parametrize("frames", [[2, 3, 4], [0, 2, 4, 6], [6, 5, 0, 1], [3]])
def test_frames_cut_by_other_programs_play_what_the_file_says(knees, tmp_path, frames):
    """They know the fields of AMASS, and leave ours as they were."""
    knees.save(tmp_path / "a.npz")
    fields = dict(np.load(tmp_path / "a.npz"))
    cut = {name: fields[name][frames] for name in ("poses", "trans")}
    np.savez(tmp_path / "b.npz", **fields | cut)
    (read,) = load_amass(tmp_path / "b.npz")
    np.testing.assert_allclose(read[:], knees[:][frames], atol=1e-9)
    cut["trans"] = cut["trans"][1:]
    np.savez(tmp_path / "c.npz", **fields | cut)
    with pytest.raises(FileFormatError, match="must have shape"):
        load_amass(tmp_path / "c.npz")


def test_poses_edited_by_other_programs(knees, tmp_path):
    """The same person then performs what the file shows, as with any file of AMASS."""
    knees.save(tmp_path / "a.npz")
    fields = dict(np.load(tmp_path / "a.npz"))
    fields["poses"] = fields["poses"].astype(np.float32)
    np.savez(tmp_path / "single.npz", **fields)  # which changes no pose
    np.testing.assert_allclose(load_amass(tmp_path / "single.npz")[0][:], knees[:], atol=1e-9)
    elbow = slice(3 * SMPL_JOINTS.index("left_elbow"), 3 * SMPL_JOINTS.index("left_elbow") + 3)
    fields["poses"][:, elbow] = 0.0
    np.savez(tmp_path / "b.npz", **fields)
    (read,) = load_amass(tmp_path / "b.npz")
    np.testing.assert_array_equal(read.betas, knees.betas)
    moved = joints_of(read)[0] - joints_of(knees)[0]
    apart = np.linalg.norm(moved, axis=-1).max(axis=0)
    unmoved = [name not in ("left_wrist",) for name in read.model.joint_names]
    assert apart[unmoved].max() < 0.07
    assert apart[~np.array(unmoved)].min() > 0.15


def test_amass_of_smpl(tmp_path):
    model, rng = smpl_model(52), np.random.default_rng(1)
    poses, places = 0.3 * rng.normal(size=(5, 52, 3)), rng.normal(size=(5, 3))
    betas = rng.normal(size=16)
    motion = motion_from_arrays(poses, places, 60.0, up="y", betas=betas, model=model)
    motion.save(tmp_path / "a.npz")
    (read,) = load_amass(tmp_path / "a.npz", model)
    np.testing.assert_allclose(read[:], motion[:], atol=1e-9)
    assert read.frames_per_second == 60.0


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
