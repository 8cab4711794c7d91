"""The commands ``register`` and ``match``."""

import csv
import json
import re
from types import SimpleNamespace

import numpy as np
import pytest
from open_bodies import coarse_bodies

import riemhuman as rh
from riemhuman.registration.folders import _write, record_of
from riemhuman.surfaces.nearest_points import nearest_points


@pytest.fixture(scope="module")
def scan(tmp_path_factory):
    bodies = coarse_bodies()
    seen = rh.registration.simulated_scan(bodies[3], bodies.template.faces, rng=1, n_points=1000)
    file = tmp_path_factory.mktemp("scans") / "scan.npy"
    np.save(file, 1000.0 * seen.points)
    return file


@pytest.fixture
def fitted(bodies, monkeypatch):
    """Make registrations end at once with a given trust, and return what they are given."""
    given = {}

    def solve(self, scan, *, landmarks=None):
        given.update(landmarks or {}, scan=scan, clothed=self.clothed)
        count = len(scan)
        return SimpleNamespace(
            trusted=given.get("trusted", True), message="no body", unit="millimetres",
            likelihood=2.52, points=bodies.points[3], upright_points=bodies.points[3] + 1.0,
            distances=np.full(count, 0.002), background=np.zeros(count, dtype=bool),
            matched=np.ones(bodies.template.n_vertices, dtype=bool),
            trusted_vertices=bodies.points[3][:, 1] > 0.9,
        )  # fmt: skip

    monkeypatch.setattr(rh.registration.ScanRegistration, "solve", solve)
    return given


def test_bodies_are_written_upright_or_where_the_scans_are(run, scan, fitted, bodies, tmp_path):
    finished = run("register", scan, "-o", tmp_path / "body.ply", "--coarse", "--json")
    record = json.loads(finished.out)
    assert (finished.code, record["trusted"], record["median_distance"]) == (0, True, 0.002)
    points, faces = rh.load_mesh(tmp_path / "body.ply")
    np.testing.assert_allclose(points, bodies.points[3] + 1.0, atol=1e-6)
    np.testing.assert_array_equal(faces, bodies.template.faces)
    trusted = rh.io.load_trusted(tmp_path / "body.ply")
    np.testing.assert_array_equal(trusted, bodies.points[3][:, 1] > 0.9)
    assert not fitted["clothed"]
    options = ("--coarse", "--keep-axes", "--force", "--clothed")
    finished = run("register", scan, "-o", tmp_path / "body.ply", *options)
    assert fitted["clothed"]
    assert "2.0 mm from the scan in the median" in finished.out
    np.testing.assert_allclose(rh.load_mesh(tmp_path / "body.ply")[0], bodies.points[3], atol=1e-6)


def test_untrusted_bodies_are_written_on_request(run, scan, fitted, tmp_path):
    fitted["trusted"] = False
    command = ("register", scan, "-o", tmp_path / "body.ply", "--coarse")
    finished = run(*command)
    assert finished.code == 1
    assert "scan.npy is not trusted: no body" in finished.err
    assert list(tmp_path.iterdir()) == []
    assert json.loads(run(*command, "--json").out)["output"] is None
    assert run(*command, "--untrusted").code == 1
    assert (tmp_path / "body.ply").exists()


@pytest.mark.parametrize("flag", ["--sequence", "--same-person"])
def test_folders_are_registered_with_a_page_and_told_about(run, tmp_path, monkeypatch, flag):
    def register_folder(registration, scans, output, **settings):
        is_sequence = flag == "--sequence"
        how = {"sequence": is_sequence, "same_person": not is_sequence}
        assert settings == {**how, "keep_axes": False, "progress": False}
        measures = {"median_distance": 0.002, "matched_share": 0.5}
        return [
            SimpleNamespace(name="anna", trusted=True, message="", **measures),
            SimpleNamespace(name="box", trusted=False, message="no person", **measures),
        ]

    monkeypatch.setattr(rh.registration, "register_folder", register_folder)
    monkeypatch.setattr(rh.report, "scan_page", lambda folder, units: folder / "index.html")
    options = ("-o", tmp_path / "bodies", "--coarse", flag)
    finished = run("register", tmp_path, *options)
    assert finished.code == 1  # as for one scan
    assert "box is not trusted: no person" in finished.err
    page = tmp_path / "bodies" / "index.html"
    assert f"1 of 2 scans are registered and trusted; see {page}" in finished.out


def test_a_partial_scan_with_landmarks_is_told_about_in_one_line(run, scan, fitted, tmp_path):
    finished = run("register", scan, "-o", tmp_path / "body.ply", "--coarse")
    (line,) = [text for text in finished.err.splitlines() if "missing" in text]
    assert re.search(r"scan\.npy: no body: \d+ measurements are missing$", line)
    marks = tmp_path / "marks.csv"
    marks.write_text("name,x,y,z\nleft_wrist,620,1310,50\nhead,0,1600,0\n", encoding="utf-8")
    command = ("register", scan, "-o", tmp_path / "body.ply", "--coarse", "-f")
    record = json.loads(run(*command, "--landmarks", marks, "--json").out)
    assert record["likelihood"] == 2.52
    np.testing.assert_array_equal(fitted["left_wrist"], [620.0, 1310.0, 50.0])
    np.testing.assert_array_equal(fitted["head"], [0.0, 1600.0, 0.0])
    assert f": {len(record['missing_measurements'])} measurements" in line
    assert "foot length" in " ".join(record["missing_measurements"])


