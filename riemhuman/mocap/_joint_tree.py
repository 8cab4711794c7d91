"""Which joint of a skeleton is which, by the shape of its tree and the way its joints move.

Two long branches that leave one joint, alike in length, are the legs; two such branches above are
the arms. The two longest bones of a branch, one after the other, are those of the limb. Feet point
forward, and tell left from right.
"""

from __future__ import annotations

from itertools import combinations, pairwise

import numpy as np

from riemhuman.arrays import Array, Integers
from riemhuman.bodies.skinning import joints_to_root

# Lengths of the branches of a pair have at least this ratio.
_ALIKE = 0.75
# Limbs have at least this share of the length of the longest one.
_LONG = 0.45
# Of pairs of bones in a limb with similar lengths, those farther from the trunk are the limb's.
_AS_LONG = 0.85
# Joints nearer than this share of the skeleton's longest bone are in one place.
_ONE_PLACE = 0.02
_FRAMES = 200
# Skeletons of people have fewer joints, with fingers and face.
_MOST_JOINTS = 500


def joints_by_tree(parents: Integers, positions: Array) -> dict[str, int]:
    """Return the joints by their names in the open model; none if the tree is not a person's."""
    if len(parents) > _MOST_JOINTS:
        return {}
    frames = np.unique(np.linspace(0, len(positions) - 1, _FRAMES).astype(np.int64))
    positions = positions[frames]
    lengths = bone_lengths(parents, positions)
    paths = _longest_paths(parents, lengths)
    reaches = np.array([sum(lengths[joint] for joint in path) for path in paths])
    pairs = _pairs_of_branches(parents, reaches)
    if len(pairs) < 2:
        return {}
    legs, arms = pairs
    leg_joints, arm_joints = (
        [_limb(paths[first], lengths) for first in pair] for pair in (legs, arms)
    )
    if not all(leg_joints + arm_joints):
        return {}
    left = _left_directions(positions, leg_joints, arm_joints)
    joints = _sided_joints(positions, leg_joints, left, ("hip", "knee", "ankle"), below="toes")
    joints |= _sided_joints(
        positions, arm_joints, left, ("shoulder", "elbow", "wrist"), above="collar"
    )
    return joints | _neck_and_head(parents, paths, lengths, arms)


def _sided_joints(
    positions: Array,
    limbs: list[list[int]],
    left: Array,
    roles: tuple[str, str, str],
    above: str = "",
    below: str = "",
) -> dict[str, int]:
    """Return the joints of a pair of limbs by name, with those above or below that have a name."""
    first, second = (positions[:, limb[1]] for limb in limbs)
    is_left_first = np.sum((first - second) * left, axis=1).mean() >= 0.0
    joints: dict[str, int] = {}
    for side, limb in zip(("left", "right"), limbs if is_left_first else limbs[::-1], strict=True):
        for role, joint in zip((above, *roles, below), limb, strict=True):
            if role and joint >= 0:
                joints[f"{side}_{role}"] = joint
    return joints


def bone_lengths(parents: Integers, positions: Array) -> Array:
    """Return the median distance of each joint from its parent; 0 for a root."""
    lengths = np.zeros(len(parents))
    below = np.flatnonzero(parents >= 0)
    bones = positions[:, below] - positions[:, parents[below]]
    lengths[below] = np.median(np.linalg.norm(bones, axis=-1), axis=0)
    return lengths


def _longest_paths(parents: Integers, lengths: Array) -> list[list[int]]:
    """Return the joints from each one to its farthest descendant."""
    upward = [joints_to_root(parents, joint) for joint in range(len(parents))]
    from_root = np.array([sum(lengths[joint] for joint in path) for path in upward])
    is_below = np.zeros((len(parents), len(parents)), dtype=bool)
    for joint, path in enumerate(upward):
        is_below[path, joint] = True
    paths = []
    for joint, below in enumerate(is_below):
        reaches = np.where(below, from_root - from_root[joint], 0.0)
        longest = reaches.max()
        # The first of those that are as long but for rounding.
        end = int(np.argmax(reaches >= longest * (1.0 - 1e-9))) if longest > 0.0 else joint
        paths.append(upward[end][: upward[end].index(joint) + 1][::-1])
    return paths


