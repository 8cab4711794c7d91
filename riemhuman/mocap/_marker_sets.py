"""Sets of markers, and how their markers tell where the centre of a joint is.

`RECIPES` is the one table: a row for each way to place a joint, the most accurate first, with the
names of the markers without their side, below the sets in which they are called so. Names are
compared in small letters, without separators: "R.Knee.Lat" is "kneelat" of the right side.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from enum import Enum

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
    words = ("jc", "jointcentre", "jointcenter", "centre", "center", "joint", "jcs")
    return _row(joint, Way.CENTRE, " ".join([names, *(joint + word for word in words)]))


def _middle(joint: str, stems: str) -> Row:
    lateral = _with_words(stems, "lat lateral l out outer outside o ext")
    medial = _with_words(stems, "med medial m in inner inside i int")
    return _row(joint, Way.MIDDLE, f"{stems} {lateral}", medial)


RECIPES = (
    # Cortex, OpenCap, Plug-in Gait, Rajagopal 2016.
    _centre("hip", "hjc fep hjcreg"),
    _centre("knee", "kjc feo"),
    _centre("ankle", "ajc tio"),
    _centre("shoulder", "sjc ghjc gh clo"),
    _centre("elbow", "ejc huo"),
    _centre("wrist", "wjc rao"),
    # OpenCap, Plug-in Gait with medial markers, Helen Hayes, gait2354.
    _middle("knee", "knee kne"),
    # IOR (Leardini 2007), Rajagopal 2016, Qualisys, Human Body Model.
    _row(
        *("knee", Way.MIDDLE),
        "lfe lfc lek fle le lepi lateralepicondyle lateralcondyle",
        "mfe mfc mek fme me mepi medialepicondyle medialcondyle",
    ),
    # Laboratories' own, Visual3D, and names in full.
    _row(
        *("knee", Way.MIDDLE),
        "latcon lcon lk lateralfemoralepicondyle",
        "medcon mcon mk medialfemoralepicondyle",
    ),
    # OpenCap, Plug-in Gait with medial markers, Helen Hayes, gait2354.
    _middle("ankle", "ankle ank"),
    # IOR, Rajagopal 2016, Qualisys, Human Body Model.
    _row(
        *("ankle", Way.MIDDLE),
        "lm lmal latmal fal lma la lateralmalleolus",
        "mm mmal medmal tam mma ma medialmalleolus",
    ),
    # CMU with 53 markers, Rajagopal 2016.
    _row(
        *("shoulder", Way.MIDDLE),
        "fsh ash frontshoulder shoulderfront shoant shoulderant",
        "bsh psh backshoulder shoulderback shopost shoulderpost",
    ),
    # OpenCap, gait2354.
    _middle("elbow", "elbow elb"),
    # Rajagopal 2016, Qualisys, Human Body Model.
    _row("elbow", Way.MIDDLE, "lhe lel lee hle lhepi epicl", "mhe mel mee hme mhepi epicm"),
    # gait2354, CMU with 53 markers (LOWR, LIWR).
    _middle("wrist", "wrist wri wr"),
    # Plug-in Gait, OpenCap, Rajagopal 2016, Qualisys, Human Body Model.
    _row(
        *("wrist", Way.MIDDLE),
        "wra wristradius wristradial radius faradius rsp w1 wr1 lw",
        "wrb wristulna wristulnar ulna faulna usp w2 wr2 mw",
    ),
    # pyomeca.
    _row("wrist", Way.MIDDLE, "stylr rs", "stylu us"),
    # OpenPose, Pose2Sim, HALPE and other video methods.
    *(
        _row(joint, Way.CENTRE, joint)
        for joint in ("hip", "knee", "ankle", "shoulder", "elbow", "wrist")
    ),
    # IOR, Human Body Model.
    _row("hip", Way.LATERAL, "hip gtro gt ftc tro troch trochanter greatertrochanter"),
    # Plug-in Gait, CMU, and other sets without their medial markers.
    _row(
        *("knee", Way.LATERAL),
        "knee kne kneelat latknee kneeout knee1 lfe lfc lek fle le lepi latcon lcon lk",
    ),
    _row(
        *("ankle", Way.LATERAL),
        "ankle ank anklelat latankle ankleout ankle1 lm lmal latmal fal lma la mall",
    ),
    # Plug-in Gait, CMU, IOR, Qualisys, gait2354.
    _row(
        *("shoulder", Way.ABOVE),
        "shoulder sho shld sh should shouldertop saj sae caj acromion acromium acr acro ac acrotip "
        "acj",
    ),
    # Plug-in Gait, CMU, Qualisys.
    _row(
        *("elbow", Way.LATERAL), "elbow elb elbowlat latelbow elbowout uhe elbow1 lhe lel lee hle"
    ),
    # Helen Hayes, Qualisys, and others with one of two.
    _row(
        *("wrist", Way.LATERAL),
        "wrist wri wr wrist1 wra wrb rsp usp w1 w2 wristlat wristmed wristout wristin owr iwr rad",
    ),
    # Of the toes: the middle of the foot in front (Plug-in Gait, IOR, Human Body Model), pairs
    # across it (OpenCap, Pose2Sim, IOR, gait2354), and its end (gait2354, MediaPipe).
    _row("toes", Way.CENTRE, "toes toe mt2 2meta meta2 2mth mtp2 fm2 smh 2nd met"),
    _row(
        *("toes", Way.MIDDLE),
        "smalltoe mt5 5thmet mh5 5meta meta5 5mth mtp5 fm5 toelat toeout p5mt",
        "bigtoe mt1 1stmet mh1 1meta meta1 1mth mtp1 fm1 toemed toein p1mt",
    ),
    _row("toes", Way.CENTRE, "tiptoe toetip bigtoe hallux footindex toe1 5meta mt5 meta5"),
    # Corners of the pelvis: Plug-in Gait, IOR, CMU (LFWT, LBWT), OptiTrack.
    _row(
        "asis",
        Way.CENTRE,
        "asis asi ias fwt frontwaist waistfront pelvisfront anteriorsuperioriliacspine",
    ),
    _row(
        "psis",
        Way.CENTRE,
        "psis psi ips bwt backwaist waistback pelvisback posteriorsuperioriliacspine",
    ),
    # The head: video methods and laboratories' own; Plug-in Gait, CMU.
    _row("ear", Way.CENTRE, "ear head temple"),
    _row("head_front", Way.CENTRE, "fhd headfront fronthead"),
    _row("head_back", Way.CENTRE, "bhd headback backhead"),
)

# Markers without a side.
_SACRUM = ("sacr", "sacrum", "sacral", "vsacral", "sac", "psis", "midpsis", "s1", "s2")
_HEAD = ("head", "headcentre", "headcenter", "tophead", "headtop", "thead", "vertex")
_NOSE = ("nose",)
# Joints of which video methods see the centre, under names that laboratories use for the skin.
_NAMES_OF_CENTRES = frozenset(role.split("_")[1] for role in NEEDED)
# OpenCap's suffix for markers on the skin: RShoulder is a centre, r_shoulder_study is not.
_SKIN_WORD, _ON_SKIN = "study", " on skin"
_SIDE_WORDS = {"left": ("left", "lx", "l"), "right": ("right", "rx", "r")}


@dataclass(frozen=True)
class Recipe:
    """Numbers of the markers that place a joint, and how they do."""

    markers: tuple[int, ...]
    way: Way


class MarkerNames:
    """The markers of one person, interpreted by name."""

    def __init__(self, names: Sequence[str]) -> None:
        self._numbers: dict[tuple[str, str], int] = {}
        # A trial or a person before all names: "251112_KUO_LASI".
        first = re.match(r".{3,}[_.\s-]", names[0]) if names else None
        is_shared = first is not None and all(name.startswith(first[0]) for name in names)
        start = len(first[0]) if first is not None and is_shared else 0
        for number, name in enumerate(name[start:] for name in names):
            for side, text, is_skin in _readings(name):
                spelling = text + _ON_SKIN if is_skin else text
                self._numbers.setdefault((side, spelling), number)
        corners = next(row.names[0] for row in RECIPES if row.joint == "asis")
        self._is_laboratory = any(("left", name) in self._numbers for name in corners)

    def recipes(self, role: str) -> list[Recipe]:
        """Return the recipes of a joint by its name in the open model, the best one first."""
        side, part = role.split("_", 1)
        return self._recipes(side, part)

    def _recipes(self, side: str, part: str) -> list[Recipe]:
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
            number = self._first(side, row.names[0])
            if number is not None:
                recipes.append(Recipe((number,), row.way))
        return recipes

    def _pairs(self, side: str, row: Row) -> list[tuple[int, int]]:
        """Return the pairs of markers of a row, both from one source."""
        pairs = []
        for ending in (_ON_SKIN, ""):
            ends = []
            for names in row.names:
                found = [self._numbers.get((side, name + ending)) for name in names]
                ends.append(next((number for number in found if number is not None), None))
            first, second = ends
            if first is not None and second is not None and first != second:
                pairs.append((first, second))
        return pairs

    def _first(self, side: str, names: Sequence[str]) -> int | None:
        """Return the number of the first marker with one of some names."""
        for name in names:
            for spelling in (name, name + _ON_SKIN):
                if (side, spelling) in self._numbers:
                    return self._numbers[side, spelling]
        return None

    def corners(self) -> dict[str, int]:
        """Return the markers at the corners of the pelvis, by the names in `CORNERS`."""
        return self._found({"sacrum": _SACRUM}, ("asis", "psis"))

    def head(self) -> dict[str, int]:
        """Return the markers of the head: "head", "nose", and "left_ear" and others on sides."""
        return self._found({"head": _HEAD, "nose": _NOSE}, ("ear", "head_front", "head_back"))

    def _found(self, single: Mapping[str, Sequence[str]], sided: Sequence[str]) -> dict[str, int]:
        """Return the markers of parts in the middle, by their names, and of parts on both sides."""
        found = {part: self._first("", names) for part, names in single.items()}
        for side in SIDES:
            for part in sided:
                recipes = self._recipes(side, part)
                found[f"{side}_{part}"] = recipes[0].markers[0] if recipes else None
        return {part: number for part, number in found.items() if number is not None}


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
