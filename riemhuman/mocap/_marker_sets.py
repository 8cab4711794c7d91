"""Sets of markers, and how their markers tell where the centre of a joint is.

`RECIPES` is the one table: a row for each way to place a joint, the most accurate first, with the
names of the markers without their side, below the sets in which they are called so. Names are
compared in small letters, without separators: "R.Knee.Lat" is "kneelat" of the right side.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from enum import Enum
from itertools import product

from riemhuman.bodies.skinning import LIMBS
from riemhuman.mocap._joint_names import SIDES

NEEDED = tuple(role for limb in LIMBS for role in limb)
"""Joints of the limbs."""

CORNERS = ("left_asis", "right_asis", "left_psis", "right_psis", "sacrum")
"""Corners of the pelvis that users may name: at its front and back, or one in the middle behind."""


class Way(Enum):
    """How markers place a joint."""

    CENTRE = "centre"  # a program computed the centre, or a method for videos saw it
    MIDDLE = "middle"  # the centre is halfway between two markers
    LATERAL = "lateral"  # one marker on the skin beside the joint
    ABOVE = "above"  # one marker on the acromion, above the shoulder


@dataclass(frozen=True)
class Row:
    """A way to place a joint: names of markers, one tuple for each of two in the middle."""

    joint: str
    way: Way
    names: tuple[tuple[str, ...], ...]


def _row(joint: str, way: Way, *names: str) -> Row:
    return Row(joint, way, tuple(tuple(text.split()) for text in names))


def _with_words(stems: str, words: str) -> str:
    """Return names of which a word of a list comes before or behind a stem."""
    pairs = [(stem, word) for stem in stems.split() for word in words.split()]
    return " ".join(
        [*(word + stem for stem, word in pairs), *(stem + word for stem, word in pairs)]
    )


def _centre(joint: str, names: str) -> Row:
    ends = "jc jointcentre jointcenter centre center joint jcs"
    return _row(joint, Way.CENTRE, " ".join([names, *(joint + end for end in ends.split())]))


def _joint(joint: str, centre: str, stems: str, lateral: str, medial: str = "") -> tuple[Row, ...]:
    """Return the ways to a joint: its centre, between two markers, or beside one on the skin."""
    lateral = f"{stems} {_with_words(stems, 'lat lateral l out outer outside o ext')} {lateral}"
    medial = f"{_with_words(stems, 'med medial m in inner inside i int')} {medial}"
    return (
        _centre(joint, centre),
        _row(joint, Way.MIDDLE, lateral, medial),
        # OpenPose, Pose2Sim, HALPE and other video methods.
        _row(joint, Way.CENTRE, joint),
        _row(joint, Way.LATERAL, lateral),
    )


# Names of centres are those of Cortex, OpenCap, Plug-in Gait, and Rajagopal 2016. Stems are those
# of OpenCap, Plug-in Gait, CMU, CGM 2, Helen Hayes, OptiTrack and gait2354.
RECIPES = (
    # IOR (Leardini 2007), Human Body Model, CAST.
    *_joint(
        *("hip", "hjc fep hjcreg", "hip"),
        "gtro gt ftc tro troch trochanter greatertrochanter",
    ),
    # IOR, Rajagopal 2016, Qualisys, Human Body Model; Visual3D; Xsens; names in full.
    *_joint(
        *("knee", "kjc feo", "knee kne kn"),
        "lfe lfc lek fle le lepi latcon lcon lk knee1 lateralepicondyle lateralcondyle "
        "lateralfemoralepicondyle femoralepicondyle kneelatepicondyle",
        "mfe mfc mek fme me mepi medcon mcon mk medialepicondyle medialcondyle "
        "medialfemoralepicondyle kneemedepicondyle",
    ),
    *_joint(
        *("ankle", "ajc tio", "ankle ank"),
        "lm lmal latmal fal lma la mall ankle1 lateralmalleolus latmalleolus",
        "mm mmal medmal tam mma ma med medialmalleolus medmalleolus",
    ),
    _centre("shoulder", "sjc ghjc gh clo"),
    # CMU with 53 markers, Rajagopal 2016.
    _row(
        *("shoulder", Way.MIDDLE),
        "fsh ash frontshoulder shoulderfront shoant shoulderant",
        "bsh psh backshoulder shoulderback shopost shoulderpost",
    ),
    _row("shoulder", Way.CENTRE, "shoulder"),
    # Plug-in Gait, CMU, IOR, Qualisys, gait2354.
    _row(
        *("shoulder", Way.ABOVE),
        "shoulder sho shld sh should shouldertop saj sae caj acromion acromium acr acro ac acrotip "
        "acj",
    ),
    # Rajagopal 2016, Qualisys, Human Body Model; Xsens; names in full.
    *_joint(
        *("elbow", "ejc huo", "elbow elb el"),
        "lhe lee hle lhepi epicl uhe elbow1 armlatepicondyle lateralhumeralepicondyle",
        "mhe mee hme mhepi epicm armmedepicondyle medialhumeralepicondyle",
    ),
    # Plug-in Gait, Rajagopal 2016, Qualisys, Human Body Model; pyomeca; Xsens; names in full.
    *_joint(
        *("wrist", "wjc rao", "wrist wri wr"),
        "wra wristradius wristradial radius faradius rsp w1 wr1 wrist1 lw stylr rs rad "
        "radialstyloid",
        "wrb wristulna wristulnar ulna faulna usp w2 wr2 mw stylu us ulnarstyloid",
    ),
    # One of two markers, on the other side of the wrist.
    _row("wrist", Way.LATERAL, "wrb usp w2 wristmed wristin iwr"),
    # Of the toes: the middle of the foot in front (Plug-in Gait, IOR, Human Body Model, Qualisys),
    # pairs across it (OpenCap, Pose2Sim, IOR, gait2354, Xsens), and its end (gait2354, MediaPipe).
    _row(
        *("toes", Way.CENTRE),
        "toes toe mt2 2meta meta2 2mth mtp2 fm2 smh sm 2nd met forefoot2 secondmetatarsalhead",
    ),
    _row(
        *("toes", Way.MIDDLE),
        "smalltoe mt5 5thmet mh5 5meta meta5 5mth mtp5 fm5 toelat toeout p5mt vm 5th vmh forefoot5 "
        "fifthmetatarsal",
        "bigtoe mt1 1stmet mh1 1meta meta1 1mth mtp1 fm1 toemed toein p1mt fm 1st fmh forefoot1 "
        "firstmetatarsal",
    ),
    _row("toes", Way.CENTRE, "tiptoe toetip bigtoe hallux footindex toe1 5meta mt5 meta5 foot"),
    # Corners of the pelvis: Plug-in Gait, IOR, CMU (LFWT, LBWT), OptiTrack.
    _row(
        *("asis", Way.CENTRE),
        "asis asi ias fwt frontwaist waistfront pelvisfront anteriorsuperioriliacspine",
    ),
    _row(
        *("psis", Way.CENTRE),
        "psis psi ips bwt backwaist waistback pelvisback posteriorsuperioriliacspine",
    ),
    # The head: video methods and laboratories' own; Plug-in Gait, CMU.
    _row("ear", Way.CENTRE, "ear head temple auricularis"),
    _row("head_front", Way.CENTRE, "fhd headfront fronthead"),
    _row("head_back", Way.CENTRE, "bhd headback backhead"),
)

# Markers without a side.
_SACRUM = ("sacr", "sacrum", "sacral", "vsacral", "sac", "psis", "midpsis", "s1", "s2", "waistback")
_HEAD = ("head", "headcentre", "headcenter", "tophead", "headtop", "topofhead", "thead", "vertex")
_NOSE = ("nose", "headfront", "fronthead", "fhead")
# Joints of which video methods see the centre, under names that laboratories use for the skin.
_NAMES_OF_CENTRES = frozenset(role.split("_")[1] for role in NEEDED)
# OpenCap's suffix for markers on the skin: RShoulder is a centre, r_shoulder_study is not.
_SKIN_WORD, _ON_SKIN = "study", " on skin"
_SIDE_WORDS = {"left": ("left", "lx", "l"), "right": ("right", "rx", "r")}
# Cortex puts a V before what it computed.
_LETTERS = {"v", *(word for words in _SIDE_WORDS.values() for word in words)}
# What may be before all names; Xsens has "pLeftASI".
_FIRST_WORD = re.compile(r"[^_.\s-]+[_.\s-]+|p(?=[A-Z])")


@dataclass(frozen=True)
class Recipe:
    """Numbers of the markers that place a joint, and how they do."""

    markers: tuple[int, ...]
    way: Way


class MarkerNames:
    """The markers of one person, interpreted by name."""

    def __init__(self, names: Sequence[str]) -> None:
        self._numbers: dict[tuple[str, str], int] = {}
        for number, name in enumerate(_without_prefix(names)):
            for side, text, is_skin in _readings(name):
                spelling = text + _ON_SKIN if is_skin else text
                self._numbers.setdefault((side, spelling), number)
        corners = next(row.names[0] for row in RECIPES if row.joint == "asis")
        self._is_laboratory = any(("left", name) in self._numbers for name in corners)

    def recipes(self, role: str) -> list[Recipe]:
        """Return the recipes of a joint by its name in the open model, the best one first."""
        side, part = role.split("_", 1)
        recipes = []
        for row in RECIPES:
            if row.joint != part:
                continue
            if row.way is Way.MIDDLE:
                recipes += [Recipe(pair, row.way) for pair in self._pairs(side, row)]
                continue
            is_centre = row.names == ((part,),) and part in _NAMES_OF_CENTRES
            if is_centre and (self._is_laboratory or (side, part) not in self._numbers):
                continue  # among a laboratory's markers, it is one on the skin
            recipes += [Recipe((number,), row.way) for number in self._all(side, row.names[0])]
        return recipes

    def _pairs(self, side: str, row: Row) -> list[tuple[int, int]]:
        """Return the pairs of markers of a row, both on the skin or both not."""
        first, second = row.names
        return [
            pair
            for ending in ((_ON_SKIN,), ("",))
            for pair in product(self._all(side, first, ending), self._all(side, second, ending))
            if pair[0] != pair[1]
        ]

    def _all(
        self, side: str, names: Sequence[str], endings: Sequence[str] = ("", _ON_SKIN)
    ) -> list[int]:
        """Return the numbers of the markers with some of these names, in the order of the names."""
        spellings = [(side, name + ending) for name in names for ending in endings]
        return [self._numbers[spelling] for spelling in spellings if spelling in self._numbers]

    def corners(self) -> dict[str, int]:
        """Return the markers at the corners of the pelvis, by the names in `CORNERS`."""
        return self._found({"sacrum": _SACRUM}, ("asis", "psis"))

    def head(self) -> dict[str, int]:
        """Return the markers of the head: "head", "nose", and "left_ear" and others on sides."""
        return self._found({"head": _HEAD, "nose": _NOSE}, ("ear", "head_front", "head_back"))

    def _found(self, single: Mapping[str, Sequence[str]], sided: Sequence[str]) -> dict[str, int]:
        """Return the markers of parts in the middle, by their names, and of parts on both sides."""
        found = {part: self._all("", names) for part, names in single.items()}
        for side in SIDES:
            for part in sided:
                found[f"{side}_{part}"] = [
                    recipe.markers[0] for recipe in self.recipes(f"{side}_{part}")
                ]
        return {part: numbers[0] for part, numbers in found.items() if numbers}


def first_word(name: str) -> str:
    """Return the first word of a marker's name, with what follows it, unless it is a side."""
    found = _FIRST_WORD.match(name)
    word = found[0] if found else ""
    return "" if word.rstrip("_. -").lower() in _LETTERS else word


