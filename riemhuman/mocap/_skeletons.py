"""Joints of recordings and models in space: bones, directions, frames of the body's parts."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from riemhuman.arrays import Array
from riemhuman.errors import ArgumentError
from riemhuman.kernels.rotations import shortest_rotations
from riemhuman.kernels.surface import unit_vectors as unit
from riemhuman.mocap._joint_names import BONES, SIDES

# Bones shorter than this share of the skeleton's longest have no direction.
_COLLAPSED = 1e-3
# Share of the bend between trunk and thigh that is the spine's, below the line of the trunk, and
# the most of it, radians: the pelvis of a jump in the CMU database leans so.
_SPINE_SHARE, _MOST_SPINE = 0.25, np.radians(20.0)


def middle(positions: Array, joints: Mapping[str, int], part: str) -> Array:
    """Return the middle between a joint's left and right positions."""
    left, right = (joints[f"{side}_{part}"] for side in SIDES)
    return np.asarray(0.5 * (positions[..., left, :] + positions[..., right, :]))


def trunk(positions: Array, joints: Mapping[str, int]) -> Array:
    """Return the vectors from the middle of the hips to the middle of the shoulders."""
    return middle(positions, joints, "shoulder") - middle(positions, joints, "hip")


def bone(positions: Array, joints: Mapping[str, int], first: str, second: str) -> Array:
    """Return the vectors between two joints."""
    return np.asarray(positions[..., joints[second], :] - positions[..., joints[first], :])


def bones(
    positions: Array, joints: Mapping[str, int], pairs: Sequence[tuple[str, str]] = BONES
) -> Array:
    """Return the vectors between pairs of joints, and along the trunk."""
    vectors = [bone(positions, joints, *pair) for pair in pairs]
    return np.stack([*vectors, trunk(positions, joints)], axis=-2)


def body_frame(positions: Array, joints: Mapping[str, int], part: str) -> Array:
    """Return the axes of pelvis ("hip") or chest ("shoulder"): to the left, and along the trunk."""
    line = bone(positions, joints, f"right_{part}", f"left_{part}")
    return frame(line, trunk(positions, joints))


def pelvis_frame(positions: Array, joints: Mapping[str, int]) -> Array:
    """Return the axes of the pelvis, which leans less than the trunk where that bends forward."""
    axes = body_frame(positions, joints, "hip")
    left, up, ahead = np.moveaxis(axes, -1, 0)
    bends = []
    for side in SIDES:
        thigh = unit(bone(positions, joints, f"{side}_hip", f"{side}_knee"))
        bends.append(np.arctan2(np.sum(thigh * ahead, axis=-1), -np.sum(thigh * up, axis=-1)))
    # A raised thigh alone does not bend the spine.
    bend = np.clip(_SPINE_SHARE * np.minimum(*bends), 0.0, _MOST_SPINE)[..., None]
    upright = np.cos(bend) * up - np.sin(bend) * ahead
    return frame(left, upright)


def leg_length(positions: Array, joints: Mapping[str, int]) -> float:
    """Return the mean length of the legs, of bones with their median lengths over frames."""
    lengths = [np.linalg.norm(bone(positions, joints, *pair), axis=-1) for pair in BONES[:4]]
    return float(sum(np.median(length) for length in lengths)) / 2.0


def check_bones(positions: Array, joints: Mapping[str, int], names: Sequence[str]) -> None:
    """Raise an error that names the joints at the ends of a bone without a length."""
    pairs = (*BONES, ("left_hip", "right_hip"), ("left_shoulder", "right_shoulder"))
    lengths = np.median(np.linalg.norm(bones(positions, joints, pairs), axis=-1), axis=0)
    for (first, second), length in zip(pairs, lengths, strict=False):
        if not length > _COLLAPSED * lengths.max():
            upper, lower = names[joints[first]], names[joints[second]]
            raise ArgumentError(
                f"joints: {first} ({upper!r}) and {second} ({lower!r}) are in the same "
                "place; name others with joints="
            )
    if not lengths[-1] > _COLLAPSED * lengths.max():
        raise ArgumentError("joints: the shoulders are in the same place as the hips")


def has_bone(positions: Array, joints: Mapping[str, int], first: str, second: str) -> bool:
    """Return whether two joints are known, and apart."""
    if not {first, second} <= joints.keys():
        return False
    length = np.median(np.linalg.norm(bone(positions, joints, first, second), axis=-1))
    return bool(length > _COLLAPSED * leg_length(positions, joints))


def frame(first: Array, second: Array) -> Array:
    """Return rotation matrices with columns along a vector, towards another, and across both."""
    first, second = np.broadcast_arrays(unit(first), second)
    second = unit(second - np.sum(second * first, axis=-1, keepdims=True) * first)
    return np.stack([first, second, np.cross(first, second)], axis=-1)


def nearest_axis(directions: Array) -> Array:
    """Return the axis of space, or its opposite, along which directions mostly point."""
    mean = np.mean(unit(directions), axis=0)
    axis = int(np.argmax(np.abs(mean)))
    return np.asarray(np.eye(3)[axis] * (1.0 if mean[axis] >= 0.0 else -1.0))


def turned_towards(rotations: Array, rest: Array, directions: Array) -> Array:
    """Turn rotations the shortest way until they take a vector at rest to directions."""
    return shortest_rotations(rotations @ unit(rest), directions) @ rotations
