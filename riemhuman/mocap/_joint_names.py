"""Which joint of a skeleton is which: as told, by name, or by the shape of the tree."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from itertools import pairwise

import numpy as np

from riemhuman.arrays import Array, Integers
from riemhuman.bodies import BodyModel
from riemhuman.bodies.skinning import LIMBS, joints_to_root, usual_joint_names
from riemhuman.errors import ArgumentError, shown, warn
from riemhuman.mocap._joint_tree import joints_by_tree
from riemhuman.representation import join_names

SIDES = ("left", "right")
# Names of joints in recordings, the surest first; a joint is used once, so that "foot" is the toes
# and "shoulder" the collar where there are other names for the ankle and the shoulder.
_SIDED_NAMES = {
    "hip": ("upleg", "upperleg", "thigh", "femur", "hip"),
    "knee": ("lowleg", "lowerleg", "knee", "calf", "shin", "shank", "tibia", "leg"),
    "ankle": ("ankle", "foot"),
    "toes": ("toebase", "toes", "toe", "ball", "foot"),
    "shoulder": (
        *("upperarm", "uparm", "uarm", "humerus", "bicep", "shldr", "arm", "shoulder"),
        *("shoulderjoint", "glenohumeral"),
    ),
    "elbow": ("forearm", "lowerarm", "lowarm", "farm", "elbow", "radius", "ulna"),
    "wrist": ("wrist", "hand"),
    "collar": ("collar", "clavicle", "collarbone", "scapula", "shoulder"),
}
_OTHER_NAMES = {
    "neck": ("neck", "lowerneck", "neckbase", "cervical", "upperneck"),
    "head": ("head", "skull"),
}
_PARTS = {name for names in (*_SIDED_NAMES.values(), *_OTHER_NAMES.values()) for name in names}
_SIDE_WORDS = {"left": "left", "l": "left", "lft": "left", "lt": "left"}
_SIDE_WORDS |= {"right": "right", "r": "right", "rgt": "right", "rt": "right"}
# Meaningless additions of programs to names of joints.
_ADDED_WORDS = frozenset(
    (
        *("jnt", "joint", "jt", "j", "bone", "bn", "b", "bind", "skin", "skel", "sk", "node"),
        *("def", "deform", "fk", "rig", "bend", "rot", "x", "y", "z", "m", "c", "main", "model"),
        "mesh",
    )
)
BONES = tuple((first, second) for limb in LIMBS for first, second in pairwise(limb))
OTHER_BONES = tuple(
    (f"{side}_{upper}", f"{side}_{lower}")
    for side in SIDES
    for upper, lower in (("collar", "shoulder"), ("ankle", "toes"))
)
"""Bones besides those of the limbs."""
_MOST_NAMES = 40


def find_joints(
    names: Sequence[str],
    parents: Integers,
    table: Mapping[str, str] | None = None,
    positions: Array | None = None,
) -> dict[str, int]:
    """Return the numbers of a skeleton's joints by their names in the open model.

    If names do not identify the joints, and positions (n_frames, J, 3) are given, the shape of the
    tree does, with a warning.
    """
    assigned = _assigned_joints(names, table or {})
    named = _named_joints(names, parents, assigned)
    joints = named
    problem = _problem(names, parents, joints)
    if problem and positions is not None:
        inferred = joints_by_tree(parents, positions)
        if inferred and not _problem(names, parents, inferred | assigned):
            joints = inferred | assigned
            pairs = ", ".join(f"{role}={names[joint]!r}" for role, joint in inferred.items())
            missing = [role for limb in LIMBS for role in limb if role not in named]
            reason = f"names of joints do not identify {', '.join(missing)}" if missing else problem
            warn(
                f"{reason}; they were inferred from the shape of the skeleton: {pairs}. Pass "
                "joints= if that is wrong",
                UserWarning,
            )
            problem = ""
    if problem:
        raise ArgumentError(problem)
    return joints | _branchings(parents, joints)


def model_joints(model: BodyModel) -> dict[str, int]:
    """Return the numbers of a model's joints; those of SMPL need no names."""
    return find_joints(usual_joint_names(model), model.parents)


def _assigned_joints(names: Sequence[str], table: Mapping[str, str]) -> dict[str, int]:
    """Return the joints that the user named."""
    assigned: dict[str, int] = {}
    for role, name in table.items():
        if name not in names:
            listed = join_names(names, _MOST_NAMES)
            raise ArgumentError(f"joints[{role!r}] must be one of {listed}; found {shown(name)}")
        assigned[role] = list(names).index(name)
    return assigned


