"""The commands make-map and convert."""

from types import SimpleNamespace

import numpy as np
import pytest

import riemhuman as rh
from riemhuman.registration import topology_map


@pytest.fixture
def smpl_map(bodies, tmp_path, run, monkeypatch):
    """Return the map of the coarse bodies' own topology, whose registration is known."""
    full = rh.datasets.load_open_bodies("full")[0]
    known = SimpleNamespace(points=full, fit=None, trusted=True, message="")
    monkeypatch.setattr(topology_map, "_register", lambda *options: known)
    rh.save_mesh(tmp_path / "body.ply", bodies[0], bodies.template.faces)
    finished = run("make-map", tmp_path / "body.ply", "-o", tmp_path / "map.npz")
    assert finished.code == 0, finished.err
    return tmp_path / "map.npz"


def test_bodies_change_their_topology_and_return(smpl_map, bodies, run, tmp_path):
    there, back = tmp_path / "there.ply", tmp_path / "back.obj"
    rh.save_mesh(tmp_path / "body.ply", bodies[1], bodies.template.faces)
    assert run("convert", tmp_path / "body.ply", "-o", there, "--map", smpl_map).code == 0
    assert len(rh.load_mesh(there)[0]) == 13348
    assert run("convert", there, "-o", back, "--map", smpl_map).code == 0
    points, faces = rh.load_mesh(back)
    np.testing.assert_array_equal(faces, bodies.template.faces)
    assert np.linalg.norm(points - bodies[1], axis=1).mean() < 0.002


def test_photographs_become_meshes(bodies, run, tmp_path):
    arrays = {"pred_vertices": bodies[0] * [1.0, -1.0, -1.0]}
    rh.io.save_arrays(tmp_path / "photograph.npz", arrays)
    rh.save_mesh(tmp_path / "faces.ply", bodies[1], bodies.template.faces)
    target = tmp_path / "body.ply"
    source = tmp_path / "photograph.npz"
    assert run("convert", source, "-o", target, "--faces", tmp_path / "faces.ply").code == 0
    np.testing.assert_allclose(rh.load_mesh(target)[0][:, 1], bodies[0][:, 1], atol=1e-5)


def test_motions_change_their_format(run, refused, tmp_path):
    motion = rh.datasets.load_open_motions("coarse", sequences=["knees"])[0]
    motion.save(tmp_path / "knees.npz")
    assert run("convert", tmp_path / "knees.npz", "-o", tmp_path / "knees.bvh").code == 0
    assert len(rh.datasets.load_bvh(tmp_path / "knees.bvh")) == len(motion)
    said = refused("convert", tmp_path / "knees.npz", "-o", tmp_path / "knees.ply")
    assert "must be a motion" in said


def test_info_knows_maps_and_photographs(smpl_map, bodies, run, refused, tmp_path):
    assert "map between topologies" in run("info", smpl_map).out
    rh.io.save_arrays(tmp_path / "photograph.npz", {"pred_vertices": bodies[0]})
    said = run("info", tmp_path / "photograph.npz").out
    assert "SAM 3D Body" in said
    assert "triangles, pred_cam_t" in said
    rh.io.save_arrays(tmp_path / "number.npz", {"pred_vertices": 3.0})
    assert "must have shape (V, 3)" in refused("info", tmp_path / "number.npz")
