"""Choices of bodies, sentences about results, and the section on measurements."""

import csv
import re

import numpy as np
import pytest

from riemhuman.measurements import Measurements
from riemhuman.registration import ScanRecord
from riemhuman.report import _body_sections as sections
from riemhuman.report._report import Task, choose_pair, group_within
from riemhuman.report.registered_scans import scan_section

SUBJECT = np.repeat([0, 1, 2], 3)
POSE = np.tile([0, 1, 2], 3)
DISTANCES = np.abs(np.subtract.outer(np.arange(9.0) ** 2, np.arange(9.0) ** 2))


def test_pairs_by_what_they_share_and_their_distance():
    suits = np.equal.outer(SUBJECT, SUBJECT) & ~np.equal.outer(POSE, POSE)
    # Items i and j are |i² − j²| apart: 0 and 1 are nearest, 6 and 8 farthest within a person.
    assert choose_pair(DISTANCES, suits, 0.0) == (0, 1)
    assert choose_pair(DISTANCES, suits, 1.0) == (6, 8)
    assert choose_pair(DISTANCES, np.eye(9, dtype=bool), 0.5) is None


def test_groups_hold_one_of_each():
    np.testing.assert_array_equal(group_within(POSE, SUBJECT, 5), [0, 3, 6])
    np.testing.assert_array_equal(group_within(POSE, SUBJECT, 2), [0, 6])
    uneven = np.array([0, 1, 1, 1, 0])
    np.testing.assert_array_equal(group_within(uneven, np.array([0, 0, 1, 1, 1]), 5), [0, 4])


LABELS = np.repeat(np.arange(5), 4)


TASKS = [
    Task("shape", "person", "", "", LABELS, ()),
    Task("pose", "pose", "", "", LABELS, ()),
]


@pytest.mark.parametrize(
    ("labels", "is_retrieval"),
    [([0, 1, 2], False), ([0, 0, 1, 2], False), ([0, 0, 0], False), ([0, 0, 1, 1], True)],
)
def test_retrieval_needs_two_classes_of_two(labels, is_retrieval):
    task = Task("shape", "person", "", "", np.array(labels), ())
    assert task.is_retrieval == is_retrieval


def record(name, *, trusted, message, share):
    return ScanRecord(name, trusted, message, 2.52, 0.002, share, {})


def test_scans_have_one_badge_of_three_and_no_likelihood():
    records = [
        record("ann", trusted=False, message="far from the scan", share=0.4),
        record("ben", trusted=True, message="the legs were not seen", share=0.66),
        record("cy", trusted=True, message="", share=0.97),
    ]
    html = scan_section(records).html
    assert re.findall(r'<strong class="badge (\w+)">([^<]*)<', html) == [
        ("untrusted", "not trusted"),
        ("partial", "partly seen: 66 %"),
        ("trusted", "trusted"),
    ]
    assert "likelihood" not in html
    assert "2.52" not in html
    assert "2 of 3 scans are registered and trusted; 1 of them shows only part" in html
    assert "20.0 mm and more" in html
    assert "0.787 in and more" in scan_section(records, units="in").html


def test_best_weights_are_those_of_the_rows():
    key = "{}_mean_average_precision"
    rows = [
        {"lam": lam, "c": c, key.format("shape"): on_people, key.format("pose"): on_poses}
        for lam, c, on_people, on_poses in [(0, 0, 20, 50), (0, 1, 70, 50), (None, 1, 30, 40)]
    ]
    people, poses = sections.best_weights(rows, TASKS)
    assert (people["classes"], people["row"], people["n_ties"]) == ("people", rows[1], 0)
    assert (poses["value"], poses["row"], poses["n_ties"]) == (50, rows[0], 1)


def test_people_have_their_measurements(report_page, nine_bodies):
    with (report_page.parent / "tables" / "measurements.csv").open(encoding="utf-8") as stream:
        rows = list(csv.DictReader(stream))
    assert [row["person"] for row in rows] == [nine_bodies.subject_names[k] for k in (0, 5, 8)]
    own = Measurements(nine_bodies.model, ["waist girth"])
    values = own.measure(nine_bodies.points[:2], pose="standard").values  # of two poses
    assert float(rows[0]["waist girth (m)"]) == pytest.approx(float(values.mean()), abs=1e-6)
    assert "Girths, lengths and volumes" in report_page.read_text(encoding="utf-8")
