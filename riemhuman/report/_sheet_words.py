"""Words and numbers of a person's sheet that its templates cannot make by themselves."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache

import numpy as np

from riemhuman.arrays import Integers
from riemhuman.readable_units import ReadableUnit, readable_unit
from riemhuman.report.registered_scans import badge_of
from riemhuman.report.sheet_values import SheetSubject, SheetValues

NOTHING = "–"
_MINUS = "−"
# Digits justified by the uncertainty of measurements.
_DIGITS = {"cm": 1, "kg": 1, "L": 1, "in": 1, "lb": 1, "in³": 0, "in²": 0, "m²": 2}
_SQUARE_METRES = ReadableUnit("m²", 1.0, 2)
WHOLE = 0.98  # share of the vertices from which a body counts as seen
# What names functions, arguments or options says nothing to a client.
_CODE = re.compile(r"--\w|\w=|\w\(|\w_\w|[A-Z]\w*[a-z][A-Z]|\w\.\w")


@dataclass(frozen=True)
class Numbers:
    """Numbers in SI units as people read them, in centimetres or inches ("cm" or "in")."""

    system: str

    def value(self, value: float, unit: str, sign: str = "") -> str:
        if not np.isfinite(value):
            return NOTHING
        return _unit(unit, self.system).text(value, sign=sign).replace("-", _MINUS)

    def uncertainty(self, value: float, unit: str) -> str:
        """Return an uncertainty, with one more digit if it would be 0; nothing if it is exact."""
        if not np.isfinite(value):
            return ""
        readable = _unit(unit, self.system)
        if abs(value * readable.scale) >= 0.5 * 10.0**-readable.digits:
            return self.value(value, unit)
        return replace(readable, digits=readable.digits + 1).text(value)

    def length(self, metres: float) -> float:
        return metres * _unit("m", self.system).scale

    def name(self, unit: str) -> str:
        return _unit(unit, self.system).name


@cache
def _unit(unit: str, system: str) -> ReadableUnit:
    """Return a unit with the digits that the uncertainty of measurements justifies."""
    if unit == "m²" and system == "cm":
        return _SQUARE_METRES
    readable = readable_unit(unit, system)
    return replace(readable, digits=_DIGITS.get(readable.name, readable.digits))


def percentile_text(percentile: float) -> str:
    if not np.isfinite(percentile):
        return NOTHING
    if percentile < 1.0:
        return "<1"
    return ">99" if percentile > 99.0 else f"{percentile:.0f}"


def badge(subject: SheetSubject, values: SheetValues) -> tuple[str, str]:
    """Return the class and the words of the badge of a body."""
    if subject.is_measurable and values.withheld:
        return "partial", "partly trusted"
    if subject.trusted_vertices is None and subject.is_trusted:
        return "unknown", "registered mesh"
    is_part = np.isnan(subject.matched_share) and subject.known_vertices.mean() < WHOLE
    return badge_of(subject.is_measurable, bool(subject.message or is_part))


def sentences_of(message: str) -> list[str]:
    """Return what a message of a registration says to a client, as sentences."""
    clauses = [part.replace(" (not trusted)", "").strip() for part in message.split(";")]
    known = dict.fromkeys(clause.rstrip(".") for clause in clauses)
    return [sentence(clause) for clause in known if clause and not _CODE.search(clause)]


def sentence(clause: str) -> str:
    """Return a clause with a capital and a full stop."""
    return f"{clause[:1].upper()}{clause[1:]}."


def line_of(values: Sequence[float]) -> str:
    """Return the points of a line through values, from left to right in a box of 100 by 20."""
    series = np.array(values)
    known = np.flatnonzero(np.isfinite(series))
    if len(known) < 2:
        return ""
    low, high = series[known].min(), series[known].max()
    x = 3.0 + 94.0 * known / (len(series) - 1)
    y = 17.0 - 14.0 * (series[known] - low) / (high - low) if high > low else 10.0 + 0.0 * x
    return " ".join(f"{a:.1f},{b:.1f}" for a, b in zip(x, y, strict=True))


def changes_in_order(values: SheetValues) -> Integers:
    """Return the numbers of changes: significant ones first, then the most requested, by size."""
    result = values.changes
    if result is None:
        return np.zeros(0, dtype=np.int64)
    titles = {row.name for row in values.shown_rows}
    requested = {row.name for rows in values.key_rows().values() for row in rows}
    is_requested = [name in requested for name in result.names]
    strength = np.nan_to_num(np.abs(result.changes) / result.thresholds)
    order = np.lexsort((-strength, np.logical_not(is_requested), ~result.is_significant))
    return order[[result.names[k] in titles for k in order]]


def posture_texts(posture: Mapping[str, float]) -> list[tuple[str, str, str]]:
    """Return the titles of angles, the angles, and their side or direction."""

    def of(title: str, angles: Sequence[float], what: str) -> tuple[str, str, str]:
        is_seen = any(map(np.isfinite, angles))
        return title, " / ".join(map(_angle, angles)), what if is_seen else "not seen"

    def directed(name: str, title: str, positive: str, negative: str) -> tuple[str, str, str]:
        angle = posture[name]
        towards = positive if angle > 0.0 else negative
        return of(title, [abs(angle)], towards if abs(angle) >= 0.5 else "level")

    def paired(name: str, title: str, what: str) -> tuple[str, str, str]:
        return of(title, [posture[name.format("left")], posture[name.format("right")]], what)

    if not posture:
        return []
    both = "left / right"
    return [
        of("Neck base to ear", [posture["head over neck"]], "above horizontal"),
        directed("head tilt", "Head tilt", "left ear higher", "right ear higher"),
        directed("shoulder tilt", "Shoulder tilt", "left higher", "right higher"),
        directed("pelvis tilt", "Pelvis tilt", "left higher", "right higher"),
        directed("trunk lean forward", "Trunk lean", "forward", "back"),
        directed("trunk lean to the left", "Trunk lean, sideways", "to the left", "to the right"),
        directed("shoulders turned to the left", "Shoulders turned", "left", "right"),
        paired("{} knee bent", "Knees bent", both),
        paired("{} elbow bent", "Elbows bent", both),
        paired("{} arm from the trunk", "Arms from the trunk", both),
        paired("{} foot turned out", "Feet turned out", f"{both}; minus: in"),
    ]


def _angle(degrees: float) -> str:
    if not np.isfinite(degrees):
        return NOTHING
    return f"{degrees:.0f}°".replace("-0°", "0°").replace("-", _MINUS)
