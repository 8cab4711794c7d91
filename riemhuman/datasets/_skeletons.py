"""Skeletons of recordings and body models: their joints by name, and bones in all frames."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from itertools import pairwise

import numpy as np
from numpy import ndarray
from scipy.ndimage import uniform_filter1d
from scipy.spatial.transform import Rotation

from riemhuman.bodies import BodyModel
from riemhuman.bodies.skinning import joints_to_root, usual_joint_names
from riemhuman.datasets.bvh import SkeletonMotion
from riemhuman.errors import ArgumentError
from riemhuman.kernels.surface import unit_vectors as unit
from riemhuman.representation import join_names
from riemhuman.surfaces.procrustes import make_upright

SIDES = ("left", "right")
# Names of joints in recordings, the surest first; a joint is used once, so that "foot" is the toes
# and "shoulder" the collar where there are other names for the ankle and the shoulder.
_SIDED_NAMES = {
    "hip": ("upleg", "upperleg", "thigh", "hip", "femur"),
    "knee": ("lowleg", "lowerleg", "knee", "calf", "shin", "tibia", "leg"),
    "ankle": ("ankle", "foot"),
    "toes": ("toebase", "toes", "toe", "ball", "foot"),
    "shoulder": ("upperarm", "uparm", "humerus", "shldr", "arm", "shoulder"),
    "elbow": ("forearm", "lowerarm", "lowarm", "elbow", "radius"),
    "wrist": ("wrist", "hand"),
    "collar": ("collar", "clavicle", "shoulder"),
}
_OTHER_NAMES = {"neck": ("neck",), "head": ("head",)}
_PARTS = {name for names in (*_SIDED_NAMES.values(), *_OTHER_NAMES.values()) for name in names}
_SIDE_WORDS = {"left": "left", "l": "left", "right": "right", "r": "right"}
LIMBS = tuple(
    tuple(f"{side}_{part}" for part in parts)
    for parts in (("hip", "knee", "ankle"), ("shoulder", "elbow", "wrist"))
    for side in SIDES
)
BONES = tuple((first, second) for limb in LIMBS for first, second in pairwise(limb))
# A foot stands still below this speed, in lengths of the leg a second (some 12 cm a second) …
_STILL = 0.15
# … averaged over so many seconds, against noise.
_SMOOTHED = 0.1
# Still feet so near to the floor in the recording stand on it, and their joints are at most so high
# above its lowest point, in lengths of the leg (some 3 and 12 cm).
_NEAR_FLOOR, _FOOT = 0.04, 0.15
# The rest pose is upright along an axis if shoulders are above feet in it by this cosine.
_UPRIGHT = 0.8
# A knee or elbow shows its axis where it bends by more than this, degrees.
BENT = 15.0
_MOST_NAMES = 40


def find_joints(
    names: Sequence[str], parents: ndarray, table: Mapping[str, str] | None = None
) -> dict[str, int]:
    """Return the numbers of a skeleton's joints by their names in the open model."""
    found: dict[str, int] = {}
    for role, name in (table or {}).items():
        if name not in names:
            known = join_names(names, _MOST_NAMES)
            raise ArgumentError(f"joints[{role!r}] must be one of {known}; found {name!r}")
        found[role] = list(names).index(name)
    branches = [joints_to_root(parents, joint) for joint in range(len(names))]
    read = [_read_name(name) for name in names]
    sides = [(f"{side}_", side, _SIDED_NAMES) for side in SIDES] + [("", "", _OTHER_NAMES)]
    for prefix, side, parts in sides:
        for part, spellings in parts.items():
            candidates = [
                (spellings.index(name), len(branches[joint]), joint)
                for joint, (own_side, name) in enumerate(read)
                if own_side == side and name in spellings and joint not in found.values()
            ]
            if candidates and prefix + part not in found:
                found[prefix + part] = min(candidates)[2]
    for side in SIDES:
        # Hands and toes may have other names, or be end sites.
        for role, above in ((f"{side}_wrist", f"{side}_elbow"), (f"{side}_toes", f"{side}_ankle")):
            below = np.flatnonzero(np.asarray(parents) == found.get(above, -2))
            if role not in found and len(below):
                found[role] = int(below[0])
    missing = [role for limb in LIMBS for role in limb if role not in found]
    if missing:
        raise ArgumentError(
            f"joints must name {', '.join(missing)}, such as {{{missing[0]!r}: ...}}; the skeleton "
            f"has {join_names(names, _MOST_NAMES)}"
        )
    for first, second in BONES:
        if found[first] not in branches[found[second]][1:]:
            upper, lower = names[found[first]], names[found[second]]
            raise ArgumentError(
                f"joints: {second} must be below {first}; found {lower!r}, which is not below "
                f"{upper!r}"
            )
    for role, part in (("pelvis", "hip"), ("chest", "shoulder")):
        left, right = (branches[found[f"{side}_{part}"]][1:] for side in SIDES)
        found[role] = next((joint for joint in left if joint in right), -1)
    if found["pelvis"] not in branches[found["chest"]]:
        raise ArgumentError("joints: the shoulders must be above the hips in one tree of joints")
    return found