def _without_prefix(names: Sequence[str]) -> list[str]:
    """Return names without a trial or a person before most of them: "251112_KUO_LASI"."""
    for word, count in Counter(map(first_word, names)).items():
        # More than half: the others are of the room, or without a name.
        if word and 2 * count > len(names):
            return _without_prefix([name.removeprefix(word) for name in names])
    return list(names)


def _readings(name: str) -> list[tuple[str, str, bool]]:
    """Return readings of a marker's name: a side or "", the rest, and whether it is on the skin."""
    # A small letter behind capitals is a side: "ASISl".
    spaced = re.sub(r"(?<=[A-Z]{3})([lr])$", r" \1", name.rpartition(":")[2])
    words = re.findall(r"[A-Z]+(?![a-z])|[A-Z]?[a-z]+|\d+", spaced)
    words = [word.lower() for word in words]
    if words[:1] == ["v"]:  # computed by Cortex
        words = words[1:]
    is_skin = bool(words) and words[-1] == _SKIN_WORD
    if is_skin:
        words = words[:-1]
    text = "".join(words)
    readings = [("", text, is_skin)]
    for side, side_words in _SIDE_WORDS.items():
        for letters in side_words:
            if text.startswith(letters):
                readings.append((side, text.removeprefix(letters), is_skin))
            # Elsewhere, a single letter is a word of its own: "ankle_r", not "shoulder".
            for place in range(1, len(words)):
                if words[place] == letters:
                    others = (*words[:place], *words[place + 1 :])
                    readings.append((side, "".join(others), is_skin))
            if letters == side and text.endswith(letters):
                readings.append((side, text.removesuffix(letters), is_skin))
    return readings
