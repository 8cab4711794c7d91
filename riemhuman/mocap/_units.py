"""Units of lengths in recordings, which most files do not state."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

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
# Units that are tried without being asked for; CMU's is 1 / 0.45 of an inch.
_USUAL = ("metres", "centimetres", "millimetres", "inches", "feet")
_CMU_UNIT = 0.0254 / 0.45
_CMU_JOINTS = {"LHipJoint", "RHipJoint", "LowerBack", "lhipjoint", "rhipjoint", "lowerback"}
# Legs of adults from hip to ankle, metres.
_ADULT_LEG = 0.82


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


def guessed_unit(leg: float, joint_names: Sequence[str]) -> tuple[str, float]:
    """Return the unit in which legs are most like those of adults, and the metres in it."""
    units = {name: _UNITS[name][0] for name in _USUAL}
    if len(_CMU_JOINTS & set(joint_names)) >= 3:
        units["units of CMU (1/0.45 inch)"] = _CMU_UNIT
    name = min(units, key=lambda candidate: abs(np.log(units[candidate] * leg / _ADULT_LEG)))
    return name, units[name]