def _read_name(name: str) -> tuple[str, str]:
    """Return the side and the part that the name of a joint says, or empty texts."""
    name = name.rpartition(":")[2]  # before the colon is the name of the person
    words = [word.lower() for word in re.findall(r"[A-Z]+(?![a-z])|[A-Z]?[a-z]+", name)]
    side = "".join(_SIDE_WORDS.get(word, "") for word in words)
    words = [word for word in words if word not in _SIDE_WORDS]
    # Other words before, such as the name of the person, do not matter; words after do.
    texts = ["".join(words[first:]) for first in range(len(words))]
    for text in texts:
        if text in _PARTS:
            return side, text
        for word, own in _SIDE_WORDS.items():
            if not side and text.removeprefix(word) in _PARTS:
                return own, text.removeprefix(word)
    return side, ""


def model_joints(model: BodyModel) -> dict[str, int]:
    """Return the numbers of a model's joints; those of SMPL need no names."""
    return find_joints(usual_joint_names(model), model.parents)


class Skeleton:
    """Joints of a recording or a model in the rest pose."""

    def __init__(self, parents: ndarray, rest: ndarray, joints: dict[str, int]) -> None:
        self.parents, self.rest, self.joints = parents, rest, joints
        self.leg = sum(np.linalg.norm(self.bone(*bone)) for bone in BONES[:4]) / 2.0
        across = self.bone("right_hip", "left_hip")
        self.frame = frame(self.middle(rest, "shoulder") - self.middle(rest, "hip"), across)

    def bone(self, first: str, second: str) -> ndarray:
        """Return the vector between two joints in the rest pose."""
        bone: ndarray = self.rest[self.joints[second]] - self.rest[self.joints[first]]
        if not np.linalg.norm(bone) > 0.0:
            raise ArgumentError(f"joints: {first} and {second} lie in one place in the rest pose")
        return bone

    def bones(self, positions: ndarray, pairs: Sequence[tuple[str, str]] = BONES) -> ndarray:
        """Return the vectors between pairs of joints, and along the trunk."""
        starts, ends = ([self.joints[pair[k]] for pair in pairs] for k in (0, 1))
        trunk = self.middle(positions, "shoulder") - self.middle(positions, "hip")
        bones = positions[..., ends, :] - positions[..., starts, :]
        return np.concatenate([bones, trunk[..., None, :]], axis=-2)

    def middle(self, positions: ndarray, part: str) -> ndarray:
        """Return the middle between a joint's left and right positions."""
        left, right = (self.joints[f"{side}_{part}"] for side in SIDES)
        return np.asarray(0.5 * (positions[..., left, :] + positions[..., right, :]))


