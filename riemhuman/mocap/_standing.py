"""Bodies on the floor: feet that stay in place, and nothing below the floor.

A performance is the rotations of the model's joints in space, shape (n_frames, J, 3, 3), and their
positions, shape (n_frames, J, 3), in metres.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from scipy import sparse

from riemhuman.arrays import Array, Integers
from riemhuman.bodies.skinning import LIMBS
from riemhuman.kernels.compilation import compiled
from riemhuman.kernels.threads import Run, in_runs
from riemhuman.mocap._joint_axes import Figure
from riemhuman.mocap._joint_names import SIDES
from riemhuman.mocap._limbs import RUN, joint_positions, reach
from riemhuman.mocap._recorded_skeletons import RecordedSkeleton
from riemhuman.mocap._skeletons import middle

# Bodies less than this below the floor touch it, metres.
_TOUCHING = 0.005
# Still feet are moved by at most this much to stay in place, metres.
_MOST_SHIFT = 0.05
# The body changes from one foot to the other in this many seconds.
_SHIFT_SECONDS = 0.25
# Weight of a foot in the air beside that of a standing one.
_SWING = 0.05
# Vertices of a sole that are held above the floor.
_SOLE_VERTICES = 40
# If no foot stands, the lowest points of this percentage of frames are on the floor.
_LOWEST_FRAMES = 5.0
# Approximate number of vertices whose height is checked.
_BODY_VERTICES = 1500
# Seconds within which a body is raised above the floor.
_RAISE_SECONDS = 0.2


class Performance(NamedTuple):
    """Rotations and positions of the joints of a figure in space."""

    rotations: Array
    positions: Array


def stand(source: RecordedSkeleton, figure: Figure, rotations: Array, scale: float) -> Performance:
    """Return the performance with the body moved with its standing feet, and feet to the floor."""
    surface = figure.model(figure.betas)
    feet = [figure.joints[f"{side}_ankle"] for side in SIDES]

    def stand_on_feet(frames: Run) -> tuple[Array, Array, Array]:
        part, turned = source.run(frames), rotations[frames]
        soles = [_sole(figure, surface, turned, side) for side in SIDES]
        lows, balls = (np.stack(arrays, axis=1) for arrays in zip(*soles, strict=True))
        return joint_positions(part, figure, turned, scale), lows, balls

    positions, lows, balls = _joined(stand_on_feet, len(rotations))
    recorded = scale * source.positions[:, [source.joints[f"{side}_ankle"] for side in SIDES]]
    positions = positions + _body_shift(source, recorded - positions[:, feet])
    targets = _footholds(source, figure, Performance(rotations, positions), surface, lows, balls)
    positions = positions + _body_shift(source, targets - positions[:, feet])

    def reach_footholds(frames: Run) -> tuple[Array, Array, Array]:
        part, turned, places = source.run(frames), rotations[frames], positions[frames]
        for k, leg in enumerate(LIMBS[:2]):
            to_end = targets[frames, k] - places[:, figure.joints[leg[0]]]
            turned = reach(part, figure, turned, leg, to_end)
        hips = middle(places, figure.joints, "hip")
        places = joint_positions(part, figure, turned, scale)
        places += (hips - middle(places, figure.joints, "hip"))[:, None]
        return turned, places, _lowest_points(figure, surface, Performance(turned, places))

    rotations, positions, lowest = _joined(reach_footholds, len(rotations))
    positions[..., 1] += _raised(-lowest, source)[:, None]
    return Performance(rotations, positions)


def _joined(task: Callable[[Run], tuple[Array, ...]], n_frames: int) -> tuple[Array, ...]:
    """Return the arrays of all frames from a task that returns those of a run of them."""
    runs = in_runs(task, n_frames, RUN)
    return tuple(np.concatenate(arrays) for arrays in zip(*runs, strict=True))


def _raised(depths: Array, source: RecordedSkeleton) -> Array:
    """Return how much a body is raised, smoothly, so that no part is below the floor."""
    from scipy.ndimage import maximum_filter1d, uniform_filter1d  # take long to import

    heights = np.maximum(0.0, depths - _TOUCHING)
    width = max(1, round(_RAISE_SECONDS * source.frames_per_second))
    if width % 2 == 0:
        width += 1  # so that filters are symmetric
    # A mean of nearby maxima is never below the values themselves.
    largest = maximum_filter1d(np.where(source.is_valid, heights, 0.0), width)
    smooth = uniform_filter1d(largest, width)
    # After an interruption, a body may be anywhere.
    return np.asarray(np.where(source.is_valid, smooth, heights))


def _body_shift(source: RecordedSkeleton, shifts: Array) -> Array:
    """Return the mean shift of the feet, above all of those that stand still."""
    from scipy.ndimage import uniform_filter1d  # takes long to import

    width = max(1, round(_SHIFT_SECONDS * source.frames_per_second))
    still = source.still.astype(np.float64)
    weights = _SWING + uniform_filter1d(still, width, axis=0, mode="nearest")
    shares = weights / weights.sum(axis=1, keepdims=True)
    shift: Array = np.sum(shares[..., None] * shifts, axis=1)[:, None]
    return shift


def _sole(figure: Figure, surface: Array, rotations: Array, side: str) -> tuple[Array, Array]:
    """Return the height of a foot's lowest vertex, and its ball, relative to its ankle."""
    names = [f"{side}_{part}" for part in ("ankle", "toes")]
    foot = [figure.joints[name] for name in names if name in figure.joints]
    weights = figure.model.weights[:, foot]
    total = weights.sum(axis=1)
    vertices = np.flatnonzero(total >= 0.5 * total.max())
    vertices = vertices[np.argsort(surface[vertices] @ figure.frame[:, 0])[:_SOLE_VERTICES]]
    ball = rotations[:, foot[0]] @ (figure.rest[foot[-1]] - figure.rest[foot[0]])
    heights = np.zeros((len(ball), len(vertices)))
    for k, joint in enumerate(foot):
        share = weights[vertices, k] / total[vertices]
        moved = rotations[:, joint, 1] @ (surface[vertices] - figure.rest[joint]).T
        heights += share * (moved + (ball[:, 1:2] if k else 0.0))
    return heights.min(axis=1), ball


