"""Skeletons with joints at centres found from markers: the tree, and rotations."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import pairwise

import numpy as np

from riemhuman.arrays import Array
from riemhuman.bodies.skinning import LIMBS
from riemhuman.kernels.rotations import transpose
from riemhuman.kernels.surface import unit_vectors as unit
from riemhuman.mocap._joint_centres import Markers, find_centres
from riemhuman.mocap._joint_names import SIDES
from riemhuman.mocap._marker_sets import NEEDED
from riemhuman.mocap._skeletons import (
    bone,
    frame,
    middle,
    pelvis_frame,
    trunk,
    turned_towards,
)
from riemhuman.mocap.skeleton_motion import SkeletonMotion

# Weight of the axis of an unbent knee or elbow beside the sine of its angle.
_UNBENT = 0.1
# An arm is lowered if the cosine of its angle to the trunk's upward direction is below this.
_LOWERED = 0.0
# Where collars begin, as a share of the way from the middle of the chest to the shoulder.
_COLLAR = 0.13


def skeleton_of(
    markers: Markers, joints: Mapping[str, str | Sequence[str]] | None = None
) -> SkeletonMotion:
    """Return the skeleton with joints located by markers, and rotations that show bends."""
    centres, head_axes = find_centres(markers, joints or {})
    return _skeleton(markers, centres | _trunk_places(centres), head_axes)


def _trunk_places(centres: Mapping[str, Array]) -> dict[str, Array]:
    """Return the places of pelvis and chest, and of collars, which raised arms lift.

    With raised arms, the shoulders are farther from the hips than with lowered ones.
    """
    roles = {role: number for number, role in enumerate(NEEDED)}
    positions = np.stack([centres[role] for role in NEEDED], axis=1)
    hips, shoulders = (middle(positions, roles, part) for part in ("hip", "shoulder"))
    lengths = np.linalg.norm(shoulders - hips, axis=1)
    back = unit(shoulders - hips)
    lowered = np.ones(len(positions), dtype=bool)
    for side in SIDES:
        arm = unit(bone(positions, roles, f"{side}_shoulder", f"{side}_elbow"))
        lowered &= np.sum(arm * back, axis=1) < _LOWERED
    usual = np.median(lengths[lowered] if lowered.any() else lengths)
    chest = shoulders - np.maximum(lengths - usual, 0.0)[:, None] * back
    places = {"pelvis": hips, "chest": chest}
    for side in SIDES:
        outward = centres[f"{side}_shoulder"] - shoulders
        places[f"{side}_collar"] = chest + _COLLAR * outward
    return places


def _skeleton(
    markers: Markers, places: Mapping[str, Array], head_axes: Array | None
) -> SkeletonMotion:
    """Return a skeleton with these joints, rotated so that bones and knees are as they are seen."""
    parents = _parents(places)
    names = tuple(parents)
    numbers = {name: number for number, name in enumerate(names)}
    positions = np.stack([places[name] for name in names], axis=1)
    rotations = _rotations(positions, numbers, head_axes)
    local, steps = rotations.copy(), positions.copy()
    above = np.array([numbers.get(parent, -1) for parent in parents.values()])
    for joint, parent in enumerate(above):
        if parent >= 0:
            back = transpose(rotations[:, parent])
            local[:, joint] = back @ rotations[:, joint]
            apart = positions[:, joint] - positions[:, parent]
            steps[:, joint] = (back @ apart[..., None])[..., 0]
    offsets = np.median(steps, axis=0)
    offsets[0] = 0.0
    return SkeletonMotion(
        names,
        above,
        offsets,
        local,
        steps,
        markers.frames_per_second,
        markers.name,
        markers.unit,
        has_rest_pose=False,
    )


def _parents(places: Mapping[str, Array]) -> dict[str, str]:
    """Return the parents of joints, parents first."""
    parents = {"pelvis": "", "chest": "pelvis"}
    for limb in LIMBS:
        side, part = limb[0].split("_")
        chain = ("pelvis", *limb) if part == "hip" else ("chest", f"{side}_collar", *limb)
        parents |= {lower: upper for upper, lower in pairwise(chain)}
    optional = {f"{side}_toes": f"{side}_ankle" for side in SIDES} | {"head": "chest"}
    return parents | {name: above for name, above in optional.items() if name in places}


def _rotations(positions: Array, joints: Mapping[str, int], head_axes: Array | None) -> Array:
    """Return rotations in space, (n_frames, J, 3, 3), from a T-pose with x left and y up."""
    left, up, ahead = np.eye(3)
    rotations = np.empty((*positions.shape, 3))
    rotations[:, joints["pelvis"]] = pelvis_frame(positions, joints)
    rotations[:, joints["chest"]] = _chest_frame(positions, joints)
    for limb in LIMBS:
        is_leg = limb[0].endswith("hip")
        outward = left if limb[0].startswith("left") else -left
        # Straight arms to the sides bend forward in their elbows.
        direction, hinge = (-up, left) if is_leg else (outward, np.cross(outward, ahead))
        above = rotations[:, joints["pelvis" if is_leg else "chest"]]
        if not is_leg:
            collar = limb[0].split("_")[0] + "_collar"
            raised = unit(bone(positions, joints, collar, limb[0]))
            above = turned_towards(above, outward, raised)
            rotations[:, joints[collar]] = above
        rotations = _rotate_limb(rotations, positions, joints, limb, (direction, hinge), above)
    for side in SIDES:
        ankle, toes = f"{side}_ankle", f"{side}_toes"
        shank = rotations[:, joints[f"{side}_knee"]]
        rotations[:, joints[ankle]] = shank
        if toes in joints:
            foot = unit(bone(positions, joints, ankle, toes))
            turned = frame(foot, shank @ left) @ frame(ahead, left).T
            rotations[:, [joints[ankle], joints[toes]]] = turned[:, None]
    if "head" in joints:
        chest = rotations[:, joints["chest"]]
        raised = unit(positions[:, joints["head"]] - middle(positions, joints, "shoulder"))
        head_rotations = turned_towards(chest, up, raised)
        if head_axes is not None:
            head_rotations = head_axes @ frame(left, ahead).T
        rotations[:, joints["head"]] = head_rotations
    return rotations


def _chest_frame(positions: Array, joints: Mapping[str, int]) -> Array:
    """Return the axes of the chest, which one shrugged shoulder does not tilt.

    If the shoulders are lifted on average, one of them may be shrugged. As far as that explains the
    tilt of their line, the chest continues the line of the hips along an evenly bent spine.
    """
    up = unit(trunk(positions, joints))
    shoulders, hips = (
        bone(positions, joints, f"right_{part}", f"left_{part}") for part in ("shoulder", "hip")
    )
    width = np.linalg.norm(shoulders, axis=1)
    beside_spine = np.sum(shoulders * up, axis=1) + width * np.sum(unit(hips) * up, axis=1)
    centre = middle(positions, joints, "shoulder")
    lift = np.linalg.norm(centre - positions[:, joints["chest"]], axis=1)
    shrug = np.clip(beside_spine, -2.0 * lift, 2.0 * lift)
    return frame(shoulders - shrug[:, None] * up, up)


def _rotate_limb(
    rotations: Array,
    positions: Array,
    joints: Mapping[str, int],
    limb: Sequence[str],
    rest: tuple[Array, Array],
    above: Array,
) -> Array:
    """Return rotations in which both bones of a limb turn about the axis in which it bends."""
    direction, hinge = rest
    upper, lower = (unit(bone(positions, joints, *pair)) for pair in (limb[:2], limb[1:]))
    # As if the limb had been raised without being rotated about itself.
    unbent = turned_towards(above, direction, upper) @ hinge
    axis = np.cross(upper, lower) + _UNBENT * unbent
    for joint, recorded in zip(limb[:2], (upper, lower), strict=True):
        rotations[:, joints[joint]] = frame(recorded, axis) @ frame(direction, hinge).T
    rotations[:, joints[limb[2]]] = rotations[:, joints[limb[1]]]
    return rotations
