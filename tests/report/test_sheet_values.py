"""What a sheet says of a body, in numbers: names, percentiles, posture and changes."""

import re

import numpy as np

import riemhuman as rh


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
    assert f"{int(expected.is_significant.sum())} of 85 measurements changed" in sheet.html
    assert "hardly the same person" not in sheet.html
    assert rh.report.sheet(after).changes is None


def test_a_body_on_its_back_has_no_posture(bodies, measurements):
    lying = bodies[0][:, [0, 2, 1]] * [1.0, 1.0, -1.0]
    sheet = rh.report.sheet(lying)
    assert sheet.posture == {}
    assert "another axis points up" in sheet.html
