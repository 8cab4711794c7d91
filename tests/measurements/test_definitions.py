"""Definitions: what they refuse, and their way to JSON and back."""

import json

import pytest
from build_measurement_page import PAGE, page

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
    for measurement in open_measurements("coarse").measurements:
        record = json.loads(json.dumps(measurement.to_dict()))
        assert measurement_from_dict(record) == measurement


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: measurement_from_dict({"kind": "Girht", "name": "g"}), "did you mean 'Girth'"),
        (lambda: measurement_from_dict({"kind": "Girth", "name": "g", "hul": 1}), "mean 'hull'"),
        (lambda: measurement_from_dict({"kind": "Girth", "name": "g"}), "cannot be made"),
        (lambda: measurement_from_dict(["Girth"]), "must be a mapping"),
        (lambda: Girth(name="g", at="a", normal="north"), "normal must be one of"),
        (lambda: Height(name="", at="crown"), "name must be a non-empty string"),
        (lambda: Girth(name="g", at="a", parts="trunk"), "parts must be a list of names"),
        (lambda: Girth(name="g", at="a", leave_out=["left arm"]), "needs hull=True"),
        (lambda: Length(name="l", along="crown"), "two or more places"),
        (lambda: Length(name="l", along=("a", "b", "c"), path="joints"), "two names of joints"),
        (lambda: Length(name="l", along=("a", "b"), axis=["c"]), "two or three places"),
        (lambda: Mass(name="m", density=-1.0), "density"),
    ],
)
def test_wrong_definitions(make, message):
    with pytest.raises((ArgumentError, ArgumentTypeError), match=message):
        make()


def test_the_page_lists_the_definitions():
    """`python tutorials/remake/build_measurement_page.py` writes it."""
    assert PAGE.read_text(encoding="utf-8") == page()
