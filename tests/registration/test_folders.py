"""Folders of scans: what is written, what a second run leaves, and what is damaged."""

import copy
import shutil

import numpy as np
import pytest

import riemhuman as rh
from riemhuman.registration import ScanRegistration, read_records, register_folder, simulated_scan


@pytest.fixture(scope="module")
def registration():
    return ScanRegistration(rh.datasets.load_open_model("coarse"), up="y")


@pytest.fixture(scope="module")
def registered(tmp_path_factory, registration):
    """Return folders of scans and bodies: one good scan, one that is damaged, one of no body."""
    scans = tmp_path_factory.mktemp("scans")
    bodies = rh.datasets.load_open_bodies("coarse")
    scan = simulated_scan(bodies[3], registration.model.faces, rng=1, n_points=4000, rotate=False)
    np.save(scans / "anna.npy", scan.points)
    (scans / "broken.xyz").write_text("1 2 3\n4 5\n")
    np.save(scans / "box.npy", np.random.default_rng(0).random((2000, 3)))
    output = scans.parent / "bodies"
    return scans, output, register_folder(registration, scans, output)


def test_trusted_bodies_are_registered_meshes(registered, registration):
    _, output, records = registered
    assert [record.name for record in records] == ["anna", "box", "broken"]
    assert [record.trusted for record in records] == [True, False, False]
    points, faces = rh.load_mesh(output / "anna.ply")
    np.testing.assert_array_equal(faces, registration.model.faces)
    arrays = records[0].arrays
    transform = arrays["transform"]
    moved = arrays["points"] @ transform[:3, :3].T + transform[:3, 3]
    np.testing.assert_allclose(points, moved, atol=1e-12)
    assert abs(points[:, 1].min()) < 1e-9
    assert sorted(each.name for each in output.glob("*.ply")) == ["anna.ply"]
    assert (output / "untrusted" / "box.ply").is_file()


def test_bodies_may_keep_the_axes_of_the_scans(registered, registration, tmp_path):
    scans, _, records = registered
    (tmp_path / "scans").mkdir()
    shutil.copy(scans / "anna.npy", tmp_path / "scans")
    register_folder(registration, tmp_path / "scans", tmp_path / "bodies", keep_axes=True)
    points, _ = rh.load_mesh(tmp_path / "bodies" / "anna.ply")
    np.testing.assert_allclose(points, records[0].arrays["points"], atol=1e-9)


def test_damaged_scans_are_named(registered):
    assert "broken.xyz: line 2 must hold 3 numbers" in registered[2][2].message


def test_records_come_worst_first(registered):
    names = [record.name for record in read_records(registered[1])]
    assert names == ["broken", "box", "anna"]


def test_a_second_run_does_what_is_missing(registered, registration, monkeypatch):
    scans, output, _ = registered
    (output / "untrusted" / "box.ply").unlink()
    solved = []

    def solve(self, scan, **options):
        solved.append(len(scan))
        raise rh.errors.ArgumentError("solved again")

    monkeypatch.setattr(ScanRegistration, "solve", solve)
    records = register_folder(registration, scans, output)
    assert solved == [2000]
    assert records[0].trusted
    assert records[1].message == "solved again"


def test_changed_bodies_and_bodies_without_a_scan_are_noticed(registered, registration, tmp_path):
    scans, output, _ = registered
    shutil.copytree(output, tmp_path / "bodies")
    (tmp_path / "scans").mkdir()
    shutil.copy(scans / "broken.xyz", tmp_path / "scans")
    with pytest.warns(UserWarning, match="bodies whose scans are gone: anna"):
        register_folder(registration, tmp_path / "scans", tmp_path / "bodies")
    points, faces = rh.load_mesh(tmp_path / "bodies" / "anna.ply")
    rh.save_mesh(tmp_path / "bodies" / "anna.ply", points + 0.01, faces)
    with pytest.raises(rh.errors.FileError, match=r"anna\.ply was changed after it was registered"):
        register_folder(registration, scans, tmp_path / "bodies")
    rh.load_mesh(tmp_path / "bodies" / "anna.ply")  # and left as it is


def test_bodies_that_a_scan_does_not_show_fully_are_apart(registration, tmp_path):
    bodies = rh.datasets.load_open_bodies("coarse")
    scan = simulated_scan(bodies[0], registration.model.faces, rng=0, rotate=False)
    (tmp_path / "scans").mkdir()
    hip = (registration.model.joint_regressor @ scan.body)[0, 1]
    np.save(tmp_path / "scans" / "ben.npy", scan.points[scan.points[:, 1] > hip])
    (record,) = register_folder(registration, tmp_path / "scans", tmp_path / "bodies")
    assert record.trusted, record.message
    assert "is not in the scan" in record.message
    assert (tmp_path / "bodies" / "partial" / "ben.ply").is_file()
    assert not list((tmp_path / "bodies").glob("*.ply"))
    trusted = rh.io.load_trusted(tmp_path / "bodies" / "partial" / "ben.ply")
    assert not trusted.all()
    np.testing.assert_array_equal(trusted, record.arrays["trusted_vertices"])


@pytest.mark.parametrize(
    "change", [{"trusted": [True, False]}, {"message": 1.0}, {"points": np.full((3, 3), np.nan)}]
)
def test_damaged_records_are_refused(registered, tmp_path, change):
    arrays = rh.io.load_arrays(registered[1] / "registrations" / "anna.npz", [])
    (tmp_path / "registrations").mkdir()
    rh.io.save_arrays(tmp_path / "registrations" / "anna.npz", arrays | change)
    with pytest.raises(rh.errors.FileFormatError, match=next(iter(change))):
        read_records(tmp_path)


def test_another_model_registers_scans_again(registered, registration, tmp_path, monkeypatch):
    scans, output, _ = registered
    shutil.copytree(output, tmp_path / "bodies")
    model = copy.copy(registration.model)
    vars(model)["joint_regressor"] = np.roll(model.joint_regressor, 1, axis=1)

    def solve(self, scan, **options):
        raise rh.errors.ArgumentError("solved again")

    monkeypatch.setattr(ScanRegistration, "solve", solve)
    records = register_folder(ScanRegistration(model, up="y"), scans, tmp_path / "bodies")
    assert [record.message for record in records[:2]] == ["solved again"] * 2


def test_the_page_shows_every_scan(registered):
    _, output, _ = registered
    page = rh.report.scan_page(output)
    text = page.read_text(encoding="utf-8")
    assert page == output / "index.html"
    assert text.index("<h3>broken") < text.index("<h3>anna")
    assert text.count("not trusted</strong>") == 2
    assert text.count('alt="body registered to the scan anna"') == 1
    assert text.count('class="colour-bar"') == 1


def test_folders_without_scans_are_refused(tmp_path, registration):
    with pytest.raises(rh.errors.FileError, match="holds no scans"):
        register_folder(registration, tmp_path, tmp_path / "bodies")
    with pytest.raises(rh.errors.FileError, match="holds no registered scans"):
        read_records(tmp_path)


def test_two_scans_of_one_name_are_refused(tmp_path, registration):
    for name in ("anna.npy", "anna.xyz"):
        (tmp_path / name).write_text("")
    with pytest.raises(rh.errors.FileError, match=r"would become one body anna\.ply"):
        register_folder(registration, tmp_path, tmp_path / "bodies")
