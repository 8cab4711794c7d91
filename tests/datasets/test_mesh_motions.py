"""Folders of meshes are motions."""

import numpy as np
import pytest

import riemhuman as rh


@pytest.fixture
def folder(tmp_path):
    motion = rh.datasets.load_open_motions("coarse", sequences="knees")[0]
    for name in ("anna", "ben"):
        (tmp_path / name).mkdir()
        for number in (1, 2, 10):
            rh.save_mesh(tmp_path / name / f"frame_{number}.ply", motion[number], motion.faces)
    return tmp_path


def test_frames_in_natural_order(folder):
    motion = rh.datasets.load_mesh_motions(folder / "anna", frames_per_second=30)[0]
    knees = rh.datasets.load_open_motions("coarse", sequences="knees")[0]
    np.testing.assert_array_equal(motion[:], np.stack([knees[k] for k in (1, 2, 10)]))
    assert motion.frames_per_second == 30


def test_folders_of_folders(folder):
    assert [m.sequence for m in rh.datasets.load_mesh_motions(folder)] == ["anna", "ben"]


def test_no_motion(tmp_path):
    with pytest.raises(rh.RiemhumanError, match="holds no motion"):
        rh.datasets.load_mesh_motions(tmp_path)