def _footholds(
    source: RecordedSkeleton,
    figure: Figure,
    performance: Performance,
    surface: Array,
    lows: Array,
    balls: Array,
) -> Array:
    """Return where ankles must be for still feet to stay in place with no sole below 0."""
    ankles = performance.positions[:, [figure.joints[f"{side}_ankle"] for side in SIDES]]
    heights = ankles[..., 1] + lows
    grounded = source.grounded
    if grounded.any():
        floor = np.median(heights[grounded])
    else:
        lowest = _lowest_points(figure, surface, performance)
        floor = np.percentile(lowest[source.is_valid], _LOWEST_FRAMES)
    targets, above = ankles - [0.0, floor, 0.0], heights - floor
    apart = np.sign(above) * np.maximum(np.abs(above) - _TOUCHING, 0.0)
    frames = np.arange(len(ankles))
    for k, still in enumerate(source.still.T):
        shift = np.zeros_like(balls[:, k])
        shift[:, 1] = np.where(grounded[:, k], -apart[:, k], 0.0)
        runs = np.ma.clump_unmasked(np.ma.masked_array(frames, ~still))  # type: ignore[no-untyped-call]  # of NumPy
        for standing in runs:
            drift = (ankles[standing, k] + balls[standing, k])[:, [0, 2]]
            shift[standing, ::2] = drift.mean(axis=0) - drift
        size = np.linalg.norm(shift[:, ::2], axis=1, keepdims=True)
        shift[:, ::2] *= _MOST_SHIFT / np.maximum(size, _MOST_SHIFT)
        # In between, feet move from one place to the next.
        still_frames = np.flatnonzero(still)
        for column in shift.T:
            if len(still_frames):
                column[:] = np.interp(frames, still_frames, column[still_frames])
            else:
                column[:] = 0.0
        shift[:, 1] += np.maximum(0.0, -(above[:, k] + shift[:, 1] + _TOUCHING))
        targets[:, k] += shift
    return targets


def _lowest_points(figure: Figure, surface: Array, performance: Performance) -> Array:
    """Return the height of the lowest vertex in every frame."""
    step = max(1, len(surface) // _BODY_VERTICES)
    vertices, weights = surface[::step], figure.model.weights[::step]
    # Few joints move each vertex.
    carried = sparse.csr_array(weights)
    numbers = np.repeat(np.arange(len(vertices)), np.diff(carried.indptr))
    arms = carried.data[:, None] * (vertices[numbers] - figure.rest[carried.indices])
    lowest = np.empty(len(performance.positions))
    _fill_lowest(
        np.ascontiguousarray(performance.rotations[:, :, 1]),
        np.ascontiguousarray(performance.positions[:, :, 1]),
        *(carried.indptr, carried.indices, carried.data, arms, lowest),
    )
    return lowest


@compiled
def _fill_lowest(
    upward: Array,
    heights: Array,
    starts: Integers,
    joints: Integers,
    weights: Array,
    arms: Array,
    lowest: Array,
) -> None:
    """Fill the least height of vertices, the k-th moved by joints[starts[k] : starts[k + 1]]."""
    for t in range(len(heights)):
        lowest[t] = np.inf
        for vertex in range(len(starts) - 1):
            height = 0.0
            for k in range(starts[vertex], starts[vertex + 1]):
                joint = joints[k]
                height += weights[k] * heights[t, joint]
                for i in range(3):
                    height += upward[t, joint, i] * arms[k, i]
            lowest[t] = min(lowest[t], height)