@pytest.fixture(scope="module")
def matched(tmp_path_factory, bodies):
    """Return files of two scans, and a folder in which they are registered."""
    folder = tmp_path_factory.mktemp("matched")
    faces, registration = bodies.template.faces, rh.registration.TemplateRegistration
    (folder / "bodies" / "registrations").mkdir(parents=True)
    for name, number in (("anna", 0), ("ben", 4)):
        options = {"n_points": 700, "mesh": name == "anna", "rotate": False}
        seen = rh.registration.simulated_scan(bodies.points[number], faces, number, **options)
        if seen.faces is None:
            np.save(folder / f"{name}.npy", seen.points)
        else:
            rh.save_mesh(folder / f"{name}.ply", 100.0 * seen.points, seen.faces)
        scan = rh.registration.load_scan(next(folder.glob(f"{name}.*")))
        result = registration(bodies.template).solve(scan, start=bodies.points[number])
        _write(folder / "bodies", record_of(name, result), "key", None)
    return folder


def test_scans_are_matched(run, matched, tmp_path):
    table, picture = tmp_path / "map.csv", tmp_path / "map.png"
    files = matched / "ben.npy", matched / "anna.ply"
    options = ("--registered", matched / "bodies", "--picture", picture)
    finished = run("match", *files, "-o", table, *options)
    assert finished.code == 0, finished.err
    with table.open(encoding="utf-8") as lines:
        header, *rows = csv.reader(lines)
    weights = [f"weight_{k}" for k in (1, 2, 3)]
    assert header == ["vertex", "nearest", "triangle", *weights, "x", "y", "z"]
    scan = rh.registration.load_scan(matched / "anna.ply")
    assert len(rows) == len(np.load(files[0]))
    placed = np.array([row for row in rows if row[1]], dtype=float)
    assert len(placed) > 0.9 * len(rows)
    corners = 100.0 * scan.points[scan.faces[placed[:, 2].astype(int)]]
    places = np.einsum("nk,nkx->nx", placed[:, 3:6], corners)
    np.testing.assert_allclose(places, placed[:, 6:], atol=1e-6)  # in the unit of the scan
    assert picture.stat().st_size > 10_000
    run("match", *files[::-1], "-o", table, "-f", "--registered", matched / "bodies")
    with table.open(encoding="utf-8") as lines:
        assert all(row[2:6] == [""] * 4 for row in [*csv.reader(lines)][1:])  # a cloud


def test_registrations_of_other_scans_are_refused(refused, matched, tmp_path):
    np.save(tmp_path / "ben.npy", np.load(matched / "ben.npy") + 0.01)
    np.save(tmp_path / "carl.npy", np.load(matched / "ben.npy"))
    folder, output = matched / "bodies", ("-o", tmp_path / "map.csv")
    for name, said in (("ben", "not the scan from which ben"), ("carl", "no registration of carl")):
        files = (tmp_path / f"{name}.npy", matched / "anna.ply")
        assert said in refused("match", *files, *output, "--registered", folder)


@pytest.mark.slow
def test_a_sheet_of_one_scan(run, refused, scan, bodies, tmp_path, monkeypatch):
    def solve(self, scan, *, landmarks=None):
        points, faces = bodies.points[3], bodies.template.faces
        places, distances = nearest_points(scan.points, points, faces)
        whole = np.ones(len(points), dtype=bool)
        return rh.registration.RegisteredScan(
            points=points, trusted=True, trusted_vertices=whole, message="", likelihood=2.5,
            fit=None, distances=distances, matched=whole, correspondence=places,
            background=np.zeros(len(scan), dtype=bool), up=np.array([0.0, 1.0, 0.0]),
            transform=np.eye(4), unit=scan.unit, faces=faces, scan=scan,
        )  # fmt: skip

    monkeypatch.setattr(rh.registration.ScanRegistration, "solve", solve)
    command = ("register", scan, "-o", tmp_path / "body.ply", "--coarse")
    finished = run(*command, "--sheet", "--sex", "woman")
    assert finished.code == 0, finished
    assert sorted(file.name for file in tmp_path.iterdir()) == ["body.html", "body.pdf", "body.ply"]
    page = (tmp_path / "body.html").read_text(encoding="utf-8")
    assert "women of this stature" in page
    (tmp_path / "body.ply").unlink()
    assert "body.html exists; --force replaces it" in refused(*command, "--sheet")
    assert "--sex needs --sheet" in refused(*command, "--sex", "man")


def test_sheets_of_a_folder_of_scans(run, refused, scan, tmp_path, monkeypatch):
    given = {}

    def make_sheets(folder, output, **settings):
        given.update(settings, folder=folder, output=output)
        return output / "index.html"

    monkeypatch.setattr(rh.registration, "register_folder", lambda *given, **settings: [])
    monkeypatch.setattr(rh.report, "scan_page", lambda folder, units: folder / "index.html")
    monkeypatch.setattr(rh.report, "make_sheets", make_sheets)
    scans = tmp_path / "scans"
    scans.mkdir()
    (scans / "labels.csv").touch()
    command = ("register", scans, "-o", tmp_path / "bodies", "--coarse", "--sheet")
    finished = run(*command, "--output-units", "in")
    assert given["units"] == "in"
    assert f"sheets of all people: {tmp_path / 'bodies' / 'sheets' / 'index.html'}" in finished.out
    assert given["labels"] == scans / "labels.csv"
    assert given["replace_output"]
    assert "--sex is for one scan" in refused(*command, "--sex", "man")
