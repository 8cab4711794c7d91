"""Folders of scans: what is written, what a second run leaves, and what is damaged."""

from dataclasses import replace

import numpy as np
import pytest
from open_bodies import model_with

import riemhuman as rh
from riemhuman.registration import ScanRegistration, read_records, register_folder

BEN, BOX = 3000, 2000  # numbers of points of scans without a lower half, and of no body


@pytest.fixture
def solved(monkeypatch, result):
    """Let scans have this one result, or one that belongs to their number of points."""
    counts = []

    def solve(self, scan, *, start=None):
        counts.append(len(scan))
        shown = {name: getattr(result, name)[: len(scan)] for name in ("distances", "background")}
        found = replace(result, **shown)
        if len(scan) == BEN:
            upper = result.points[:, 1] > np.median(result.points[:, 1])
            return replace(found, message="50 % is not in the scan", trusted_vertices=upper)
        return replace(found, trusted=False, message="no body") if len(scan) == BOX else found

    monkeypatch.setattr(ScanRegistration, "solve", solve)
    return counts


@pytest.fixture
def folders(tmp_path, scan):
    """Return folders of scans and of bodies; one scan is damaged."""
    scans = tmp_path / "scans"
    scans.mkdir()
    for name, count in (("anna", len(scan.points)), ("ben", BEN), ("box", BOX)):
        np.save(scans / f"{name}.npy", scan.points[:count])
    (scans / "broken.xyz").write_text("1 2 3\n4 5\n")
    return scans, tmp_path / "bodies"


@pytest.fixture
def registered(registration, folders, solved):
    return register_folder(registration, *folders)


def test_bodies_are_apart_by_trust(registered, registration, result, folders):
    assert [record.name for record in registered] == ["anna", "ben", "box", "broken"]
    assert [record.trusted for record in registered] == [True, True, False, False]
    assert "line 2 is not valid: '4 5'; it has 2 numbers" in registered[3].message
    # Hands hold many vertices and little surface.
    areas = rh.surfaces.triangle_areas(result.points, result.faces)
    share = areas @ result.matched[result.faces].mean(axis=1) / areas.sum()
    assert registered[0].matched_share == pytest.approx(share)
    assert registered[0].matched_share != pytest.approx(result.matched.mean(), abs=1e-3)
    output = folders[1]
    points, faces = rh.load_mesh(output / "anna.ply")
    np.testing.assert_array_equal(faces, registration.model.faces)
    arrays = registered[0].arrays
    transform = arrays["transform"]
    moved = arrays["points"] @ transform[:3, :3].T + transform[:3, 3]
    np.testing.assert_allclose(points, moved, atol=1e-12)
    assert abs(points[:, 1].min()) < 1e-9
    assert sorted(str(entry.relative_to(output)) for entry in output.glob("**/*.ply")) == [
        "anna.ply",
        "partial/ben.ply",
        "untrusted/box.ply",
    ]
    assert [entry.name for entry in read_records(output)][:2] == ["broken", "box"]
    trusted = rh.io.load_trusted(output / "partial" / "ben.ply")
    assert not trusted.all()
    np.testing.assert_array_equal(trusted, registered[1].arrays["trusted_vertices"])


def test_an_interrupt_keeps_what_is_finished(registration, folders, solved, monkeypatch):
    solve = ScanRegistration.solve

    def stopped(self, scan, *, start=None):
        if len(scan) == BOX:
            raise KeyboardInterrupt
        return solve(self, scan, start=start)

    with monkeypatch.context() as patch:
        patch.setattr(ScanRegistration, "solve", stopped)
        with pytest.raises(rh.solvers.Interrupted) as caught:
            register_folder(registration, *folders)
    assert [record.name for record in caught.value.result.records] == ["anna", "ben"]
    assert caught.value.result.status is rh.solvers.Status.INTERRUPTED
    solved.clear()
    assert len(register_folder(registration, *folders)) == 4
    assert solved == [BOX]


