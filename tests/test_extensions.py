"""Metrics, descriptors and readers of other packages: known without a touch to the library."""

import json

import numpy as np
import pytest
from third_party import Extents, VertexOffsets, read_crowd

from riemhuman import extensions
from riemhuman.cli import main
from riemhuman.datasets import load_open_bodies
from riemhuman.descriptors.descriptor import Descriptor
from riemhuman.errors import ArgumentError, ArgumentTypeError
from riemhuman.io import save_mesh
from riemhuman.measurements import Measurements, measurement_from_dict, open_measurements
from riemhuman.retrieval import benchmark, representations
from riemhuman.testing import check_dataset, check_metric

ENTRIES = """
[riemhuman.metrics]
offsets = third_party:VertexOffsets

[riemhuman.descriptors]
extents = third_party:Extents

[riemhuman.readers]
crowd = third_party:read_crowd

[riemhuman.measurements]
area of the head = third_party:area_of_the_head
"""


@pytest.fixture
def installed(tmp_path_factory, monkeypatch):
    """Install what names the module in entry points, and return the folder of the installation."""
    site = tmp_path_factory.mktemp("site-packages")
    folder = site / "third_party-1.0.dist-info"
    folder.mkdir()
    (folder / "METADATA").write_text("Metadata-Version: 2.1\nName: third-party\nVersion: 1.0\n")
    (folder / "entry_points.txt").write_text(ENTRIES)
    monkeypatch.syspath_prepend(str(site))
    return folder


@pytest.mark.slow
def test_tables_know_a_metric_of_another_package(installed, capsys):
    assert main(["tables", "--reader", "crowd", "20", "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    # The crowd has no poses to ask for.
    assert list(found) == ["Who is it?"]
    assert list(found["Who is it?"])[-1] == "offsets"
    assert main(["tables", "--reader", "crowd", "20"]) == 0
    assert "20 bodies: 2 people, unknown poses" in capsys.readouterr().out


def test_measurements_of_another_package_are_taken_with_the_others(installed):
    bodies = load_open_bodies("coarse")
    measured = Measurements(bodies.model).measure(bodies.points[:2])
    assert measured.names[-1] == "area of the head"
    assert np.all((measured["area of the head"] > 0.08) & (measured["area of the head"] < 0.25))
    # Where one says what to measure, that is measured.
    assert Measurements(bodies.model, ["stature"]).names == ("stature",)
    assert Measurements(open_measurements(bodies.model)).names == measured.names[:-1]


def test_kinds_of_measurements_of_another_package_are_found(installed):
    """As in a file of definitions, before anything of the package was imported."""
    module = "from riemhuman.measurements import Area\n\n\nclass Wing(Area):\n    kind = 'wing'\n"
    (installed.parent / "wings.py").write_text(module)
    (installed / "entry_points.txt").write_text("[riemhuman.measurements]\nwing = wings:Wing\n")
    record = {"kind": "wing", "name": "left wing", "parts": ["left arm"]}
    assert measurement_from_dict(record).to_dict() == record


def test_tables_of_all_know_a_descriptor_of_another_package(installed):
    names = list(representations(load_open_bodies("coarse")))
    assert names[-2:] == ["offsets", "extents"]
    assert list(representations([]))[-1] == "extents"
    assert "offsets" not in representations([])


def test_commands_take_a_metric_of_another_package(installed, tmp_path, capsys):
    bodies = load_open_bodies("coarse")
    paths = [str(tmp_path / f"{k}.ply") for k in range(2)]
    for path, points in zip(paths, bodies.points, strict=False):
        save_mesh(path, points, bodies.template.faces)
    assert main(["dist", *paths, "--metric", "offsets", "--json"]) == 0
    record = json.loads(capsys.readouterr().out)
    assert record["metric"] == {"name": "VertexOffsets"}
    assert main(["dist", *paths, "--metric", "unknown"]) == 2
    assert (
        "'unknown' is not among the metrics that packages register: 'offsets'"
        in capsys.readouterr().err
    )
    assert main(["dist", *paths, "--metric", "offsets", "-a", "1"]) == 2
    assert "--metric offsets sets all weights" in capsys.readouterr().err
    assert main(["tables", "--reader", "nobody", "20"]) == 2
    assert (
        "'nobody' is not among the readers that packages register: 'crowd'"
        in capsys.readouterr().err
    )


def test_what_cannot_be_loaded_is_named(installed):
    (installed / "entry_points.txt").write_text("[riemhuman.metrics]\nlost = nowhere:Metric\n")
    with pytest.raises(ArgumentError, match="'lost', nowhere:Metric, which cannot be loaded: Mod"):
        extensions.extensions("metrics")


def test_registration_in_a_script(monkeypatch):
    monkeypatch.setattr(extensions, "_REGISTERED", {kind: {} for kind in extensions.KINDS})
    assert extensions.extensions("descriptors") == {}
    extensions.register("descriptors", "extents", Extents)
    extents = representations([])["extents"]
    assert extents.describe([[0, 0, 0], [1, 2, 3]], None).tolist() == [1, 2, 3]
    extensions.register("descriptors", "extents", Extents)
    with pytest.raises(ArgumentError, match="'extents' is taken"):
        extensions.register("descriptors", "extents", VertexOffsets)


def test_bad_registrations():
    with pytest.raises(ArgumentError, match="kind must be one of 'metrics', 'descriptors'"):
        extensions.register("solvers", "any", Extents)
    with pytest.raises(ArgumentTypeError, match="factory must be called with an `AlignedSurfaces`"):
        extensions.register("metrics", "any", 3)


def test_a_descriptor_and_a_data_set_by_their_methods_alone():
    crowd = read_crowd(20)
    assert not isinstance(Extents(), Descriptor)
    assert check_dataset(crowd).passed
    (record,) = benchmark(crowd, {"extents": Extents()})
    assert record.scores.nn > 0
    space_of = load_open_bodies("coarse")[:4]
    space = representations(space_of)["SRNF"].space
    report = check_metric(VertexOffsets(space), space_of.points)
    assert report.passed, report