class RecordedSkeleton(Skeleton):
    """A recorded skeleton in its rest pose and in space, y up."""

    def __init__(
        self, recording: SkeletonMotion, table: Mapping[str, str] | None, up: str | None
    ) -> None:
        parents = recording.parents
        # Some files have positions of all joints in place of offsets.
        rest = np.median(recording.translations, axis=0)
        rest[parents < 0] = 0.0
        for joint, parent in enumerate(parents):
            if parent >= 0:
                rest[joint] += rest[parent]
        super().__init__(parents, rest, find_joints(recording.joint_names, parents, table))
        self.rotations, self.positions = recording.global_rotations, recording.positions
        upright = make_upright(np.eye(3), up=up or self._upward()).T
        self.rotations, self.positions = upright @ self.rotations, self.positions @ upright.T
        self.hips = self.middle(self.positions, "hip")
        self.trunk = self.middle(self.positions, "shoulder") - self.hips
        self.frames_per_second = recording.frames_per_second
        self.ankles = [self.joints[f"{side}_ankle"] for side in SIDES]
        self.balls = [
            self.joints.get(f"{side}_toes", self.joints[f"{side}_ankle"]) for side in SIDES
        ]
        # Whether the ball of each foot, and the whole foot, stand still, shapes (n_frames, 2).
        self.still = self._still_frames(self.balls)
        self.grounded = self.still & self._near_floor()
        self.flat = self.grounded & self._still_frames(self.ankles)

    def _upward(self) -> str:
        """Return the axis along which people stand in the recording."""
        recorded, resting = (
            unit(self.middle(places, "shoulder") - self.middle(places, "ankle")).reshape(-1, 3)
            for places in (self.positions, self.rest)
        )
        upward, at_rest = recorded.mean(axis=0), resting[0]
        if np.abs(at_rest).max() < _UPRIGHT:
            return "z" if upward[2] > abs(upward[1]) else "y"
        # Where the rest pose stands along another axis, either people lie in the recording, or it
        # was converted. The floor is at height 0 in most recordings.
        floors = {}
        for direction in (upward, at_rest):
            number = int(np.abs(direction).argmax())
            sign = float(np.sign(direction[number]))
            lowest = np.percentile((sign * self.positions[..., number]).min(axis=1), 1.0)
            floors["-" * (sign < 0) + "xyz"[number]] = max(abs(lowest), _FOOT * self.leg)
        return min(floors, key=lambda axis: (floors[axis], axis not in ("y", "z")))

    def _near_floor(self) -> ndarray:
        """Return whether each foot is as low as where it stands, and near the lowest joint."""
        heights = self.positions[:, self.balls, 1]
        known = heights[self.still] if self.still.any() else heights
        lowest = np.percentile(self.positions[..., 1].min(axis=1), 1.0)
        floor = min(np.percentile(known, 10.0), lowest + _FOOT * self.leg)
        return np.asarray(heights < floor + _NEAR_FLOOR * self.leg)

    def direction(self, first: str, second: str) -> ndarray:
        """Return the directions between two joints in all frames."""
        first_joint, second_joint = self.joints[first], self.joints[second]
        return unit(self.positions[:, second_joint] - self.positions[:, first_joint])

    def _still_frames(self, joints: list[int]) -> ndarray:
        paths = self.positions[:, joints]
        if len(paths) < 2:
            return np.ones(paths.shape[:2], dtype=bool)
        width = max(1, round(_SMOOTHED * self.frames_per_second))
        steps = np.gradient(uniform_filter1d(paths, width, axis=0, mode="nearest"), axis=0)
        speeds = np.linalg.norm(steps, axis=-1) * self.frames_per_second
        return np.asarray(speeds < _STILL * self.leg)

    def hinge(self, upper: str, lower: str, end: str) -> ndarray | None:
        """Return the axis in which a knee or elbow bends, in the axes of the bone above it."""
        axes = np.cross(self.direction(upper, lower), self.direction(lower, end))
        bent = np.linalg.norm(axes, axis=1)
        local = np.einsum("nji,nj->ni", self.rotations[:, self.joints[upper]], axes)
        # Squares weight the frames in which the joint bends most.
        mean = np.sum(bent[:, None] * local, axis=0)
        if bent.max() < np.sin(np.radians(BENT)) or not mean @ mean > 0.25 * np.sum(bent**2) ** 2:
            return None
        return unit(mean)


def frame(first: ndarray, second: ndarray) -> ndarray:
    """Return rotation matrices with columns along a vector, towards another, and across both."""
    first, second = np.broadcast_arrays(unit(first), second)
    second = unit(second - np.sum(second * first, axis=-1, keepdims=True) * first)
    return np.stack([first, second, np.cross(first, second)], axis=-1)


def shortest(start: ndarray, end: ndarray) -> ndarray:
    """Return the shortest rotations between unit vectors, shape (..., 3, 3)."""
    start, end = np.broadcast_arrays(start, end)
    # Between opposite vectors it is half a turn about any axis across them.
    across = np.cross(start, end) + 1e-14 * np.cross(start, [0.36, 0.48, 0.8])
    cosines = np.sum(start * end, axis=-1, keepdims=True)
    quaternions = np.concatenate([across, 1.0 + cosines], axis=-1)
    rotations = Rotation.from_quat(quaternions.reshape(-1, 4)).as_matrix()
    return rotations.reshape(*start.shape, 3)
