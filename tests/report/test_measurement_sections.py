"""The section on measurements shows what the library measures."""

import csv
from types import SimpleNamespace

import numpy as np
import pytest

from riemhuman.measurements import Measurements
from riemhuman.plots.body_plots import plot_measurement_lines
from riemhuman.report._body_sections import measurement_section
from riemhuman.surfaces.template import Template


def test_people_have_their_measurements(report_page, nine_bodies):
    with (report_page.parent / "tables" / "measurements.csv").open(encoding="utf-8") as stream:
        rows = list(csv.DictReader(stream))
    assert [row["person"] for row in rows] == [nine_bodies.subject_names[k] for k in (0, 5, 8)]
    own = Measurements(nine_bodies.model, ["waist girth"])
    values = own.measure(nine_bodies.points[:3], pose="standard").values
    assert float(rows[0]["waist girth"]) == pytest.approx(float(values.mean()), abs=1e-6)
    assert "Girths, lengths and volumes" in report_page.read_text(encoding="utf-8")


def test_other_templates_have_no_section():
    vertices = np.random.default_rng(0).normal(size=(4, 3))
    template = Template(vertices, [[0, 1, 2], [0, 2, 3]])
    bodies = SimpleNamespace(template=template)
    materials = SimpleNamespace(bodies=bodies, output=None)
    assert measurement_section(materials) is None


def test_every_tape_is_drawn_on_every_side(nine_bodies):
    pytest.importorskip("matplotlib")
    tapes = Measurements(nine_bodies.model).lines(nine_bodies.points[0])
    figure = plot_measurement_lines(
        nine_bodies.points[0], nine_bodies.template.faces, tapes, height=60
    )
    n_curves = sum(map(len, tapes.values()))
    assert [len(axes.lines) for axes in figure.axes] == [n_curves] * 3
    listed = [text.get_text() for text in figure.legends[0].get_texts()]
    assert listed == [name for name, curves in tapes.items() if curves]
