"""The commands measure, compare and sheet say what the library measures."""

import csv
import json

import numpy as np
import pytest

import riemhuman as rh
from riemhuman.datasets import load_open_model
from riemhuman.io import save_mesh
from riemhuman.measurements import Girth, Measurements, compare_visits


@pytest.fixture(scope="module")
def measurements():
    return Measurements(load_open_model("coarse"))


def test_a_folder_in_the_standard_pose(run, scans, bodies, measurements, tmp_path):
    finished = run("measure", scans, "-o", tmp_path / "table.csv", "--only", "waist girth", "-q")
    assert finished.code == 0
    with open(tmp_path / "table.csv", encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    assert [row["file"].rpartition("body_")[2] for row in rows] == [
        f"{number}.ply" for number in (0, 1, 2, 20, 21, 22)
    ]
    waist = Measurements(measurements.definitions, ["waist girth"])
    expected = waist.measure(bodies.points[20], pose="standard").values[0]
    np.testing.assert_allclose(float(rows[3]["waist girth (m)"]), expected, atol=1e-6)


def test_bodies_as_they_stand(run, scans, bodies, measurements):
    finished = run("measure", scans / "body_1.ply", "--as-is", "--json")
    record = json.loads(finished.out)
    (values,) = record["bodies"].values()
    expected = measurements.measure(bodies.points[1])
    np.testing.assert_allclose(list(values.values()), expected.values, rtol=1e-5)
    assert record["pose"] == "as is"
    assert "Measurements of 1 mesh: " in finished.err
    assert record["units"]["volume"] == "m³"


def test_reasons_for_missing_values(run, scans, measurements, tmp_path):
    hips = Girth(name="hips of a leg", at="right_buttock", parts=["right leg"])
    measurements.definitions.with_measurements(["stature", hips]).save(tmp_path / "own.json")
    measurements.definitions.template.save(tmp_path / "model.npz")
    options = ("--model", tmp_path / "model.npz", "--definitions", tmp_path / "own.json")
    arguments = ("measure", scans / "body_0.ply", "--as-is", *options, "-q")
    assert "no hips of a leg of body_0.ply: its line leaves right leg" in run(*arguments).out
    (missing,) = json.loads(run(*arguments, "--json").out)["missing"]
    assert missing["measurement"] == "hips of a leg"
    assert missing["file"].endswith("body_0.ply")
    assert missing["why"].startswith("its line leaves right leg")


def test_parts_that_a_scan_does_not_show(run, bodies, tmp_path):
    """A body whose legs are not trusted, as its file says."""
    point, faces = bodies.points[0], bodies.template.faces
    save_mesh(tmp_path / "anna.ply", point, faces, point[:, 1] > 0.9)
    only = ("--only", "stature", "--only", "head girth", "--as-is", "--json")
    picture = tmp_path / "lines.svg"
    record = json.loads(run("measure", tmp_path / "anna.ply", *only, "--picture", picture).out)
    drawn = picture.read_text(encoding="utf-8")
    assert ("<!-- Girths -->" in drawn, "<!-- Heights -->" in drawn) == (True, False)
    assert [missing["measurement"] for missing in record["missing"]] == ["stature"]
    assert "untrusted parts" in record["missing"][0]["why"]
    assert next(iter(record["bodies"].values()))["head girth"] > 0.5


def test_people_who_sit(run, scans):
    record = json.loads(run("measure", scans / "body_0.ply", "--seated", "--json").out)
    assert record["pose"] == "seated"
    (values,) = record["bodies"].values()
    assert 0.7 < values["sitting height"] < 1.0


def test_visits_without_parts_that_a_scan_does_not_show(run, bodies, tmp_path):
    """The second scan shows no head."""
    faces, points = bodies.template.faces, bodies.points[[0, 2]]
    shown = points[1][:, 1] < points[1][:, 1].max() - 0.3
    save_mesh(tmp_path / "one.ply", points[0], faces)
    save_mesh(tmp_path / "two.ply", points[1], faces, shown)
    command = ("compare", tmp_path / "one.ply", tmp_path / "two.ply")
    command += ("--only", "head girth", "--only", "calf girth")
    record = json.loads(run(*command, "--json").out)
    assert record["changes"][0] is None
    (missing,) = record["missing"]
    assert (missing["measurement"], missing["file"][-7:]) == ("head girth", "two.ply")
    assert f"no head girth of two.ply: {missing['why']}" in run(*command).out
    assert abs(record["changes"][1]) < 0.02
    assert record["exceeds_threshold"][0] is False
    assert record["expected_beyond_threshold_by_chance"] == pytest.approx(0.0455, rel=1e-3)
    assert np.isfinite(record["outward_millimetres"]["most"])


def test_two_visits(run, scans, bodies, measurements, tmp_path):
    files = (scans / "body_0.ply", scans / "body_2.ply")
    finished = run("compare", *files, "--json")
    record = json.loads(finished.out)
    expected = compare_visits(measurements, bodies.points[0], bodies.points[2])
    np.testing.assert_allclose(record["changes"], expected.changes, atol=1e-5)
    assert record["exceeds_threshold"] == expected.is_significant.tolist()
    thresholds = np.array(record["thresholds"], dtype=float)
    np.testing.assert_allclose(thresholds, expected.thresholds)
    by_chance = pytest.approx(0.0455 * np.isfinite(thresholds).sum(), rel=1e-3)
    assert record["expected_beyond_threshold_by_chance"] == by_chance
    assert "probably not the same person" not in finished.err
    finished = run("compare", *files, "-o", tmp_path / "changes.csv", "--only", "stature")
    (line,) = [line for line in finished.out.splitlines() if line.startswith("stature ")]
    with open(tmp_path / "changes.csv", encoding="utf-8", newline="") as file:
        (row,) = csv.DictReader(file)
    assert (row["measurement"], row["unit"]) == ("stature", "m")
    shown = [float(number) for number in line.split()[1:5]]
    stored = [100 * float(row[key]) for key in ("before", "after", "change", "threshold")]
    np.testing.assert_allclose(shown, stored, atol=0.051)


def test_visits_with_several_scans(run, bodies, measurements, tmp_path):
    for visit, numbers in (("first", (0, 5)), ("second", (1, 3))):
        (tmp_path / visit).mkdir()
        for number in numbers:
            save_mesh(
                tmp_path / visit / f"{number}.ply", bodies.points[number], bodies.template.faces
            )
    names = ["stature", "waist girth"]
    only = [word for name in names for word in ("--only", name)]
    visits = tmp_path / "first", tmp_path / "second"
    record = json.loads(run("compare", *visits, *only, "--json").out)
    few = Measurements(measurements.definitions, names)
    expected = compare_visits(few, bodies.points[[0, 5]], bodies.points[[1, 3]])
    np.testing.assert_allclose(record["changes"], expected.changes, atol=1e-5)
    thresholds = np.array(record["thresholds"], dtype=float)
    np.testing.assert_allclose(thresholds, expected.thresholds, rtol=1e-4)
    assert record["scans"] == [2, 2]
    person = json.loads(run("measure", visits[0], "--same-person", *only, "--json").out)
    np.testing.assert_allclose([*person["bodies"]["person"].values()], expected.before, atol=1e-5)
    save_mesh(tmp_path / "first" / "9.ply", bodies.points[50], bodies.template.faces)
    doubted = run("measure", visits[0], "--same-person", *only).err
    assert "0.ply and 9.ply are probably not the same person" in doubted
    assert "5.ply" not in doubted


def test_two_people_are_hardly_one(run, scans, bodies, tmp_path):
    only = ("--only", "stature")
    save_mesh(tmp_path / "other.ply", bodies.points[50], bodies.template.faces)
    two = run("compare", scans / "body_0.ply", tmp_path / "other.ply", *only, "--json")
    assert "are probably not the same person" in two.err
    record = json.loads(two.out)
    usual = record["usual_area_distances"]
    assert usual["one_person"] < usual["two_people"] < 10 * usual["one_person"]
    assert record["area_distance"] > 0.5 * usual["two_people"]


@pytest.mark.slow
def test_people_read_centimetres(run, scans):
    """An inch is 0.0254 m, a pound 0.45359237 kg; only the printed table is converted."""
    only = [word for name in ("stature", "body mass") for word in ("--only", name)]
    command = ("measure", scans / "body_0.ply", "--as-is", *only)
    (values,) = json.loads(run(*command, "--json", "--output-units", "in").out)["bodies"].values()
    for system, stature, mass in (
        ("cm", (100, "cm"), (1, "kg")),
        ("in", (1 / 0.0254, "in"), (1 / 0.45359237, "lb")),
    ):
        table = run(*command, "--output-units", system).out
        for name, (scale, unit) in {"stature": stature, "body mass": mass}.items():
            (line,) = [line for line in table.splitlines() if line.startswith(f"{name} ")]
            value, shown_unit = line.removeprefix(name).split()
            assert shown_unit == unit
            assert float(value) == pytest.approx(scale * values[name], abs=0.051)
    changes = ("compare", scans / "body_0.ply", scans / "body_2.ply", "--only", "stature")
    outward = json.loads(run(*changes, "--json").out)["outward_millimetres"]
    said = run(*changes, "--output-units", "in").out
    (line,) = [line for line in said.splitlines() if line.startswith("surface change")]
    inward, _, _, _, high, *_ = line.split(": ")[1].split()
    ends = [outward["least"] / 25.4, outward["most"] / 25.4]
    assert [-float(inward), float(high)] == pytest.approx(ends, abs=0.0021)


def test_options_reach_the_sheets(run, scans, tmp_path, monkeypatch):
    given = {}

    def make_sheets(files, output, **settings):
        given.update(settings, files=files)
        output.mkdir()
        return output / "index.html"

    monkeypatch.setattr(rh.report, "make_sheets", make_sheets)
    command = ("sheet", scans / "body_0.ply", "-o", tmp_path / "sheets", "--stature", "1.7")
    options = ("--output-units", "in", "--unit", "metres", "--up", "y", "--force")
    tables = ("--labels", scans / "labels.csv", "--logo", scans / "logo.png")
    finished = run(*command, *options, *tables)
    assert finished.out.startswith(f"open {tmp_path / 'sheets' / 'index.html'}")
    assert given.pop("progress")
    assert given == {
        "files": [scans / "body_0.ply"], "labels": scans / "labels.csv", "measurements": None,
        "stature": 1.7, "units": "in", "unit": "metres", "up": "y", "replace_output": True,
        "logo": scans / "logo.png",
    }  # fmt: skip
