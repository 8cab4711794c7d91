"""The commands make-map and convert."""

import re

import numpy as np
import pytest

import riemhuman as rh
from riemhuman.cli import main


@pytest.fixture(scope="module")
def faces(bodies):
    """Return another topology: one triangle of the coarse bodies has a vertex in its middle."""
    (a, b, c), middle = bodies.template.faces[0], bodies.template.n_vertices
    return np.concatenate(
        [bodies.template.faces[1:], [[a, b, middle], [b, c, middle], [c, a, middle]]]
    )


@pytest.fixture(scope="module")
def others(bodies):
    """Return the first bodies in the other topology."""
    middles = bodies.points[:3, bodies.template.faces[0]].mean(axis=1, keepdims=True)
    return np.concatenate([bodies.points[:3], middles], axis=1)


@pytest.fixture(scope="module")
def a_map(bodies, others, faces, tmp_path_factory):
    """Return a map to the other topology, as the command writes it, of a known registration."""
    folder = tmp_path_factory.mktemp("map")

    def fit(body, model, up=None):
        assert (body, up) == (folder / "body.ply", "y")
        return rh.topologies.TopologyMap._from_surfaces(model, others[0], faces, bodies[0], "")

    rh.save_mesh(folder / "body.ply", others[0], faces)
    command = ["make-map", folder / "body.ply", "-o", folder / "map.npz", "--coarse", "--up", "y"]
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(rh.topologies.TopologyMap, "fit", fit)
        assert main([*map(str, command)]) == 0
    return folder / "map.npz"


def test_bodies_change_their_topology_and_return(a_map, bodies, others, faces, run, tmp_path):
    """Each mesh of a folder, and upside down with the axis that points up."""
    (tmp_path / "meshes").mkdir()
    rh.save_mesh(tmp_path / "meshes" / "down.obj", others[1] * [1.0, -1.0, -1.0], faces)
    there, back = tmp_path / "open", tmp_path / "back.obj"
    command = ("convert", tmp_path / "meshes", there, "--map", a_map)
    assert run(*command, "--up=-y").code == 0
    points, _ = rh.load_mesh(there / "down.ply")
    np.testing.assert_allclose(points[:, 1], bodies[1][:, 1], atol=0.002)
    assert run("convert", there / "down.ply", "-o", back, "--map", a_map).code == 0
    points, found = rh.load_mesh(back)
    np.testing.assert_array_equal(found, faces)
    assert np.linalg.norm(rh.procrustes(points, to=others[1]) - others[1], axis=1).mean() < 0.002


@pytest.mark.filterwarnings("ignore:.*betas differ")
def test_photographs_of_a_video_become_a_motion(a_map, others, faces, run, refused, tmp_path):
    rh.io.save_arrays(tmp_path / "video.npz", {"pred_vertices": others * [1.0, -1.0, -1.0]})
    rh.save_mesh(tmp_path / "faces.ply", others[1], faces)
    given = ("convert", tmp_path / "video.npz", tmp_path / "video.bvh", "--fps", "24")
    assert "must be a mesh" in refused(*given, "--faces", tmp_path / "faces.ply")
    assert run(*given, "--faces", tmp_path / "faces.ply", "--map", a_map).code == 0
    motion = rh.datasets.load_bvh(tmp_path / "video.bvh")
    assert (len(motion), round(motion.frames_per_second)) == (3, 24)


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (lambda body: body[:-1], "1,203 vertices.* found 1,202|triangle"),
        (lambda body: body * [1.0, -1.0, -1.0], 'up="-y"'),
    ],
    ids=["vertices", "y down"],
)
def test_bodies_that_do_not_fit_a_map_are_refused_by_file(
    a_map, others, faces, refused, tmp_path, change, said
):
    points = change(others[1])
    source = tmp_path / "wrong.obj"
    with source.open("w") as file:
        file.writelines(f"v {x} {y} {z}\n" for x, y, z in points)
        used = faces[(faces < len(points)).all(axis=1)]
        file.writelines(f"f {a + 1} {b + 1} {c + 1}\n" for a, b, c in used)
    error = refused("convert", source, tmp_path / "there.ply", "--map", a_map)
    assert "wrong.obj" in error
    assert re.search(said, error), error
    rh.save_mesh(source, [-1.0, 1.0, 1.0] * others[1], faces)
    error = refused("make-map", source, "-o", tmp_path / "map.npz")
    assert re.search("wrong.obj.*mirrored", error), error


def test_motions_change_their_format(run, refused, tmp_path):
    motion = rh.datasets.load_open_motions("coarse", sequences=["knees"])[0]
    motion.save(tmp_path / "knees.npz")
    assert run("convert", tmp_path / "knees.npz", "-o", tmp_path / "knees.bvh").code == 0
    assert len(rh.datasets.load_bvh(tmp_path / "knees.bvh")) == len(motion)
    said = refused("convert", tmp_path / "knees.npz", "-o", tmp_path / "knees.ply")
    assert "must be a motion" in said


def test_info_knows_photographs(bodies, run, refused, tmp_path):
    rh.io.save_arrays(tmp_path / "photograph.npz", {"pred_vertices": bodies[0]})
    assert "SAM 3D Body" in run("info", tmp_path / "photograph.npz").out
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
    assert len(list((tmp_path / "bodies").glob("*.ply"))) == 3
    points, _ = rh.load_mesh(tmp_path / "bodies" / "people_2.ply")
    np.testing.assert_allclose(points[:, 1], bodies[2][:, 1], atol=1e-5)


def test_the_output_is_given_once(bodies, run, refused, tmp_path):
    source, target = tmp_path / "a.obj", tmp_path / "b.ply"
    rh.save_mesh(source, bodies[0], bodies.template.faces)
    assert run("convert", source, target).code == 0
    assert "one output" in refused("convert", source)
    assert "one output" in refused("convert", source, target, "-o", target)
    assert refused("convert", source, tmp_path / "b.stl")
