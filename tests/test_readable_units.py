"""Units in which people read measurements."""

import pytest

from riemhuman.errors import ArgumentError
from riemhuman.readable_units import gap_unit, readable_gap, readable_unit


@pytest.mark.parametrize(
    ("value", "unit", "system", "text"),
    [
        (1.72, "m", "cm", "172.00 cm"),
        (1.72, "m", "in", "67.72 in"),
        (1.9, "m²", "cm", "19000 cm²"),
        (1.0, "m²", "in", "1550 in²"),
        (0.0705, "m³", "cm", "70.500 L"),
        (0.001, "m³", "in", "61.0 in³"),
        (80.0, "kg", "cm", "80.00 kg"),
        (80.0, "kg", "in", "176.37 lb"),
        (0.5, "rad", "in", "0.5000 rad"),
    ],
)
def test_values_in_the_units_of_people(value, unit, system, text):
    readable = readable_unit(unit, system)
    assert f"{readable.text(value)} {readable.name}" == text


def test_text_may_have_a_width_and_a_sign():
    assert readable_unit("m").text(0.012, 8, "+") == "   +1.20"
    assert readable_unit("m").text(-0.012, sign="+") == "-1.20"


def test_what_is_rounded_to_zero_has_no_minus():
    assert readable_gap(-1e-17) == "0.0 mm"
    assert readable_unit("kg").text(-1e-9, 6, "+") == " +0.00"


def test_gaps_are_small():
    assert (readable_gap(0.0024), readable_gap(0.0254, "in")) == ("2.4 mm", "1.000 in")
    assert gap_unit("cm").name == "mm"
    for function in (lambda: gap_unit("mm"), lambda: readable_unit("m", "SI")):
        with pytest.raises(ArgumentError, match="system must be one of"):
            function()
