"""Messages of registrations: parts of bodies in words, and what a scan does not show.

In go names of joints and reasons; out come sentences.
"""

from __future__ import annotations

from collections.abc import Sequence

from riemhuman.registration._limbs import TRUNK

# Each limb from its root outward: joints, the limb from there on, and the part of this joint alone.
_LIMBS = (
    (
        ("hip", "leg", "thigh"),
        ("knee", "leg below the knee", "shin"),
        ("ankle", "foot", "foot"),
        ("toes", "toes", "toes"),
    ),
    (
        ("collar", "arm with the shoulder", "shoulder"),
        ("shoulder", "arm", "upper arm"),
        ("elbow", "arm below the elbow", "forearm"),
        ("wrist", "hand", "hand"),
    ),
)
_PLURALS = {
    "leg": "legs",
    "leg below the knee": "legs below the knee",
    "thigh": "thighs",
    "shin": "shins",
    "foot": "feet",
    "toes": "toes",
    "arm with the shoulder": "arms with the shoulders",
    "shoulder": "shoulders",
    "arm": "arms",
    "upper arm": "upper arms",
    "arm below the elbow": "arms below the elbow",
    "forearm": "forearms",
    "hand": "hands",
}
# What to do about a doubt; said once, at the end of a message.
MARK_JOINTS = "rescan with the limbs away from the body, or mark some joints by hand"
MARK_WRISTS = "rescan with open hands, or mark the wrists by hand"
OPEN_HANDS = "fingers can be told apart only if the hands are open and away from the body"
_REMEDIES = (MARK_JOINTS, MARK_WRISTS, OPEN_HANDS)
_SIDES = ("left", "right")


def in_words(joint: str) -> str:
    """Return the name of a joint as people say it: left knee."""
    return joint.replace("_", " ")


def part_in_words(joint: str) -> str:
    """Return the part of a limb that a joint moves: left shin."""
    side, _, name = joint.partition("_")
    singles = {first: single for limb in _LIMBS for first, _, single in limb}
    return f"{side} {singles[name]}" if name in singles else in_words(joint)


def join_words(words: Sequence[str]) -> str:
    """Return words as in a sentence: a, b and c."""
    return " and ".join([*([", ".join(words[:-1])] if len(words) > 1 else []), *words[-1:]])


def parts_in_words(joints: Sequence[str]) -> list[str]:
    """Return the parts of a body that these joints move, limbs from their first joint on."""
    rest = set(joints)
    parts = []
    if rest.issuperset(TRUNK):
        parts.append("trunk")
        rest -= {*TRUNK}
    for limb in _LIMBS:
        by_side = {side: _parts_of_limb(limb, side, rest) for side in _SIDES}
        both = [part for part in by_side["left"] if part in by_side["right"]]
        parts += [_PLURALS[part] for part in both]
        for side, parts_of_side in by_side.items():
            parts += [f"{side} {part}" for part in parts_of_side if part not in both]
        rest -= {f"{side}_{joint}" for side in _SIDES for joint, *_ in limb}
    return parts + [in_words(joint) for joint in joints if joint in rest]


def _parts_of_limb(limb: Sequence[tuple[str, str, str]], side: str, joints: set[str]) -> list[str]:
    """Return the parts of one limb: from a joint to its end, or of single joints."""
    unseen = [f"{side}_{joint}" in joints for joint, *_ in limb]
    # Toes may be too small to count alone.
    to_end = [joint == "toes" or missing for (joint, *_), missing in zip(limb, unseen, strict=True)]
    starts = [k for k in range(len(limb)) if unseen[k] and all(to_end[k:])]
    first = starts[0] if starts else len(limb)
    alone = [
        single for (_, _, single), missing in zip(limb[:first], unseen, strict=False) if missing
    ]
    return alone + [whole for _, whole, _ in limb[first : first + 1]]


def say_unseen(joints: Sequence[str], share: float, where: str = "") -> str:
    """Return what to say about parts that a scan does not show, as these joints name them.

    Parameters
    ----------
    joints : sequence of str
        Joints of which most vertices are not seen.
    share : float
        Share of the body's area that is not seen.
    where : str
        Why not, such as " under clothes".
    """
    parts = parts_in_words(joints)
    percent = f"{100 * share:.0f} % of the body"
    if not parts:
        return f"{percent} was not seen{where}"
    is_many = len(parts) > 1 or parts[0] in _PLURALS.values()
    return f"the {join_words(parts)} {'were' if is_many else 'was'} not seen{where} ({percent})"


def join_reasons(reasons: Sequence[str]) -> str:
    """Return one message that says what to do only once, at its end."""
    said = "; ".join(reasons)
    for remedy in _REMEDIES:
        at_end = f"; {remedy}"
        said = said.replace(at_end, "") + at_end * (at_end in said)
    return said
