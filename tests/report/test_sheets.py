"""Sheets of people: what they say of a body."""

import base64
import io
import re
from dataclasses import replace

import numpy as np
import PIL.Image
import pytest

import riemhuman as rh
from riemhuman.errors import ArgumentError, FileError
from riemhuman.registration._messages import MARK_WRISTS
from riemhuman.report._sheet_words import percentile_text, posture_texts, sentences_of


def test_a_sheet_says_what_the_body_measures(bodies, measurements):
    sheet = rh.report.sheet(bodies[3], name="Emma <&>", sex="woman", visit="2026-03-02")
    measured = measurements.measure(bodies[3], pose="standard", missing="nan")
    assert [row.name for row in sheet.measurements] == list(measured.names)
    np.testing.assert_allclose([row.value for row in sheet.measurements], measured.values)
    stature = sheet.measurements[0]
    definitions = measurements.definitions
    standing = rh.measurements.in_standard_pose(definitions, bodies[3])
    distance = rh.measurements.pose_distance(definitions, bodies[3], standing)
    noise = rh.measurements.noise_of_measurements(measured.names, distance)
    assert distance > 0.3
    np.testing.assert_allclose([row.uncertainty for row in sheet.measurements], 2 * noise)
    expected = rh.measurements.percentiles({"stature": stature.value}, "woman")["stature"]
    assert stature.percentile == pytest.approx(expected)
    assert sheet.badge == "registered mesh"
    text = f"{100 * stature.value:.1f}"
    assert f">{text}<" in sheet.html.replace(f"{text} ", f"{text}<")
    assert "Emma &lt;&amp;&gt;" in sheet.html
    assert "women of this stature" in sheet.html
    assert "ANSUR II" in sheet.html
    assert sheet._repr_html_().startswith("<iframe srcdoc=")
    # Nothing is fetched: the page works without a network.
    assert not re.search(r"(src|href)=[\"']https?:", sheet.html)


def test_a_child_has_no_percentiles_of_adults(bodies):
    child, unknown = 0.7 * bodies[0], bodies[0]
    sheet = rh.report.sheet(child, sex="woman")
    stature = sheet.measurements[0].value
    assert 1.0 < stature < 1.3
    assert all(np.isnan(row.percentile) for row in sheet.measurements)
    assert f"a stature of {100 * stature:.1f} cm is outside the range of adult women" in sheet.html
    adult = rh.report.sheet(unknown, sex="woman").html
    for words in ("pctl.", "24 of 100", "Compared with the average", "percentile</th>"):
        assert words not in sheet.html
        assert words in adult
    assert f"a stature of {stature / 0.0254:.1f} in" in rh.report.sheet(child, units="in").html


def test_inches_and_pounds(bodies, record):
    assert "from the body is 0.083 in;" in rh.report.sheet(record, units="in").html
    sheet = rh.report.sheet(bodies[0], units="in")
    stature = sheet.measurements[0].value
    assert f"{stature / 0.0254:.1f}" in sheet.html
    assert " lb" in sheet.html or ">lb<" in sheet.html
    with pytest.raises(ArgumentError, match="units must be one of"):
        rh.report.sheet(bodies[0], units="mm")


def test_a_scan_that_shows_only_part_of_a_body(record):
    sheet = rh.report.sheet(record, name="Emma", sex="woman")
    assert sheet.badge == "partly trusted"
    missing = {row.name for row in sheet.measurements if np.isnan(row.value)}
    assert {"stature", "foot length", "inside leg height"} <= missing
    assert "chest girth" not in missing
    assert "The feet were not seen" in sheet.html
    count = len(sheet.measurements) - 1  # the volume repeats the mass
    assert f"{len(missing - {'volume'})} of {count} measurements could not be taken" in sheet.html
    assert "2.1 mm" in sheet.html
    assert "The scan" in sheet.html
    # No foot, no angle of it; no stature, no percentile, unless it is typed in.
    assert np.isnan(sheet.posture["left foot turned out"])
    assert all(np.isnan(row.percentile) for row in sheet.measurements)
    rows = rh.report.sheet(record, sex="woman", stature=1.62).measurements
    shown = {row.name: row.percentile for row in rows if np.isfinite(row.percentile)}
    assert {"stature", "wrist girth", "hip girth"} <= {*shown}
    expected = rh.measurements.percentiles(
        {row.name: row.value for row in rows if row.name in shown}, "woman", stature=1.62
    )
    assert shown == pytest.approx(expected)
    with pytest.raises(ArgumentError, match="is it in centimetres"):
        rh.report.sheet(record, stature=162.0)


def test_a_body_that_is_not_trusted_is_not_measured(record):
    arrays = record.arrays | {"trusted_vertices": np.zeros_like(record.arrays["trusted_vertices"])}
    doubtful = replace(record, trusted=False, message="the body fits poorly", arrays=arrays)
    sheet = rh.report.sheet(doubtful)
    assert sheet.badge == "not trusted"
    assert all(np.isnan(row.value) for row in sheet.measurements)
    assert sheet.posture == {}
    assert "Do not rely on this body" in sheet.html
    assert "The body fits poorly." in sheet.html
    failed = replace(record, trusted=False, message="too few points", arrays={})
    with pytest.raises(ArgumentError, match="was not registered: too few points"):
        rh.report.sheet(failed)


