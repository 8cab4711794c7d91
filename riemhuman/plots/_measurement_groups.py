"""Measurements in familiar groups: girths, heights, breadths and depths, lengths."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from riemhuman.arrays import Array
from riemhuman.measurements import Measurement

MOST_IN_GROUP = 15
_TITLES = ("Girths", "Heights", "Breadths and depths", "Lengths", "Volume, area and mass")
_HALVES = ("upper body", "lower body")
# Words of names, before classes: a breadth between landmarks is a length by its class.
_WORDS = {"girth": 0, "breadth": 2, "depth": 2}
_CLASSES = {"Girth": 0, "Height": 1, "Breadth": 2, "Depth": 2, "Length": 3}
_CLASSES |= {"Volume": 4, "Area": 4, "Mass": 4}

Lines = Mapping[str, Sequence[Array]]


@dataclass(frozen=True)
class MeasurementGroup:
    """Measurements of one kind, by their numbers in the set."""

    title: str
    members: tuple[int, ...]


def grouped(measurements: Sequence[Measurement]) -> list[MeasurementGroup]:
    """Return measurements by kind; those of user-defined classes are lengths."""
    members: dict[int, list[int]] = {}
    for k, measurement in enumerate(measurements):
        members.setdefault(_title_number(measurement), []).append(k)
    return [MeasurementGroup(_TITLES[number], tuple(members[number])) for number in sorted(members)]


def _title_number(measurement: Measurement) -> int:
    """Return which of the titles a measurement belongs to, by its name or else its class."""
    for word, number in _WORDS.items():
        if word in measurement.name:
            return number
    for base in type(measurement).__mro__:
        if base.__name__ in _CLASSES:
            return _CLASSES[base.__name__]
    return _TITLES.index("Lengths")


def pictured(measurements: Sequence[Measurement], lines: Lines) -> list[MeasurementGroup]:
    """Return groups of at most fifteen measurements that have lines, from the head downwards."""
    groups = []
    for group in grouped(measurements):
        drawn = [k for k in group.members if len(lines[measurements[k].name])]
        if not drawn:
            continue
        heights = {k: _height(lines[measurements[k].name]) for k in drawn}
        order = sorted(drawn, key=lambda k: heights[k], reverse=True)
        count = math.ceil(len(order) / MOST_IN_GROUP)
        for number, part in enumerate(np.array_split(np.array(order), count)):
            title = group.title
            if count > 1:
                which = _HALVES[number] if count == 2 else f"{number + 1} of {count}"
                title = f"{title}, {which}"
            groups.append(MeasurementGroup(title, tuple(part.tolist())))
    return groups


def _height(parts: Sequence[Array]) -> float:
    """Return the height of the highest point of lines."""
    return float(np.concatenate([np.asarray(part) for part in parts])[:, 1].max())
