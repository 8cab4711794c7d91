"""Which axis of a recording points up, by evidence that may contradict itself.

People mostly stand along it, the floor is at height 0, a rest pose often stands along it, and most
programs have one convention. Someone who lies on the floor or on a bed, on his or her hands or in
a file that was converted, contradicts one of them: then the convention counts, and the floor.
"""

from __future__ import annotations

import warnings
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy import ndarray

from riemhuman.kernels.surface import unit_vectors as unit

_AXES = {"x": (0, 1), "y": (1, 1), "z": (2, 1), "-x": (0, -1), "-y": (1, -1), "-z": (2, -1)}
# Evidence for an axis, in one arbitrary unit; the rest follows from the cases in the tests.
_STANDS, _FLOOR_AT_ZERO, _BED, _AT_REST = 2.0, 2.5, 1.6, 1.0
# Evidence against an axis that hardly anything uses.
_RARE = 3.0
# With this much evidence of a floor along the usual axis, another axis is in doubt.
_DOUBTFUL_FLOOR = 1.2
# With less evidence, moving bodies have no floor along an axis.
_SOME_FLOOR = 0.5
# The body is upright along an axis if shoulders are above feet by this cosine.
_UPRIGHT = 0.8
# The floor is at height 0 within, beds are at most so high, and tables where the body is at rest,
# lengths of the leg.
_NEAR_ZERO, _HIGHEST_BED, _HIGHEST_TABLE = 0.15, 0.8, 1.4
# In fewer frames than this, moving bodies may be near a floor by chance.
_ENOUGH_FRAMES = 30
# A body is supported in a frame if its lowest joint is so near to the floor, lengths of the leg.
_SUPPORTED = 0.05


@dataclass(frozen=True)
class Convention:
    """What is known before a recording is seen: its usual axis, and the evidence `against` others.

    Axes that it does not name are rare. Where bodies `move`, standing and a floor, at any height,
    count by the share of frames in which a body is near the floor: the file holds no rest pose to
    tell more.
    """

    axis: str
    against: Mapping[str, float]
    move: bool = False


BVH = Convention("y", {"z": 2.5})
# Files from elsewhere use this layout too, and in them y up is usual.
AMASS = Convention("z", {"y": 1.5}, move=True)
# In the axes of cameras, y points down.
VIDEO = Convention("y", {"-y": 0.5, "z": 1.5}, move=True)


def upward_axis(
    positions: ndarray,
    directions: ndarray,
    leg: float,
    rest_direction: ndarray | None = None,
    convention: Convention = BVH,
) -> tuple[str, str]:
    """Return the axis that points up, and another one if it may be that as well, or "".

    Parameters
    ----------
    positions : array, shape (n_frames, J, 3)
    directions : array, shape (n_frames, 3)
        From the ankles to the shoulders.
    leg : float
        Length of the legs.
    rest_direction : array, shape (3,), optional
        From the ankles to the shoulders in the rest pose, where that may say something.
    """
    usual, evidence, seen, supported = convention.axis, {}, {}, {}
    floors, rests = {}, {}
    for axis, (number, sign) in _AXES.items():
        lowest = (sign * positions[..., number]).min(axis=1) / leg
        floor = float(np.percentile(lowest, 1.0))
        supported[axis] = float(np.mean(lowest < floor + _SUPPORTED))
        if convention.move:
            supported[axis] *= min(1.0, len(lowest) / _ENOUGH_FRAMES)
        floors[axis] = _floor_evidence(floor, supported[axis], convention)
        stands = float(np.mean(sign * unit(directions)[:, number] > _UPRIGHT))
        if convention.move:
            stands *= supported[axis]
        rests[axis] = rest_direction is not None and bool(
            sign * unit(rest_direction)[number] > _UPRIGHT
        )
        seen[axis] = _STANDS * stands + floors[axis]
        against = 0.0 if axis == usual else convention.against.get(axis, _RARE)
        evidence[axis] = seen[axis] + _AT_REST * rests[axis] - against
    chosen = max(evidence, key=lambda axis: evidence[axis])
    likely = max(seen, key=lambda axis: seen[axis])
    if likely != chosen:
        # Rest pose and floor agree about someone who hardly moves: the person is lying there.
        is_sure = rests[chosen] and floors[chosen] >= _FLOOR_AT_ZERO and supported[chosen] > 0.5
        is_sure |= convention.move and floors[likely] < _SOME_FLOOR
        return chosen, "" if is_sure else likely
    # For people who stand along the opposite axis, the lowest place is the head, not a floor.
    is_doubtful = chosen not in (usual, f"-{usual}") and floors[usual] > _DOUBTFUL_FLOOR
    return chosen, usual if is_doubtful else ""


def warn_of_doubt(name: str, axes: tuple[str, str]) -> None:
    """Warn where another axis than the one that was chosen may point up."""
    chosen, alternative = axes
    if alternative:
        warnings.warn(
            f"{name or 'recording'}: {chosen} was taken to point up, but it might as well be "
            f"{alternative}: people lying on the floor look like people standing along another "
            f"axis. Pass up={chosen!r} or up={alternative!r}",
            stacklevel=2,
        )


def _floor_evidence(floor: float, supported: float, convention: Convention) -> float:
    """Return the evidence that the lowest points are on a floor, a bed or a table."""
    if convention.move:
        return supported * (_FLOOR_AT_ZERO if abs(floor) <= _NEAR_ZERO else _BED)
    if abs(floor) <= _NEAR_ZERO:
        return _FLOOR_AT_ZERO
    if not 0.0 < floor <= _HIGHEST_TABLE:
        return 0.0
    return _BED if floor <= _HIGHEST_BED else _BED * supported


def rest_directions(parents: ndarray, offsets: ndarray, joints: Mapping[str, int]) -> ndarray:
    """Return the direction from ankles to shoulders in a rest pose, shape (3,)."""
    rest = offsets.copy()
    rest[parents < 0] = 0.0
    for joint, parent in enumerate(parents):
        if parent >= 0:
            rest[joint] += rest[parent]
    sides = ("left", "right")
    shoulders, ankles = (
        np.mean([rest[joints[f"{side}_{part}"]] for side in sides], axis=0)
        for part in ("shoulder", "ankle")
    )
    return np.asarray(shoulders - ankles)
