"""The commands make-map and convert."""

import pickle
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


def test_all_bodies_of_a_file_are_written_or_none(bodies, run, refused, tmp_path):
    arrays = {"pred_vertices": bodies.points[:3] * [1.0, -1.0, -1.0]}
    rh.io.save_arrays(tmp_path / "people.npz", arrays)
    rh.save_mesh(tmp_path / "faces.ply", bodies[1], bodies.template.faces)
    source, faces = tmp_path / "people.npz", tmp_path / "faces.ply"
    said = refused("convert", source, tmp_path / "body.ply", "--faces", faces)
    assert "holds 3 bodies" in said
    assert not (tmp_path / "body.ply").exists()
    assert run("convert", source, tmp_path / "bodies", "--faces", faces).code == 0
    names = sorted(file.name for file in (tmp_path / "bodies").glob("*.ply"))
    assert names == ["people_0.ply", "people_1.ply", "people_2.ply"]
    points, _ = rh.load_mesh(tmp_path / "bodies" / "people_2.ply")
    np.testing.assert_allclose(points[:, 1], bodies[2][:, 1], atol=1e-5)


def test_folders_of_meshes_change_their_topology(smpl_map, bodies, run, tmp_path):
    (tmp_path / "meshes").mkdir()
    for number in range(2):
        file = tmp_path / "meshes" / f"body_{number}.obj"
        rh.save_mesh(file, bodies[number], bodies.template.faces)
    place = tmp_path / "open"
    assert run("convert", tmp_path / "meshes", place, "--map", smpl_map).code == 0
    found = [len(rh.load_mesh(place / f"body_{number}.ply")[0]) for number in range(2)]
    assert found == [13348, 13348]


def test_the_output_is_given_once(bodies, run, refused, tmp_path):
    source, target = tmp_path / "a.obj", tmp_path / "b.ply"
    rh.save_mesh(source, bodies[0], bodies.template.faces)
    assert run("convert", source, target).code == 0
    assert "one output" in refused("convert", source)
    assert "one output" in refused("convert", source, target, "-o", target)
    assert refused("convert", source, tmp_path / "b.stl")


@pytest.mark.filterwarnings("always")
def test_the_person_that_is_written_is_named(run, tmp_path):
    rng = np.random.default_rng(3)
    people = {
        name: {"pose": 0.1 * rng.standard_normal((n, 72)), "trans": np.zeros((n, 3))}
        for name, n in (("ann", 5), ("ben", 9))
    }
    (tmp_path / "people.pkl").write_bytes(pickle.dumps(people))
    finished = run("convert", tmp_path / "people.pkl", tmp_path / "motion.bvh")
    assert finished.code == 0
    assert "person ben" in finished.err
