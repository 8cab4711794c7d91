"""Units that people read, beside the SI units of files and of Python."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass


@dataclass(frozen=True)
class ReadableUnit:
    """A unit for people: its name, how many of it make an SI unit, and the digits to show."""

    name: str
    scale: float
    digits: int


_INCHES = 1 / 0.0254  # in a metre, exactly
_POUNDS = 1 / 0.45359237  # in a kilogram, exactly

READABLE_UNITS: Mapping[str, Mapping[str, ReadableUnit]] = {
    "cm": {
        "m": ReadableUnit("cm", 100.0, 2),
        "m²": ReadableUnit("cm²", 1e4, 0),
        "m³": ReadableUnit("L", 1000.0, 3),
        "kg": ReadableUnit("kg", 1.0, 2),
    },
    "in": {
        "m": ReadableUnit("in", _INCHES, 2),
        "m²": ReadableUnit("in²", _INCHES**2, 0),
        "m³": ReadableUnit("in³", _INCHES**3, 1),
        "kg": ReadableUnit("lb", _POUNDS, 2),
    },
}
"""Systems of units that people read, by the SI unit that each of theirs replaces."""


def readable_unit(unit: str, system: str) -> ReadableUnit:
    """Return the unit in which people read a value; one that is not known stays as it is."""
    return READABLE_UNITS[system].get(unit, ReadableUnit(unit, 1.0, 4))


def readable_value(value: float, unit: ReadableUnit, width: int, sign: str = "") -> str:
    """Return a value in SI units as text in a unit for people."""
    return f"{value * unit.scale:{sign}{width}.{unit.digits}f}"
