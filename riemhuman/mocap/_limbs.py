"""The rotations of a figure's joints in space that follow recorded ones."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from riemhuman.arrays import Array, Integers
from riemhuman.bodies import joints_between
from riemhuman.bodies.skinning import LIMBS
from riemhuman.kernels.compilation import compiled
from riemhuman.kernels.rotations import exp, log, shortest_rotations
from riemhuman.kernels.surface import unit_vectors as unit
from riemhuman.kernels.threads import Run, in_runs
from riemhuman.mocap._joint_axes import Figure, figure_hinge, joint_axes, shown_rotations
from riemhuman.mocap._recorded_skeletons import RecordedSkeleton
from riemhuman.mocap._skeletons import (
    bone,
    has_bone,
    middle,
    trunk,
    turned_towards,
)

NECK = ("neck", "head")

# Frames that are computed at a time: few enough for their numbers to stay in the cache.
RUN = 500

# Limbs deviate from the recorded directions by at most this many radians.
_LIMB = np.radians(3.8)
_BISECTIONS = 12
_TRUNK_STEPS = 3
# Limbs are stretched to at most this share of their length.
_STRETCHED = 0.9995
# Weight of the axis of a knee beside the sine of its angle: a straight knee bends about it.
_HINGE_SHARE = 0.1
# Rotations of the trunk are ignored if they differ by more than this from the positions.
_UNLIKE = np.radians(30.0)


class _Parts(NamedTuple):
    """What all frames of a recording say about its parts.

    `axes` are the constant rotations of parts by names of joints. Parts that are `shown` by
    positions alone are those whose recorded rotations contradict them.
    """

    axes: dict[str, Array]
    shown: list[str]
    has_neck: bool

    @classmethod
    def of(cls, source: RecordedSkeleton, figure: Figure) -> _Parts:
        """Return the parts of a recording."""
        axes = joint_axes(source, figure)
        shown = []
        for name in ("pelvis", "chest"):
            # Some files place joints without rotating their parents.
            angles = log(source.rotation(name) @ axes[name], shown_rotations(source, figure, name))
            if np.linalg.norm(angles, axis=-1).mean() > _UNLIKE:
                shown.append(name)
        has_neck = has_bone(source.positions, source.joints, *NECK)
        return cls(axes, shown, has_neck and set(NECK) <= figure.joints.keys())


def follow(source: RecordedSkeleton, figure: Figure, scale: float) -> Array:
    """Return rotations of all joints in space that follow a recording, (n_frames, J, 3, 3)."""
    parts = _Parts.of(source, figure)
    rotations = np.empty((len(source.positions), len(figure.rest), 3, 3))

    def follow_run(frames: Run) -> None:
        rotations[frames] = _followed(source.run(frames), figure, scale, parts)

    in_runs(follow_run, len(rotations), RUN)
    return rotations


def _followed(source: RecordedSkeleton, figure: Figure, scale: float, parts: _Parts) -> Array:
    """Return the rotations of all joints in some of the frames."""
    recorded = _recorded_rotations(source, figure, parts)
    rotations = np.empty((len(source.positions), len(figure.rest), 3, 3))
    for joint in figure.model.joint_order:
        above = figure.model.parents[joint]
        rotations[:, joint] = recorded.get(joint, rotations[:, above])
    rotations = _straighten_trunk(source, figure, rotations, scale)
    positions = joint_positions(source, figure, rotations, scale)
    for arm in LIMBS[2:]:
        wrist = scale * source.positions[:, source.joints[arm[2]]]
        to_wrist = wrist - positions[:, figure.joints[arm[0]]]
        rotations = reach(source, figure, rotations, arm, to_wrist)
    return rotations


def joint_positions(
    source: RecordedSkeleton, figure: Figure, rotations: Array, scale: float
) -> Array:
    """Return the positions of joints, the middle of the hips where it was recorded."""
    parents = figure.model.parents
    positions = np.empty(rotations.shape[:-1])
    order = np.array(figure.model.joint_order)
    _fill_positions(rotations, figure.rest - figure.rest[parents], parents, order, positions)
    hips = middle(positions, figure.joints, "hip")
    recorded = scale * middle(source.positions, source.joints, "hip")
    return np.asarray(positions + (recorded - hips)[:, None])


@compiled
def _fill_positions(
    rotations: Array, bones: Array, parents: Integers, order: Integers, positions: Array
) -> None:
    """Fill the positions of joints, from the root, which stays at the origin."""
    for t in range(len(rotations)):
        for joint in order:
            above = parents[joint]
            for i in range(3):
                total = 0.0
                if above >= 0:
                    total = positions[t, above, i]
                    for j in range(3):
                        total += rotations[t, above, i, j] * bones[joint, j]
                positions[t, joint, i] = total


def reach(
    source: RecordedSkeleton,
    figure: Figure,
    rotations: Array,
    limb: tuple[str, ...],
    to_end: Array,
) -> Array:
    """Bend a limb so that its end comes as near to a place as its directions allow."""
    a = float(np.linalg.norm(figure.bone(limb[0], limb[1])))
    b = float(np.linalg.norm(figure.bone(limb[1], limb[2])))
    joints = [figure.joints[name] for name in limb[:2]]
    upper, lower = (_direction(source, *pair) for pair in (limb[:2], limb[1:]))
    # A straight limb bends about its hinge, a bent one in its plane.
    hinge = rotations[:, joints[0]] @ figure_hinge(figure, limb)
    axes = np.cross(upper, lower) + _HINGE_SHARE * hinge
    new_upper, new_lower = np.empty_like(upper), np.empty_like(lower)
    _fill_bent(upper, lower, (a, b), axes, to_end, new_upper, new_lower)
    rotations = rotations.copy()
    for joint, old, new in zip(joints, (upper, lower), (new_upper, new_lower), strict=True):
        rotations[:, joint] = shortest_rotations(old, new) @ rotations[:, joint]
    return rotations


def _direction(source: RecordedSkeleton, first: str, second: str) -> Array:
    """Return the recorded directions between two joints in all frames."""
    return unit(bone(source.positions, source.joints, first, second))


def _recorded_rotations(
    source: RecordedSkeleton, figure: Figure, known: _Parts
) -> dict[int, Array]:
    """Return the rotations in space of joints that are recorded; others follow their parents."""
    parts = {name: source.rotation(name) @ axes for name, axes in known.axes.items()}
    for name in known.shown:
        parts[name] = shown_rotations(source, figure, name)
    if "chest" in known.shown:
        # Rotations of what it carries in space contain its own.
        for name in ("head", "left_collar", "right_collar"):
            parts.pop(name, None)
    for limb in LIMBS:
        for pair in (limb[:2], limb[1:]):
            directions = _direction(source, *pair)
            parts[pair[0]] = turned_towards(parts[pair[0]], figure.bone(*pair), directions)
    parts.setdefault("head", parts["chest"])
    neck = _interpolated(parts["chest"], parts["head"], 3)[1]
    if known.has_neck:
        neck = turned_towards(neck, figure.bone(*NECK), _direction(source, *NECK))
    parts["neck"] = neck
    rotations = {figure.joints[name]: part for name, part in parts.items() if name in figure.joints}
    spine = joints_between(figure.model.parents, figure.joints["pelvis"], figure.joints["chest"])
    turned = _interpolated(parts["pelvis"], parts["chest"], len(spine))
    return rotations | dict(zip(spine, turned, strict=True))


def _straighten_trunk(
    source: RecordedSkeleton, figure: Figure, rotations: Array, scale: float
) -> Array:
    """Rotate the spine until shoulders are above hips as recorded."""
    parents, joints = figure.model.parents, figure.joints
    spine = joints_between(parents, joints["pelvis"], joints["chest"])[1:-1]
    recorded = unit(trunk(source.positions, source.joints))
    rotations = rotations.copy()
    for _ in range(_TRUNK_STEPS if spine else 0):
        positions = joint_positions(source, figure, rotations, scale)
        hips, shoulders = (middle(positions, joints, part) for part in ("hip", "shoulder"))
        start = positions[:, spine[0]]
        length = np.linalg.norm(shoulders - hips, axis=1, keepdims=True)
        towards = unit(hips + length * recorded - start)
        turn = shortest_rotations(unit(shoulders - start), towards)
        rotations[:, spine] = turn[:, None] @ rotations[:, spine]
    return rotations


@compiled
def _fill_bent(
    upper: Array,
    lower: Array,
    lengths: tuple[float, float],
    axes: Array,
    to_end: Array,
    new_upper: Array,
    new_lower: Array,
) -> None:
    """Fill directions of two bones that come as near to an end as their old directions allow."""
    a, b = lengths
    place, nearest = np.empty(3), np.cos(_LIMB)
    for t in range(len(to_end)):
        low, high = 0.0, 1.0
        for step in range(_BISECTIONS + 1):
            # In the last step, the largest share that was near enough.
            share = 0.5 * (low + high) if step < _BISECTIONS else low
            for i in range(3):
                end = a * upper[t, i] + b * lower[t, i]
                place[i] = end + share * (to_end[t, i] - end)
            _bend(place, a, b, axes[t], new_upper[t], new_lower[t])
            first, second = 0.0, 0.0
            for i in range(3):
                first += new_upper[t, i] * upper[t, i]
                second += new_lower[t, i] * lower[t, i]
            if min(first, second) > nearest:
                low = share
            else:
                high = share


@compiled
def _bend(
    to_end: Array, a: float, b: float, axis: Array, new_upper: Array, new_lower: Array
) -> None:
    """Fill the directions of two bones of lengths a and b to an end, bent about an axis."""
    distance = math.sqrt(to_end[0] ** 2 + to_end[1] ** 2 + to_end[2] ** 2)
    length = min(max(distance, abs(a - b) + 1e-6), _STRETCHED * (a + b))
    scale = 1.0 / distance if distance > 0.0 else 0.0
    x, y, z = scale * to_end[0], scale * to_end[1], scale * to_end[2]
    along = (length**2 + a**2 - b**2) / (2.0 * length)
    across = math.sqrt(max(a**2 - along**2, 0.0))
    side_x = y * axis[2] - z * axis[1]
    side_y = z * axis[0] - x * axis[2]
    side_z = x * axis[1] - y * axis[0]
    size = math.sqrt(side_x**2 + side_y**2 + side_z**2)
    share = across / size if size > 0.0 else 0.0
    new_upper[0] = (along * x + share * side_x) / a
    new_upper[1] = (along * y + share * side_y) / a
    new_upper[2] = (along * z + share * side_z) / a
    new_lower[0] = (length * x - a * new_upper[0]) / b
    new_lower[1] = (length * y - a * new_upper[1]) / b
    new_lower[2] = (length * z - a * new_upper[2]) / b


def _interpolated(start: Array, end: Array, n: int) -> list[Array]:
    """Return n rotations from one rotation to another, in each frame."""
    turn = log(start, end)
    return [exp(share * turn, start) for share in np.linspace(0.0, 1.0, n)]
