"""A recorded skeleton in space, y up, and when its feet stand."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from riemhuman.arrays import Array, Booleans, Integers
from riemhuman.bodies.skinning import joints_to_root
from riemhuman.kernels.surface import unit_vectors as unit
from riemhuman.mocap._joint_names import BONES, OTHER_BONES, SIDES, find_joints
from riemhuman.mocap._skeletons import (
    body_frame,
    bone,
    check_bones,
    frame,
    leg_length,
    middle,
    pelvis_frame,
    trunk,
)
from riemhuman.mocap._upward import BVH, MARKERS, chosen_axis, upward_axis
from riemhuman.mocap.skeleton_motion import SkeletonMotion, in_space
from riemhuman.surfaces.procrustes import make_upright

# A foot stands still below this speed, in leg lengths per second (about 12 cm/s) …
_STILL = 0.15
# … averaged over this many seconds to suppress noise.
_SMOOTHED = 0.1
# Still feet this near to the floor in the recording stand on it, leg lengths (about 3 cm).
_NEAR_FLOOR = 0.04
# Joints of standing feet are at most this far above the lowest point, leg lengths (about 12 cm).
_FOOT = 0.15
# If someone moves faster than this, leg lengths per second, and farther than this between two
# frames, leg lengths, the recording may have been interrupted.
_FASTEST = 8.0
_FARTHEST = 0.25
# After an interruption, a part is on another floor if its lowest joints differ by more than this
# from those of the longest part, leg lengths.
_OTHER_FLOOR = 0.4
# A toe is at least this share of the farthest joint of the foot away, and at least so many leg
# lengths; a foot in line with the shank on average, by its cosine, shows no direction.
_SHORT_FOOT, _SHORTEST_FOOT, _STRAIGHT_FOOT = 0.5, 0.06, 0.94
# Legs of an upright rest pose are straight by this cosine, those of one that stands by the second.
# Lines from hips to shoulders that lean by these degrees there lean because of where the joints
# were placed.
_STRAIGHT_LEG, _LEGS_APART = 0.985, 0.9
_LEAST_LEAN, _MOST_LEAN = 6.0, 30.0
# A shank stands on its foot if it points up by this cosine.
_BELOW_KNEE = 0.5
# Joints nearer than this are in one place, leg lengths.
_ONE_PLACE = 1e-3


@dataclass(frozen=True, eq=False)
class RecordedSkeleton:
    """A recorded skeleton in space, y up, in the unit of the recording.

    `joints` are numbers of joints by names of the open model, and `carriers` those of the joints
    that carry their bones: there may be others in between, for a twist. `rotations`
    (n_frames, J, 3, 3) are those in space; `is_valid` (n_frames,) marks frames on the floor of the
    longest part without an interruption. Of each foot (n_frames, 2), the ball is `still`, the ball
    is `grounded` on the floor, and the whole foot is `flat` on it. `upright` has the rotations by
    which the frames of pelvis and chest lean at rest, where they do. `standing_axes` are the axes
    up, to the left and ahead of a standing rest pose, in those of the file, if it has such a pose.
    """

    joints: dict[str, int]
    carriers: dict[str, int]
    rotations: Array
    positions: Array
    frames_per_second: float
    leg: float
    is_valid: Booleans
    still: Booleans
    grounded: Booleans
    flat: Booleans
    upright: dict[str, Array]
    standing_axes: Array | None

    def rotation(self, name: str) -> Array:
        """Return the rotations in space of the bone that begins at a joint, (n_frames, 3, 3)."""
        return self.rotations[:, self.carriers[name]]

    def run(self, frames: slice[int, int, None]) -> RecordedSkeleton:
        """Return consecutive frames."""
        return replace(
            self,
            rotations=self.rotations[frames],
            positions=self.positions[frames],
            is_valid=self.is_valid[frames],
            still=self.still[frames],
            grounded=self.grounded[frames],
            flat=self.flat[frames],
        )


def read_skeleton(
    recording: SkeletonMotion, joints: Mapping[str, int] | None = None, up: str | None = None
) -> RecordedSkeleton:
    """Return a recording as a skeleton that stands on a floor, y up.

    By default, joints are found by name and the axis that points up from the positions.
    """
    names = recording.joint_names
    parents = recording.parents
    rate = recording.frames_per_second
    rotations = recording.global_rotations
    positions = recording.positions
    if joints is None:
        joints = find_joints(names, parents, None, positions)
    joints = dict(joints)
    check_bones(positions, joints, names)
    leg = leg_length(positions, joints)
    for side in SIDES:
        toes = _toes(positions, parents, joints, side, leg)
        if toes is None:
            joints.pop(f"{side}_toes", None)
        else:
            joints[f"{side}_toes"] = toes
    if up is None:
        directions = _away_from_feet(positions, joints)
        at_rest, convention = None, MARKERS
        if recording.has_rest_pose:
            offsets = np.median(recording.translations, axis=0)
            at_rest = _away_from_feet(_rest_positions(offsets, parents), joints)
            convention = BVH
        axes = upward_axis(positions, directions, leg, at_rest, convention)
        up = chosen_axis(recording.name, axes)
    if up != "y":
        upright = make_upright(np.eye(3), up=up).T
        rotations, positions = upright @ rotations, positions @ upright.T
    parts = _uninterrupted_parts(recording, positions, joints, leg)
    is_valid = _is_on_one_floor(parts, positions, leg)
    ankles = [joints[f"{side}_ankle"] for side in SIDES]
    balls = [joints.get(f"{side}_toes", joints[f"{side}_ankle"]) for side in SIDES]
    ball_still = is_valid[:, None] & _is_still(positions[:, balls], rate, leg)
    ankle_still = is_valid[:, None] & _is_still(positions[:, ankles], rate, leg)
    grounded = ball_still & _is_near_floor(positions, balls, ball_still, is_valid, leg)
    flat = grounded & ankle_still & stands_on(positions, joints)
    carriers = joints | {
        upper: _carrier(positions, parents, joints[lower], leg)
        for upper, lower in (*BONES, *OTHER_BONES)
        if {upper, lower} <= joints.keys()
    }
    return RecordedSkeleton(
        *(joints, carriers, rotations, positions, rate, leg, is_valid, ball_still, grounded, flat),
        *_standing_rest(recording, joints),
    )


def _away_from_feet(positions: Array, joints: Mapping[str, int]) -> Array:
    """Return the vectors from the middle of the ankles to that of the shoulders."""
    return middle(positions, joints, "shoulder") - middle(positions, joints, "ankle")


def _rest_positions(offsets: Array, parents: Integers) -> Array:
    """Return the positions of joints in the rest pose, shape (J, 3)."""
    still = np.tile(np.eye(3), (1, len(parents), 1, 1))
    _, (positions,) = in_space(still, offsets[None], parents)
    return np.asarray(positions)


def _toes(
    positions: Array, parents: Integers, joints: Mapping[str, int], side: str, leg: float
) -> int | None:
    """Return the joint at the end of a foot, or None if none shows where the foot points.

    A joint just below the ankle is no toe: its end site is, or whichever joint of the foot is
    farthest away.
    """
    ankle = joints[f"{side}_ankle"]
    below = [joint for joint in range(len(parents)) if ankle in joints_to_root(parents, joint)[1:]]
    named = joints.get(f"{side}_toes")
    if named is not None and named not in below:
        below.append(named)
    if not below:
        return None
    feet = positions[:, below] - positions[:, [ankle]]
    lengths = np.median(np.linalg.norm(feet, axis=-1), axis=0)
    chosen = int(np.argmax(lengths))
    if named is not None and lengths[below.index(named)] > _SHORT_FOOT * lengths[chosen]:
        chosen = below.index(named)
    shank = positions[:, ankle] - positions[:, joints[f"{side}_knee"]]
    straight = np.sum(unit(feet[:, chosen]) * unit(shank), axis=-1).mean()
    if lengths[chosen] < _SHORTEST_FOOT * leg or straight > _STRAIGHT_FOOT:
        return None
    return below[chosen]


def _standing_rest(
    recording: SkeletonMotion, joints: Mapping[str, int]
) -> tuple[dict[str, Array], Array | None]:
    """Return what a standing rest pose says, if there is one.

    That is rotations that turn the frames of pelvis and chest upright, where they lean at rest with
    straight legs; and its axes up, to the left and ahead.
    """
    if not recording.has_rest_pose:
        return {}, None
    rest = _rest_positions(recording.offsets, recording.parents)
    legs = [
        unit(bone(rest, joints, f"{side}_{first}", f"{side}_{second}"))
        for side in SIDES
        for first, second in (("hip", "knee"), ("knee", "ankle"))
    ]
    up = -unit(np.mean(legs, axis=0))
    back = unit(trunk(rest, joints))
    lean = np.degrees(np.arccos(np.clip(back @ up, -1.0, 1.0)))
    straight = min(-leg @ up for leg in legs)
    if straight < _LEGS_APART or not lean < _MOST_LEAN:
        return {}, None
    hips, shoulders = (
        bone(rest, joints, f"right_{line}", f"left_{line}") for line in ("hip", "shoulder")
    )
    standing_axes = frame(up, hips)
    if straight < _STRAIGHT_LEG or lean <= _LEAST_LEAN:
        return {}, standing_axes
    pelvis, chest = pelvis_frame(rest, joints), body_frame(rest, joints, "shoulder")
    upright = {"pelvis": pelvis.T @ frame(hips, up), "chest": chest.T @ frame(shoulders, up)}
    return upright, standing_axes


def stands_on(positions: Array, joints: Mapping[str, int]) -> Booleans:
    """Return whether each foot is below its knee, as it is not if someone lies or kneels."""
    shanks = [unit(bone(positions, joints, f"{side}_ankle", f"{side}_knee")) for side in SIDES]
    return np.asarray(np.stack(shanks, axis=1)[..., 1] > _BELOW_KNEE)


def _carrier(positions: Array, parents: Integers, end: int, leg: float) -> int:
    """Return the joint that carries a bone to its end: the last one in another place."""
    above = int(parents[end])
    while np.linalg.norm(positions[:, above] - positions[:, end], axis=1).max() < _ONE_PLACE * leg:
        above = int(parents[above])
    return above


def _uninterrupted_parts(
    recording: SkeletonMotion, positions: Array, joints: Mapping[str, int], leg: float
) -> Integers:
    """Return the number of the part of each frame; parts are separated by impossible jumps."""
    hips = middle(positions, joints, "hip")
    steps = np.linalg.norm(np.diff(hips, axis=0), axis=1) / leg
    jumps = (steps * recording.frames_per_second > _FASTEST) & (steps > _FARTHEST)
    return np.concatenate([[0], np.cumsum(jumps)])


def _is_on_one_floor(parts: Integers, positions: Array, leg: float) -> Booleans:
    """Return whether frames are of parts on the floor of the longest one."""
    lowest = positions[..., 1].min(axis=1)
    numbers, counts = np.unique(parts, return_counts=True)
    floor = np.percentile(lowest[parts == numbers[np.argmax(counts)]], 5.0)
    is_valid = np.zeros(len(parts), dtype=bool)
    for number in numbers:
        is_here = parts == number
        is_near = abs(np.percentile(lowest[is_here], 5.0) - floor) < _OTHER_FLOOR * leg
        is_valid |= is_here & is_near
    return is_valid


def _is_still(paths: Array, rate: float, leg: float) -> Booleans:
    """Return whether feet stand still, shape (n_frames, 2)."""
    from scipy.ndimage import uniform_filter1d  # takes long to import

    if len(paths) < 2:
        return np.ones(paths.shape[:2], dtype=bool)
    width = max(1, round(_SMOOTHED * rate))
    steps = np.gradient(uniform_filter1d(paths, width, axis=0, mode="nearest"), axis=0)
    speeds = np.linalg.norm(steps, axis=-1) * rate
    return np.asarray(speeds < _STILL * leg)


def _is_near_floor(
    positions: Array, balls: list[int], still: Booleans, is_valid: Booleans, leg: float
) -> Booleans:
    """Return whether each foot is as low as when it stands, and near the lowest joint."""
    heights = positions[:, balls, 1]
    standing = heights[still] if still.any() else heights[is_valid]
    lowest = np.percentile(positions[is_valid, :, 1].min(axis=1), 1.0)
    floor = min(np.percentile(standing, 10.0), lowest + _FOOT * leg)
    return np.asarray(heights < floor + _NEAR_FLOOR * leg)
