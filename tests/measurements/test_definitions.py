"""Definitions: what they refuse, and their way to JSON and back."""

import json

import pytest

from riemhuman.datasets import load_open_model
from riemhuman.errors import ArgumentError, ArgumentTypeError
from riemhuman.measurements import (
    Girth,
    Height,
    Length,
    Mass,
    measurement_from_dict,
    open_measurements,
)


def test_all_of_the_open_body_come_back_from_json():
    for measurement in open_measurements(load_open_model("coarse")).measurements:
        record = json.loads(json.dumps(measurement.to_dict()))
        assert measurement_from_dict(record) == measurement


@pytest.mark.parametrize(
    ("record", "message"),
    [
        (
            {"kind": "Girht", "name": "g", "at": "a"},
            "kind of measurement 'Girht'; did you mean 'Girth'",
        ),
        ({"kind": "Girth", "name": "g", "at": "a", "hul": True}, "did you mean 'hull'"),
        ({"kind": "Girth", "name": "g"}, "cannot be made"),
        ({"kind": "Girth", "name": "g", "at": "a", "normal": "north"}, "normal must be one of"),
    ],
)
def test_records_that_are_wrong(record, message):
    with pytest.raises(ArgumentError, match=message):
        measurement_from_dict(record)


def test_definitions_that_are_wrong():
    with pytest.raises(ArgumentTypeError, match="must be a mapping"):
        measurement_from_dict(["Girth"])
    with pytest.raises(ArgumentTypeError, match="name must be a non-empty string"):
        Height(name="", at="crown")
    with pytest.raises(ArgumentTypeError, match="parts must be a list of names"):
        Girth(name="g", at="a", parts="trunk")
    with pytest.raises(ArgumentError, match="needs hull=True"):
        Girth(name="g", at="a", leave_out=["left arm"])
    with pytest.raises(ArgumentError, match="two or more places"):
        Length(name="l", along="crown")
    with pytest.raises(ArgumentError, match="two names of joints"):
        Length(name="l", along=("a", "b", "c"), path="joints")
    with pytest.raises(ArgumentError, match="density"):
        Mass(name="m", density=-1.0)