def test_angles_and_percentiles_in_words():
    assert [percentile_text(x) for x in (0.2, 41.6, 99.7, np.nan)] == ["<1", "42", ">99", "–"]
    names = rh.measurements.posture_angles(
        rh.measurements.Measurements(rh.datasets.load_open_model("coarse")),
        rh.datasets.load_open_model("coarse").template.vertices,
    )
    angles = dict.fromkeys(names, 0.0) | {"shoulder tilt": -4.0, "head tilt": np.nan}
    angles |= dict.fromkeys(("left knee bent", "left elbow bent", "right elbow bent"), np.nan)
    texts = {title: said for title, *said in posture_texts(angles)}
    assert texts["Shoulder tilt"] == ["4°", "right higher"]
    assert texts["Head tilt"] == ["–", "not seen"]
    assert texts["Pelvis tilt"] == ["0°", "level"]
    assert texts["Knees bent"] == ["– / 0°", "left / right"]
    assert texts["Elbows bent"] == ["– / –", "not seen"]


def test_messages_in_the_words_of_clients():
    message = (
        "the feet were not seen (7 % of the body); right forearm: its rotation is ambiguous (not "
        "trusted); landmarks decide: the argument of ScanRegistration.solve, or --landmarks; "
        f"{MARK_WRISTS}; set it with up="
    )
    assert sentences_of(message) == [
        "The feet were not seen (7 % of the body).",
        "Right forearm: its rotation is ambiguous.",
        f"{MARK_WRISTS[0].upper()}{MARK_WRISTS[1:]}.",
    ]
    assert sentences_of("") == []


def test_values_that_hair_explains_are_withheld(bodies, measurements):
    head = measurements.definitions.model.weights[:, bodies.model.joint_names.index("head")]
    for size, badge in ((1.0, "registered mesh"), (1.2, "partly trusted")):
        person = bodies[0].copy()
        chin = person[head > 0.9].min(axis=0) * [0, 1, 0]
        person += head[:, np.newaxis] * (size - 1.0) * (person - chin)
        sheet = rh.report.sheet(person, sex="woman")
        values = {row.name: row.value for row in sheet.measurements}
        assert sheet.badge == badge
        assert np.isnan(values["head girth"]) == (size > 1.0)
        assert np.isfinite(values["hip girth"])
    assert "hair or a cap seems to cover the head" in sheet.html
    # What was withheld at either visit did not change.
    for before, after in ((bodies[0], person), (person, bodies[0])):
        changes = rh.report.sheet(after, sex="woman", before=before).changes
        known = dict(zip(changes.names, changes.changes, strict=True))
        assert np.isnan(known["head girth"])
        assert np.isfinite(known["hip girth"])
    assert "cover the hair with a tight cap" in sheet.html


def test_a_logo_is_at_the_top(bodies, tmp_path):
    picture = np.full((60, 3000, 3), 200, dtype=np.uint8)
    PIL.Image.fromarray(picture).save(tmp_path / "logo.jpg")
    page = rh.report.sheet(bodies[3], logo=tmp_path / "logo.jpg").html
    source = re.search(r'<img class="logo" src="data:image/png;base64,([^"]+)"', page)[1]
    with PIL.Image.open(io.BytesIO(base64.b64decode(source))) as logo:
        assert logo.size == (900, 18)
        assert logo.getpixel((5, 5)) == (200, 200, 200, 255)
    assert 'class="logo"' not in rh.report.sheet(bodies[3]).html
    (tmp_path / "text.png").write_text("no picture")
    with pytest.raises(FileError, match="text.png cannot be read as a picture"):
        rh.report.sheet(bodies[3], logo=tmp_path / "text.png")


@pytest.mark.parametrize(("hole", "is_hidden"), [(0.0, False), (0.05, True)])
def test_a_crotch_that_the_scan_does_not_show_has_no_height(record, measurements, hole, is_hidden):
    vertices, weights = measurements.definitions.landmarks["crotch"]
    points, shown = record.arrays["points"], record.arrays["points"].astype(np.float32)
    shown = shown[np.linalg.norm(shown - weights @ points[vertices], axis=1) >= hole]
    trusted = np.ones(len(points), dtype=bool)
    arrays = record.arrays | {"shown": shown, "trusted_vertices": trusted}
    sheet = rh.report.sheet(replace(record, message="", arrays=arrays), sex="woman")
    values = {row.name: row.value for row in sheet.measurements}
    assert np.isnan(values["inside leg height"]) == is_hidden
    assert np.isfinite(values["outside leg length"])
    assert ("stand with the feet further apart" in sheet.html) == is_hidden
