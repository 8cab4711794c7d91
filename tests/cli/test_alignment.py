"""The verb align, and meshes in other units and axes."""

import json

import numpy as np
import pytest

from riemhuman.io import load_mesh, save_mesh
from riemhuman.surfaces.procrustes import procrustes

# z up, in millimetres.
TURN = 1000 * np.array([[1.0, 0, 0], [0, 0, -1], [0, 1, 0]]).T


@pytest.fixture
def turned(bodies, tmp_path):
    """Return a folder of meshes in millimetres with z up."""
    folder = tmp_path / "turned"
    folder.mkdir()
    for name, f in zip("ab", bodies.points[:2] @ TURN, strict=True):
        save_mesh(folder / f"{name}.ply", f, bodies.template.faces)
    return folder


def test_align_takes_out_rigid_motions(run, scans, bodies, tmp_path):
    finished = run("align", scans, "-o", tmp_path / "aligned", "--json")
    record = json.loads(finished.out)
    assert record["root_mean_square"][0] == pytest.approx(0, abs=1e-6)
    found, _ = load_mesh(tmp_path / "aligned" / "body_20.ply")
    np.testing.assert_allclose(found, procrustes(bodies.points[20], bodies.points[0]), atol=1e-6)
    assert (tmp_path / "aligned" / "aligned.html").exists()


def test_align_brings_units_and_axes(run, turned, bodies, tmp_path):
    options = ("--unit", "millimetres", "--up", "z")
    assert run("align", turned, "-o", tmp_path / "aligned", *options).code == 0
    found, _ = load_mesh(tmp_path / "aligned" / "a.ply")
    np.testing.assert_allclose(found, bodies.points[0], atol=1e-5)


def test_units_and_axes_make_other_verbs_measure_the_same(run, turned, scans):
    ours = run("dist", scans / "body_0.ply", scans / "body_1.ply")
    theirs = run("dist", turned / "a.ply", turned / "b.ply", "--unit", "millimetres", "--up", "z")
    assert float(theirs.out) == pytest.approx(float(ours.out), rel=1e-5)


def test_align_refuses_two_meshes_of_one_name(refused, scans, turned, bodies, tmp_path):
    save_mesh(turned / "body_0.ply", bodies.points[0], bodies.template.faces)
    files = (scans / "body_0.ply", turned / "body_0.ply")
    assert "the same name" in refused("align", *files, "-o", tmp_path / "aligned")
    assert not (tmp_path / "aligned").exists()


def test_labelled_folders_take_template_unit_and_what_is_there(run, refused, turned, scans):
    (turned / "labels.csv").write_text(
        "file,subject,pose\na.ply,anna,sits\nb.ply,anna,sits\nc.ply,ben,sits\n"
        "body_0.ply,ben,stands\n", encoding="utf-8",
    )  # fmt: skip
    options = ("--unit", "millimetres", "--up", "z", "--template", turned / "b.ply")
    assert "rows without a mesh" in refused("tables", "--bodies", turned, *options, "--json")
    finished = run("tables", "--bodies", turned, *options, "--allow-missing", "--json")
    assert finished.code == 0
    assert "shape metric (1, 0.0001, 0)" in finished.out
    assert "--bodies FOLDER" in refused("tables", "--unit", "metres")
    assert "--template needs" in refused("tables", "--template", scans / "body_0.ply")
    assert "--allow-missing needs" in refused("tables", "--allow-missing")
