"""A folder of sheets: its pages and tables, what is refused, and what an interruption leaves."""

import csv
import json
import re
from dataclasses import replace

import numpy as np
import pytest

import riemhuman as rh
from riemhuman.cli import main
from riemhuman.errors import ArgumentError, FileError
from riemhuman.report import sheet_folders
from riemhuman.report._sheet_subjects import find_subjects
from riemhuman.report.sheet_values import CROTCH


def table_of(folder):
    text = (folder / "measurements.csv").read_text(encoding="utf-8")
    return list(csv.reader(text.splitlines()))


@pytest.mark.filterwarnings("ignore:no PDF")
def test_visits_of_two_people_are_doubted(bodies, folder, tmp_path, no_browser):
    """The page says so, and a warning in the words of `riemhuman compare`."""
    people = rh.measurements.person_distance(bodies[0], bodies[13], bodies.template.faces)
    sheet = rh.report.sheet(bodies[13], name="Emma", before=bodies[0])
    assert people.is_hardly_one_person
    assert "The two visits are probably not of the same person" in sheet.html
    assert people.text not in sheet.html
    rh.save_mesh(folder / "emma_2.ply", bodies[13], bodies.template.faces)
    (folder / "index.ply").unlink()
    with pytest.warns(UserWarning, match=re.escape(f"emma_1 and emma_2 are {people.text}")):
        rh.report.make_sheets(folder, tmp_path / "sheets")


@pytest.mark.filterwarnings("ignore:no PDF")
def test_a_folder_of_sheets(folder, tmp_path, no_browser, measurements, bodies):
    page = rh.report.make_sheets(folder, tmp_path / "sheets")
    names = {"index.html", "measurements.csv", "emma_1.html", "emma_2.html", "index_2.html"}
    written = {file.name for file in page.parent.iterdir()}
    assert written - {"measurements.xlsx"} == names
    text = page.read_text(encoding="utf-8")
    assert re.findall(r"<button>(\w+)", text)[:5] == ["Name", "Sex", "Visit", "Trust", "Stature"]
    for name in names - {"index.html"}:
        assert f'href="{name}"' in text
    rows = table_of(tmp_path / "sheets")
    table = [dict(zip(rows[0], row, strict=True)) for row in rows[1:]]
    assert [row["name"] for row in table] == ["emma_1", "emma_2", "index"]
    assert [row["sex"] for row in table] == ["woman", "woman", "adult"]
    assert table[2]["person"] == "'=Ada"  # no formula
    measured = measurements.measure(bodies.points[[0, 3, 12]], pose="standard", missing="nan")
    for column in ("stature", "waist girth"):
        np.testing.assert_allclose(
            [float(row[f"{column} (m)"]) for row in table], measured[column], atol=1e-6
        )
    assert float(table[0]["body mass (kg)"]) == pytest.approx(measured["body mass"][0])
    later = (tmp_path / "sheets" / "emma_2.html").read_text(encoding="utf-8")
    assert "Changes since 2026-02-28" in later
    assert "Changes since" not in (tmp_path / "sheets" / "emma_1.html").read_text(encoding="utf-8")
    # The workbook holds the same.
    openpyxl = pytest.importorskip("openpyxl")
    book = openpyxl.load_workbook(tmp_path / "sheets" / "measurements.xlsx")
    assert book.sheetnames == ["Measurements", "Percentiles", "Uncertainty", "Posture", "Changes"]
    header, *in_book = book["Measurements"].iter_rows(values_only=True)
    column = header.index("hip girth (m)")
    assert [row[column] for row in in_book] == pytest.approx(
        [float(row["hip girth (m)"]) for row in table]
    )


def test_nothing_is_left_of_what_fails(folder, bodies, tmp_path, no_browser, monkeypatch):
    output = tmp_path / "sheets"

    def fail(*arguments):
        raise FileError("the disk is full")

    with monkeypatch.context() as broken:
        broken.setattr(sheet_folders, "_write_tables", fail)
        with (
            pytest.raises(FileError, match="the disk is full"),
            pytest.warns(UserWarning, match="no PDF files are written"),
        ):
            rh.report.make_sheets([folder / "emma_1.ply"], output)
    assert sorted(file.name for file in tmp_path.iterdir()) == ["bodies"]
    output.mkdir()
    (output / "thesis.doc").touch()
    with pytest.raises(FileError, match="something else"):
        rh.report.make_sheets(folder, output, replace_output=True)


@pytest.mark.filterwarnings("ignore:no PDF")
def test_an_earlier_result_is_kept_unless_asked(folder, tmp_path, no_browser):
    output = tmp_path / "sheets"
    output.mkdir()
    (output / "gone.html").touch()
    # Pages or PDF files alone may be the user's own.
    with pytest.raises(FileError, match=r"gone\.html, but no measurements\.csv"):
        rh.report.make_sheets([folder / "emma_1.ply"], output, replace_output=True)
    assert (output / "gone.html").exists()
    (output / "measurements.csv").touch()
    with pytest.raises(FileError, match="earlier result"):
        rh.report.make_sheets([folder / "emma_1.ply"], output)
    rh.report.make_sheets([folder / "emma_1.ply"], output, replace_output=True)
    assert not (output / "gone.html").exists()
    assert (output / "emma_1.html").exists()


