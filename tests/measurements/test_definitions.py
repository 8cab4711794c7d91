"""Definitions: what they refuse, and their way to JSON and back."""

import json
from dataclasses import dataclass

import pytest
from build_measurement_page import PAGE, page

from riemhuman.datasets import load_open_model
from riemhuman.errors import ArgumentError, ArgumentTypeError, FileFormatError
from riemhuman.measurements import (
    Girth,
    Height,
    Length,
    Measurement,
    Measurements,
    MeasurementSet,
    measurement_from_dict,
    open_measurements,
)


def test_all_of_the_open_body_come_back_from_json():
    for measurement in open_measurements("coarse").measurements:
        record = json.loads(json.dumps(measurement.to_dict()))
        assert measurement_from_dict(record) == measurement


@pytest.mark.everyday
@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: measurement_from_dict({"kind": "Girht", "name": "g"}), "did you mean 'Girth'"),
        (lambda: measurement_from_dict({"kind": "Girth", "name": "g", "hul": 1}), "mean 'hull'"),
        (lambda: measurement_from_dict({"kind": "Girth", "name": "g"}), "cannot be made"),
        (lambda: measurement_from_dict(["Girth"]), "must be a mapping"),
        (lambda: Height(name="", at="crown"), "name must be a non-empty string"),
        (lambda: Girth(name="g", at="a", parts="trunk"), "parts must be a list of names"),
        (lambda: Girth(name="g", at="a", leave_out=["left arm"]), "needs hull=True"),
        (lambda: Length(name="l", along=("a", "b", "c"), path="joints"), "two names of joints"),
        (lambda: Length(name="l", along=("a", "b"), axis=["c"]), "two or three places"),
    ],
)
def test_wrong_definitions(make, message):
    with pytest.raises((ArgumentError, ArgumentTypeError), match=message):
        make()


@dataclass(frozen=True, kw_only=True)
class Distance(Measurement):
    """A user's measurement, whose fields name landmarks and parts."""

    kind = "distance of landmarks"

    ends: tuple[str, ...]
    part: str = "trunk"

    def __post_init__(self):
        super().__post_init__()
        object.__setattr__(self, "ends", tuple(self.ends))

    @property
    def places(self):
        return self.ends

    @property
    def part_names(self):
        return (self.part,)

    def value(self, bodies):
        start, end = map(bodies.place, self.ends)
        return ((end - start) ** 2).sum(axis=-1) ** 0.5


def test_a_measurement_of_a_users_class_comes_back_from_its_file(tmp_path):
    model = load_open_model("coarse")
    distance = Distance(name="spread", ends=["left_ankle", "right_ankle"], note="between ankles")
    measurements = open_measurements(model).with_measurements(["stature", distance])
    measurements.save(tmp_path / "set.json")
    loaded = MeasurementSet.load(tmp_path / "set.json", model)
    assert loaded.measurements[1] == distance
    before, after = (
        Measurements(definitions).measure(model.template.vertices[None]).values
        for definitions in (measurements, loaded)
    )
    assert before.tolist() == after.tolist()


def test_what_a_users_measurement_refers_to_must_exist():
    open_set = open_measurements("coarse")
    for wrong, message in (
        ({"ends": ["left_ankl", "right_ankle"]}, "no landmark for 'spread'.*mean 'left_ankle'"),
        ({"ends": ["left_ankle", "right_ankle"], "part": "trnk"}, "no part for.*mean 'trunk'"),
    ):
        with pytest.raises(ArgumentError, match=message):
            open_set.with_measurements([Distance(name="spread", **wrong)])


def test_a_file_with_a_class_that_is_not_imported_says_so(tmp_path):
    model, path = load_open_model("coarse"), tmp_path / "set.json"
    distance = Distance(name="spread", ends=["left_ankle", "right_ankle"])
    open_measurements(model).with_measurements([distance]).save(path)
    path.write_text(path.read_text(encoding="utf-8").replace(Distance.kind, "span"), "utf-8")
    with pytest.raises(FileFormatError, match="kind of measurement 'span'.*import a class"):
        MeasurementSet.load(path, model)


def test_kinds_of_measurements_are_not_mixed_up():
    with pytest.raises(ArgumentError, match=r"kind 'Girth'; declare another `kind` in the class G"):
        type("Girth", (Girth,), {"__module__": "first"})
    again = type("Ambiguous", (Height,), {"__module__": "first"})
    again = type("Ambiguous", (Height,), {"__module__": "first"})
    record = again(name="h", at="crown").to_dict()
    assert type(measurement_from_dict(record)) is again
    type("Ambiguous", (Height,), {"__module__": "second"})
    with pytest.raises(ArgumentError, match="modules first and second both define"):
        measurement_from_dict(record)


def test_the_page_lists_the_definitions():
    """`python tutorials/remake/build_measurement_page.py` writes it."""
    assert PAGE.read_text(encoding="utf-8") == page()
