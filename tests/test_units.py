"""Units of length: recognised from sizes, and surfaces of different ones told apart."""

import numpy as np
import pytest

from riemhuman.datasets import load_open_bodies
from riemhuman.errors import ArgumentError, FileFormatError
from riemhuman.units import UNITS, body_units, refuse_other_scale


@pytest.mark.parametrize(
    ("extent", "units"),
    [
        (1.8, ["metres"]),
        (0.5, ["metres"]),
        (180.0, ["centimetres"]),
        (70.9, ["centimetres", "inches"]),
        (1800.0, ["millimetres"]),
        (0.02, []),
        (1e6, []),
    ],
)
def test_units_of_bodies(extent, units):
    assert body_units(extent) == units


def test_bodies_of_one_unit_pass():
    bodies = load_open_bodies("coarse")
    refuse_other_scale(bodies.points, bodies.template.vertices, "points", "template")
    for factor in (0.3, 1.9):  # a child, and a giant with raised arms
        refuse_other_scale(factor * bodies[0], bodies.template.vertices, "points", "template")
    refuse_other_scale(0.0 * bodies[0], bodies.template.vertices, "points", "template")


@pytest.mark.parametrize("unit", [unit for unit in UNITS if unit != "metres"])
@pytest.mark.parametrize("person", range(0, 100, 10))
def test_other_units_are_named(unit, person):
    bodies = load_open_bodies("coarse")
    points, reference = UNITS[unit] * bodies.points[person : person + 10], bodies.points[55]
    with pytest.raises(ArgumentError, match=rf"f\[0\] is .* large as T, as if one were in {unit}"):
        refuse_other_scale(points, reference, "f", "T")
    with pytest.raises(ArgumentError, match="as small as T, as if one were in metres"):
        refuse_other_scale(reference, points[0], "f", "T")


def test_sizes_of_no_unit_are_refused_without_one():
    surface = np.random.default_rng(0).normal(size=(30, 3))
    with pytest.raises(FileFormatError, match="f is 300 times as large as T; bring both"):
        refuse_other_scale(300 * surface, surface, "f", "T", error=FileFormatError)
