"""What a sheet says of a body, in numbers: names, percentiles, posture and changes."""

import re

import numpy as np
import pytest

import riemhuman as rh
from riemhuman.measurements.populations import spread_of_adults
from riemhuman.report.sheet_folders import at_visit
from riemhuman.report.sheet_values import SheetSubject, values_of


def test_names_are_words_of_people(bodies):
    """No anatomists' words, and no two rows of one name; files keep the names of the library."""
    sheet = rh.report.sheet(bodies[0])
    titles = [row.title for row in sheet.measurements]
    assert len(set(titles)) == len(titles)
    jargon = "omphalion|scye|tragion|suprasternale|trochanter|iliocristale|patella|C7|biacromial"
    assert not re.search(jargon, re.sub(r'title="[^"]*"|"data:[^"]*"', "", sheet.html))
    by_title = {row.title: row for row in sheet.measurements}
    assert by_title["Arm length"].name == "arm length"
    assert "waist depth (omphalion)" in {row.name for row in sheet.measurements}


def test_changes_since_a_visit(bodies, measurements):
    betas = bodies.betas[0].copy()
    later = betas + np.eye(len(betas))[1] * 0.8
    pose = bodies.pose_vectors[0]
    before, after = (bodies.model(shape, pose) for shape in (betas, later))
    sheet = rh.report.sheet(after, name="Emma", before=before)
    expected = rh.measurements.compare_visits(measurements, before, after)
    assert sheet.changes is not None
    np.testing.assert_allclose(sheet.changes.changes, expected.changes, atol=1e-9)
    assert "Changes since" in sheet.html
    shown = np.array([name != "volume" for name in expected.names])  # which repeats the mass
    count = int(expected.is_significant[shown].sum())
    assert f"{count} of {shown.sum()} measurements changed" in sheet.html
    assert "probably not of the same person" not in sheet.html
    assert rh.report.sheet(after).changes is None


def test_a_body_on_its_back_has_no_posture(bodies, measurements):
    lying = bodies[0][:, [0, 2, 1]] * [1.0, 1.0, -1.0]
    sheet = rh.report.sheet(lying)
    assert sheet.posture == {}
    assert "another axis points up" in sheet.html


def test_both_sides_are_measured_alike(bodies):
    """A body with a thicker left arm and leg."""
    open_body = bodies.model.template.vertices
    on_left = open_body[:, 0] > 0.06
    thicker = open_body.copy()
    arms = {name: bodies.model.joint_names.index(f"left_{name}") for name in ("elbow", "knee")}
    limb = bodies.model.weights[:, [*arms.values()]].sum(axis=1) * on_left
    thicker[:, 2] += 0.3 * limb * (thicker[:, 2] - (limb @ thicker[:, 2]) / limb.sum())
    pairs = {pair.title: pair for pair in _values_of(thicker, bodies).pairs}
    values = _values_of(open_body, bodies)
    plain = {pair.title: pair for pair in values.pairs}
    deviations = {row.title: row.uncertainty for row in values.rows}
    assert len(plain) == 8
    for title in ("Forearm girth", "Calf girth"):
        assert pairs[title].left > pairs[title].right + 0.01
        assert abs(plain[title].left - plain[title].right) < 0.005  # the mesh is no mirror
        assert plain[title].threshold == pytest.approx(2**0.5 * deviations[title])
    assert abs(pairs["Thigh girth"].left - pairs["Thigh girth"].right) < 0.003


def _values_of(points, bodies):
    measurements = rh.measurements.Measurements(bodies.model)
    subject = SheetSubject(name="body", points=points)
    return values_of(measurements, [subject])[0]


def test_percentiles_that_the_pose_hides_are_left_out(bodies):
    """A neck varies by two centimetres over poses, nearly as much as among people."""
    values = _values_of(bodies[0], bodies)
    rows = values.by_name
    known = rh.measurements.percentiles({n: rows[n].value for n in ("stature", "neck girth")})
    assert np.isfinite(known["neck girth"])
    spread = spread_of_adults("neck girth", "adult") * rows["neck girth"].value
    assert np.isnan(rows["neck girth"].percentile) == (rows["neck girth"].uncertainty > spread)
    assert np.isfinite(rows["hip girth"].percentile)


def test_a_row_of_visits_holds_statures_of_one_kind(bodies, measurements):
    (values,) = values_of(measurements, [SheetSubject("x", bodies[0], stature=1.61)])
    scanned = measurements.measure(bodies[0], pose="standard")["stature"]
    assert values.by_name["stature"].value == 1.61
    assert at_visit(values, is_typed_in=True)["stature"] == 1.61
    assert abs(at_visit(values, is_typed_in=False)["stature"] - scanned) < 1e-9


def test_several_scans_of_a_visit(bodies, measurements):
    """The mean is measured; a scan that is not trusted is left out, another person is said."""
    definitions = measurements.definitions
    mean = rh.measurements.person_in_standard_pose(definitions, bodies.points[[0, 3]])
    measured = measurements.measure(mean, axes="space", missing="nan").values
    sheet = rh.report.sheet(bodies.points[[0, 3]], before=bodies.points[1:3])
    values = [row.value for row in sheet.measurements]
    np.testing.assert_allclose(values, measured, rtol=1e-12, equal_nan=True)
    compared = rh.measurements.compare_visits(
        measurements, bodies.points[1:3], bodies.points[[0, 3]]
    )
    np.testing.assert_allclose(sheet.changes.noise, compared.noise)
    # ± is smaller than that of one scan in either pose.
    deviations = np.array([row.uncertainty for row in sheet.measurements])
    for k in (0, 3):
        one = np.array([row.uncertainty for row in rh.report.sheet(bodies[k]).measurements])
        assert (deviations < one)[np.isfinite(one)].all()
    seen, unseen = (
        SheetSubject(
            f"scan {k}", bodies[k], trusted_vertices=np.full(definitions.n_vertices, k == 0)
        )
        for k in (0, 3)
    )
    other = SheetSubject("scan 12", bodies[12])
    visit = SheetSubject.of_visit([unseen, seen, other])
    assert visit.name == "scan 0"
    (values,) = values_of(measurements, [visit])
    assert values.remarks[0] == "scan 3 is not trusted and left out"
    assert values.remarks[1] == "scan 0 and scan 12 are probably not of one person"
