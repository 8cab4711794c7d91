"""Units of lengths in recordings, which most files do not state."""

from __future__ import annotations

from riemhuman.checks import real_number
from riemhuman.errors import ArgumentError, shown

# Metres in a unit, and its spellings.
_UNITS = {
    "metres": (1.0, ("m", "meter", "meters", "metre", "metres")),
    "decimetres": (0.1, ("dm", "decimeter", "decimeters", "decimetre", "decimetres")),
    "centimetres": (0.01, ("cm", "centimeter", "centimeters", "centimetre", "centimetres")),
    "millimetres": (0.001, ("mm", "millimeter", "millimeters", "millimetre", "millimetres")),
    "inches": (0.0254, ("in", "inch", "inches")),
    "feet": (0.3048, ("ft", "foot", "feet")),
    "yards": (0.9144, ("yd", "yard", "yards")),
}
_SPELLINGS = {spelling: name for name, (_, some) in _UNITS.items() for spelling in some}


def metres_in(unit: str | float) -> float:
    """Return the metres in a unit, which is a name or a number."""
    if isinstance(unit, str):
        name = _SPELLINGS.get(unit.strip().lower())
        if name is None:
            names = ", ".join(map(repr, _UNITS))
            raise ArgumentError(
                f"unit must be one of {names}, or the metres in one; found {shown(unit)}"
            )
        return _UNITS[name][0]
    return real_number(unit, "unit", minimum=0.0, strict=True)
