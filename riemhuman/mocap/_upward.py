"""Which axis of a recording points up, by evidence that may contradict itself.

People mostly stand along it, the floor is at height 0, the rest pose often stands along it, and
most programs follow one convention. Someone who lies on the floor or on a bed, someone who stands
on their hands, or a converted file contradicts one of these: then the convention and the floor
decide.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from riemhuman.arrays import Array
from riemhuman.errors import warn
from riemhuman.kernels.surface import unit_vectors as unit

_AXES = {"x": (0, 1), "y": (1, 1), "z": (2, 1), "-x": (0, -1), "-y": (1, -1), "-z": (2, -1)}
# Evidence for an axis, in an arbitrary unit; the numbers were chosen on the cases in the tests.
_STANDS = 2.0
_FLOOR_AT_ZERO = 2.5
_BED = 1.6
_AT_REST = 1.0
# Evidence against an axis that hardly anything uses.
_RARE = 3.0
# With this much evidence of a floor along the usual axis, another axis is in doubt.
_DOUBTFUL_FLOOR = 1.2
# With less evidence, there is no floor along an axis.
_SOME_FLOOR = 0.5
# The body is upright along an axis if shoulders are above feet by this cosine.
_UPRIGHT = 0.8
# Heights in lengths of the leg: a floor is this near to 0, and beds, and tables on which a body is
# at rest, are at most this high.
_NEAR_ZERO = 0.15
_HIGHEST_BED = 0.8
_HIGHEST_TABLE = 1.4
# A body is supported in a frame if its lowest joint is so near to the floor, lengths of the leg.
_SUPPORTED = 0.05


@dataclass(frozen=True)
class Convention:
    """What is known before a recording is seen: its usual axis, and the evidence `against` others.

    Axes that it does not name are rare. Where bodies `move`, standing and a floor, at any height,
    count by the share of frames in which a body is near the floor: the file holds no rest pose to
    tell more. Axes that are `as_usual` as the first are not doubted.
    """

    axis: str
    against: Mapping[str, float]
    move: bool = False
    as_usual: tuple[str, ...] = ()


# Laboratories have z up, OpenSim y.
MARKERS = Convention("y", {"z": 0.5, "-y": 1.0}, as_usual=("z",))
BVH = Convention("y", {"z": 2.5})
# Files from elsewhere use this layout too, and in them y up is usual.
AMASS = Convention("z", {"y": 1.5}, move=True)
# In the axes of cameras, y points down.
VIDEO = Convention("y", {"-y": 0.5, "z": 1.5}, move=True)


def upward_axis(
    positions: Array,
    directions: Array,
    leg: float,
    rest_direction: Array | None = None,
    convention: Convention = BVH,
) -> tuple[str, str]:
    """Return the axis that points up, and another one if it may be that as well, or "".

    Positions are (n_frames, J, 3); directions (n_frames, 3) and that in the rest pose (3,), where
    it may say something, point from the ankles to the shoulders.
    """
    evidence = {
        axis: _evidence_for(
            sign * positions[..., number] / leg,
            sign * unit(directions)[:, number],
            None if rest_direction is None else sign * unit(rest_direction)[number],
            convention,
        )
        for axis, (number, sign) in _AXES.items()
    }
    usual = convention.axis
    totals = {}
    for axis, evidence_for_axis in evidence.items():
        against = 0.0 if axis == usual else convention.against.get(axis, _RARE)
        totals[axis] = evidence_for_axis.motion + _AT_REST * evidence_for_axis.is_rest - against
    chosen = max(totals, key=lambda axis: totals[axis])
    likely = max(evidence, key=lambda axis: evidence[axis].motion)
    if likely != chosen:
        # If rest pose and floor agree, the person hardly moves and is lying there.
        of_chosen = evidence[chosen]
        is_lying = of_chosen.is_rest and of_chosen.floor >= _FLOOR_AT_ZERO
        return chosen, "" if is_lying and of_chosen.supported > 0.5 else likely
    # For people who stand along the opposite axis, the lowest place is the head, not a floor.
    is_unusual = chosen not in (usual, f"-{usual}", *convention.as_usual)
    if is_unusual and evidence[usual].floor > _DOUBTFUL_FLOOR:
        return chosen, usual
    # Someone who lies is on a floor along one usual axis, and seems to float along another.
    for axis in sorted({usual, *convention.as_usual} - {chosen}):
        has_floor = evidence[axis].floor > _DOUBTFUL_FLOOR and evidence[axis].supported > 0.5
        if has_floor and evidence[chosen].floor < _SOME_FLOOR:
            return chosen, axis
    return chosen, ""


class _Evidence(NamedTuple):
    """What speaks for an axis."""

    supported: float  # share of frames in which the body is near the floor
    floor: float
    motion: float  # evidence of the floor and of standing
    is_rest: bool  # whether the rest pose stands along the axis


def _evidence_for(
    heights: Array, cosines: Array, rest_cosine: float | None, convention: Convention
) -> _Evidence:
    """Return the evidence for an axis, from coordinates along it.

    Heights (n_frames, J) are those of joints in lengths of the leg, and cosines (n_frames,) those
    of the angles between the axis and the direction from ankles to shoulders.
    """
    lowest = heights.min(axis=1)
    floor = float(np.percentile(lowest, 1.0))
    supported = float(np.mean(lowest < floor + _SUPPORTED))
    stands = float(np.mean(cosines > _UPRIGHT))
    if convention.move:
        stands *= supported
    floor_evidence = _floor_evidence(floor, supported, convention)
    is_rest = rest_cosine is not None and bool(rest_cosine > _UPRIGHT)
    return _Evidence(supported, floor_evidence, _STANDS * stands + floor_evidence, is_rest)


def chosen_axis(name: str, axes: tuple[str, str]) -> str:
    """Return the axis that was chosen; warn where another one may point up."""
    chosen, alternative = axes
    if alternative:
        warn(
            f"{name or 'recording'}: {chosen} was taken to point up, but it might as well be "
            f"{alternative}: people lying on the floor look like people standing along another "
            f"axis. Pass up={chosen!r} or up={alternative!r}",
            UserWarning,
        )
    return chosen


def _floor_evidence(floor: float, supported: float, convention: Convention) -> float:
    """Return the evidence that the lowest points are on a floor, a bed or a table."""
    if convention.move:
        return supported * (_FLOOR_AT_ZERO if abs(floor) <= _NEAR_ZERO else _BED)
    if abs(floor) <= _NEAR_ZERO:
        return _FLOOR_AT_ZERO
    if not 0.0 < floor <= _HIGHEST_TABLE:
        return 0.0
    return _BED if floor <= _HIGHEST_BED else _BED * supported
