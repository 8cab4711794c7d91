"""Units for readers of measurements; arrays, files and JSON keep SI units."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from riemhuman.checks import checked, choice, instance, positive, whole

_SYSTEMS = ("cm", "in")


@checked(name=instance(str), scale=positive, digits=whole(minimum=0))
@dataclass(frozen=True)
class ReadableUnit:
    """A unit for people.

    Parameters
    ----------
    name : str
    scale : float
        Number of these units in one SI unit.
    digits : int
        Digits to show after the decimal point.

    Examples
    --------
    >>> rh.measurements.readable_unit("m").text(1.72)
    '172.00'
    """

    name: str
    scale: float
    digits: int

    def text(self, value: float, width: int = 0, sign: str = "") -> str:
        """Return a value in SI units as text in this unit.

        Parameters
        ----------
        value : float
            A number, or NaN for a missing value.
        width : int
            Minimum number of characters.
        sign : {"", "+"}
            Whether positive values have a sign, too.
        """
        # "z": what is rounded to zero has no minus.
        return f"{self.scale * value:{sign}z{width or ''}.{self.digits}f}"


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


# For gaps between surfaces, which are small.
_GAP_UNITS: Mapping[str, ReadableUnit] = {
    "cm": ReadableUnit("mm", 1000.0, 1),
    "in": ReadableUnit("in", _INCHES, 3),
}


@checked(unit=instance(str), system=choice(*_SYSTEMS))
def readable_unit(unit: str, system: str = "cm") -> ReadableUnit:
    """Return the unit in which people read a value; unknown units are returned unchanged.

    Parameters
    ----------
    unit : str
        SI unit: "m", "m²", "m³" or "kg".
    system : {"cm", "in"}
        Centimetres, litres and kilograms, or inches and pounds.

    Examples
    --------
    >>> rh.measurements.readable_unit("m³").name
    'L'
    """
    return READABLE_UNITS[system].get(unit, ReadableUnit(unit, 1.0, 4))


def readable_gap(metres: float, system: str = "cm") -> str:
    """Return a small distance, such as that of a scan from its body, with its unit.

    Parameters
    ----------
    metres : float
    system : {"cm", "in"}
        Millimetres, or inches.

    Examples
    --------
    >>> rh.measurements.readable_gap(0.0024), rh.measurements.readable_gap(0.0024, "in")
    ('2.4 mm', '0.094 in')
    """
    unit = gap_unit(system)
    return f"{unit.text(metres)} {unit.name}"


@checked(system=choice(*_SYSTEMS))
def gap_unit(system: str) -> ReadableUnit:
    """Return the unit of `readable_gap`."""
    return _GAP_UNITS[system]
