"""The open motions, written as joint angles over one cycle.

Angles are degrees from the T-pose, in the axes of `riemhuman.datasets.open_poses`. An angle that
changes is written as the tuple of its values at evenly spaced times of the cycle: (0, 40) swings
from 0 to 40 and back. Between these times it follows a smooth curve within the values.

Arms are mostly written "xzx": a turn of the arm about itself (forward side down), the height of the
arm (-90 hangs, 0 is level, 90 is straight up), and a swing of the whole arm (-x is forward).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

Curve = float | tuple[float, ...]
"""A constant, or values at evenly spaced times of one cycle."""

CurvedAngles = tuple[Any, ...]
"""Axes, then one `Curve` for each: ("xz", 30, (-70, 0)) turns about x, then swings about z."""


@dataclass(frozen=True)
class Choreography:
    """One cycle of a motion, and its number of repetitions."""

    seconds: float
    cycles: float
    angles: Mapping[str, CurvedAngles]
    alternating: bool = False
    standing_on: tuple[str, ...] = ("left", "right")
    height: Curve = 0.0


OPEN_MOTIONS: dict[str, Choreography] = {
    # Two flaps with folded arms, then both arms rise from the sides to overhead.
    "chicken_wings": Choreography(
        seconds=2.6,
        cycles=1.2,
        angles={
            "collar": ("z", (0, 8, 0, 8, 0, 14, 24, 8)),
            "shoulder": (
                "xzx",
                (24, 45, 24, 45, 15, -25, -55, -10),
                (-62, -5, -62, -5, -76, -5, 56, -20),
                0,
            ),
            "elbow": ("y", (-118, -130, -118, -130, -30, -10, -14, -12)),
            "wrist": ("z", (-10, -25, -10, -25, -5, 0, 0, 0)),
            "hip": ("zx", 6, (-4, -9, -4, -9)),
            "knee": ("x", (9, 18, 9, 18)),
            "ankle": ("x", (-5, -9, -5, -9)),
            "upper_spine": ("x", (0, 3, 0, 3, 0, -2, -5, 0)),
            "head": ("x", (0, 4, 0, 4, 0, -4, -10, 0)),
        },
    ),
    # The pelvis circles over standing feet, while head and trunk look around and bend.
    "hips": Choreography(
        seconds=1.5,
        cycles=2.0,
        angles={
            "pelvis": ("xz", (14, 0, -10, 0), (0, 9, 0, -9)),
            "lower_spine": ("xz", (-5, 0, 3, 0), (0, -7, 0, 7)),
            "middle_spine": ("xz", (-5, 0, 3, 0), (0, -6, 0, 6)),
            "upper_spine": ("xz", (-3, 0, 3, 0), (0, -4, 0, 4)),
            "neck": ("xy", (-3, 0, 3, 0), (-10, 0, 10, 0)),
            "head": ("xy", (4, 0, 0, 0), (-18, 0, 18, 0)),
            "left_hip": ("xz", (-26, -8, 6, -8), (9, 0, 9, 18)),
            "right_hip": ("xz", (-26, -8, 6, -8), (-9, -18, -9, 0)),
            "knee": ("x", (18, 12, 8, 12)),
            "ankle": ("x", (-6, -4, -4, -4)),
            "shoulder": ("xyz", 50, 12, -42),
            "elbow": ("y", (-90, -84)),
            "wrist": ("z", -10),
        },
    ),
    "jiggle_on_toes": Choreography(
        seconds=0.5,
        cycles=4.4,
        angles={
            "hip": ("zx", 5, (-4, -12)),
            "knee": ("x", (8, 24)),
            "ankle": ("x", (34, 8)),
            "toes": ("x", (-36, -14)),
            "shoulder": ("xzx", 10, (-58, -66), (-6, 4)),
            "elbow": ("y", (-32, -20)),
            "wrist": ("z", (-14, 8)),
            "collar": ("z", (6, -2)),
            "upper_spine": ("x", (0, 3)),
            "head": ("x", (-3, 4)),
        },
    ),
    # Arms rise from the sides to overhead while the feet jump apart.
    "jumping_jacks": Choreography(
        seconds=1.1,
        cycles=2.2,
        height=(0.0, 0.10, 0.0, 0.10),
        angles={
            "collar": ("z", (-4, 10, 27, 10)),
            "shoulder": ("xzx", (20, -15, -55, -15), (-67, -5, 56, -5), (0, -4, 0, -4)),
            "elbow": ("y", (-12, -24, -16, -24)),
            "hip": ("zx", (3, 11, 20, 11), (-16, -4, -18, -4)),
            "knee": ("x", (28, 9, 30, 9)),
            "ankle": ("x", (-14, 28, -12, 28)),
            "toes": ("x", (0, -6, 0, -6)),
            "lower_spine": ("x", (4, 0, 2, 0)),
            "head": ("x", (2, 0, -8, 0)),
        },
    ),
    # Knees come up in turn, almost to the chest.
    "knees": Choreography(
        seconds=1.5,
        cycles=1.8,
        alternating=True,
        standing_on=(),
        angles={
            "pelvis": ("xyz", -3, (-5, 5), (3, -3)),
            "lower_spine": ("xy", (3, 3), (4, -4)),
            "middle_spine": ("xy", 3, (5, -5)),
            "upper_spine": ("xy", 2, (5, -5)),
            "hip": ("zx", (4, 7, 4, 4), (-8, -98, -8, 3)),
            "knee": ("x", (16, 112, 16, 7)),
            "ankle": ("x", (-2, 18, -2, -6)),
            "shoulder": ("xzx", 4, -69, (-5, 32, -5, -42)),
            "elbow": ("y", (-35, -30, -35, -70)),
        },
    ),
    "light_hopping_loose": Choreography(
        seconds=0.62,
        cycles=3.8,
        height=(0.0, 0.0, 0.09, 0.0),
        angles={
            "collar": ("z", (-3, 4, 10, 3)),
            "shoulder": ("xzx", 15, (-72, -62, -34, -48), (10, -12, -20, 4)),
            "elbow": ("y", (-18, -38, -62, -40)),
            "wrist": ("zy", (12, -8, -25, 5), (0, 10, 0, -10)),
            "hip": ("zx", 5, (-34, -8, -10, -16)),
            "knee": ("x", (54, 12, 20, 26)),
            "ankle": ("x", (-22, 26, 36, 12)),
            "toes": ("x", (0, -24, -4, -12)),
            "lower_spine": ("x", (8, 1, 0, 4)),
            "upper_spine": ("x", (7, 1, 0, 4)),
            "neck": ("x", (6, -3, -6, 2)),
            "head": ("x", (6, -4, -6, 2)),
        },
    ),
    "light_hopping_stiff": Choreography(
        seconds=0.5,
        cycles=4.4,
        height=(0.0, 0.0, 0.06, 0.0),
        angles={
            "shoulder": ("xzx", 5, (-71, -68), (2, -3)),
            "elbow": ("y", (-9, -13)),
            "hip": ("zx", 3, (-9, -3, -3, -5)),
            "knee": ("x", (18, 7, 7, 11)),
            "ankle": ("x", (-9, 26, 30, 16)),
            "toes": ("x", (0, -26, -4, -14)),
            "collar": ("z", (-2, 4)),
            "head": ("x", (3, -2)),
        },
    ),
    # Hopping on the left leg, arms out for balance.
    "one_leg_jump": Choreography(
        seconds=0.75,
        cycles=3.2,
        height=(0.0, 0.0, 0.10, 0.0),
        standing_on=("left",),
        angles={
            "pelvis": ("z", (-4, -2)),
            "lower_spine": ("xz", (9, 1, 1, 5), (3, 2)),
            "upper_spine": ("xz", (8, 1, 1, 5), (3, 1)),
            "left_hip": ("zx", -1, (-40, -6, -8, -18)),
            "left_knee": ("x", (60, 11, 18, 28)),
            "left_ankle": ("x", (-22, 26, 36, 12)),
            "left_toes": ("x", (0, -24, -4, -12)),
            "right_hip": ("zx", -7, (-50, -56, -60, -52)),
            "right_knee": ("x", (96, 94, 100, 90)),
            "right_ankle": ("x", (12, 24)),
            "left_shoulder": ("xzx", 10, (-48, -14, -2, -30), (18, -12, -20, 4)),
            "right_shoulder": ("xzx", 10, (44, 20, 10, 30), (10, -18, -26, -6)),
            "left_elbow": ("y", (-25, -42, -50, -34)),
            "right_elbow": ("y", (38, 54, 60, 44)),
            "head": ("x", (-8, -2, 2, -4)),
        },
    ),
    # Standing on the left leg, the right one shaken loosely, first in front, then behind.
    "one_leg_loose": Choreography(
        seconds=2.4,
        cycles=1.2,
        standing_on=("left",),
        angles={
            "pelvis": ("xyz", (0, 2, 8, 4), 0, -4),
            "lower_spine": ("xyz", (0, 0, 4, 2), (4, -4), 4),
            "upper_spine": ("xyz", (0, 0, 2, 1), (5, -5), 3),
            "neck": ("yz", (14, -14), (4, -4)),
            "head": ("xy", (6, 6, -6, 0), (18, -18)),
            "left_hip": ("zx", -3, (-8, -10, -22, -14)),
            "left_knee": ("x", (10, 12, 22, 16)),
            "left_ankle": ("x", (-3, -4, -9, -6)),
            "right_hip": (
                "yzx",
                (0, -14, 14, -14, 10, 0, 8, -8),
                (-8, -14, -8, -14, -6, -8, -5, -8),
                (-30, -48, -62, -44, -12, 14, 4, -6),
            ),
            "right_knee": ("x", (16, 58, 14, 62, 24, 58, 26, 52)),
            "right_ankle": ("x", (2, 30, -4, 28, 4, 32, 6, 28)),
            "left_shoulder": ("xzx", 10, (-22, -12, -34, -26), (0, -12, 6, 10)),
            "right_shoulder": ("xzx", 10, (24, 36, 14, 28), (6, -8, 0, -12)),
            "left_elbow": ("y", (-20, -34)),
            "right_elbow": ("y", (30, 18)),
        },
    ),
    # From a guard before the chin, straight punches left and right.
    "punching": Choreography(
        seconds=0.95,
        cycles=2.6,
        alternating=True,
        angles={
            "pelvis": ("y", (0, -9, 0, 9)),
            "lower_spine": ("xy", 4, (0, -8, 0, 8)),
            "middle_spine": ("xy", 4, (0, -8, 0, 8)),
            "upper_spine": ("xy", 3, (0, -8, 0, 8)),
            "head": ("xy", -4, (0, 20, 0, -20)),
            "collar": ("y", (0, -18, 0, 6)),
            "shoulder": ("xzx", (12, 32, 12, 6), (-70, -84, -70, -68), (-32, -84, -32, -22)),
            "elbow": ("y", (-126, -14, -126, -130)),
            "hip": ("zyx", 9, 8, (-16, -10, -16, -20)),
            "knee": ("x", (26, 18, 26, 32)),
            "ankle": ("x", (-10, -8, -10, -12)),
        },
    ),
    "running_on_spot": Choreography(
        seconds=0.72,
        cycles=3.4,
        alternating=True,
        standing_on=(),
        height=(0.0, 0.04, 0.0, 0.04),
        angles={
            "pelvis": ("xyz", 6, (-7, 0, 7, 0), (3, 0, -3, 0)),
            "lower_spine": ("xy", 2, (6, 0, -6, 0)),
            "middle_spine": ("xy", 1, (7, 0, -7, 0)),
            "upper_spine": ("xy", 1, (6, 0, -6, 0)),
            "head": ("xy", -4, (-8, 0, 8, 0)),
            "hip": ("zx", 2, (-74, -28, -10, 0)),
            "knee": ("x", (88, 34, 20, 92)),
            "ankle": ("x", (4, 8, -8, 30)),
            "toes": ("x", (0, -6, 0, -20)),
            "shoulder": ("xzx", 2, -66, (44, 6, -46, 2)),
            "elbow": ("y", (-84, -92, -108, -94)),
        },
    ),
    # Arms shaken loosely, from hanging over curled elbows to stretched out in front and sideways.
    "shake_arms": Choreography(
        seconds=3.0,
        cycles=1.0,
        angles={
            "collar": ("z", (0, 2, 0, 4, 0, 4, 4, 8, 6, 10, 6, 2)),
            "shoulder": (
                "xzx",
                (10, 0, 15, 5, 20, 10, 15, -10, 20, -15, 10, 10),
                (-74, -66, -74, -70, -78, -74, -70, -36, -14, -28, -6, -46),
                (0, -8, -6, -24, -46, -70, -44, -24, 0, -12, 0, 0),
            ),
            "elbow": ("y", (-14, -62, -112, -78, -20, -62, -20, -66, -18, -58, -16, -40)),
            "wrist": ("zy", (0, -30, 20, -30, 25, -30, 25, -30, 25, -30, 20, -10), (6, -6)),
            "hip": ("zx", 6, (-6, -12, -6, -12, -6, -12)),
            "knee": ("x", (10, 20, 10, 20, 10, 20)),
            "ankle": ("x", (-4, -8, -4, -8, -4, -8)),
            "chest": ("y", (3, -3, 3, -3, 3, -3)),
            "head": ("z", (4, -4)),
        },
    ),
    # Hips thrown from side to side, weight on one leg and the other.
    "shake_hips": Choreography(
        seconds=0.8,
        cycles=3.0,
        angles={
            "pelvis": ("zy", (11, -11), (0, 9, 0, -9)),
            "lower_spine": ("zy", (-7, 7), (0, -5, 0, 5)),
            "middle_spine": ("zy", (-6, 6), (0, -4, 0, 4)),
            "upper_spine": ("zy", (-3, 3), (0, -4, 0, 4)),
            "neck": ("z", (6, -6)),
            "left_hip": ("zx", (-8, 21), (-8, -20)),
            "right_hip": ("zx", (-21, 8), (-20, -8)),
            "left_knee": ("x", (10, 34)),
            "right_knee": ("x", (34, 10)),
            "left_ankle": ("x", (-3, -12)),
            "right_ankle": ("x", (-12, -3)),
            "left_shoulder": ("xzx", 15, (-48, -56), (-8, 4)),
            "right_shoulder": ("xzx", 15, (56, 48), (4, -8)),
            "elbow": ("y", (-70, -82)),
            "wrist": ("z", (-14, 8)),
        },
    ),
    # Shoulders thrown forward and back in turn, while the trunk bends down, up and sideways.
    "shake_shoulders": Choreography(
        seconds=2.8,
        cycles=1.1,
        angles={
            "pelvis": ("xz", (0, 14, 0, 0), (0, 0, 2, -2)),
            "lower_spine": ("xz", (0, 10, -4, -2), (0, 0, 8, -8)),
            "middle_spine": ("xzy", (0, 11, -4, -2), (0, 0, 8, -8), (5, -5) * 5),
            "upper_spine": ("xzy", (0, 9, -3, -2), (0, 0, 7, -7), (6, -6) * 5),
            "chest": ("y", (9, -9) * 5),
            "neck": ("xyz", (0, 12, -6, 0), (-9, 9) * 5, (0, 0, 6, -6)),
            "head": ("xyz", (0, 14, -14, 0), (-8, 8) * 5, (0, 0, 4, -4)),
            "left_collar": ("yz", (9, -11) * 5, (8, -2) * 5),
            "right_collar": ("yz", (11, -9) * 5, (2, -8) * 5),
            "left_shoulder": ("xzx", 15, (-58, -50, -44, -56), (12, -16) * 5),
            "right_shoulder": ("xzx", 15, (58, 50, 56, 44), (-16, 12) * 5),
            "left_elbow": ("y", (-52, -66) * 5),
            "right_elbow": ("y", (66, 52) * 5),
            "hip": ("zx", 7, (-8, -36, -4, -8)),
            "knee": ("x", (10, 24, 10, 12)),
            "ankle": ("x", (-2, -3)),
        },
    ),
}
"""The motions, in the order of their names."""
