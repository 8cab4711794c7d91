"""How fast and how far a body travels over the ground, whatever its pose."""

from __future__ import annotations

import numpy as np

from riemhuman.arrays import Array
from riemhuman.errors import ArgumentError, ArgumentTypeError
from riemhuman.geometry import AlignedSurfaces
from riemhuman.geometry.point_space import PointSpace
from riemhuman.mocap.motions import Motion as RecordedMotion

_GRAVITY = 9.81  # metres per second squared
# Seconds between the two places from which a speed is computed: within a step, the body speeds up
# and slows down.
_SMOOTHED = 0.25
# Legs are about half as long as people are tall.
_SHARE_OF_HEIGHT = 0.5


def frame_rate(motion: object, frames_per_second: float | None, name: str) -> float:
    """Return the frames per second of a motion, by default those of a recording."""
    if frames_per_second is not None:
        return frames_per_second
    if isinstance(motion, RecordedMotion):
        return motion.frames_per_second
    raise ArgumentError(
        f"the speed of {name} depends on the frame rate: pass frames_per_second, or a motion "
        "from riemhuman.datasets, which has one, instead of an array"
    )


def surface_space(space: PointSpace) -> AlignedSurfaces:
    """Return a space of surfaces, or raise an error: other points do not travel."""
    if not isinstance(space, AlignedSurfaces):
        raise ArgumentTypeError(
            f"travel_weight needs surfaces, which have positions; found {space!r}"
        )
    return space


def ground_places(space: AlignedSurfaces, frames: Array) -> Array:
    """Return where the centres of surfaces are on the ground, shape (n_frames, 2)."""
    shares = space.template.vertex_areas / space.template.vertex_areas.sum()
    places: Array = np.einsum("v,nvk->nk", shares, frames[..., [0, 2]])
    return places


def leg_length(space: AlignedSurfaces) -> float:
    """Return the approximate length of the template's legs."""
    return _SHARE_OF_HEIGHT * float(np.ptp(space.template.vertices[:, 1]))


def travel_speeds(space: AlignedSurfaces, places: Array, rate: float) -> Array:
    """Return speeds over the ground in units of √(g · leg length), shape (n_frames,)."""
    if len(places) < 2:
        return np.zeros(len(places))
    reach = max(1, round(0.5 * _SMOOTHED * rate))
    numbers = np.arange(len(places))
    before = np.maximum(numbers - reach, 0)
    after = np.minimum(numbers + reach, len(places) - 1)
    lengths = np.linalg.norm(places[after] - places[before], axis=1)
    speeds = rate * lengths / (after - before)
    return np.asarray(speeds / np.sqrt(_GRAVITY * leg_length(space)))


def travelled_lengths(space: AlignedSurfaces, places: Array) -> Array:
    """Return how far bodies have travelled since the first frame, in leg lengths."""
    steps = np.linalg.norm(np.diff(places, axis=0), axis=1)
    return np.concatenate([[0.0], np.cumsum(steps)]) / leg_length(space)
