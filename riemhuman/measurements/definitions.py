"""The kinds of measurements, and measurements from JSON records."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import fields
from difflib import get_close_matches
from typing import Any

from riemhuman.errors import ArgumentError, ArgumentTypeError
from riemhuman.measurements.length_measurements import Height, Length
from riemhuman.measurements.measurement import Measurement
from riemhuman.measurements.section_measurements import Breadth, Depth, Girth
from riemhuman.measurements.volume_measurements import Area, Mass, Volume

KINDS = {
    kind.__name__: kind for kind in (Girth, Length, Height, Breadth, Depth, Volume, Mass, Area)
}
"""Kinds of measurements by name."""


def measurement_from_dict(record: Mapping[str, Any]) -> Measurement:
    """Return the measurement that a JSON record describes.

    Parameters
    ----------
    record : mapping
        The name of its class under "kind", and its parameters.

    Returns
    -------
    Measurement

    Raises
    ------
    ArgumentError
        If the kind or a parameter is unknown (the message offers the nearest names), or a parameter
        is missing or out of range.
    ArgumentTypeError
        If it is not a mapping.

    Examples
    --------
    >>> import riemhuman as rh
    >>> record = {"kind": "Height", "name": "stature", "at": "crown"}
    >>> rh.measurements.measurement_from_dict(record).at
    'crown'
    """
    if not isinstance(record, Mapping):
        raise ArgumentTypeError(f"a measurement must be a mapping; found {record!r}")
    known = dict(record)
    kind = KINDS[nearest_name(str(known.pop("kind", "")), "kind of measurement", KINDS)]
    for name in known:
        nearest_name(name, f"parameter of {kind.__name__}", [f.name for f in fields(kind)])
    try:
        return kind(**known)
    except TypeError as error:
        if isinstance(error, ArgumentTypeError):
            raise
        raise ArgumentError(f"a {kind.__name__} cannot be made of {record!r}: {error}") from error


def nearest_name(name: str, what: str, known: Sequence[str] | Mapping[str, Any]) -> str:
    """Return a name if it is known; otherwise offer the nearest names.

    Parameters
    ----------
    name : str
        The name.
    what : str
        The kind of thing named, for messages.
    known : sequence of str
        All known names.

    Returns
    -------
    str
        The name itself.

    Raises
    ------
    ArgumentError
        If it is unknown; the message offers names with a similar spelling.
    """
    if name in known:
        return name
    near = get_close_matches(name, list(known), n=3, cutoff=0.5)
    offered = f"did you mean {' or '.join(map(repr, near))}?" if near else ""
    listed = offered or f"there are {', '.join(map(repr, known)) or 'none'}"
    raise ArgumentError(f"there is no {what} {name!r}; {listed}")