def _pairs_of_branches(parents: Integers, reaches: Array) -> list[tuple[int, int]]:
    """Return the two pairs of long branches that are alike, those nearer to the root first."""
    candidates: list[tuple[int, int]] = []
    for joint in range(len(parents)):
        below = np.flatnonzero((parents == joint) & (reaches > 0.0)).tolist()
        ratios = {
            pair: min(reaches[list(pair)]) / max(reaches[list(pair)])
            for pair in combinations(below, 2)
        }
        paired: set[int] = set()
        for pair in sorted(ratios, key=lambda pair: -ratios[pair]):
            if ratios[pair] > _ALIKE and not paired & set(pair):
                candidates.append(pair)
                paired |= set(pair)
    size = {pair: min(reaches[list(pair)]) for pair in candidates}
    longest = max(size.values(), default=0.0)
    long = [pair for pair in candidates if size[pair] > _LONG * longest]

    def is_inside(pair: tuple[int, int], outer: tuple[int, int]) -> bool:
        return any(joint in joints_to_root(parents, pair[0]) for joint in outer)

    # A pair of hands within a pair of arms is part of the arms.
    outermost = [
        pair for pair in long if not any(outer != pair and is_inside(pair, outer) for outer in long)
    ]
    # Skirts and wings are shorter than limbs.
    limbs = sorted(outermost, key=lambda pair: -size[pair])[:2]
    limbs.sort(key=lambda pair: (len(joints_to_root(parents, pair[0])), -size[pair]))
    return limbs


def _limb(path: list[int], lengths: Array) -> list[int]:
    """Return the joint above a limb, its three joints, and the one below; -1 where there is none.

    The joints of the limb are the ends of two long bones, one after the other.
    """
    nearby = _ONE_PLACE * lengths[path].max()
    # Of joints in one place, the last one moves what is below.
    chain = [joint for joint, child in pairwise(path) if lengths[child] > nearby]
    chain.append(path[-1])
    if len(chain) < 3:
        return []
    reached = np.cumsum(lengths[path])
    bones = np.diff([reached[path.index(joint)] for joint in chain])
    pairs = np.minimum(bones[:-1], bones[1:])
    # A collar may be as long as a forearm, but a hand is shorter.
    first = int(np.flatnonzero(pairs >= _AS_LONG * pairs.max())[-1])
    above = chain[first - 1] if first > 0 else -1
    upper, lower, end = chain[first : first + 3]
    below = chain[first + 3] if first + 3 < len(chain) else -1
    # Fingers may begin at the wrist: the first joint there moves the whole hand.
    place = path.index(end)
    while reached[path.index(end)] - reached[place - 1] <= nearby:
        place -= 1
    return [above, upper, lower, path[place], below]


def _left_directions(positions: Array, legs: list[list[int]], arms: list[list[int]]) -> Array:
    """Return the direction to the left of the body in all frames."""
    # The joints of a limb are those of `_limb`: above it, its three joints, and below it.
    hips, knees, ankles = (
        np.mean([positions[:, leg[place]] for leg in legs], axis=0) for place in (1, 2, 3)
    )
    shoulders = np.mean([positions[:, arm[1]] for arm in arms], axis=0)
    up = shoulders - hips
    # Knees bend forward, and feet point forward.
    forward = knees - 0.5 * (hips + ankles)
    for _, _, _, ankle, toes in legs:
        if toes >= 0:
            forward = forward + positions[:, toes] - positions[:, ankle]
    line = positions[:, legs[0][1]] - positions[:, legs[1][1]]
    sign = np.sign(np.sum(np.cross(up, forward) * line, axis=1).sum()) or 1.0
    return np.asarray(sign * line)


def _neck_and_head(
    parents: Integers, paths: list[list[int]], lengths: Array, arms: tuple[int, int]
) -> dict[str, int]:
    """Return the neck and the head on the longest other branch above the arms."""
    branches = [
        int(joint)
        for joint in np.flatnonzero(parents == parents[arms[0]])
        if joint not in arms and sum(lengths[paths[joint]]) > 0.0
    ]
    if not branches:
        return {}
    path = max((paths[joint] for joint in branches), key=lambda path: sum(lengths[path]))
    inner = [joint for joint in path if np.any(parents == joint)]
    if len(inner) < 2:
        return {"head": path[0]}
    return {"neck": inner[0], "head": inner[-1]}
