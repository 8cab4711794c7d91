"""Sets of measurements: files, and the way to other templates."""

import json

import numpy as np
import pytest
from open_bodies import coarse_bodies, model_with

import riemhuman as rh
from riemhuman.errors import ArgumentError, ArgumentTypeError, FileFormatError
from riemhuman.measurements import (
    Girth,
    Height,
    Length,
    Measurements,
    MeasurementSet,
    open_measurements,
)
from riemhuman.measurements.measurement_set import DATA


@pytest.fixture(scope="module")
def coarse():
    return open_measurements("coarse")


def test_files_come_back(coarse, tmp_path):
    coarse.save(tmp_path / "set.json")
    read = MeasurementSet.load(tmp_path / "set.json", coarse.template)
    assert read.measurements == coarse.measurements
    assert read.landmarks.keys() == coarse.landmarks.keys()
    point = coarse_bodies().points[0]
    expected = Measurements(coarse).measure(point).values
    np.testing.assert_array_equal(Measurements(read).measure(point).values, expected)
    by_path = Measurements(coarse.template, tmp_path / "set.json")
    assert by_path.names == coarse.names


def test_files_that_are_wrong(coarse, tmp_path):
    file = tmp_path / "set.json"
    coarse.save(file)
    text = file.read_text(encoding="utf-8")
    record = json.loads(text)
    first = record["measurements"][:1]
    for wrong, message in (
        (
            json.dumps({k: v for k, v in record.items() if k != "landmarks"}),
            "definitions of measurements: 'landmarks'",
        ),
        (json.dumps(record | {"n_vertices": 7}), "it is for 7 vertices"),
        (json.dumps(record | {"frame": ["pelvis"]}), "frame must name four"),
        (json.dumps(record | {"axes": [[0, 0, 0]] * 3}), "axes must be orthonormal"),
        (json.dumps(record | {"parts": {"trunk": [[0, 10**12]]}}), "has triangle 1000000000000"),
        (json.dumps(record | {"measurements": first + first}), "two measurements"),
        (text[:50], "damaged, or not definitions of measurements"),
    ):
        file.write_text(wrong, encoding="utf-8")
        with pytest.raises(FileFormatError, match=message):
            MeasurementSet.load(file, coarse.template)


def test_seated_measurements(coarse):
    """A person's trunk and thighs, measured on the same person brought to a chair."""
    seated = open_measurements("coarse", pose="seated")
    assert seated.parts.keys() == coarse.parts.keys()
    bodies = coarse_bodies().select(subject=0)
    measured = Measurements(seated).measure(bodies.points[:3], pose="standard")
    assert measured.values.std(axis=0).max() < 0.006
    stature = Measurements(coarse, ["stature"]).measure(bodies.points[:3], pose="standard")
    shares = measured["sitting height"] / stature["stature"]
    assert ((shares > 0.48) & (shares < 0.56)).all()
    assert (measured["elbow rest height"] < 0.35).all()


def test_mapped_to_shuffled_vertices_changes_nothing(coarse):
    rng = np.random.default_rng(0)
    model = coarse.template
    order = rng.permutation(model.n_vertices)
    place = np.argsort(order)
    shuffled = model_with(
        model,
        v_template=model.template.vertices[order],
        faces=place[model.faces],
        shapedirs=model.shapedirs[order],
        joint_regressor=model.joint_regressor[:, order],
        weights=model.weights[order],
        hand_directions=model.hand_directions[order],
    )
    mapped = coarse.mapped(shuffled, place)
    points = model(rng.normal(size=(2, 32)))
    expected = Measurements(coarse).measure(points).values
    found = Measurements(mapped).measure(points[:, order]).values
    np.testing.assert_allclose(found, expected, rtol=1e-9)


def test_wrong_arguments(coarse):
    for wrong, message in (
        ([Height(name="h", at={})], "do not sum to zero"),
        ([Height(name="h", at={"crown": 1.0, "cervicale": -1.0})], "do not sum to zero"),
        ([Height(name="h", at={"crown": np.nan})], "must be numbers that do not sum to zero"),
        ([3], "found int"),
        ([], "at least one measurement"),
    ):
        with pytest.raises((ArgumentError, ArgumentTypeError), match=message):
            Measurements(coarse.with_measurements(wrong))
    with pytest.raises(ArgumentError, match="did you mean 'trunk'"):
        coarse.with_measurements([Girth(name="g", at="crown", parts=["trunc"])])
    with pytest.raises(ArgumentError, match="landmark"):
        MeasurementSet(coarse.template, [], {"far": ([10**6], [1.0])})
    with pytest.raises(ArgumentError, match="weights with sum 2"):
        MeasurementSet(coarse.template, [], {"two": ([0], [2.0])})
    with pytest.raises(ArgumentError, match="must say where 1202 vertices lie"):
        coarse.mapped(coarse.template, np.arange(5))
    surface = coarse.template.template
    ends = {"a": ([0], [1.0]), "b": ([1], [1.0])}
    with pytest.raises(ArgumentError, match="need a body model"):
        MeasurementSet(surface, [Length(name="l", along=("a", "b"), path="joints")], ends)
    measurements = MeasurementSet(surface, [Height(name="h", at="top")], {"top": ([0], [1.0])})
    with pytest.raises(ArgumentError, match="fit removes the pose"):
        Measurements(measurements).measure(surface.vertices, pose="standard")


@pytest.mark.parametrize("resolution", ["coarse", "full"])
def test_open_definitions_are_stored_as_they_are_saved(resolution, tmp_path):
    stored = DATA / f"open_body_{resolution}.json"
    model = rh.datasets.load_open_model(resolution)
    MeasurementSet.load(stored, model).save(tmp_path / "again.json")
    assert (tmp_path / "again.json").read_bytes() == stored.read_bytes()