def _named_joints(
    names: Sequence[str], parents: Integers, assigned: Mapping[str, int]
) -> dict[str, int]:
    """Return the joints given by the user, and those found by name."""
    joints = dict(assigned)
    depths = [len(joints_to_root(parents, joint)) for joint in range(len(names))]
    readings = [_read_name(name) for name in names]
    parts = [(side, part) for side in SIDES for part in _SIDED_NAMES]
    parts += [("", part) for part in _OTHER_NAMES]
    for side, part in parts:
        spellings = _SIDED_NAMES[part] if side else _OTHER_NAMES[part]
        role = f"{side}_{part}" if side else part
        # Of a collar in two parts, the lower one carries the rotations of both.
        order = -1 if part == "collar" else 1
        # The best candidate is the first by the rank of its spelling, then by an unshortened name,
        # then by its depth in the tree.
        candidates = [
            (spellings.index(name), is_shortened, order * depths[joint], joint)
            for joint, (name_side, name, is_shortened) in enumerate(readings)
            if name_side == side and name in spellings and joint not in joints.values()
        ]
        if candidates and role not in joints:
            _, _, _, joints[role] = min(candidates)
    for side in SIDES:
        # Hands and toes may have other names, or be end sites.
        for role, above in ((f"{side}_wrist", f"{side}_elbow"), (f"{side}_toes", f"{side}_ankle")):
            below = np.flatnonzero(np.asarray(parents) == joints.get(above, -2))
            if role not in joints and len(below):
                joints[role] = int(below[0])
        # What is called like a collar may be elsewhere.
        collar, shoulder = f"{side}_collar", f"{side}_shoulder"
        arm = joints_to_root(parents, joints[shoulder]) if shoulder in joints else []
        if arm and joints.get(collar) not in arm[1:]:
            joints.pop(collar, None)
    return joints


def _problem(names: Sequence[str], parents: Integers, joints: Mapping[str, int]) -> str:
    """Return what is wrong with the joints of the limbs, or an empty text."""
    missing = [role for limb in LIMBS for role in limb if role not in joints]
    if missing:
        return (
            f"joints must name {', '.join(missing)}, such as {{{missing[0]!r}: ...}}; the skeleton "
            f"has {join_names(names, _MOST_NAMES)}"
        )
    for first, second in BONES:
        if joints[first] not in joints_to_root(parents, joints[second])[1:]:
            upper, lower = names[joints[first]], names[joints[second]]
            return (
                f"joints: {second} must be below {first}; found {lower!r}, which is not below "
                f"{upper!r}"
            )
    branchings = _branchings(parents, joints)
    if min(branchings.values()) >= 0:
        above_pelvis = joints_to_root(parents, branchings["pelvis"])
        above_chest = joints_to_root(parents, branchings["chest"])
        if set(above_pelvis) & set(above_chest):
            return ""
    return "joints: hips and shoulders must be in one tree of joints"


def _branchings(parents: Integers, joints: Mapping[str, int]) -> dict[str, int]:
    """Return the joints from which both legs and both arms hang; -1 where there are none."""
    branchings = {}
    for role, part in (("pelvis", "hip"), ("chest", "shoulder")):
        left, right = (joints_to_root(parents, joints[f"{side}_{part}"])[1:] for side in SIDES)
        branchings[role] = next((joint for joint in left if joint in right), -1)
    return branchings


def _read_name(name: str) -> tuple[str, str, bool]:
    """Return the side and the part that the name of a joint says, and whether it was shortened.

    Texts are empty if it says none.
    """
    name = name.rpartition(":")[2]  # before the colon is the name of the person
    # Words begin with a capital or after anything that is no letter; "LUpArm" has three.
    words = [word.lower() for word in re.findall(r"[A-Z]+(?![a-z])|[A-Z]?[a-z]+", name)]
    side = next((_SIDE_WORDS[word] for word in words if word in _SIDE_WORDS), "")
    words = [word for word in words if word not in _SIDE_WORDS]
    shortened = [word for word in words if word not in _ADDED_WORDS]
    for is_shortened, candidate in ((False, words), (True, shortened)):
        # Other words before, such as the name of the person, do not matter; words after do.
        for first in range(len(candidate)):
            text_side, part = _read_part("".join(candidate[first:]), side)
            if part:
                return text_side, part, is_shortened
    return side, "", False


def _read_part(text: str, side: str) -> tuple[str, str]:
    """Return the side and the part that a text names, where the side may be part of a word."""
    if text in _PARTS:
        return side, text
    if not side:
        for word, side_of_word in _SIDE_WORDS.items():
            for shorter in (text.removeprefix(word), text.removesuffix(word)):
                if shorter != text and shorter in _PARTS:
                    return side_of_word, shorter
    return side, ""
