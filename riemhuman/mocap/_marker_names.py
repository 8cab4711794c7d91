"""Which markers of a laboratory or of a video method tell where a joint's centre is.

A joint has several recipes, the most accurate first: a centre that some program computed, the
middle between two markers on the skin, a centre that a video method saw, and one marker on the
skin.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass

from riemhuman.bodies.skinning import LIMBS
from riemhuman.mocap._joint_names import SIDES

NEEDED = tuple(role for limb in LIMBS for role in limb)
# Words for the two sides of a joint that markers on the skin have.
_LATERAL = ("l", "lat", "lateral", "outer", "ext")
_MEDIAL = ("m", "med", "medial", "inner", "int")
# Words for the centre of a joint.
_CENTRE = ("jc", "jointcentre", "jointcenter", "centre", "center", "joint", "jcs")
# OpenCap's suffix for markers on the skin.
_SKIN_WORD, _ON_SKIN = "study", " on skin"

# Abbreviations in names of markers on the skin.
_SHORT = {"knee": ("kne",), "ankle": ("ank",), "elbow": ("elb",), "wrist": ("wri", "wr")}
# Centres under other names: initials, and the origins of segments in Plug-in Gait.
_CENTRES = {
    "hip": ("hjc", "fep"),
    "knee": ("kjc", "feo"),
    "ankle": ("ajc", "tio"),
    "shoulder": ("sjc", "ghjc", "gh", "clo"),
    "elbow": ("ejc", "huo"),
    "wrist": ("wjc", "rao"),
}
# Pairs of markers under names of bones: epicondyles, malleoli, styloid processes, metatarsals.
_PAIRS = {
    "knee": (
        ("lfe", "lfc", "lek", "fle", "le", "lateralepicondyle", "lateralcondyle"),
        ("mfe", "mfc", "mek", "fme", "me", "medialepicondyle", "medialcondyle"),
    ),
    "ankle": (
        ("lm", "lmal", "latmal", "fal", "lateralmalleolus"),
        ("mm", "mmal", "medmal", "tam", "medialmalleolus"),
    ),
    "elbow": (("lhe", "lel", "lee", "hle"), ("mhe", "mel", "mee", "hme")),
    "wrist": (
        ("wra", "wristradius", "wristradial", "radius", "faradius", "rsp"),
        ("wrb", "wristulna", "wristulnar", "ulna", "faulna", "usp"),
    ),
    "toes": (
        ("smalltoe", "mt5", "5meta", "5mth", "fm5", "toelat"),
        ("bigtoe", "mt1", "1meta", "1mth", "fm1", "toemed"),
    ),
}
# Single markers on the skin: of a shoulder on its acromion.
_SKIN = {"shoulder": ("acromion", "acromium", "acr", "acro", "ac", "sae", "sho", "shld")}
# Of the toes, markers in the middle of the foot, and at its end.
_TOES = ("toes", "toe", "mt2", "2meta", "2mth", "mtp2", "fm2")
_TIPS = ("tiptoe", "toetip", "bigtoe", "hallux")
_HEAD = {
    "ear": ("ear",),
    "head_front": ("fhd", "headfront", "fronthead"),
    "head_back": ("bhd", "headback", "backhead"),
}
_UNSIDED = {"head": ("head", "headcentre", "headcenter"), "nose": ("nose",)}
# Corners of the pelvis, from which the centres of hips are estimated.
_PELVIS = {
    "asis": ("asis", "asi", "ias"),
    "psis": ("psis", "psi", "ips"),
}
_SACRUM = ("sacr", "sacrum", "sacral", "vsacral", "sac")


@dataclass(frozen=True)
class Recipe:
    """Numbers of the markers whose mean is a joint's centre, or one marker `on_skin` near it."""

    markers: tuple[int, ...]
    on_skin: bool = False


