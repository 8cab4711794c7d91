"""Motions in folders of meshes."""

import numpy as np
import pytest

import riemhuman as rh
from riemhuman.errors import FileError
from riemhuman.io.meshes import save_mesh


def test_folders_of_meshes_are_motions(tmp_path):
    with pytest.raises(FileError, match="holds no motion"):
        rh.datasets.load_mesh_motions(tmp_path)
    knees = rh.datasets.load_open_motions("coarse", sequences="knees")[0]
    for name in ("anna", "ben"):
        (tmp_path / name).mkdir()
        for number in (1, 2, 10):
            save_mesh(tmp_path / name / f"frame_{number}.ply", knees[number], knees.faces)
    motion = rh.datasets.load_mesh_motions(tmp_path / "anna", frames_per_second=30)[0]
    np.testing.assert_array_equal(motion[:], np.stack([knees[k] for k in (1, 2, 10)]))
    assert motion.frames_per_second == 30
    assert [m.sequence for m in rh.datasets.load_mesh_motions(tmp_path)] == ["anna", "ben"]
