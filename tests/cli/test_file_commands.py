"""The commands info and view."""

import json
import pickle
import re
import shutil
import sys
from pathlib import Path

import h5py
import numpy as np
import pytest
import trimesh
from marker_files import write_trc

from riemhuman.cli._file_commands import mesh_facts
from riemhuman.datasets import load_open_model
from riemhuman.io import save_arrays, save_mesh
from riemhuman.measurements import Measurements
from riemhuman.registration import simulated_scan
from riemhuman.surfaces import signed_volume


@pytest.fixture
def facts(run):
    def facts_of(path):
        finished = run("info", path, "--json")
        assert (finished.code, finished.err) == (0, "")
        record = json.loads(finished.out)
        readable = run("info", path).out
        assert all(k.replace("_", " ") in readable for k, v in record.items() if v is not None)
        return record

    return facts_of


def test_mesh_agrees_with_trimesh(facts, scans, bodies):
    found = facts(scans / "body_0.ply")
    oracle = trimesh.Trimesh(bodies.points[0], bodies.template.faces, process=False)
    assert found["kind"] == "mesh"
    assert (found["vertices"], found["triangles"]) == (1202, 2400)
    assert found["edges"] == len(oracle.edges_unique)
    assert found["closed"] is oracle.is_watertight
    assert found["parts"] == oracle.body_count
    assert found["area"] == pytest.approx(oracle.area, rel=1e-12)
    assert found["volume"] == pytest.approx(oracle.volume, rel=1e-9)
    np.testing.assert_allclose(found["extents"], oracle.extents, rtol=1e-12)
    assert found["unit_guess"] == "metres"
    assert found["usable_as_template"] == "yes"


def test_meshes_of_other_formats(facts, bodies, tmp_path):
    """The command reads what `load_mesh` reads."""
    bodies.template.to_trimesh().export(tmp_path / "body.stl")
    found = facts(tmp_path / "body.stl")
    assert (found["kind"], found["triangles"]) == ("mesh", 2400)


def test_defects_of_a_mesh():
    vertices = np.array(
        [[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1], [0, 0, 1], [2, 0, 0], [9, 9, 9.0]]
    )
    faces = np.array([[0, 1, 2], [0, 1, 3], [0, 1, 4], [0, 1, 5]])
    found = mesh_facts(vertices, faces)
    assert {found["closed"], found["consistently_oriented"]} == {False}
    assert found["boundary_edges"] == 8
    assert found["non_manifold_edges"] == 1
    assert found["degenerate_triangles"] == 1
    assert found["unused_vertices"] == 1
    assert found["coincident_vertices"] == 1
    assert found["volume"] is None
    assert found["usable_as_template"].startswith("no: the template has 1 of 4 triangles without")
    assert found["extents"].tolist() == [2.0, 1.0, 1.0]
    two = np.concatenate([vertices[:4], vertices[:4] + 5])
    tetrahedron = np.array([[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2]])
    found = mesh_facts(two, np.concatenate([tetrahedron, tetrahedron + 4]))
    assert (found["parts"], found["closed"]) == (2, True)
    assert found["volume"] == pytest.approx(1 / 3)


def test_folder(facts, scans, bodies, tmp_path):
    found = facts(scans)
    assert (found["meshes"], found["registered"]) == (6, True)
    assert (found["first"], found["last"]) == ("body_0.ply", "body_22.ply")
    save_mesh(tmp_path / "a.ply", bodies.points[0], bodies.template.faces)
    save_mesh(tmp_path / "b.ply", bodies.points[0], bodies.template.faces[1:])
    assert "b.ply is not registered to" in facts(tmp_path)["registered"]


def test_archives(facts, bodies, tmp_path):
    load_open_model("coarse").save(tmp_path / "model.npz")
    found = facts(tmp_path / "model.npz")
    assert (found["kind"], found["vertices"]) == ("body model", 1202)
    assert found["joints"] == load_open_model("coarse").n_joints
    assert found["used"].startswith("23 joints, 32 shape coefficients")
    assert found["left_out"] == "nothing"
    with np.load(tmp_path / "model.npz") as saved:
        np.savez(tmp_path / "hands.npz", **saved, hands_meanl=np.zeros(45))
    assert "components of the hands" in facts(tmp_path / "hands.npz")["left_out"]
    np.savez(tmp_path / "other.npz", some=np.zeros((2, 3)))
    assert facts(tmp_path / "other.npz")["some"] == "float64 (2, 3)"


def test_scans_measurements_and_labels(facts, scans, bodies, tmp_path):
    np.save(tmp_path / "scan.npy", bodies.points[0])
    found = facts(tmp_path / "scan.npy")
    assert found["points"] == 1202
    assert "riemhuman register" in found["next"]
    definitions = Measurements(load_open_model("coarse")).definitions
    definitions.with_measurements(["stature"]).save(tmp_path / "own.json")
    assert facts(tmp_path / "own.json")["measurements"] == ["stature"]
    assert facts(scans / "labels.csv")["kind"] == "table of labels"
    assert facts(scans / "labels.csv")["rows"] == 6


