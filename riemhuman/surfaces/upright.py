"""Conversion of surfaces to metres with y up."""

from __future__ import annotations

import numpy as np
from numpy import ndarray

from riemhuman.checks import one_of
from riemhuman.units import UNITS

# Rotations to y up by the axis that points up, about the third axis.
_ROTATIONS = {
    "x": [[0, -1, 0], [1, 0, 0], [0, 0, 1]],
    "y": [[1, 0, 0], [0, 1, 0], [0, 0, 1]],
    "z": [[1, 0, 0], [0, 0, 1], [0, -1, 0]],
    "-x": [[0, 1, 0], [-1, 0, 0], [0, 0, 1]],
    "-y": [[-1, 0, 0], [0, -1, 0], [0, 0, 1]],
    "-z": [[1, 0, 0], [0, 0, -1], [0, 1, 0]],
}
AXES = tuple(_ROTATIONS)
"""Names of the axes that may point up."""


def upright(points: ndarray, unit: str | None = None, up: str | None = None) -> ndarray:
    """Return surfaces in metres, rotated so that y points up.

    Parameters
    ----------
    points : array, shape (..., 3)
        Surfaces.
    unit : {"metres", "centimetres", "millimetres", "inches"}, optional
        Unit of the coordinates; by default surfaces are not scaled.
    up : {"x", "y", "z", "-x", "-y", "-z"}, optional
        Axis that points up; by default surfaces are not rotated.

    Returns
    -------
    array, shape (..., 3)

    Raises
    ------
    ArgumentError
        If there is no such unit or axis.
    """
    one_of(unit, "unit", (None, *UNITS))
    one_of(up, "up", (None, *AXES))
    if unit is not None:
        points = points / UNITS[unit]
    return points if up is None else points @ np.array(_ROTATIONS[up], dtype=float).T
