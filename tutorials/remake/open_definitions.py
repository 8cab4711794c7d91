"""Definitions of the open body model's measurements, named as in the standards.

Numbers are those of ISO 8559-1:2017 and ISO 7250-1:2008 where they are known. ANSUR II is the
survey of the US Army of 2012, defined in Hotzman et al., "Measurer's handbook", Natick/TR-11/017,
2011; its names are the columns of its tables.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

from riemhuman.measurements import (
    Area,
    Breadth,
    Depth,
    Girth,
    Height,
    Length,
    Mass,
    Measurement,
    Volume,
)

STANDARD_POSE = {"shoulder": ("z", -50), "hip": ("z", 3)}
SEATED_POSE = {"shoulder": ("z", -80), "elbow": ("y", -90), "hip": ("x", -90), "knee": ("x", 90)}
"""Joint angles of the standard poses, in the notation of `riemhuman.datasets.open_poses`."""

_TRUNK_JOINTS = ("pelvis", "lower_spine", "middle_spine", "upper_spine", "chest")
PARTS = {
    "trunk": (*_TRUNK_JOINTS, "left_collar", "right_collar"),
    "neck": ("neck",),
    "head": ("head",),
    "left arm": ("left_shoulder", "left_elbow", "left_wrist"),
    "left leg": ("left_hip", "left_knee", "left_ankle", "left_toes"),
    "right arm": ("right_shoulder", "right_elbow", "right_wrist"),
    "right leg": ("right_hip", "right_knee", "right_ankle", "right_toes"),
}
"""Parts of the body: a triangle belongs to the part of the joint with its largest weight."""

TRUNK = ("trunk",)
ARMS = ("left arm", "right arm")
LEGS = ("left leg", "right leg")

# Landmarks chosen on the mean body of the full model: vertices and weights. Those of bones that the
# surface does not show are at their mean height among the people of ANSUR II.
# fmt: off
LANDMARKS: dict[str, dict[int, float]] = {
    "omphalion": {4100: 0.99, 4105: 0.01},
    "omphalion_back": {4172: 0.14, 4165: 0.86},
    "right_omphalion": {4046: 0.47, 4116: 0.26, 4113: 0.27},
    "suprasternale": {1526: 0.12, 1524: 0.88},
    "right_iliocristale": {4151: 0.21, 4113: 0.08, 4116: 0.71},
    "right_tenth_rib": {4017: 0.82, 4123: 0.09, 4127: 0.09},
    "right_trochanterion": {4277: 0.06, 4283: 0.5, 4280: 0.44},
    "right_lateral_epicondyle": {4614: 0.29, 4633: 0.28, 4632: 0.43},
    "right_tibiale": {6391: 0.34, 6390: 0.05, 4639: 0.61},
    "right_midpatella": {4608: 0.46, 4627: 0.43, 4616: 0.11},
    "right_suprapatella": {4589: 0.77, 4608: 0.14, 4597: 0.09},
    "right_lateral_malleolus": {6364: 0.13, 6357: 0.38, 6223: 0.49},
    "right_medial_malleolus": {6325: 0.12, 6330: 0.02, 6327: 0.86},
    "right_first_metatarsal": {5777: 1},
    "right_fifth_metatarsal": {6180: 1},
    "right_heel_inside": {6292: 0.46, 6291: 0.54},
    "right_heel_outside": {6404: 0.28, 6429: 0.58, 6403: 0.14},
    "right_heel_bottom": {6438: 0.11, 6207: 0.43, 6300: 0.46},
    "right_ankle_front": {6230: 0.57, 6219: 0.09, 6368: 0.34},
    "right_radiale": {3372: 0.66, 3356: 0.08, 3355: 0.26},
    "right_olecranon": {3392: 0.39, 3374: 0.02, 3375: 0.59},
    "right_dactylion": {2129: 1},
    "right_stylion": {3755: 0.88, 3884: 0.05, 3881: 0.07},
    "right_ulnar_styloid": {3549: 0.2, 3874: 0.7, 3790: 0.1},
    "right_second_metacarpal": {3820: 0.5, 3161: 0.38, 3805: 0.12},
    "right_fifth_metacarpal": {3174: 0.92, 3139: 0.07, 3137: 0.01},
    "right_palm_base": {3547: 0.22, 3879: 0.67, 3882: 0.11},
    "right_finger_base": {3792: 0.24, 3096: 0.58, 3796: 0.18},
    "right_knuckles": {3227: 0.77, 3181: 0.13, 3197: 0.1},
    "right_deltoid": {1628: 0.32, 1638: 0.3, 1404: 0.38},
    "right_axilla": {3829: 0.25, 1666: 0.56, 1631: 0.19},
    "right_midscye": {1630: 0.03, 1673: 0.13, 1667: 0.84},
    "right_neck_base": {1503: 0.34, 822: 0.19, 828: 0.47},
    "right_clavicle": {1461: 0.24, 1516: 0.5, 1514: 0.26},
    "right_midshoulder": {1485: 0.43, 1480: 0.09, 1481: 0.48},
    "sellion": {132: 0.99, 133: 0.01},
    "menton": {732: 0.99, 5280: 0.01},
    "pogonion": {724: 0.03, 733: 0.97},
    "submandibular": {787: 1},
    "right_tragion": {5615: 0.05, 5509: 0.59, 5516: 0.36},
    "right_zygion": {5187: 0.1, 5185: 0.76, 269: 0.14},
    "right_euryon": {1008: 0.5, 978: 0.19, 863: 0.31},
    "right_ear_top": {5397: 1},
    "right_ear_bottom": {5727: 1},
    "right_ear_front": {5433: 1},
    "right_ear_back": {5403: 1},
    "right_ear_outside": {5423: 1},
    "right_mastoid": {942: 0.7, 949: 0.25, 1004: 0.05},
    "right_ectocanthus": {4865: 0.45, 26: 0.07, 4864: 0.48},
    "right_pupil": {5292: 0.2, 1321: 0.4, 1331: 0.4},
    "right_seat": {4219: 0.74, 4228: 0.21, 4235: 0.05},
    "right_popliteal": {4625: 0.61, 4644: 0.18, 4648: 0.21},
    "right_calf_back": {4644: 0.53, 4663: 0.24, 4667: 0.23},
    "right_thigh_top": {4399: 0.23, 4425: 0.68, 4418: 0.09},
    "abdomen": {4094: 0.13, 4351: 0.87},
    "right_buttock_seated": {4184: 0.01, 4194: 0.26, 4193: 0.73},
    "right_knee_front": {4627: 0.77, 4646: 0.11, 4635: 0.12},
    "right_knee_top": {4570: 0.61, 4589: 0.33, 4578: 0.06},
    "right_hip_seated": {4283: 0.6, 4289: 0.39, 4286: 0.01},
    "right_olecranon_below": {3375: 0.27, 3396: 0.61, 3392: 0.12},
    "right_olecranon_back": {3341: 0.91, 3323: 0.07, 3324: 0.02},
    "right_foot_inside": {6688: 0.23, 6687: 0.37, 6236: 0.4},
    "right_foot_outside": {6141: 0.69, 6135: 0.14, 6689: 0.17},
    "perineum": {6415: 0.46, 4356: 0.54},
    "right_ankle_front_inside": {6231: 0.77, 6414: 0.08, 6413: 0.15},
    "midspine": {1598: 0.97, 1599: 0.03},
}
# fmt: on

_RIGHT_ARM, _RIGHT_LEG = ("right arm",), ("right leg",)
_SKULL = {"glabella": 0.5, "opisthocranion": 0.5}
_BUST = {"left_nipple": 0.5, "right_nipple": 0.5}
_BUTTOCKS = {"left_buttock": 0.5, "right_buttock": 0.5}
_UPPER_ARM, _FOREARM = ("right_elbow", "right_shoulder"), ("right_wrist", "right_elbow")
_THIGH, _SHIN = ("right_knee", "right_hip"), ("right_ankle", "right_knee")
_CLOTHING, _DESIGN = "ISO 8559-1", "ISO 7250-1"
_BOTH = f"{_CLOTHING}; {_DESIGN}"
_OVER_SKIN = "over the skin, where a calliper presses to the bone"


def open_definitions(fractions: Mapping[str, float]) -> tuple[Measurement, ...]:
    """Return the measurements of the open body model, standing.

    Parameters
    ----------
    fractions : mapping of str to float
        Places on their bones, from 0 to 1, where the forearm and the calf are thickest and the
        wrist and the ankle thinnest.

    Returns
    -------
    tuple of Measurement
    """

    def on(bone: tuple[str, str], fraction: float) -> dict[str, float]:
        end, start = bone
        return {start: round(1.0 - fraction, 2), end: fraction}

    return (*_heights(), *_girths(on, fractions), *_lengths(), *_breadths(), *_wholes())


def _named(standard: str = "", ansur: str = "", caesar: str = "", smpl: str = "") -> dict[str, Any]:
    names = {"ANSUR II": ansur, "CAESAR": caesar, "SMPL-Anthropometry": smpl}
    return {"standard": standard, "equivalents": {k: v for k, v in names.items() if v}}


def _heights() -> tuple[Measurement, ...]:
    rows = (
        ("stature", "crown", _DESIGN, "stature", "Stature", "height"),
        ("cervical height", "cervicale", _CLOTHING, "cervicaleheight"),
        ("waist height", "right_waist", _CLOTHING, "", "≈ Waist Height, Preferred"),
        ("waist height (omphalion)", "omphalion", "", "waistheightomphalion"),
        ("hip height", _BUTTOCKS, _CLOTHING, "buttockheight", "≈ Hip Circ Max Height"),
        ("inside leg height", "crotch", _DESIGN, "crotchheight", "Crotch Height")
        + ("inside leg height",),
        ("shoulder height", "right_acromion", _DESIGN, "acromialheight"),
        ("armpit height", "right_axilla", "", "axillaheight"),
        ("chest height", "right_nipple", "", "chestheight"),
        ("suprasternale height", "suprasternale", "", "suprasternaleheight"),
        ("tenth rib height", "right_tenth_rib", "", "tenthribheight"),
        ("iliocristale height", "right_iliocristale", "", "iliocristaleheight"),
        ("trochanter height", "right_trochanterion", "", "trochanterionheight"),
        ("knee height (midpatella)", "right_midpatella", "", "kneeheightmidpatella"),
        ("lateral epicondyle height", "right_lateral_epicondyle", "")
        + ("lateralfemoralepicondyleheight",),
        ("tibial height", "right_tibiale", _DESIGN, "tibialheight"),
        ("ankle height", "right_lateral_malleolus", _CLOTHING, "lateralmalleolusheight"),
    )
    above = Height(
        name="tragion to crown",
        at="crown",
        above="right_tragion",
        **_named(ansur="tragiontopofhead"),
    )
    return (*(Height(name=name, at=at, **_named(*names)) for name, at, *names in rows), above)


def _girths(on: Any, fractions: Mapping[str, float]) -> tuple[Measurement, ...]:
    return (
        *_girths_of_head_and_neck(),
        *_girths_of_trunk(),
        *_girths_of_arms(on, fractions),
        *_girths_of_thighs(on),
        *_girths_of_lower_legs(on, fractions),
    )


def _girths_of_head_and_neck() -> tuple[Measurement, ...]:
    neck: dict[str, Any] = {"parts": ("trunk", "neck", "head"), "hull": True}
    return (
        Girth(
            name="head girth",
            at=_SKULL,
            normal=(_SKULL, "skull_top"),
            parts=("head",),
            hull=True,
            **_named(_BOTH, "headcircumference", "Head Circumference", "head circumference"),
        ),
        Girth(
            name="neck girth",
            at="right_neck",
            normal=("neck", "head"),
            **neck,
            **_named(_BOTH, "neckcircumference", smpl="neck circumference"),
        ),
        Girth(
            name="neck base girth",
            at={"left_neck_base": 0.5, "right_neck_base": 0.5},
            normal=("cervicale", "left_clavicle", "right_clavicle"),
            **neck,
            **_named(_CLOTHING, "neckcircumferencebase", "Neck Base Circumference"),
        ),
    )


def _girths_of_trunk() -> tuple[Measurement, ...]:
    trunk: dict[str, Any] = {"parts": TRUNK, "leave_out": ARMS, "hull": True}
    hips: dict[str, Any] = {"parts": (*TRUNK, *LEGS), "leave_out": ARMS, "hull": True}
    return (
        Girth(
            name="chest girth",
            at=_BUST,
            note="at the bust points, of women: bust; CAESAR's chest girth at the scye is higher",
            **trunk,
            **_named(
                _BOTH, "chestcircumference", "Bust/Chest Circumference", "chest circumference"
            ),
        ),
        Girth(
            name="under-bust girth",
            at="under_bust",
            **trunk,
            **_named(_CLOTHING, caesar="Bust/Chest Circ Under Bust"),
        ),
        Girth(
            name="waist girth",
            at="right_waist",
            note="natural waist: the narrowest level, near the midpoint of the lowest rib and the "
            "iliac crest; not the navel's",
            **trunk,
            **_named(_BOTH, caesar="≈ Waist Circumference, Preferred"),
        ),
        Girth(
            name="waist girth (omphalion)",
            at="omphalion",
            note="level at the navel",
            **hips,
            **_named(ansur="waistcircumference", smpl="waist circumference"),
        ),
        Girth(
            name="hip girth",
            at=_BUTTOCKS,
            note="level where the buttocks protrude most",
            **hips,
            **_named(
                _CLOTHING,
                "buttockcircumference",
                "≈ Hip Circumference, Maximum",
                "hip circumference",
            ),
        ),
    )


def _girths_of_arms(on: Any, fractions: Mapping[str, float]) -> tuple[Measurement, ...]:
    arm: dict[str, Any] = {"parts": _RIGHT_ARM, "hull": True}
    return (
        Girth(
            name="upper arm girth",
            at=on(_UPPER_ARM, 0.5),
            normal=_UPPER_ARM,
            note="relaxed, at the middle of the bone; ANSUR's is flexed, at the thickest place",
            **arm,
            **_named(_CLOTHING, "≈ bicepscircumferenceflexed", smpl="bicep right circumference"),
        ),
        Girth(
            name="forearm girth",
            at=on(_FOREARM, fractions["forearm"]),
            normal=_FOREARM,
            note="relaxed, at the thickest place; ANSUR's is flexed with a fist",
            **arm,
            **_named(_CLOTHING, "≈ forearmcircumferenceflexed", smpl="forearm right circumference"),
        ),
        Girth(
            name="wrist girth",
            at=on(_FOREARM, fractions["wrist"]),
            normal=_FOREARM,
            **arm,
            **_named(_BOTH, "wristcircumference", smpl="wrist right circumference"),
        ),
        Girth(
            name="hand girth",
            at={"right_second_metacarpal": 0.5, "right_fifth_metacarpal": 0.5},
            normal=("right_wrist", "right_dactylion"),
            note="around the knuckles without the thumb",
            **arm,
            **_named(_CLOTHING, "handcircumference", "Hand Circumference"),
        ),
    )


def _girths_of_thighs(on: Any) -> tuple[Measurement, ...]:
    leg: dict[str, Any] = {"parts": _RIGHT_LEG, "hull": True}
    return (
        # Where thighs touch, or the crotch is low, the line crosses other parts.
        Girth(
            name="thigh girth",
            at="right_thigh",
            normal=_THIGH,
            leave_out=(*TRUNK, "left leg", *ARMS),
            note="3 cm below the crotch, across the thigh bone; ANSUR's is level, at the fold of "
            "the buttock",
            **leg,
            **_named(
                _BOTH, "thighcircumference", "Thigh Circumference", "thigh left circumference"
            ),
        ),
        Girth(
            name="mid-thigh girth",
            at=on(_THIGH, 0.5),
            normal=_THIGH,
            **leg,
            **_named(_CLOTHING),
        ),
        Girth(
            name="lower thigh girth",
            at="right_suprapatella",
            normal=_THIGH,
            note="just above the kneecap",
            **leg,
            **_named(ansur="lowerthighcircumference"),
        ),
        Girth(
            name="knee girth",
            at="right_knee",
            normal=("right_ankle", "right_hip"),
            **leg,
            **_named(_CLOTHING),
        ),
    )


def _girths_of_lower_legs(on: Any, fractions: Mapping[str, float]) -> tuple[Measurement, ...]:
    leg: dict[str, Any] = {"parts": _RIGHT_LEG, "hull": True}
    return (
        Girth(
            name="calf girth",
            at=on(_SHIN, fractions["calf"]),
            normal=_SHIN,
            note="where it is the largest on the mean body",
            **leg,
            **_named(_BOTH, "calfcircumference", smpl="calf left circumference"),
        ),
        Girth(
            name="ankle girth",
            at=on(_SHIN, fractions["ankle"]),
            normal=_SHIN,
            note="the least of the leg, above the malleoli",
            **leg,
            **_named(
                _CLOTHING, "anklecircumference", "Ankle Circumference", "ankle left circumference"
            ),
        ),
        Girth(
            name="heel and ankle girth",
            at={"right_heel_bottom": 0.5, "right_ankle_front": 0.5},
            normal=("right_heel_bottom", "right_ankle_front", "right_ankle_front_inside"),
            **leg,
            **_named(ansur="heelanklecircumference"),
        ),
        Girth(
            name="foot girth",
            at={"right_first_metatarsal": 0.5, "right_fifth_metatarsal": 0.5},
            normal=("right_heel", "right_toe"),
            note="at the ball of the foot",
            **leg,
            **_named(_CLOTHING, "balloffootcircumference"),
        ),
    )


def _lengths() -> tuple[Measurement, ...]:
    return (
        *_lengths_of_limbs(),
        *_lengths_of_trunk(),
        *_lengths_of_shoulders_and_arms(),
        *_lengths_of_feet_and_head(),
    )


def _lengths_of_limbs() -> tuple[Measurement, ...]:
    return (
        Length(
            name="arm length",
            along=("right_acromion", "right_elbow", "right_wrist"),
            note="by the centres of elbow and wrist",
            **_named(
                _CLOTHING, "≈ sleeveoutseam", "≈ Arm Length (Shoulder to Wrist)", "arm right length"
            ),
        ),
        Length(
            name="arm length along joints", along=("right_shoulder", "right_wrist"), path="joints"
        ),
        Length(
            name="outside leg length",
            along=("right_waist", "right_thigh", "right_sole"),
            standard=_CLOTHING,
            note="from the waist over the side of the thigh to the sole",
        ),
    )


def _lengths_of_trunk() -> tuple[Measurement, ...]:
    return (
        Length(
            name="shoulder (biacromial) breadth",
            along=("left_acromion", "right_acromion"),
            **_named(_DESIGN, "biacromialbreadth", "Biacromial Breadth", "shoulder breadth"),
        ),
        Length(
            name="back length",
            along=("cervicale", "waist_back"),
            path="surface",
            note="from the cervicale to the natural waist, along the surface",
            **_named(_CLOTHING),
        ),
        Length(
            name="back length (omphalion)",
            along=("cervicale", "omphalion_back"),
            path="surface",
            note="from the cervicale to the level of the navel, along the surface",
            **_named(ansur="waistbacklength"),
        ),
        Length(
            name="front length (omphalion)",
            along=("suprasternale", "omphalion"),
            path="surface",
            note="ANSUR's people sit",
            **_named(ansur="≈ waistfrontlengthsitting", caesar="≈ Waist Front Length"),
        ),
        Length(
            name="crotch length (omphalion)",
            along=("omphalion", "perineum", "omphalion_back"),
            path="surface",
            **_named(ansur="crotchlengthomphalion", caesar="Total Crotch Length"),
        ),
        Length(
            name="posterior crotch length (omphalion)",
            along=("perineum", "omphalion_back"),
            path="surface",
            **_named(ansur="crotchlengthposterioromphalion"),
        ),
        Length(
            name="vertical trunk girth",
            along=("right_midshoulder", "right_nipple", "perineum")
            + ("right_buttock", "right_midshoulder"),
            path="surface",
            **_named(_CLOTHING, "verticaltrunkcircumferenceusa", "Vertical Trunk Circumference"),
        ),
    )


def _lengths_of_shoulders_and_arms() -> tuple[Measurement, ...]:
    side = ("shoulder", "elbow", "wrist", "dactylion")
    both = (*(f"left_{p}" for p in reversed(side)), *(f"right_{p}" for p in side))
    return (
        Length(
            name="shoulder length",
            along=("right_neck_base", "right_acromion"),
            path="surface",
            **_named(_CLOTHING, "shoulderlength"),
        ),
        Length(
            name="back breadth (interscye)",
            along=("left_axilla", "right_axilla"),
            path="surface",
            note="between the folds of the armpits",
            **_named(ansur="interscyei"),
        ),
        Length(
            name="back breadth (midscye)",
            along=("left_midscye", "right_midscye"),
            path="surface",
            **_named(_CLOTHING, "interscyeii"),
        ),
        Length(
            name="upper arm length",
            along=("right_acromion", "right_radiale"),
            **_named(ansur="acromionradialelength"),
        ),
        Length(
            name="forearm length",
            along=("right_radiale", "right_stylion"),
            **_named(_DESIGN, "radialestylionlength"),
        ),
        Length(
            name="spine to wrist length",
            along=("midspine", "right_acromion", "right_radiale", "right_stylion"),
            note="straight from point to point; ANSUR's along the bent arm",
            **_named(ansur="≈ sleevelengthspinewrist", caesar="≈ Arm Length (Spine to Wrist)"),
        ),
        Length(
            name="arm span",
            along=both,
            note="the sum of the straight lines between the joints",
            **_named(ansur="span"),
        ),
        Length(
            name="hand length",
            along=("right_stylion", "right_dactylion"),
            **_named(_DESIGN, "handlength", "Hand Length"),
        ),
        Length(
            name="palm length",
            along=("right_palm_base", "right_finger_base"),
            **_named(_DESIGN, "palmlength"),
        ),
    )


def _lengths_of_feet_and_head() -> tuple[Measurement, ...]:
    return (
        Length(
            name="foot length",
            along=("right_heel", "right_toe"),
            **_named(_DESIGN, "footlength", "Foot Length"),
        ),
        Length(
            name="ball of foot length",
            along=("right_heel", "right_first_metatarsal"),
            axis=("right_heel", "right_toe"),
            **_named(ansur="balloffootlength"),
        ),
        Length(
            name="head length",
            along=("glabella", "opisthocranion"),
            **_named(_DESIGN, "headlength", "Head Length"),
        ),
        Length(
            name="face length",
            along=("sellion", "menton"),
            **_named(_DESIGN, "mentonsellionlength", "Face Length"),
        ),
        Length(
            name="bitragion-chin arc",
            along=("left_tragion", "pogonion", "right_tragion"),
            path="surface",
            **_named(ansur="bitragionchinarc"),
        ),
        Length(
            name="bitragion-submandibular arc",
            along=("left_tragion", "submandibular", "right_tragion"),
            path="surface",
            **_named(ansur="bitragionsubmandibulararc"),
        ),
        Length(
            name="ear length",
            along=("right_ear_top", "right_ear_bottom"),
            **_named(ansur="earlength"),
        ),
        Length(
            name="ear breadth",
            along=("right_ear_front", "right_ear_back"),
            **_named(ansur="earbreadth"),
        ),
        Length(
            name="ear protrusion",
            along=("right_mastoid", "right_ear_outside"),
            axis=("right_tragion", "left_tragion"),
            **_named(ansur="earprotrusion"),
        ),
    )


def _breadths() -> tuple[Measurement, ...]:
    trunk: dict[str, Any] = {"parts": TRUNK, "leave_out": ARMS}
    hips: dict[str, Any] = {"parts": (*TRUNK, *LEGS), "leave_out": ARMS}

    def across(name: str, point: str, standard: str, ansur: str, caesar: str = "") -> Length:
        along = (f"left_{point}", f"right_{point}")
        return Length(name=name, along=along, **_named(standard, ansur, caesar))

    def between(name: str, first: str, last: str, ansur: str) -> Length:
        return Length(name=name, along=(first, last), **_named(ansur=ansur))

    return (
        Breadth(name="chest breadth", at=_BUST, **trunk, **_named(_DESIGN, "chestbreadth")),
        Depth(
            name="chest depth",
            at=_BUST,
            **trunk,
            **_named(_DESIGN, "chestdepth"),
        ),
        Breadth(name="waist breadth", at="right_waist", note="at the natural waist", **trunk),
        Depth(name="waist depth", at="right_waist", note="at the natural waist", **trunk),
        Breadth(
            name="waist breadth (omphalion)",
            at="omphalion",
            **hips,
            **_named(ansur="waistbreadth"),
        ),
        Depth(name="waist depth (omphalion)", at="omphalion", **hips, **_named(ansur="waistdepth")),
        Breadth(name="hip breadth", at=_BUTTOCKS, **hips, **_named(_DESIGN, "hipbreadth")),
        Depth(name="buttock depth", at=_BUTTOCKS, **hips, **_named(ansur="buttockdepth")),
        replace(
            across("iliac crest breadth", "iliocristale", "", "≈ bicristalbreadth"), note=_OVER_SKIN
        ),
        across("head breadth", "euryon", _DESIGN, "headbreadth", "Head Breadth"),
        across("face breadth", "zygion", "", "bizygomaticbreadth"),
        across("interpupillary breadth", "pupil", "", "interpupillarybreadth"),
        between("hand breadth", "right_second_metacarpal", "right_fifth_metacarpal", "handbreadth"),
        between("foot breadth", "right_foot_inside", "right_foot_outside", "footbreadthhorizontal"),
        between("heel breadth", "right_heel_inside", "right_heel_outside", "heelbreadth"),
        between(
            "ankle breadth",
            "right_medial_malleolus",
            "right_lateral_malleolus",
            "bimalleolarbreadth",
        ),
    )


def _wholes() -> tuple[Measurement, ...]:
    return (
        Volume(name="volume"),
        Area(name="surface area"),
        Mass(
            name="body mass",
            note="an estimate: the volume at 1000 kg a cubic metre",
            **_named(_DESIGN, "weightkg", "Weight"),
        ),
    )


def seated_definitions() -> tuple[Measurement, ...]:
    """Return the measurements of the open body model, seated with forearms forward."""
    return (*_seated_heights(), *_seated_lengths())


def _seated_heights() -> tuple[Measurement, ...]:
    def height(name: str, at: str, standard: str, ansur: str, caesar: str = "") -> Height:
        return Height(name=name, at=at, above="right_seat", **_named(standard, ansur, caesar))

    return (
        height("sitting height", "crown", _DESIGN, "sittingheight", "Sitting Height"),
        height(
            "eye height, sitting",
            "right_ectocanthus",
            _DESIGN,
            "eyeheightsitting",
            "Eye Height, Sitting",
        ),
        height(
            "elbow rest height",
            "right_olecranon_below",
            _DESIGN,
            "elbowrestheight",
            "Elbow Height, Sitting",
        ),
        Height(
            name="knee height, sitting",
            at="right_knee_top",
            **_named(_DESIGN, "kneeheightsitting", "Knee Height, Sitting"),
        ),
        Height(
            name="popliteal height",
            at="right_popliteal",
            **_named(_DESIGN, "poplitealheight"),
        ),
        height("thigh clearance", "right_thigh_top", _DESIGN, "thighclearance"),
    )


def _seated_lengths() -> tuple[Measurement, ...]:
    arms: dict[str, Any] = {"parts": (*TRUNK, *ARMS), "hull": True}

    def reach(name: str, *along: str, **names: Any) -> Length:
        return Length(name=name, along=along, axis="forward", **_named(**names))

    return (
        reach(
            "buttock-knee length",
            "right_buttock_seated",
            "right_knee_front",
            standard=_DESIGN,
            ansur="buttockkneelength",
            caesar="Buttock-Knee Length",
        ),
        reach(
            "buttock-popliteal length",
            "right_buttock_seated",
            "right_calf_back",
            standard=_DESIGN,
            ansur="buttockpopliteallength",
        ),
        reach(
            "forearm-hand length",
            "right_olecranon_back",
            "right_dactylion",
            standard=_DESIGN,
            ansur="forearmhandlength",
        ),
        Length(
            name="shoulder-elbow length",
            along=("right_acromion", "right_olecranon_below"),
            axis="up",
            **_named(_DESIGN, "shoulderelbowlength"),
        ),
        Length(
            name="shoulder (bideltoid) breadth",
            along=("left_deltoid", "right_deltoid"),
            **_named(_DESIGN, "bideltoidbreadth", "Shoulder Breadth"),
        ),
        Length(
            name="hip breadth, sitting",
            along=("left_hip_seated", "right_hip_seated"),
            axis="left",
            **_named(_DESIGN, "hipbreadthsitting", "Hip Breadth, Sitting"),
        ),
        Depth(
            name="abdominal depth, sitting",
            at="abdomen",
            parts=TRUNK,
            leave_out=(*ARMS, *LEGS),
            **_named(_DESIGN, "abdominalextensiondepthsitting"),
        ),
        Girth(
            name="shoulder girth",
            at={"left_deltoid": 0.5, "right_deltoid": 0.5},
            **arms,
            **_named(ansur="shouldercircumference"),
        ),
    )
