"""Units of length: the likely unit of a body, and whether two surfaces have the same unit."""

from __future__ import annotations

import numpy as np
from numpy import ndarray

from riemhuman.errors import ArgumentError

# Units in a metre.
UNITS = {"metres": 1.0, "centimetres": 100.0, "millimetres": 1000.0, "inches": 39.37}

SCALES = ("template", None)
"""Choices of a reference that surfaces must have about the same size as."""

TAKE_ANY_SCALE = "scale=None, on the command line --any-scale, takes them as they are"
"""Advice for users who mean surfaces of any size."""

# Largest extents of human bodies, from infants to men with their arms raised.
_BODY_METRES = (0.45, 2.8)
# An infant and a tall man with raised arms differ by less than this, and units by more, but for
# centimetres and inches, which differ by 2.54.
_LARGEST_RATIO = 8.0
# Two bodies in different units differ by the ratio of the units times that of the bodies.
_BODY_RATIO = 1.5
# Some vertices tell the size of a surface well enough.
_N_SAMPLES = 256


def likely_units(extent: float) -> list[str]:
    """Return the units in which this extent is the size of a human body."""
    low, high = _BODY_METRES
    return [name for name, size in UNITS.items() if low * size <= extent <= high * size]


def check_same_scale(
    points: ndarray,
    reference: ndarray,
    name: str,
    reference_name: str,
    *,
    error: type[Exception] = ArgumentError,
    remedy: str = TAKE_ANY_SCALE,
) -> None:
    """Raise an error if a surface, shape (..., V, 3), is over 8 times larger or smaller."""
    # Diagonals of the boxes around some of the vertices, found faster in rows than in columns.
    some = (f[..., :: max(1, f.shape[-2] // _N_SAMPLES), :] for f in (points, reference))
    rows = (np.ascontiguousarray(np.swapaxes(f, -1, -2)) for f in some)
    sizes, size = (np.linalg.norm(np.ptp(f, axis=-1), axis=-1) for f in rows)
    if size == 0:
        return
    ratios = sizes / size
    strange = (ratios > _LARGEST_RATIO) | ((ratios > 0) & (ratios < 1 / _LARGEST_RATIO))
    if not strange.any():
        return
    index = tuple(int(i) for i in np.argwhere(strange)[0]) if strange.ndim else ()
    ratio = float(ratios[index])
    place = f"{name}[{', '.join(map(str, index))}]" if index else name
    factor, kind = (ratio, "large") if ratio > 1 else (1 / ratio, "small")
    raise error(
        f"{place} is {factor:.3g} times as {kind} as {reference_name}{_unit_hint(ratio)}; bring "
        f"both to one unit; {remedy}"
    )


def _unit_hint(ratio: float) -> str:
    """Return a text that names the units of two surfaces whose sizes have this ratio, if likely."""
    pairs = {
        (unit, reference): UNITS[unit] / UNITS[reference]
        for unit in UNITS
        for reference in UNITS
        if unit != reference
    }
    distances = {pair: abs(np.log(ratio / expected)) for pair, expected in pairs.items()}
    (unit, reference), least = min(distances.items(), key=lambda item: item[1])
    if least > np.log(_BODY_RATIO):
        return ""
    return f", as if one were in {unit} and the other in {reference}"