def test_recordings(facts):
    found = facts(Path(__file__).parents[1] / "mocap" / "recordings" / "cmu_01_01.bvh")
    assert (found["kind"], found["joints"]) == ("motion capture recording", 38)
    assert found["seconds"] == found["frames"] / found["frames_per_second"]


def test_hdf5(facts, bodies, tmp_path):
    with h5py.File(tmp_path / "registrations_f.hdf5", "w") as file:
        file["faces"] = bodies.template.faces
        file["50020_hips"] = np.moveaxis(bodies.points[:3], 0, -1)
    found = facts(tmp_path / "registrations_f.hdf5")
    assert found["sequences"] == ["50020_hips: 3 frames"]
    assert (found["people"], found["vertices"]) == (["50020"], 1202)


@pytest.mark.slow
def test_recordings_of_every_kind(run, refused, tmp_path):
    folder = Path(__file__).parents[1] / "mocap" / "recordings"
    found = run("info", folder / "cmu_01_01.amc", "--json")
    assert json.loads(found.out)["frames"] == 40
    joints = {
        f"{side}{name}": np.tile([sign * across, height, 0.0], (4, 1))
        for side, sign in (("L", 1.0), ("R", -1.0))
        for name, across, height in (
            *(("HJC", 0.1, 0.9), ("KJC", 0.1, 0.5), ("AJC", 0.1, 0.1)),
            *(("SJC", 0.2, 1.4), ("EJC", 0.5, 1.4), ("WJC", 0.8, 1.4)),
        )
    }
    file = write_trc(tmp_path / "stand.trc", joints)
    facts = json.loads(run("info", file, "--json").out)
    assert (facts["kind"], facts["frames"]) == ("recording of markers", 4)
    assert "left_knee" in facts["joints"]
    assert run("view", file, "-o", tmp_path / "stand.html").code == 0
    joints["Gamba"] = joints.pop("LKJC")
    file = write_trc(tmp_path / "other.trc", joints)
    assert "none: " in json.loads(run("info", file, "--json").out)["joints"]
    (tmp_path / "names.json").write_text('{"left_knee": ["Gamba"]}')
    view = ("view", file, "-o", tmp_path / "other.html")
    assert run(*view, "--joints", tmp_path / "names.json").code == 0
    (tmp_path / "names.json").write_text('["Gamba"]')
    assert "must hold names of joints" in refused(
        *view, "--force", "--joints", tmp_path / "names.json"
    )
    video = {"smpl_poses": np.zeros((5, 72)), "smpl_trans": np.zeros((5, 3)), "fps": 30}
    (tmp_path / "dance.pkl").write_bytes(pickle.dumps(video))
    facts = json.loads(run("info", tmp_path / "dance.pkl", "--json").out)
    assert (facts["kind"], facts["frames"]) == ("recording of poses", 5)
    page = tmp_path / "dance.html"
    assert run("view", tmp_path / "dance.pkl", "-o", page).code == 0
    assert "dance" in page.read_text()


def test_info_says_that_seams_will_be_joined(run, tmp_path):
    sphere = trimesh.creation.icosphere(subdivisions=2)
    faces = np.arange(3 * len(sphere.faces)).reshape(-1, 3)
    for name in ("a.obj", "b.obj"):
        save_mesh(tmp_path / name, sphere.vertices[sphere.faces].reshape(-1, 3), faces)
    found = json.loads(run("info", tmp_path / "a.obj", "--json").out)
    assert found["seam_edges"] == 480
    assert found["usable_as_template"].startswith("yes, once its seams are joined: 798 duplicated")
    folder = json.loads(run("info", tmp_path, "--json").out)
    assert (folder["vertices"], folder["seams_joined"]) == (162, 480)


def test_view_without_an_output_opens_a_temporary_page(run, scans, monkeypatch):
    opened = []
    monkeypatch.setattr("webbrowser.open", opened.append)
    finished = run("view", scans / "body_0.ply", "--json")
    page = Path(json.loads(finished.out)["page"])
    assert opened == [page.resolve().as_uri()]
    assert page.read_text("utf-8").lower().startswith("<!doctype html>")
    shutil.rmtree(page.parent)


def test_pictures_of_bodies_need_no_matplotlib(run, scans, tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "matplotlib", None)
    run("view", scans / "body_0.ply", scans / "body_1.ply", "-o", tmp_path / "two.png")
    assert (tmp_path / "two.png").stat().st_size > 10_000


