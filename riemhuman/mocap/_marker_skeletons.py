"""Skeletons with joints at centres found from markers: gaps, the tree, and rotations."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from riemhuman.arrays import Array
from riemhuman.bodies.skinning import LIMBS
from riemhuman.errors import ArgumentError, ArgumentTypeError, FileFormatError, shown, warn
from riemhuman.kernels.rotations import transpose
from riemhuman.kernels.surface import unit_vectors as unit
from riemhuman.mocap._joint_names import SIDES
from riemhuman.mocap._marker_names import NEEDED, MarkerNames, Recipe
from riemhuman.mocap._skeletons import (
    bone,
    frame,
    middle,
    pelvis_frame,
    trunk,
    turned_towards,
)
from riemhuman.mocap.skeleton_motion import SkeletonMotion
from riemhuman.representation import join_names

# Longest gaps that are filled: seconds, and frames where those are fewer.
_LONGEST_GAP, _FRAMES_OF_GAP = 0.2, 3
# A recipe is used if it covers this share of the frames that another recipe covers.
_COVERED = 0.95
# Centres of hips behind, beside and below the front corners of the pelvis, as shares of the
# distance between those (Bell, Pedersen and Brand 1990).
_HIP_BEHIND = 0.22
_HIP_INSIDE = 0.14
_HIP_BELOW = 0.30
# Weight of the axis of an unbent knee or elbow beside the sine of its angle.
_UNBENT = 0.1
# An arm is lowered if the cosine of its angle to the trunk's upward direction is below this.
_LOWERED = 0.0
# Where collars begin, as a share of the way from the middle of the chest to the shoulder.
_COLLAR = 0.13
_MOST_NAMES = 80
_OPTIONAL = ("left_toes", "right_toes", "head")


@dataclass(frozen=True, eq=False)
class Markers:
    """Markers over time: positions (n_frames, M, 3), NaN where one was not seen.

    `unit` is that of the positions, "metres" or None where it is not known; `file` is for messages.
    """

    file: str
    names: tuple[str, ...]
    positions: Array
    frames_per_second: float
    name: str
    unit: str | None


def skeleton_of(
    markers: Markers, joints: Mapping[str, str | Sequence[str]] | None = None
) -> SkeletonMotion:
    """Return the skeleton with joints located by markers, and rotations that show bends."""
    assigned = _assigned_markers(markers, joints or {})
    numbers = _markers_of_one_person(markers, assigned)
    centres, on_skin = _centres(markers, numbers, assigned)
    missing = [role for role in NEEDED if role not in centres]
    if missing:
        raise FileFormatError(
            f"{markers.file} has no markers that give the centre of {', '.join(missing)}; its "
            f"markers are {join_names(markers.names, _MOST_NAMES)}. Name one, or two whose "
            f"midpoint it is: joints={{{missing[0]!r}: ...}}"
        )
    head_frames = centres.pop("head frame", None)
    centres, frames = _without_gaps(markers, centres)
    if on_skin:
        warn(
            f"{markers.name}: {', '.join(on_skin)} are placed at single markers on the skin, a "
            "few centimetres from the centres of the joints",
            UserWarning,
        )
    positions = centres | _trunk_places(centres)
    head = None if head_frames is None else head_frames[frames]
    return _skeleton(markers, positions, head)


def _assigned_markers(
    markers: Markers, joints: Mapping[str, str | Sequence[str]]
) -> dict[str, tuple[int, ...]]:
    """Return the numbers of the markers that the user assigned to joints."""
    assigned = {}
    roles = (*NEEDED, *_OPTIONAL)
    for role, value in joints.items():
        if role not in roles:
            raise ArgumentError(f"joints must name some of {', '.join(roles)}; found {shown(role)}")
        names = (value,) if isinstance(value, str) else tuple(value)
        for name in names:
            if not isinstance(name, str):
                raise ArgumentTypeError(f"joints[{role!r}] must name markers; found {shown(name)}")
            if name not in markers.names:
                listed = join_names(markers.names, _MOST_NAMES)
                raise ArgumentError(
                    f"joints[{role!r}] must be one of {listed}; found {shown(name)}"
                )
        if not names:
            raise ArgumentError(f"joints[{role!r}] must name markers; found none")
        assigned[role] = tuple(markers.names.index(name) for name in names)
    return assigned


def _markers_of_one_person(markers: Markers, assigned: Mapping[str, tuple[int, ...]]) -> list[int]:
    """Return the numbers of the markers of one person: names may begin with "Anna:"."""
    people = [name.rpartition(":")[0] for name in markers.names]
    groups: dict[str, list[int]] = {}
    for number, person in enumerate(people):
        groups.setdefault(person, []).append(number)
    whole = [
        person
        for person, numbers in groups.items()
        if set(NEEDED) <= _centres(markers, numbers, assigned)[0].keys()
    ]
    if not whole:
        return list(range(len(people)))
    people_of_assigned = {people[number] for numbers in assigned.values() for number in numbers}
    candidates = [person for person in whole if person in people_of_assigned]
    if len(whole) > 1 and not candidates:
        warn(
            f"{markers.name} holds {len(whole)} people ({join_names(whole)}); {whole[0]!r} was "
            "taken. To choose another person, name one of its markers in joints=",
            UserWarning,
        )
    return groups[(candidates or whole)[0]]


def _centres(
    markers: Markers, chosen_markers: Sequence[int], assigned: Mapping[str, tuple[int, ...]]
) -> tuple[dict[str, Array], list[str]]:
    """Return the centres of joints over time, and those that are at one marker on the skin.

    "head frame" are the axes of the head, (n_frames, 3, 3), if its markers determine them.
    """
    names = MarkerNames([markers.names[number] for number in chosen_markers])
    positions = markers.positions[:, chosen_markers]
    centres, on_skin = {}, []
    for role in (*NEEDED, "left_toes", "right_toes"):
        if role in assigned:
            continue
        recipe = _best(positions, names.recipes(role))
        if recipe is not None:
            centres[role] = _mean(positions, recipe.markers)
            if recipe.on_skin:
                on_skin.append(role)
    hips = _hips_of_pelvis(positions, names)
    if hips and not {"left_hip", "right_hip"} <= centres.keys() - set(on_skin):
        centres |= hips
        on_skin = [role for role in on_skin if role not in hips]
    centres |= _head(positions, names.head(), markers)
    for role, numbers in assigned.items():
        centres[role] = _mean(markers.positions, numbers)
        if np.isnan(centres[role]).any(axis=-1).all():
            del centres[role]
    return centres, on_skin


def _mean(positions: Array, numbers: Sequence[int]) -> Array:
    return np.asarray(positions[:, list(numbers)].mean(axis=1))


def _best(positions: Array, recipes: Sequence[Recipe]) -> Recipe | None:
    """Return the first recipe whose markers were seen about as often as those of any other."""
    shares = [
        float(np.isfinite(_mean(positions, recipe.markers)).all(axis=-1).mean())
        for recipe in recipes
    ]
    for recipe, share in zip(recipes, shares, strict=True):
        if share > 0.0 and share >= _COVERED * max(shares):
            return recipe
    return None


def _hips_of_pelvis(positions: Array, names: MarkerNames) -> dict[str, Array]:
    """Return the centres of the hips, estimated from the corners of the pelvis."""
    corners = names.pelvis()
    if corners is None:
        return {}
    left, right = positions[:, corners[0]], positions[:, corners[1]]
    back = corners[2]
    width = np.linalg.norm(left - right, axis=1, keepdims=True)
    axes = frame(left - right, 0.5 * (left + right) - _mean(positions, back))
    across, ahead, down = np.moveaxis(axes, -1, 0)
    hips = {}
    for role, corner, sign in (("left_hip", left, 1.0), ("right_hip", right, -1.0)):
        step = _HIP_BELOW * down - _HIP_BEHIND * ahead - sign * _HIP_INSIDE * across
        hips[role] = corner + width * step
    if any(np.isnan(path).any(axis=-1).all() for path in hips.values()):
        return {}
    return hips


def _head(positions: Array, head_markers: Mapping[str, int], markers: Markers) -> dict[str, Array]:
    """Return the centre of the head and, from three or more markers, its axes."""
    paths = {}
    for name, number in head_markers.items():
        path = _filled(positions[:, number], markers.frames_per_second)
        if path is not None:
            paths[name] = path
    if {"left_ear", "right_ear", "nose"} <= paths.keys():
        centre = 0.5 * (paths["left_ear"] + paths["right_ear"])
        axes = frame(paths["left_ear"] - paths["right_ear"], paths["nose"] - centre)
    elif {f"{side}_head_{part}" for side in SIDES for part in ("front", "back")} <= paths.keys():
        foremost = 0.5 * (paths["left_head_front"] + paths["right_head_front"])
        hindmost = 0.5 * (paths["left_head_back"] + paths["right_head_back"])
        centre = 0.5 * (foremost + hindmost)
        across = paths["left_head_front"] - paths["right_head_front"]
        axes = frame(across, foremost - hindmost)
    elif "head" in paths:
        return {"head": paths["head"]}
    else:
        return {}
    return {"head": centre, "head frame": axes}


def _filled(path: Array, rate: float) -> Array | None:
    """Return a path (n_frames, 3) with its gaps interpolated, or None if one is too long.

    Frames before the first and after the last that were seen repeat those.
    """
    seen_frames = np.flatnonzero(np.isfinite(path).all(axis=-1))
    if not len(seen_frames) or _longest_gap(path) > _most_frames(rate):
        return None
    frames = np.clip(np.arange(len(path)), seen_frames[0], seen_frames[-1])
    if len(seen_frames) == 1:
        return np.asarray(path[frames])
    from scipy.interpolate import CubicSpline  # takes long to import

    return np.asarray(CubicSpline(seen_frames, path[seen_frames])(frames))


def _most_frames(rate: float) -> int:
    return max(_FRAMES_OF_GAP, round(_LONGEST_GAP * rate))


def _longest_gap(path: Array) -> int:
    """Return the largest number of consecutive frames without values between frames with some."""
    seen_frames = np.flatnonzero(np.isfinite(path).all(axis=-1))
    return int(np.diff(seen_frames).max(initial=1)) - 1


def _without_gaps(
    markers: Markers, centres: Mapping[str, Array]
) -> tuple[dict[str, Array], slice[int | None, int | None, int | None]]:
    """Return centres without gaps, and the frames from the first to the last with all joints."""
    rate = markers.frames_per_second
    is_whole = np.all([np.isfinite(centres[role]).all(axis=-1) for role in NEEDED], axis=0)
    if not is_whole.any():
        raise FileFormatError(f"{markers.file}: no frame has the centres of all needed joints")
    first, last = np.flatnonzero(is_whole)[[0, -1]]
    frames = slice(int(first), int(last) + 1)
    remarks: list[str] = []
    long_gaps: list[str] = []
    filled: dict[str, Array] = {}
    for role, whole in centres.items():
        path = whole[frames]
        gap = _longest_gap(path)
        filled_path = _filled(path, rate)
        if filled_path is not None:
            filled[role] = filled_path
            if gap:
                remarks.append(f"{role} up to {gap}")
        elif role in NEEDED:
            long_gaps.append(f"{role} in {gap}")
        else:
            remarks.append(f"{role} was left out")
    if long_gaps:
        raise FileFormatError(
            f"{markers.file}: {', '.join(long_gaps)} consecutive frames without markers; at most "
            f"{_most_frames(rate)} are interpolated. Cut the recording there, or name other "
            "markers: joints="
        )
    n_frames = len(is_whole)
    if n_frames > last + 1 - first:
        remarks.insert(0, f"only frames {first + 1} to {last + 1} of {n_frames} have all joints")
    if remarks:
        warn(
            f"{markers.name}: markers are missing and were interpolated, frames: "
            f"{', '.join(remarks)}",
            UserWarning,
        )
    return filled, frames


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
    """Return rotations in space, (n_frames, J, 3, 3), from a T-pose along the axes of the file."""
    rest = _rest_axes(positions, joints)
    left, up, ahead = rest.T
    rotations = np.empty((*positions.shape, 3))
    rotations[:, joints["pelvis"]] = pelvis_frame(positions, joints) @ rest.T
    rotations[:, joints["chest"]] = _chest_frame(positions, joints) @ rest.T
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


def _rest_axes(positions: Array, joints: Mapping[str, int]) -> Array:
    """Return the directions to the left, up and ahead of the rest pose, columns of a matrix.

    The rest pose stands along the axis along which the person mostly stands.
    """
    standing = np.mean(
        unit(middle(positions, joints, "shoulder") - middle(positions, joints, "ankle")), axis=0
    )
    axis = int(np.argmax(np.abs(standing)))
    up = np.eye(3)[axis] * (1.0 if standing[axis] >= 0.0 else -1.0)
    left = np.eye(3)[(axis + 2) % 3]
    return np.stack([left, up, np.cross(left, up)], axis=-1)


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
