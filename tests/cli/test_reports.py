"""The verb report hands over what it is asked for, and makes a page."""

import json

import h5py
import numpy as np
import pytest
from third_party import Extents, VertexOffsets

from riemhuman import extensions
from riemhuman.datasets import load_open_bodies
from riemhuman.surfaces import DeformationBasis


@pytest.fixture
def extended():
    """Register a metric and a descriptor of another package."""
    added = (("metrics", "offsets", VertexOffsets), ("descriptors", "extents", Extents))
    for one in added:
        extensions.register(*one)
    yield
    for kind, name, _ in added:
        extensions.unregister(kind, name)


@pytest.mark.sampled(3, "reports without figures")
@pytest.mark.slow
def test_page_of_a_labelled_folder(extended, undrawn, run, scans, tmp_path):
    finished = run("report", "--quick", "--bodies", scans, "-o", tmp_path / "report")
    assert finished.code == 0, finished.err
    page = tmp_path / "report" / "index.html"
    assert finished.out == f"{page}\n"
    text = page.read_text(encoding="utf-8")
    assert "<html" in text.lower()
    assert "offsets" in text
    assert "extents" in text
    provenance = json.loads((page.parent / "provenance.json").read_text(encoding="utf-8"))
    assert provenance["status"] == "finished"
    assert "Karcher mean" in finished.err


def test_options_reach_the_report(run, scans, bodies, tmp_path, monkeypatch):
    asked = {}

    def make_report(output, **settings):
        asked.update(settings, output=output)
        return output / "index.html"

    monkeypatch.setattr("riemhuman.report.make_report", make_report)
    monkeypatch.setattr("riemhuman.cli.reports._N_COMPONENTS", 3)
    with h5py.File(tmp_path / "registrations_m.hdf5", "w") as file:
        file["faces"] = bodies.template.faces
        file["50002_hips"] = np.moveaxis(bodies.points[:50], 0, -1)
    labels = scans / "labels.csv"
    arguments = ("--bodies", scans, "--labels", labels, "--dfaust", tmp_path, "-o", tmp_path)
    assert run("report", *arguments).out == f"{tmp_path / 'index.html'}\n"
    assert asked["bodies"].subject.tolist() == [1, 1, 1, 0, 0, 0]
    assert asked["bodies"].subject_names == ("athletic woman", "tall slim woman")
    expected = DeformationBasis.from_motions([bodies.points[:50]], 3)
    np.testing.assert_array_equal(asked["basis"].vectors, expected.vectors)
    assert asked["quick"] is False
    assert asked["scans"] is None
    run("report", "--quick", "--open", "natural", "--people", 4, "--scans", tmp_path)
    assert asked["scans"] == tmp_path
    expected = load_open_bodies("coarse", "natural", people=4)
    np.testing.assert_array_equal(asked["bodies"].points, expected.points)
    assert (asked["basis"], asked["quick"]) == (None, True)
    assert str(asked["output"]) == "riemhuman-report"


def test_failures(refused, scans, tmp_path):
    assert "--labels needs --bodies" in refused("report", "--labels", "labels.csv")
    assert "--people SEED is for" in refused("report", "--bodies", scans, "--people", 1)
    assert "people" in refused("report", "--people", -1, "-o", tmp_path / "r")
    assert "no folder" in refused("report", "--faust", tmp_path / "absent", "-o", tmp_path / "r")
    message = refused("report", "--bodies", scans, "--labels", "absent.csv", "-o", tmp_path / "r")
    assert "no table of labels absent.csv" in message
    assert "neither" in refused("report", "--dfaust", tmp_path, "-o", tmp_path / "r")
    assert "other files" in refused("report", "--bodies", scans, "-o", scans)
    assert list(tmp_path.iterdir()) == []
