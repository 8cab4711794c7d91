"""The verbs transfer and disentangle write what the library finds."""

import json

import numpy as np
import pytest

from riemhuman.geometry import AlignedSurfaces, ElasticMetric
from riemhuman.io import load_mesh
from riemhuman.solvers import Disentangling, MotionTransfer
from riemhuman.surfaces import DeformationBasis, Template


@pytest.fixture
def moved(bodies):
    """Return the third mesh moved as the first two."""
    space = AlignedSurfaces(Template(bodies.points[0], bodies.template.faces), equip=False)
    return MotionTransfer().solve(space, bodies.points[:2], bodies.points[20])


def test_motion_into_a_folder(run, scans, moved, tmp_path):
    files = [scans / f"body_{number}.ply" for number in (0, 1)]
    onto = scans / "body_20.ply"
    finished = run("transfer", *files, "--onto", onto, "-o", tmp_path / "moved", "--json")
    assert finished.code == 0, finished.err
    assert json.loads(finished.out)["n_frames"] == 2
    names = sorted(path.name for path in (tmp_path / "moved").iterdir())
    assert names == ["frame_0000.ply", "frame_0001.ply", "motion.html"]
    for name, frame in zip(names[:2], moved, strict=True):
        np.testing.assert_array_equal(load_mesh(tmp_path / "moved" / name)[0], frame)
    page = (tmp_path / "moved" / "motion.html").read_text(encoding="utf-8")
    assert "2 meshes, body_0.ply to body_1.ply, replayed on body_20.ply." in page
    again = ("transfer", *files, "--onto", onto, "-o", tmp_path / "moved", "-q")
    assert run(*again).code == 2
    assert run(*again, "--force").code == 0


def test_motion_into_a_file(run, scans, moved, tmp_path):
    files = [scans / f"body_{number}.ply" for number in (0, 1)]
    onto = ("--onto", scans / "body_20.ply")
    finished = run("transfer", *files, *onto, "-o", tmp_path / "moved.npz")
    assert "meshes      2" in finished.out
    np.testing.assert_array_equal(np.load(tmp_path / "moved.npz")["path"], moved)
    assert run("transfer", *files, *onto, "-o", tmp_path / "moved.glb").code == 0
    assert (tmp_path / "moved.glb").read_bytes()[:4] == b"glTF"


def test_a_terminal_shows_how_many_meshes_are_done(run, scans, tmp_path, monkeypatch):
    monkeypatch.setattr("sys.stderr.isatty", lambda: True)
    files = [scans / f"body_{number}.ply" for number in (0, 1)]
    onto = ("--onto", scans / "body_20.ply")
    finished = run("transfer", *files, *onto, "-o", tmp_path / "moved.npz")
    assert "100%" in finished.err
    assert "| 2/2 [" in finished.err
    assert "%" not in run("transfer", *files, *onto, "-o", tmp_path / "two.npz", "-q").err


def test_poses_into_a_file(run, scans, bodies, tmp_path):
    files = [scans / f"body_{number}.ply" for number in (0, 1)]
    options = ("--onto", scans / "body_20.ply", "--transfer", "pose", "--json")
    finished = run("transfer", *files, *options, "-o", tmp_path / "moved.npz")
    assert json.loads(finished.out)["transfer"] == "pose"
    space = AlignedSurfaces(Template(bodies.points[0], bodies.template.faces), equip=False)
    expected = MotionTransfer(transfer="pose").solve(space, bodies.points[:2], bodies.points[20])
    np.testing.assert_array_equal(np.load(tmp_path / "moved.npz")["path"], expected)


def test_disentangled_body(run, scans, bodies, tmp_path):
    files = (scans / "body_0.ply", scans / "body_21.ply")
    finished = run("disentangle", *files, "-o", tmp_path / "both.ply", "--json")
    space = AlignedSurfaces(Template(bodies.points[0], bodies.template.faces), equip=False)
    metrics = ElasticMetric(space, 1.0, 1.0, 0.0), ElasticMetric(space, 0.0, 0.0, 1.0)
    expected = Disentangling().solve(*metrics, bodies.points[0], bodies.points[21])
    np.testing.assert_array_equal(load_mesh(tmp_path / "both.ply")[0], expected.surface)
    record = json.loads(finished.out)
    assert record["shape_distance"] == expected.shape_dist
    assert record["pose_distance"] == expected.pose_dist


def test_disentangled_in_a_basis(run, scans, bodies, tmp_path):
    DeformationBasis.from_laplacian(bodies.template, 6).save(tmp_path / "basis.npz")
    files = (scans / "body_0.ply", scans / "body_21.ply")
    options = ("--basis", tmp_path / "basis.npz", "--pose-weight", 10)
    finished = run("disentangle", *files, "-o", tmp_path / "both.obj", *options)
    assert "converged          yes, after" in finished.out
    assert load_mesh(tmp_path / "both.obj")[0].shape == (1202, 3)


def test_failures(refused, scans, tmp_path):
    one = scans / "body_0.ply"
    assert "--force" in refused("disentangle", one, one, "-o", one)
    assert "ending must be" in refused("disentangle", one, one, "-o", tmp_path / "both.npz")
    assert "pose_weight must be" in refused(
        "disentangle", one, one, "-o", tmp_path / "both.ply", "--pose-weight", -1
    )
    assert "ending must be" in refused(
        "transfer", one, "--onto", one, "-o", tmp_path / "moved.html"
    )
    assert "absent.ply" in refused(
        "transfer", one, "--onto", tmp_path / "absent.ply", "-o", tmp_path / "moved"
    )
    assert list(tmp_path.iterdir()) == []