def test_info_says_which_fields_of_a_recording_are_used(run, tmp_path):
    arrays = {"poses": np.zeros((4, 72)), "trans": np.zeros((4, 3))}
    arrays |= {"expression": np.zeros((4, 9)), "fps": np.array(30.0)}
    save_arrays(tmp_path / "video.npz", arrays)
    finished = run("info", tmp_path / "video.npz", "--json")
    facts = json.loads(finished.out)
    assert facts["kind"] == "recording of poses"
    assert facts["used"] == "fps, poses, trans"
    assert facts["left_out"] == "expression (expression of the face)"
    save_arrays(tmp_path / "other.npz", {"poses": np.zeros(3)})
    assert json.loads(run("info", tmp_path / "other.npz", "--json").out)["kind"] == "arrays"


def test_sizes_of_meshes_have_units(run, scans, bodies, tmp_path):
    """An inch is 0.0254 m; people read centimetres or inches, whatever the unit of the file."""
    points = bodies.points[0]
    save_mesh(tmp_path / "mm.ply", 1000.0 * points, bodies.template.faces)
    np.save(tmp_path / "points.npy", 1000.0 * points)
    height, volume = np.ptp(points, axis=0)[1], signed_volume(points, bodies.template.faces)
    for file, unit, size, of_volume, litre in (
        (scans / "body_0.ply", "cm", 0.01, "L", 1e-3),
        (tmp_path / "mm.ply", "in", 0.0254, "in³", 0.0254**3),
    ):
        said = run("info", file, "--output-units", unit).out
        (extents,) = re.findall(rf"^extents +([\d., ]+) {unit}$", said, re.MULTILINE)
        assert float(extents.split(", ")[1]) == pytest.approx(height / size, abs=0.0051)
        assert re.search(rf"^area +[\d,]+ {unit}²$", said, re.MULTILINE)
        (found,) = re.findall(rf"^volume +([\d.,]+) {of_volume}$", said, re.MULTILINE)
        assert float(found.replace(",", "")) == pytest.approx(volume / litre, rel=1e-4)
    assert re.search(r"^unit guess +millimetres; the file names none$", said, re.MULTILINE)
    said = run("info", tmp_path / "points.npy", "--output-units", "in").out
    assert re.search(r"^extents +[\d., ]+ in$", said, re.MULTILINE)
    assert re.search(r"^unit +millimetres, by its size$", said, re.MULTILINE)
    save_mesh(tmp_path / "speck.ply", 1e-4 * bodies.points[0], bodies.template.faces)
    said = run("info", tmp_path / "speck.ply").out
    assert re.search(r"^area .* units²$", said, re.MULTILINE)
    assert "none: no human body has this size; the file names none" in said


@pytest.mark.slow
def test_view_lays_a_scan_over_its_body_in_either_order(run, refused, bodies, tmp_path):
    faces = bodies.template.faces
    scan = simulated_scan(bodies.points[0], faces, rng=0, n_points=3000)
    save_mesh(tmp_path / "body.ply", bodies.points[0], faces)
    np.save(tmp_path / "scan.npy", 1000.0 * scan.points)
    for files in (("scan.npy", "body.ply"), ("body.ply", "scan.npy")):
        page = tmp_path / "over.html"
        finished = run("view", *[tmp_path / name for name in files], "-o", page, "--force")
        assert finished.code == 0
        assert "scan.npy over body.ply" in page.read_text(encoding="utf-8")
    assert " mm of the body" in page.read_text(encoding="utf-8")
    run("view", *[tmp_path / name for name in files], "-o", page, "--force", "--output-units", "in")
    assert " in of the body" in page.read_text(encoding="utf-8")
    np.save(tmp_path / "other.npy", np.random.default_rng(0).uniform(0, 1.7, (2000, 3)))
    message = refused("view", tmp_path / "other.npy", tmp_path / "body.ply", "-o", page, "-f")
    assert "does not lie over the body" in message


def test_view_shows_meshes_motions_and_paths(run, scans, bodies, tmp_path):
    page = tmp_path / "both.html"
    finished = run("view", scans / "body_0.ply", scans / "body_1.ply", "-o", page)
    assert (finished.code, finished.out) == (0, f"{page}\n")
    assert '"label":"body_0"' in page.read_text(encoding="utf-8")
    files = [scans / f"body_{number}.ply" for number in (0, 1)]
    run("view", *files, "--motion", "-o", tmp_path / "motion.html")
    assert '"n_frames":2' in (tmp_path / "motion.html").read_text(encoding="utf-8")
    arrays = {"path": bodies.points[:3], "faces": bodies.template.faces}
    save_arrays(tmp_path / "path.npz", arrays)
    # The folder of a geodesic holds its path, beside meshes or without them.
    run("view", tmp_path, "-o", tmp_path / "folder.html")
    page = (tmp_path / "folder.html").read_text(encoding="utf-8")
    assert '"n_frames":3' in page
    assert f"<title>{tmp_path.name}</title>" in page
    run("view", tmp_path, "-o", tmp_path / "path.png")
    assert (tmp_path / "path.png").read_bytes().startswith(b"\x89PNG")