class MarkerNames:
    """The markers of one person, interpreted by name."""

    def __init__(self, names: Sequence[str]) -> None:
        self._numbers: dict[tuple[str, str], int] = {}
        for number, name in enumerate(names):
            for side, text, is_skin in _readings(name):
                # As in files of OpenCap, where RShoulder is a centre and r_shoulder_study is skin.
                spelling = text + _ON_SKIN if is_skin else text
                self._numbers.setdefault((side, spelling), number)
        self._is_laboratory = any(("left", text) in self._numbers for text in _PELVIS["asis"])

    def first(self, side: str, spellings: Sequence[str]) -> int | None:
        """Return the number of the first marker with one of some spellings."""
        for text in spellings:
            for spelling in (text, text + _ON_SKIN):
                if (side, spelling) in self._numbers:
                    return self._numbers[side, spelling]
        return None

    def recipes(self, role: str) -> list[Recipe]:
        """Return the recipes of a joint by its name in the open model, the best one first."""
        side, part = role.split("_", 1)
        if part == "toes":
            middle, end = (self._single(side, spellings) for spellings in (_TOES, _TIPS))
            return middle + self._pairs(side, part) + end
        recipes = self._single(side, _centre_names(part)) + self._pairs(side, part)
        joint = self._numbers.get((side, part))
        if joint is not None:
            # A video method sees the centre; among a laboratory's markers, it is one on the skin.
            recipes.append(Recipe((joint,), on_skin=self._is_laboratory))
        skin = (*_SHORT.get(part, ()), *_SKIN.get(part, ()), part)
        return recipes + self._single(side, skin, on_skin=True)

    def _single(self, side: str, spellings: Sequence[str], on_skin: bool = False) -> list[Recipe]:
        number = self.first(side, spellings)
        return [] if number is None else [Recipe((number,), on_skin)]

    def _pairs(self, side: str, part: str) -> list[Recipe]:
        """Return the pairs of markers beside a joint, both from one source."""
        recipes = []
        for lateral_spellings, medial_spellings in _pairs_of(part):
            for end in (_ON_SKIN, ""):
                lateral = self._with_ending(side, lateral_spellings, end)
                medial = self._with_ending(side, medial_spellings, end)
                if lateral is not None and medial is not None:
                    recipes.append(Recipe((lateral, medial)))
        return recipes

    def _with_ending(self, side: str, spellings: Sequence[str], end: str) -> int | None:
        """Return the number of the first marker with one of some spellings before an ending."""
        for text in spellings:
            if (side, text + end) in self._numbers:
                return self._numbers[side, text + end]
        return None

    def pelvis(self) -> tuple[int, int, tuple[int, ...]] | None:
        """Return the left and right front corners of the pelvis, and the markers at its back."""
        left, right = (self.first(side, _PELVIS["asis"]) for side in SIDES)
        back_left, back_right = (self.first(side, _PELVIS["psis"]) for side in SIDES)
        sacrum = self.first("", _SACRUM)
        if left is None or right is None:
            return None
        if back_left is not None and back_right is not None:
            return left, right, (back_left, back_right)
        return None if sacrum is None else (left, right, (sacrum,))

    def head(self) -> dict[str, int]:
        """Return the markers of the head: "head", "nose", and "left_ear" and others on sides."""
        markers = {name: self.first("", spellings) for name, spellings in _UNSIDED.items()}
        for name, spellings in _HEAD.items():
            for side in SIDES:
                markers[f"{side}_{name}"] = self.first(side, spellings)
        return {name: number for name, number in markers.items() if number is not None}


def _centre_names(part: str) -> tuple[str, ...]:
    return (*_CENTRES[part], *(part + end for end in _CENTRE))


def _pairs_of(part: str) -> list[tuple[tuple[str, ...], tuple[str, ...]]]:
    """Return spellings of the lateral and the medial marker of a joint."""
    pairs = [_PAIRS[part]] if part in _PAIRS else []
    if part in _SHORT:
        stems = (part, *_SHORT[part])
        # The marker without such a word is the lateral one.
        lateral = (*_with_words(stems, _LATERAL), *stems)
        pairs.insert(0, (lateral, _with_words(stems, _MEDIAL)))
    return pairs


def _with_words(stems: Sequence[str], words: Sequence[str]) -> tuple[str, ...]:
    """Return every stem with every word before it and behind it."""
    spellings: list[str] = []
    for stem in stems:
        for word in words:
            spellings += [word + stem, stem + word]
    return tuple(spellings)


def _readings(name: str) -> list[tuple[str, str, bool]]:
    """Return readings of a marker's name: a side or "", the rest, and whether it is on the skin."""
    words = re.findall(r"[A-Za-z]+|\d+", name.rpartition(":")[2].lower())
    if words[:1] == ["v"]:  # computed by Cortex
        words = words[1:]
    is_skin = bool(words) and words[-1] == _SKIN_WORD
    if is_skin:
        words = words[:-1]
    text = "".join(words)
    readings = [("", text, is_skin)]
    for side in SIDES:
        for letters in (side, side[0]):
            if text.startswith(letters):
                readings.append((side, text.removeprefix(letters), is_skin))
            # Behind the joint, a single letter is a word of its own: "ankle_r", not "shoulder".
            if words[-1:] == [letters] or (letters == side and text.endswith(letters)):
                readings.append((side, text.removesuffix(letters), is_skin))
    return readings