def test_bodies_may_keep_the_axes_of_the_scans(registration, folders, solved, result):
    register_folder(registration, *folders, keep_axes=True)
    points, _ = rh.load_mesh(folders[1] / "anna.ply")
    np.testing.assert_allclose(points, result.points, atol=1e-9)


def test_a_second_run_does_what_is_missing(registered, registration, folders, solved):
    (folders[1] / "untrusted" / "box.ply").unlink()
    solved.clear()
    records = register_folder(registration, *folders)
    assert solved == [BOX]
    assert [record.message for record in records] == [record.message for record in registered]


def test_another_model_registers_scans_again(registered, registration, folders, solved):
    joints = np.roll(registration.model.joint_regressor, 1, axis=1)
    model = model_with(registration.model, joint_regressor=joints)
    solved.clear()
    register_folder(ScanRegistration(model, up="y"), *folders)
    assert len(solved) == 3


def test_changed_bodies_and_bodies_without_a_scan_are_noticed(registered, registration, folders):
    scans, output = folders
    (scans / "ben.npy").unlink()
    with pytest.warns(UserWarning, match="bodies whose scans no longer exist: ben"):
        register_folder(registration, scans, output)
    points, faces = rh.load_mesh(output / "anna.ply")
    rh.save_mesh(output / "anna.ply", points + 0.01, faces)
    with pytest.raises(rh.errors.FileError, match=r"anna\.ply was changed after it was registered"):
        register_folder(registration, scans, output)
    np.testing.assert_allclose(rh.load_mesh(output / "anna.ply")[0], points + 0.01, atol=1e-6)
    # The record holds a second copy of the body, which measurements would be taken of.
    with pytest.raises(rh.errors.FileError, match=r"measure it as it is, move the body elsewhere"):
        rh.registration.read_records(output)


@pytest.mark.parametrize(
    "change",
    [{"trusted": [True, False]}, {"likelihood": b"3"}, {"points": np.full((3, 3), np.nan)}],
)
def test_damaged_records_are_refused(registered, folders, change):
    file = folders[1] / "registrations" / "anna.npz"
    rh.io.save_arrays(file, rh.io.load_arrays(file, []) | change)
    with pytest.raises(rh.errors.FileFormatError, match=next(iter(change))):
        read_records(folders[1])


@pytest.mark.slow
def test_the_page_shows_every_scan(registered, folders):
    page = rh.report.scan_page(folders[1])
    text = page.read_text(encoding="utf-8")
    assert page == folders[1] / "index.html"
    assert text.index("<h3>broken") < text.index("<h3>anna")
    assert text.count("not trusted</strong>") == 2
    assert text.count('alt="body registered to the scan anna"') == 1
    assert text.count('class="colour-bar"') == 1
    assert 'href="views/anna.html"' in text
    assert "views/broken.html" not in text  # it has no body
    view = folders[1] / "views" / "anna.html"
    assert 'data-scan="cut"' in view.read_text(encoding="utf-8")
    assert " mm of the body" in view.read_text(encoding="utf-8")
    rh.report.scan_page(folders[1], units="in")
    assert " in of the body" in view.read_text(encoding="utf-8")
    assert " mm" not in view.read_text(encoding="utf-8").split("<script")[0]


def test_folders_without_scans_are_refused(tmp_path, registration):
    (tmp_path / "._anna.ply").write_bytes(b"a hidden file that macOS writes beside a scan")
    with pytest.raises(rh.errors.FileError, match="holds no scans"):
        register_folder(registration, tmp_path, tmp_path / "bodies")
    with pytest.raises(rh.errors.FileError, match="holds no registered scans"):
        read_records(tmp_path)


def test_two_scans_of_one_name_are_refused(tmp_path, registration):
    for name in ("anna.npy", "anna.xyz"):
        (tmp_path / name).write_text("")
    with pytest.raises(rh.errors.FileError, match=r"would both become anna\.ply"):
        register_folder(registration, tmp_path, tmp_path / "bodies")
