"""Checks of sizes: bodies in one unit of length, of human size, with digits enough."""

from __future__ import annotations

import itertools
import math

import numpy as np

from riemhuman.arrays import Array, DType
from riemhuman.checks.arrays import values_of
from riemhuman.errors import ArgumentError, PrecisionWarning, warn

# Units in a metre.
UNITS = {"metres": 1.0, "centimetres": 100.0, "millimetres": 1000.0, "inches": 39.37}

SCALES = ("template", None)
"""Choices of a reference that surfaces must have about the same size as."""

# Largest extents of human bodies, from infants to men with their arms raised.
_BODY_METRES = (0.45, 2.8)
# Feet are suspected in messages, but never inferred.
SUSPECTED_UNITS = UNITS | {"feet": 3.2808}

# Smallest and largest extent of a body with its surroundings, metres. Their ratio is 10, as between
# centimetres and millimetres, so that one unit fits at most.
_HUMAN_EXTENTS = 0.4, 4.0

# Volumes of the smallest and of the heaviest people who have lived, cubic metres. Newborns have 3
# litres and more. A volume is the same in every pose, which an extent is not.
_HUMAN_VOLUMES = 0.002, 0.65

# An infant and a tall man with raised arms differ by less than this, and units by more, but for
# centimetres and inches, which differ by 2.54.
_LARGEST_RATIO = 8.0
# Two bodies in different units differ by the ratio of the units times that of the bodies.
_BODY_RATIO = 1.5
# A sample of vertices is enough to tell the size of a surface.
_N_SAMPLES = 256

# Digits of the usual distance between neighbouring vertices; with fewer, warn or refuse.
_ENOUGH_DIGITS, _FEWEST_DIGITS = 2.0, 0.5
# In double precision, whatever the unit, nothing is lost this near the origin. Beyond the second
# number of extents, coordinates may be rounded; with fewer vertices, grids may be intended.
_NEAR, _FAR, _FEWEST_VERTICES = 30.0, 50.0, 100
_N_SURFACES = 8


def likely_units(extent: float) -> list[str]:
    """Return the units in which this extent is the size of a human body."""
    low, high = _BODY_METRES
    return [name for name, size in UNITS.items() if low * size <= extent <= high * size]


def is_human_size(extent: float, volume: float = math.nan, unit: float = 1.0) -> bool:
    """Return whether a body of people, from newborns to giants, has this extent and volume.

    `unit` is the number of units in a metre; NaN is the volume of an open surface.
    """
    low, high = _HUMAN_EXTENTS
    least, most = _HUMAN_VOLUMES
    if not low * unit <= extent < high * unit:
        return False
    return math.isnan(volume) or least * unit**3 <= abs(volume) <= most * unit**3


def check_human_size(extent: float, volume: float, name: str) -> None:
    """Raise an error that suspects a unit if no human body, in metres, has this size."""
    if is_human_size(extent, volume):
        return
    units = [unit for unit, size in SUSPECTED_UNITS.items() if is_human_size(extent, volume, size)]
    shortest, longest = _HUMAN_EXTENTS
    least, most = (1000 * litres for litres in _HUMAN_VOLUMES)
    encloses = "" if math.isnan(volume) else f" and encloses {1000 * abs(volume):.4g} litres"
    raise ArgumentError(
        f"{name} is {extent:.4g} m long{encloses}, which no human body is"
        + (f", but a body in {' or '.join(units)} would be" if units else "")
        + f"; bodies must be in metres, {shortest:g} to {longest:g} m long and of {least:g} to "
        f"{most:g} litres"
        + ("; files are converted by unit, on the command line --unit" if units else "")
    )


def check_same_scale(
    points: Array,
    side: float,
    name: str,
    reference_name: str,
    *,
    error: type[Exception] = ArgumentError,
    remedy: str = "scale=None (on the command line --any-scale) accepts them unchanged",
) -> None:
    """Raise an error if a surface, shape (..., V, 3), is over 8 times larger or smaller.

    `side` is the `longest_side` of the surface that it is compared with.
    """
    if side == 0:
        return
    ratios = _longest_sides(points) / side
    strange = (ratios > _LARGEST_RATIO) | ((ratios > 0) & (ratios < 1 / _LARGEST_RATIO))
    if not np.any(strange):
        return
    index = tuple(int(i) for i in np.argwhere(strange)[0]) if strange.ndim else ()
    ratio = float(ratios[index])
    place = f"{name}[{', '.join(map(str, index))}]" if index else name
    factor, adjective = (ratio, "large") if ratio > 1 else (1 / ratio, "small")
    raise error(
        f"{place} is {factor:.3g} times as {adjective} as {reference_name}{_unit_hint(ratio)}; "
        f"bring both to one unit; {remedy}"
    )


