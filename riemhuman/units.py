"""Units of length: in which unit a body has its size, and whether two surfaces share one."""

from __future__ import annotations

import numpy as np
from numpy import ndarray

from riemhuman.errors import ArgumentError

# How many of each make a metre.
UNITS = {"metres": 1.0, "centimetres": 100.0, "millimetres": 1000.0, "inches": 39.37}

SCALES = ("template", None)
"""What surfaces must be of the size of: the template, or nothing."""

TAKE_ANY_SCALE = "scale=None, on the command line --any-scale, takes them as they are"
"""What to do where surfaces of any size are meant."""

# Largest extents of human bodies, from infants to men with their arms raised.
_BODY_METRES = (0.45, 2.8)
# An infant and a tall man with raised arms differ by less than this, and units by more, but for
# centimetres and inches, which differ by 2.54.
_LARGEST_RATIO = 8.0
# Two bodies in different units differ by the ratio of the units times that of the bodies.
_BODY_RATIO = 1.5
# Some vertices tell the size of a surface well enough.
_N_SAMPLES = 256


def body_units(extent: float) -> list[str]:
    """Return the units in which this extent is the size of a human body.

    Parameters
    ----------
    extent : float
        Largest extent along an axis.

    Returns
    -------
    list of str
        Names out of `UNITS`; empty where it is no body in any of them.
    """
    low, high = _BODY_METRES
    return [name for name, size in UNITS.items() if low * size <= extent <= high * size]


def refuse_other_scale(
    points: ndarray,
    reference: ndarray,
    name: str,
    reference_name: str,
    *,
    error: type[Exception] = ArgumentError,
    remedy: str = TAKE_ANY_SCALE,
) -> None:
    """Refuse surfaces more than eight times as large or as small as a reference.

    Parameters
    ----------
    points : array, shape (..., V, 3)
        Surfaces; those without any extent pass.
    reference : array, shape (V, 3)
        A surface with the same vertices in the same order.
    name, reference_name : str
        What to call them in the message.
    error : type
        Class of the error.
    remedy : str
        What to do where both sizes are meant.

    Raises
    ------
    ArgumentError
        Or the class given, naming the first surface, the ratio and the units it may come from.
    """
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
        f"{place} is {factor:.3g} times as {kind} as {reference_name}{_likely_units(ratio)}; bring "
        f"both to one unit; {remedy}"
    )


def _likely_units(ratio: float) -> str:
    """Return what units two surfaces may be in that differ by a ratio, or nothing."""
    pairs = {
        (one, other): UNITS[one] / UNITS[other] for one in UNITS for other in UNITS if one != other
    }
    distance = {pair: abs(np.log(ratio / expected)) for pair, expected in pairs.items()}
    (one, other), least = min(distance.items(), key=lambda item: item[1])
    if least > np.log(_BODY_RATIO):
        return ""
    return f", as if one were in {one} and the other in {other}"
