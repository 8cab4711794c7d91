"""Centres of joints from markers: by recipes, regressions of the pelvis, and breadths of joints.

Gaps are filled or cut away. Of a body of which only legs are marked, the rest stands still.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from riemhuman.arrays import Array, Booleans
from riemhuman.bodies.skinning import LIMBS
from riemhuman.errors import ArgumentError, FileFormatError, shown, warn
from riemhuman.kernels.surface import unit_vectors as unit
from riemhuman.mocap._joint_names import BONES, SIDES
from riemhuman.mocap._marker_sets import CORNERS, NEEDED, MarkerNames, Recipe, Way, first_word
from riemhuman.mocap._skeletons import frame, nearest_axis
from riemhuman.mocap._text_lines import LARGEST
from riemhuman.representation import join_names

_LEGS = NEEDED[:6]
_TOES = ("left_toes", "right_toes")
_ROLES = (*NEEDED, *_TOES, "head", *CORNERS)
# Longest gaps that are filled: seconds, and frames where those are fewer.
_LONGEST_GAP, _FRAMES_OF_GAP = 0.2, 3
# The least part of a recording between longer gaps that is used, seconds, and frames.
_SHORTEST_PART, _FEWEST_FRAMES = 0.25, 5
# Joints of arms are left out if the recording is this much longer without them.
_LONGER = 2.0
# A recipe is used if it covers this share of the frames that another recipe covers.
_COVERED = 0.95
# Centres of hips behind, beside and below the middle between the front corners of the pelvis, as
# shares of its depth, width and width, and metres (Harrington, Zavatsky, Lawson, Yuan and
# Theologis, Journal of Biomechanics 40, 2007), and a usual width, for files in an unknown unit.
_HARRINGTON_SHARES = (0.24, 0.33, 0.30)
_HARRINGTON_METRES = (0.0099, 0.0073, 0.0109)
_USUAL_WIDTH = 0.24
# Distances of joints from markers beside them, lengths of the leg: half the breadth of the joint
# in adults, and the radius of a marker.
_BREADTHS = {"hip": 0.09, "knee": 0.067, "ankle": 0.051, "elbow": 0.050, "wrist": 0.0}
# Shoulders below the acromions, as a share of the distance between those (Rab, Petuskey and
# Bagley, Gait & Posture 15, 2002).
_BELOW_ACROMION = 0.17
# Weight of the line across the body beside the sine of a knee or elbow that shows its own axis.
_ACROSS = 0.3
# A person who stands with lowered arms, lengths of the leg: the trunk, half the breadth of the
# shoulders, upper arms and forearms; and how far arms are held from the body.
_TRUNK, _HALF_SHOULDERS, _UPPER_ARM, _FOREARM, _ASIDE = 0.60, 0.21, 0.34, 0.30, 0.15
_MOST_NAMES = 80


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


def without_unseen(positions: Array) -> Array:
    """Return positions with NaN where a marker was not seen.

    Programs then write zeros or nothing, and some write huge numbers.
    """
    unseen = ~(np.abs(positions) <= LARGEST).all(axis=-1)
    unseen |= (positions == 0.0).all(axis=-1)
    return np.where(unseen[..., None], np.nan, positions)


def find_centres(
    markers: Markers, joints: Mapping[str, str | Sequence[str]]
) -> tuple[dict[str, Array], Array | None]:
    """Return the centres of joints in the frames in which there are all, and axes of the head."""
    assigned = _assigned_markers(markers, joints)
    numbers = _markers_of_one_person(markers, assigned)
    centres, on_skin = _centres(markers, numbers, assigned)
    missing = [role for role in _LEGS if role not in centres]
    if missing:
        raise FileFormatError(_missing_message(markers, centres, missing))
    head_axes = None
    if "head" not in assigned:
        head, head_axes = _head(markers, numbers)
        centres |= head
    centres, frames = _without_gaps(markers, centres)
    if on_skin:
        warn(
            f"{markers.name}: {', '.join(on_skin)} are placed by single markers on the skin and "
            "usual breadths of joints, a centimetre or two from the centres",
            UserWarning,
        )
    absent = [role for role in NEEDED if role not in centres]
    if absent:
        what = "the trunk and the arms" if len(absent) == 6 else ", ".join(absent)
        warn(
            f"{markers.name}: no markers tell where {what} are; the body holds them as someone who "
            "stands with lowered arms",
            UserWarning,
        )
        centres |= _standing_parts(centres, absent)
    return centres, None if head_axes is None else head_axes[frames]


def _missing_message(markers: Markers, centres: Mapping[str, Array], missing: list[str]) -> str:
    lacks = ", ".join(missing)
    if len(missing) == len(_LEGS) and centres.keys() & set(NEEDED):
        lacks = "the legs, without which no body is performed"
    return (
        f"{markers.file} has no markers that give the centre of {lacks}; its markers are "
        f"{join_names(markers.names, _MOST_NAMES)}. Name one, or two whose midpoint it is: "
        f"joints={{{missing[0]!r}: ...}}, on the command line --joints FILE"
    )


def _assigned_markers(
    markers: Markers, joints: Mapping[str, str | Sequence[str]]
) -> dict[str, tuple[int, ...]]:
    """Return the numbers of the markers that the user assigned to joints and corners."""
    assigned = {}
    for role, value in joints.items():
        if role not in _ROLES:
            raise ArgumentError(
                f"joints must name some of {', '.join(_ROLES)}; found {shown(role)}"
            )
        names = (value,) if isinstance(value, str) else tuple(value)
        for name in names:
            if name not in markers.names:
                listed = join_names(markers.names, _MOST_NAMES)
                raise ArgumentError(
                    f"joints[{role!r}] must be one of {listed}; found {shown(name)}"
                )
        assigned[role] = tuple(markers.names.index(name) for name in names)
    return assigned


def _markers_of_one_person(markers: Markers, assigned: Mapping[str, tuple[int, ...]]) -> list[int]:
    """Return the numbers of the markers of one person: names may begin with "Anna:" or "Anna_"."""
    has_colons = any(":" in name for name in markers.names)
    people = [name.rpartition(":")[0] if has_colons else first_word(name) for name in markers.names]
    groups: dict[str, list[int]] = {}
    for number, person in enumerate(people):
        groups.setdefault(person, []).append(number)
    whole = [
        person
        for person, numbers in groups.items()
        if set(_LEGS) <= _centres(markers, numbers, assigned)[0].keys()
    ]
    # Of a single person, other words may begin names of other parts.
    if not whole or (len(whole) == 1 and not has_colons):
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
    """Return the centres of joints over time, and those that one marker on the skin places."""
    names = MarkerNames([markers.names[number] for number in chosen_markers])
    positions = markers.positions[:, chosen_markers]
    centres: dict[str, Array] = {}
    ways: dict[str, Way] = {}
    for role in (*NEEDED, *_TOES):
        recipe = None if role in assigned else _best(positions, names.recipes(role))
        if recipe is not None:
            centres[role] = _mean(positions, recipe.markers)
            ways[role] = recipe.way
    corners = {name: positions[:, number] for name, number in names.corners().items()}
    for role, numbers in assigned.items():
        path = _mean(markers.positions, numbers)
        if not np.isnan(path).any(axis=-1).all():
            (corners if role in CORNERS else centres)[role] = path
            ways[role] = Way.CENTRE
    if not all(ways.get(f"{side}_hip") is Way.CENTRE for side in SIDES):
        hips = _hips_of_pelvis(corners, markers.unit)
        centres |= hips
        ways |= dict.fromkeys(hips, Way.CENTRE)
    on_skin = [role for role, way in ways.items() if way in (Way.LATERAL, Way.ABOVE)]
    return _moved_inward(centres, ways), on_skin


def _mean(positions: Array, numbers: Sequence[int]) -> Array:
    return np.asarray(positions[:, list(numbers)].mean(axis=1))


def _is_seen(path: Array) -> Booleans:
    return np.asarray(np.isfinite(path).all(axis=-1))


def _best(positions: Array, recipes: Sequence[Recipe]) -> Recipe | None:
    """Return the first recipe whose markers were seen about as often as those of any other."""
    shares = [float(_is_seen(_mean(positions, recipe.markers)).mean()) for recipe in recipes]
    for recipe, share in zip(recipes, shares, strict=True):
        if share > 0.0 and share >= _COVERED * max(shares):
            return recipe
    return None


def _hips_of_pelvis(corners: Mapping[str, Array], unit_name: str | None) -> dict[str, Array]:
    """Return the centres of the hips, estimated from the corners of the pelvis."""
    if not {"left_asis", "right_asis"} <= corners.keys():
        return {}
    left, right = corners["left_asis"], corners["right_asis"]
    if {"left_psis", "right_psis"} <= corners.keys():
        back = 0.5 * (corners["left_psis"] + corners["right_psis"])
    elif "sacrum" in corners:
        back = corners["sacrum"]
    else:
        return {}
    front = 0.5 * (left + right)
    depth = np.linalg.norm(front - back, axis=1, keepdims=True)
    width = np.linalg.norm(left - right, axis=1, keepdims=True)
    metre = width / _USUAL_WIDTH if unit_name is None else 1.0
    across, ahead, down = np.moveaxis(frame(left - right, front - back), -1, 0)
    behind, beside, below = (
        share * size + metres * metre
        for share, metres, size in zip(
            _HARRINGTON_SHARES, _HARRINGTON_METRES, (depth, width, width), strict=True
        )
    )
    middle_of_hips = front - behind * ahead + below * down
    hips = {
        "left_hip": middle_of_hips + beside * across,
        "right_hip": middle_of_hips - beside * across,
    }
    if any(not _is_seen(path).any() for path in hips.values()):
        return {}
    return hips


def _leg_length(centres: Mapping[str, Array]) -> float:
    """Return the mean length of the legs, of bones with their median lengths."""
    lengths = [np.linalg.norm(centres[b] - centres[a], axis=1) for a, b in BONES[:4]]
    return float(sum(np.nanmedian(length) for length in lengths)) / 2.0


def _moved_inward(centres: Mapping[str, Array], ways: Mapping[str, Way]) -> dict[str, Array]:
    """Return the centres, those at markers on the skin moved into the body."""
    moved = dict(centres)
    if not set(_LEGS) <= centres.keys():
        return moved
    leg = _leg_length(centres)
    across = unit(centres["left_hip"] - centres["right_hip"])
    for limb in LIMBS:
        if not set(limb) <= centres.keys():
            continue
        outward = across if limb[0].startswith("left") else -across
        hinge = _outward_hinge([centres[role] for role in limb], outward)
        for role in limb:
            if ways.get(role) is Way.LATERAL:
                breadth = _BREADTHS[role.split("_")[1]]
                direction = outward if role.endswith("hip") else hinge
                moved[role] = centres[role] - breadth * leg * direction
    acromions = [f"{side}_shoulder" for side in SIDES]
    if all(ways.get(role) is Way.ABOVE for role in acromions):
        left, right = (centres[role] for role in acromions)
        hips = 0.5 * (moved["left_hip"] + moved["right_hip"])
        down = unit(hips - 0.5 * (left + right))
        width = np.nanmedian(np.linalg.norm(left - right, axis=1))
        for role in acromions:
            moved[role] = centres[role] + _BELOW_ACROMION * width * down
    return moved


def _outward_hinge(limb: Sequence[Array], outward: Array) -> Array:
    """Return the axis of a knee or elbow, away from the middle of the body.

    A bent joint shows its axis, a straight one has that of the line across the body.
    """
    upper, lower = unit(limb[1] - limb[0]), unit(limb[2] - limb[1])
    normal = np.cross(upper, lower)
    sign = np.sign(np.sum(normal * outward, axis=1, keepdims=True))
    axis = sign * normal + _ACROSS * outward
    return np.asarray(unit(axis - np.sum(axis * lower, axis=1, keepdims=True) * lower))


def _head(markers: Markers, numbers: Sequence[int]) -> tuple[dict[str, Array], Array | None]:
    """Return the centre of the head by its name and, from three or more markers, its axes."""
    names = MarkerNames([markers.names[number] for number in numbers])
    paths = {}
    for name, number in names.head().items():
        path = _filled(markers.positions[:, numbers[number]], markers.frames_per_second)
        if path is not None:
            paths[name] = path
    if {"left_ear", "right_ear", "nose"} <= paths.keys():
        centre = 0.5 * (paths["left_ear"] + paths["right_ear"])
        axes = frame(paths["left_ear"] - paths["right_ear"], paths["nose"] - centre)
    elif {f"{side}_head_{part}" for side in SIDES for part in ("front", "back")} <= paths.keys():
        foremost = 0.5 * (paths["left_head_front"] + paths["right_head_front"])
        hindmost = 0.5 * (paths["left_head_back"] + paths["right_head_back"])
        centre = 0.5 * (foremost + hindmost)
        axes = frame(paths["left_head_front"] - paths["right_head_front"], foremost - hindmost)
    else:
        return {"head": paths["head"]} if "head" in paths else {}, None
    return {"head": centre}, axes


def _filled(path: Array, rate: float) -> Array | None:
    """Return a path (n_frames, 3) with its gaps interpolated, or None if one is too long.

    Frames before the first and after the last that were seen repeat those.
    """
    seen_frames = np.flatnonzero(_is_seen(path))
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
    seen_frames = np.flatnonzero(_is_seen(path))
    return int(np.diff(seen_frames).max(initial=1)) - 1


def _longest_part(centres: Mapping[str, Array], rate: float) -> slice[int, int, None]:
    """Return the frames of the longest part in which no gap of a joint is too long."""
    n_frames = len(next(iter(centres.values())))
    usable = np.ones(n_frames, dtype=bool)
    for path in centres.values():
        seen = np.flatnonzero(_is_seen(path))
        if not len(seen):
            return slice(0, 0)
        usable[: seen[0]] = usable[seen[-1] + 1 :] = False
        for gap in np.flatnonzero(np.diff(seen) > _most_frames(rate) + 1):
            usable[seen[gap] + 1 : seen[gap + 1]] = False
    edges = np.flatnonzero(np.diff(np.concatenate([[0], usable.astype(np.int8), [0]])))
    if not len(edges):
        return slice(0, 0)
    starts, ends = edges[::2], edges[1::2]
    longest = int(np.argmax(ends - starts))
    return slice(int(starts[longest]), int(ends[longest]))


def _without_gaps(
    markers: Markers, centres: Mapping[str, Array]
) -> tuple[dict[str, Array], slice[int, int, None]]:
    """Return centres without gaps, and the frames of the longest part with all joints."""
    rate = markers.frames_per_second
    needed = {role: path for role, path in centres.items() if role in NEEDED}
    legs = {role: path for role, path in needed.items() if role in _LEGS}
    frames, of_legs = _longest_part(needed, rate), _longest_part(legs, rate)
    remarks: list[str] = []
    if of_legs.stop - of_legs.start > _LONGER * (frames.stop - frames.start):
        for role in needed.keys() - legs.keys():
            part = _longest_part({**legs, role: needed[role]}, rate)
            if part.stop - part.start < (of_legs.stop - of_legs.start) / _LONGER:
                del needed[role]
                remarks.append(f"{role} was left out")
        frames = _longest_part(needed, rate)
    n_frames = frames.stop - frames.start
    total = len(markers.positions)
    if n_frames < min(total, max(_FEWEST_FRAMES, _SHORTEST_PART * rate)):
        lost = {role: float(1.0 - _is_seen(path).mean()) for role, path in needed.items()}
        worst = sorted(lost, key=lambda role: -lost[role])[:3]
        listed = ", ".join(f"{role} in {100.0 * lost[role]:.0f} %" for role in worst)
        raise FileFormatError(
            f"{markers.file}: in no {_SHORTEST_PART:g} s were the markers of all needed joints "
            f"seen: they miss {listed} of the frames. Name other markers: joints="
        )
    if n_frames < total:
        remarks.insert(
            0, f"only frames {frames.start + 1} to {frames.stop} of {total} have all joints"
        )
    filled: dict[str, Array] = {}
    for role, whole in centres.items():
        if role in NEEDED and role not in needed:
            continue
        path = whole[frames]
        filled_path = _filled(path, rate)
        if filled_path is None:
            remarks.append(f"{role} was left out")
            continue
        filled[role] = filled_path
        if gap := _longest_gap(path):
            remarks.append(f"{role} up to {gap}")
    if remarks:
        warn(
            f"{markers.name}: markers are missing and were interpolated, frames: "
            f"{', '.join(remarks)}",
            UserWarning,
        )
    return filled, frames


def _standing_parts(centres: Mapping[str, Array], absent: Sequence[str]) -> dict[str, Array]:
    """Return where joints of the upper body are of someone who stands with lowered arms."""
    hips, ankles = (
        0.5 * (centres[f"left_{part}"] + centres[f"right_{part}"]) for part in ("hip", "ankle")
    )
    up = nearest_axis(hips - ankles)
    leg = _leg_length(centres)
    line = centres["left_hip"] - centres["right_hip"]
    across = unit(line - (line @ up)[:, None] * up)
    places: dict[str, Array] = dict(centres)
    for side, sign in (("left", 1.0), ("right", -1.0)):
        outward = sign * across
        lowered = unit(_ASIDE * outward - up)
        shoulder, elbow, wrist = (f"{side}_{part}" for part in ("shoulder", "elbow", "wrist"))
        if shoulder in absent:
            places[shoulder] = hips + leg * (_TRUNK * up + _HALF_SHOULDERS * outward)
        if elbow in absent:
            places[elbow] = places[shoulder] + _UPPER_ARM * leg * lowered
        if wrist in absent:
            ahead = np.cross(across, up)
            forearm = unit(places[elbow] - places[shoulder]) + 0.2 * ahead
            places[wrist] = places[elbow] + _FOREARM * leg * unit(forearm)
    return {role: places[role] for role in absent}
