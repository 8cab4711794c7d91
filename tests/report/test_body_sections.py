"""The best weights of a sweep, and the section on measurements."""

import csv

import numpy as np
import pytest

from riemhuman.measurements import Measurements
from riemhuman.report import _body_sections as sections
from riemhuman.report._report import Task

LABELS = np.repeat(np.arange(5), 4)


TASKS = [
    Task("shape", "person", "", "", LABELS, ()),
    Task("pose", "pose", "", "", LABELS, ()),
]


def test_best_weights_are_those_of_the_rows():
    key = "{}_mean_average_precision"
    rows = [
        {"lam": lam, "c": c, key.format("shape"): on_people, key.format("pose"): on_poses}
        for lam, c, on_people, on_poses in [(0, 0, 20, 50), (0, 1, 70, 50), (None, 1, 30, 40)]
    ]
    people, poses = sections.best_weights(rows, TASKS)
    assert (people["classes"], people["row"], people["n_ties"]) == ("people", rows[1], 0)
    assert (poses["value"], poses["row"], poses["n_ties"]) == (50, rows[0], 1)


@pytest.mark.slow
def test_people_have_their_measurements(report_page, nine_bodies):
    with (report_page.parent / "tables" / "measurements.csv").open(encoding="utf-8") as stream:
        rows = list(csv.DictReader(stream))
    assert [row["person"] for row in rows] == [nine_bodies.subject_names[k] for k in (0, 5, 8)]
    measurements = Measurements(nine_bodies.model, ["waist girth"])
    values = measurements.measure(nine_bodies.points[:2], pose="standard").values  # of two poses
    assert float(rows[0]["waist girth (m)"]) == pytest.approx(float(values.mean()), abs=1e-6)
