"""The command ``register``."""

import numpy as np
import pytest

import riemhuman as rh
from riemhuman.cli import main


@pytest.fixture(scope="module")
def scan(tmp_path_factory):
    bodies = rh.datasets.load_open_bodies("coarse")
    seen = rh.registration.simulated_scan(bodies[3], bodies.template.faces, rng=1, n_points=4000)
    file = tmp_path_factory.mktemp("scans") / "scan.npy"
    np.save(file, 1000.0 * seen.points)
    return file


def test_a_scan_becomes_a_body(scan, tmp_path, capsys):
    output = tmp_path / "body.ply"
    assert main(["register", str(scan), "-o", str(output), "--coarse", "--up", "y", "-q"]) == 0
    points, faces = rh.load_mesh(output)
    np.testing.assert_array_equal(faces, rh.datasets.load_open_model("coarse").faces)
    assert 1.0 < np.ptp(points, axis=0).max() < 2.5
    assert "scan in millimetres" in capsys.readouterr().out


@pytest.mark.sampled(6, "scans that are refused")
@pytest.mark.slow
def test_what_is_no_body_is_not_written(tmp_path, capsys):
    file, output = tmp_path / "box.npy", tmp_path / "body.ply"
    np.save(file, np.random.default_rng(0).random((2000, 3)))
    arguments = ["register", str(file), "-o", str(output), "--coarse", "--up", "y", "-q"]
    assert main(arguments) == 1
    assert "box.npy is not trusted: " in capsys.readouterr().err
    assert not output.exists()
    # A folder with such a scan ends with the same code.
    arguments = ["register", str(tmp_path), "-o", str(tmp_path / "bodies"), *arguments[4:]]
    assert main(arguments) == 1


@pytest.fixture
def marks(tmp_path):
    file = tmp_path / "marks.csv"
    file.write_text("name,x,y,z\nleft_wrist,620,1310,50\nhead,0,1600,0\n", encoding="utf-8")
    return file


def test_landmarks_reach_the_registration(scan, marks, tmp_path, monkeypatch):
    seen = {}

    def solve(self, scan, *, landmarks):
        seen.update(landmarks)
        raise rh.errors.ArgumentError("enough")

    monkeypatch.setattr(rh.registration.ScanRegistration, "solve", solve)
    output = str(tmp_path / "body.ply")
    assert main(["register", str(scan), "-o", output, "--coarse", "--landmarks", str(marks)]) == 2
    np.testing.assert_array_equal(seen["left_wrist"], [620.0, 1310.0, 50.0])
    np.testing.assert_array_equal(seen["head"], [0.0, 1600.0, 0.0])