@pytest.mark.filterwarnings("ignore:no PDF")
def test_three_visits_have_a_trend(bodies, folder, tmp_path, no_browser):
    """Its statures are all of the scans, unless all are typed in."""
    rh.save_mesh(folder / "emma_3.ply", bodies[3], bodies.template.faces)
    rows = ["file,person,sex,visit,stature"]
    rows += [f"emma_{k}.ply,Emma,woman,{k},{'1.61' if k == 3 else ''}" for k in (1, 2, 3)]
    (folder / "labels.csv").write_text("\n".join(rows), encoding="utf-8")
    (folder / "index.ply").unlink()
    rh.report.make_sheets(folder, tmp_path / "sheets")
    second, third = (
        (tmp_path / "sheets" / f"emma_{k}.html").read_text(encoding="utf-8") for k in (2, 3)
    )
    assert "All visits" not in second
    assert re.findall(r'class="n">(visit \d)<', third)[:3] == ["visit 1", "visit 2", "visit 3"]
    assert '<td class="n v">161.0</td>' in third  # among the measurements of this visit
    statures = re.search(r'Stature <span class="u">cm</span>.*?</tr>', third)[0]
    shown = [float(text) for text in re.findall(r'<td class="n">([\d.]+)</td>', statures)]
    expected = [rh.report.sheet(bodies[k]).measurements[0].value for k in (0, 3, 3)]
    np.testing.assert_allclose(shown, 100 * np.array(expected), atol=0.051)
    with pytest.raises(ArgumentError, match="stature is for one body; found 3"):
        rh.report.make_sheets(folder, tmp_path / "others", stature=1.7)


def test_other_bodies_are_refused(bodies, tmp_path):
    rh.save_mesh(tmp_path / "mm.ply", 1000.0 * bodies[0], bodies.template.faces)
    with pytest.raises(
        ArgumentError, match=r"mm\.ply is .* but a body in millimetres would be; .* --unit"
    ):
        rh.report.make_sheets(tmp_path / "mm.ply", tmp_path / "sheets")
    rh.save_mesh(tmp_path / "box.ply", np.random.default_rng(0).random((4, 3)), [[0, 1, 2]])
    with pytest.raises(FileError, match=r"box\.ply has .* register it first"):
        rh.report.make_sheets(tmp_path / "box.ply", tmp_path / "sheets")


@pytest.mark.filterwarnings("ignore:no PDF")
def test_registered_scans_come_with_their_scans(record, measurements, tmp_path, no_browser, capsys):
    """Also those that are not trusted, and the reason why there is no body."""
    from riemhuman.registration.folders import _write

    place = tmp_path / "registered"
    (place / "registrations").mkdir(parents=True)
    arrays = record.arrays | {"up": np.array([0.0, 1.0, 0.0]), "matched": np.ones(1202, bool)}
    fits = {"betas": np.zeros(3), "pose": np.zeros(3), "trans": np.zeros(3), "hands": np.zeros(3)}
    shown = {"shown_distances": np.zeros(len(arrays["shown"]), np.float32)}
    whole = replace(record, arrays=arrays | fits | shown)
    _write(place, whole, "key", None)
    _write(place, replace(whole, name="bad", trusted=False, message="no person"), "key", None)
    _write(
        place, replace(record, name="none", trusted=False, message="empty", arrays={}), "k", None
    )
    page = rh.report.make_sheets(place, tmp_path / "sheets")
    text = page.read_text(encoding="utf-8")
    assert "1 partly, 1 not trusted" in text
    assert "<strong>none</strong>: empty" in text
    one = (tmp_path / "sheets" / "half.html").read_text(encoding="utf-8")
    assert "The scan from three sides" in one
    # One file of such a folder, too, is found with its scan.
    file = place / "partial" / "half.ply"
    found = find_subjects([file], None)
    assert found.subjects[0].scan is not None
    # `riemhuman measure` leaves out what the scan does not show, as a sheet does.
    for name, hole in (("half", 0.0), ("hole", 0.05)):
        crotch, weights = measurements.definitions.landmarks["crotch"]
        points = whole.arrays["points"]
        is_shown = np.linalg.norm(points - weights @ points[crotch], axis=1) >= hole
        arrays = whole.arrays | {
            "shown": points[is_shown].astype(np.float32),
            "shown_distances": np.zeros(is_shown.sum(), np.float32),
            "trusted_vertices": np.ones(len(points), dtype=bool),
        }
        _write(place, replace(whole, name=name, arrays=arrays), "key", None)
        file = place / "partial" / f"{name}.ply"
        assert main(["measure", str(file), "--only", "inside leg height", "--json"]) == 0
        missing = json.loads(capsys.readouterr().out)["missing"]
        assert [entry["why"] for entry in missing] == [CROTCH.reason] * (name == "hole")
    # Of a body that was changed since, it knows no scan.
    rh.save_mesh(file, points + 0.001, whole.arrays["faces"])
    assert main(["measure", str(file), "--only", "inside leg height", "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["missing"] == []
