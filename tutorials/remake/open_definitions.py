"""Definitions of the open body model's measurements, named as in the standards."""

from __future__ import annotations

from collections.abc import Mapping
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
"""Joint angles of the standard pose, in the notation of `riemhuman.datasets.open_poses`."""

_TRUNK_JOINTS = ("pelvis", "lower_spine", "middle_spine", "upper_spine", "chest")
PARTS = {
    "trunk": (*_TRUNK_JOINTS, "left_collar", "right_collar"),
    "neck": ("neck",),
    "head": ("head",),
    **{
        f"{side} {limb}": tuple(f"{side}_{joint}" for joint in joints)
        for side in ("left", "right")
        for limb, joints in (
            ("arm", ("shoulder", "elbow", "wrist")),
            ("leg", ("hip", "knee", "ankle", "toes")),
        )
    },
}
"""Parts of the body: a triangle belongs to the part of the joint with its largest weight."""

TRUNK, ARMS, LEGS = ("trunk",), ("left arm", "right arm"), ("left leg", "right leg")
_RIGHT_ARM, _RIGHT_LEG = ("right arm",), ("right leg",)

# Names follow the standards where they are certain; numbers of clauses are not, so none are given.
_CLOTHING, _DESIGN = "ISO 8559-1", "ISO 7250-1"
_SKULL = {"glabella": 0.5, "opisthocranion": 0.5}
_BUST = {"left_nipple": 0.5, "right_nipple": 0.5}
_BUTTOCKS = {"left_buttock": 0.5, "right_buttock": 0.5}
_UPPER_ARM, _FOREARM = ("right_elbow", "right_shoulder"), ("right_wrist", "right_elbow")
_THIGH, _SHIN = ("right_knee", "right_hip"), ("right_ankle", "right_knee")


def open_definitions(fractions: Mapping[str, float]) -> tuple[Measurement, ...]:
    """Return the measurements of the open body model.

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

    trunk: dict[str, Any] = {"parts": TRUNK, "leave_out": ARMS, "hull": True}
    hips: dict[str, Any] = {"parts": (*TRUNK, *LEGS), "leave_out": ARMS}
    arm: dict[str, Any] = {"parts": _RIGHT_ARM, "hull": True}
    leg: dict[str, Any] = {"parts": _RIGHT_LEG, "hull": True}
    return (
        Height(name="stature", at="crown", standard=_DESIGN),
        Height(name="cervical height", at="cervicale", standard=_CLOTHING),
        Height(name="waist height", at="right_waist", standard=_CLOTHING),
        Height(name="hip height", at=_BUTTOCKS, standard=_CLOTHING),
        Girth(
            name="head girth",
            at=_SKULL,
            normal=(_SKULL, "skull_top"),
            parts=("head",),
            hull=True,
            standard=_CLOTHING,
        ),
        Girth(
            name="neck girth",
            at={"neck": 0.7, "head": 0.3},
            normal=("neck", "head"),
            parts=("trunk", "neck", "head"),
            hull=True,
            standard=_CLOTHING,
        ),
        Girth(name="chest girth", at=_BUST, standard=_CLOTHING, note="of women: bust", **trunk),
        Girth(name="under-bust girth", at="under_bust", standard=_CLOTHING, **trunk),
        Girth(name="waist girth", at="right_waist", standard=_CLOTHING, **trunk),
        Girth(name="hip girth", at=_BUTTOCKS, standard=_CLOTHING, hull=True, **hips),
        Girth(
            name="upper arm girth",
            at=on(_UPPER_ARM, 0.5),
            normal=_UPPER_ARM,
            standard=_CLOTHING,
            **arm,
        ),
        Girth(
            name="forearm girth",
            at=on(_FOREARM, fractions["forearm"]),
            normal=_FOREARM,
            standard=_CLOTHING,
            **arm,
        ),
        Girth(
            name="wrist girth",
            at=on(_FOREARM, fractions["wrist"]),
            normal=_FOREARM,
            standard=_CLOTHING,
            **arm,
        ),
        # Where thighs touch, or the crotch is low, the line crosses other parts.
        Girth(
            name="thigh girth",
            at="right_thigh",
            normal=_THIGH,
            leave_out=(*TRUNK, "left leg", *ARMS),
            standard=_CLOTHING,
            **leg,
        ),
        Girth(name="mid-thigh girth", at=on(_THIGH, 0.5), normal=_THIGH, standard=_CLOTHING, **leg),
        Girth(
            name="knee girth",
            at="right_knee",
            normal=("right_ankle", "right_hip"),
            standard=_CLOTHING,
            **leg,
        ),
        Girth(
            name="calf girth",
            at=on(_SHIN, fractions["calf"]),
            normal=_SHIN,
            standard=_CLOTHING,
            **leg,
        ),
        Girth(
            name="ankle girth",
            at=on(_SHIN, fractions["ankle"]),
            normal=_SHIN,
            standard=_CLOTHING,
            note="the least of the leg",
            **leg,
        ),
        Length(
            name="arm length",
            along=("right_acromion", "right_elbow", "right_wrist"),
            standard=_CLOTHING,
            note="by the centres of elbow and wrist",
        ),
        Length(
            name="arm length along joints", along=("right_shoulder", "right_wrist"), path="joints"
        ),
        Height(name="inside leg height", at="crotch", standard=_CLOTHING),
        Length(
            name="outside leg length",
            along=("right_waist", "right_thigh", "right_sole"),
            standard=_CLOTHING,
            note="from the waist over the side of the thigh to the sole",
        ),
        Length(
            name="shoulder (biacromial) breadth",
            along=("left_acromion", "right_acromion"),
            standard=_DESIGN,
        ),
        Length(
            name="back length",
            along=("cervicale", "waist_back"),
            path="surface",
            standard=_CLOTHING,
            note="from the cervicale to the waist, along the surface",
        ),
        Length(name="foot length", along=("right_heel", "right_toe"), standard=_DESIGN),
        Depth(name="chest depth", at=_BUST, parts=TRUNK, leave_out=ARMS, standard=_DESIGN),
        Breadth(name="waist breadth", at="right_waist", parts=TRUNK, leave_out=ARMS),
        Depth(name="waist depth", at="right_waist", parts=TRUNK, leave_out=ARMS),
        Breadth(name="hip breadth", at=_BUTTOCKS, standard=_DESIGN, **hips),
        Volume(name="volume"),
        Area(name="surface area"),
        Mass(
            name="body mass",
            note="an estimate: the volume at 1000 kg a cubic metre",
        ),
    )