def longest_side(surface: Array) -> float:
    """Return the longest side of the box around some of the vertices of a surface."""
    return float(_longest_sides(surface))


def _longest_sides(surfaces: Array) -> Array:
    """Return the same of several surfaces, shape (...)."""
    sample = surfaces[..., :: max(1, surfaces.shape[-2] // _N_SAMPLES), :]
    rows = np.ascontiguousarray(np.swapaxes(sample, -1, -2))  # extremes are found faster in rows
    sides: Array = (rows.max(axis=-1) - rows.min(axis=-1)).max(axis=-1)
    return sides


def _unit_hint(ratio: float) -> str:
    """Return a text that names the units of two surfaces whose sizes have this ratio, if likely."""
    pairs = itertools.permutations(UNITS, 2)
    gaps = {
        (unit, other_unit): abs(np.log(ratio * UNITS[other_unit] / UNITS[unit]))
        for unit, other_unit in pairs
    }
    unit, other_unit = min(gaps, key=lambda pair: gaps[pair])
    if gaps[unit, other_unit] > np.log(_BODY_RATIO):
        return ""
    return f", as if one were in {unit} and the other in {other_unit}"


def _numpy_dtype(dtype: object) -> DType | None:
    """Return NumPy's type of the same name as a type of another library, if any."""
    if dtype is None:
        return None
    try:
        return np.dtype(str(dtype).rpartition(".")[2].lower())
    except TypeError:
        return None


def check_resolution(
    points: object, name: str, dtype: object = None, error: type[Exception] = ArgumentError
) -> None:
    """Warn, or raise an error, if few digits of the distances between vertices are left.

    Coordinates, shape (..., V, 3), have the resolution of their type, or of the `dtype` that they
    had; far from the origin also that of steps that they are all multiples of, as those of numbers
    that were once in single precision or written with few decimals.
    """
    values = values_of(points, name)
    if not isinstance(dtype, np.dtype):
        dtype = _numpy_dtype(dtype) or values.dtype
    if values.size == 0 or values.shape[-2] < _FEWEST_VERTICES or dtype.kind not in "fiu":
        return
    first = values[..., 0, :]
    largest = float(max(abs(first.max()), abs(first.min())))
    if dtype.itemsize == 8 and dtype.kind == "f" and largest <= _NEAR:
        return
    sample = values.reshape(-1, *values.shape[-2:])
    sample = sample[:: max(1, len(sample) // _N_SURFACES)]
    sample = sample[:, :: max(1, sample.shape[1] // _N_SAMPLES)].astype(np.float64)
    extent = float(np.ptp(sample, axis=1).max())
    if not 0.0 < extent < np.inf:
        return
    largest = float(np.abs(sample).max())
    step = 1.0 if dtype.kind in "iu" else float(np.spacing(np.abs(sample).max().astype(dtype)))
    has_step = dtype.kind in "iu" or dtype.itemsize < 8
    if not has_step and largest > _FAR * extent:
        step = max(step, *(_common_step(x.ravel()) for x in np.moveaxis(sample, 2, 0)))
    usual = extent / math.sqrt(values.shape[-2])
    digits = math.log10(usual / step)
    if digits >= _ENOUGH_DIGITS:
        return
    message = (
        f"{name} are up to {largest:.3g} from the origin, with a rounding step of {step:.2g}: "
        f"this leaves {max(digits, 0.0):.1f} digits of the usual distance {usual:.2g} between "
        "vertices; subtract an offset in double precision, before coordinates are rounded"
    )
    if digits < _FEWEST_DIGITS:
        raise error(message)
    warn(message, PrecisionWarning)


def _common_step(values: Array) -> float:
    """Return the step between numbers that are all on one grid, 0 if they are on none."""
    gaps = np.diff(np.unique(values))
    # Rounding of decimal fractions leaves gaps that are far smaller than the step.
    gaps = gaps[gaps > 8.0 * np.spacing(np.abs(values).max())]
    if not len(gaps):
        return 0.0
    step = float(gaps.min())
    multiples = gaps / step
    is_grid = np.all(np.abs(multiples - np.round(multiples)) < 0.01)
    return step if is_grid else 0.0
