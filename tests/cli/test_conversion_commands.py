"""The commands make-map and convert."""

import pickle
import re
from types import SimpleNamespace

import numpy as np
import pytest

import riemhuman as rh
from riemhuman.cli import main


@pytest.fixture(scope="module")
def smpl_map(tmp_path_factory):
    """Return the map of the coarse bodies' own topology, whose registration is known."""
    full = rh.datasets.load_open_bodies("full")[0]
    coarse = rh.datasets.load_open_bodies("coarse")
    known = SimpleNamespace(points=full, fit=None, trusted=True, message="")
    folder = tmp_path_factory.mktemp("map")
    rh.save_mesh(folder / "body.ply", coarse[0], coarse.template.faces)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(rh.registration.ScanRegistration, "solve", lambda *options: known)
        assert main(["make-map", str(folder / "body.ply"), "-o", str(folder / "map.npz")]) == 0
    return folder / "map.npz"


@pytest.mark.slow
def test_bodies_change_their_topology_and_return(smpl_map, bodies, run, tmp_path):
    there, back = tmp_path / "there.ply", tmp_path / "back.obj"
    rh.save_mesh(tmp_path / "body.ply", bodies[1], bodies.template.faces)
    assert run("convert", tmp_path / "body.ply", "-o", there, "--map", smpl_map).code == 0
    assert len(rh.load_mesh(there)[0]) == 13348
    assert run("convert", there, "-o", back, "--map", smpl_map).code == 0
    points, faces = rh.load_mesh(back)
    np.testing.assert_array_equal(faces, bodies.template.faces)
    assert np.linalg.norm(points - bodies[1], axis=1).mean() < 0.002


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore:.*betas differ")
def test_photographs_of_a_video_become_a_motion(smpl_map, bodies, run, refused, tmp_path):
    frames = bodies.points[:3] * [1.0, -1.0, -1.0]
    rh.io.save_arrays(tmp_path / "video.npz", {"pred_vertices": frames})
    rh.save_mesh(tmp_path / "faces.ply", bodies[1], bodies.template.faces)
    given = ("convert", tmp_path / "video.npz", tmp_path / "video.bvh", "--fps", "24")
    assert "must be a mesh" in refused(*given, "--faces", tmp_path / "faces.ply")
    assert run(*given, "--faces", tmp_path / "faces.ply", "--map", smpl_map).code == 0
    motion = rh.datasets.load_bvh(tmp_path / "video.bvh")
    assert (len(motion), round(motion.frames_per_second)) == (3, 24)


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (lambda body: body[:-1], "1,202 vertices.* found 1,201|triangle"),
        (lambda body: body * [-1.0, 1.0, 1.0], "mirrored"),
        (lambda body: 100.0 * body, "times as large"),
        (lambda body: body * [1.0, -1.0, -1.0], 'up="-y"'),
        (lambda body: np.where(np.arange(len(body))[:, None] == 7, np.nan, body), "NaN|finite"),
    ],
    ids=["vertices", "mirrored", "centimetres", "y down", "NaN"],
)
def test_bodies_that_do_not_fit_a_map_are_refused_by_file(
    smpl_map, bodies, refused, tmp_path, change, said
):
    points, faces = change(bodies[1]), bodies.template.faces
    faces = faces[(faces < len(points)).all(axis=1)]
    source = tmp_path / "wrong.obj"
    with source.open("w") as file:
        file.writelines(f"v {x} {y} {z}\n" for x, y, z in points)
        file.writelines(f"f {a + 1} {b + 1} {c + 1}\n" for a, b, c in faces)
    error = refused("convert", source, tmp_path / "there.ply", "--map", smpl_map)
    assert "wrong.obj" in error
    assert re.search(said, error), error


def test_bodies_are_turned_upright(smpl_map, bodies, run, tmp_path):
    rh.save_mesh(tmp_path / "down.ply", bodies[1] * [1.0, -1.0, -1.0], bodies.template.faces)
    rh.save_mesh(tmp_path / "upright.ply", bodies[1], bodies.template.faces)
    for name, options in (("down", ("--up=-y",)), ("upright", ())):
        target = tmp_path / f"{name}_open.ply"
        given = ("convert", tmp_path / f"{name}.ply", target, "--map", smpl_map)
        assert run(*given, *options).code == 0
    down, upright = (rh.load_mesh(tmp_path / f"{n}_open.ply")[0] for n in ("down", "upright"))
    np.testing.assert_allclose(down[:, 1], upright[:, 1], atol=1e-6)


def test_other_triangles_are_refused_by_file(smpl_map, bodies, refused, tmp_path):
    source = tmp_path / "wrong.ply"
    rh.save_mesh(source, bodies[1], bodies.template.faces[::-1])
    error = refused("convert", source, tmp_path / "there.ply", "--map", smpl_map)
    assert re.search(r"wrong\.ply.*must have the triangles of the map", error)


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (lambda body: body * [-1.0, 1.0, 1.0], "mirrored"),
        (lambda body: 100.0 * body, "times as large"),
        (lambda body: 0.001 * body, "times as large|small|size"),
    ],
    ids=["mirrored", "centimetres", "millimetres"],
)
def test_maps_are_not_made_of_bad_bodies(bodies, refused, tmp_path, change, said):
    rh.save_mesh(tmp_path / "wrong.ply", change(bodies[1]), bodies.template.faces)
    error = refused("make-map", tmp_path / "wrong.ply", "-o", tmp_path / "map.npz")
    assert "wrong.ply" in error
    assert re.search(said, error), error


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
