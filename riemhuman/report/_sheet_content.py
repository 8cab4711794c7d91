"""The words and drawings of a person's sheet, which its page and its PDF share."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache, cached_property

import numpy as np

from riemhuman.arrays import Array, Triangles
from riemhuman.measurements import MeasurementSet
from riemhuman.measurements.populations import largest_body_mass_index
from riemhuman.measurements.readable_units import ReadableUnit, readable_gap, readable_unit
from riemhuman.plots.rendering import image_source
from riemhuman.report._sheet_pictures import (
    LARGEST_CHANGE,
    Picture,
    body_pictures,
    change_picture,
    front_facing,
    silhouette_picture,
)
from riemhuman.report.registered_scans import badge_of
from riemhuman.report.sheet_values import SheetRow, SheetSubject, SheetValues
from riemhuman.representation import join_names

NOTHING = "–"
_MINUS = "−"
# Digits justified by the uncertainty of measurements.
_DIGITS = {"cm": 1, "kg": 1, "L": 1, "in": 1, "lb": 1, "in³": 0, "in²": 0, "m²": 2}
_SQUARE_METRES = ReadableUnit("m²", 1.0, 2)
_HEADLINE = {
    "stature": "Stature",
    "body mass": "Weight, estimated",
    "chest girth": "Chest",
    "waist girth": "Waist",
    "hip girth": "Hip",
}
_PEOPLE = {"woman": "women", "man": "men", "adult": "adults, women and men together,"}
_MOST_CHANGES = 11
_MOST_VISITS = 6  # of a trend
_RATIOS = ("Waist to hip", "Waist to height")
_WHOLE = 0.98  # share of the vertices from which a body counts as seen
# Of rulers: metres between two marks, and metres in a unit of their numbers.
_RULERS = {"cm": (0.2, 0.01), "in": (0.3048, 0.0254)}
_RULER_SHARE = 0.09  # width of a ruler over the height of its picture
_TITLE_PIXELS = 34
_HIPS = ("left_trochanterion", "right_trochanterion")
# What names functions, arguments or options says nothing to a client.
_CODE = re.compile(r"--\w|\w=|\w\(|\w_\w|[A-Z]\w*[a-z][A-Z]|\w\.\w")


@dataclass(frozen=True)
class RowText:
    """A measurement in words; `place` is where its percentile is on a bar, in per cent."""

    title: str
    value: str
    unit: str
    uncertainty: str
    percentile: str
    place: float | None
    why: str
    name: str = ""


@dataclass(frozen=True)
class ChangeText:
    title: str
    before: str
    after: str
    change: str
    unit: str
    threshold: str
    is_significant: bool


@dataclass(frozen=True)
class PostureText:
    title: str
    value: str
    what: str


@dataclass(frozen=True)
class PairText:
    title: str
    left: str
    right: str
    difference: str
    is_significant: bool


@dataclass(frozen=True)
class TrendText:
    """A measurement at all visits, and the points of its line in a box of 100 by 20."""

    title: str
    values: tuple[str, ...]
    unit: str
    line: str


@dataclass(frozen=True)
class Label:
    """A number of a ruler or the title of a view: pixels from the top, or from the left edge."""

    place: float
    text: str


@dataclass(frozen=True)
class Drawing:
    """A picture with a ruler at its left and titles under its views; lengths in pixels."""

    picture: Picture
    ruler: int
    marks: tuple[Label, ...]
    views: tuple[Label, ...]
    alt: str
    caption: str

    @property
    def width(self) -> int:
        return self.ruler + int(self.picture.pixels.shape[1])

    @property
    def picture_height(self) -> int:
        return len(self.picture.pixels)

    @property
    def height(self) -> int:
        return self.picture_height + _TITLE_PIXELS

    @cached_property
    def source(self) -> str:
        """The address of the picture, encoded once for the page and the PDF file."""
        return image_source(self.picture.pixels)


@dataclass(frozen=True)
class ChangesText:
    since: str
    rows: tuple[ChangeText, ...]
    figure: Drawing
    note: str
    warning: str


@dataclass(frozen=True)
class Content:
    """The content of a sheet."""

    title: str
    about: str
    when: str
    badge: tuple[str, str]
    trust: str
    units: str
    length_unit: str
    headline: tuple[RowText, ...]
    pictures: tuple[Drawing, ...]
    groups: tuple[tuple[str, tuple[RowText, ...]], ...]
    silhouette: Drawing | None
    posture: tuple[PostureText, ...]
    pairs: tuple[PairText, ...]
    visits: tuple[str, ...]
    trend: tuple[TrendText, ...]
    changes: ChangesText | None
    remarks: tuple[str, ...]
    all_rows: tuple[RowText, ...]
    has_percentiles: bool
    population: str
    uncertainty: str
    logo: str = ""  # its address


def content_of(
    definitions: MeasurementSet, subject: SheetSubject, values: SheetValues, units: str
) -> Content:
    """Return the words and drawings of a sheet of a body, and of what is known about it."""
    faces = definitions.faces
    scan, body = body_pictures(subject, faces, front_facing(_across(definitions, subject)))
    pictures = []
    if scan is not None:
        what = f"The scan, {subject.file}" if subject.file else "The scan"
        pictures.append(_drawing(scan, units, "The scan from three sides", what))
    caption = "The registered body"
    if subject.known_vertices.mean() < _WHOLE:
        caption += "; parts that are not trusted are blue"
    pictures.append(_drawing(body, units, "The body from three sides", caption))
    silhouette = silhouette_picture(values, faces)
    stature = values.by_name.get("stature")
    return Content(
        title=subject.person or subject.name,
        about=" · ".join(_about(subject)),
        when=subject.visit,
        badge=badge(subject, values),
        trust=_trust(subject, values, units),
        units=units,
        length_unit=readable_unit("m", units).name,
        headline=_headline(values, units),
        pictures=tuple(pictures),
        groups=_groups(values, units),
        silhouette=None
        if silhouette is None
        else _drawing(
            silhouette,
            units,
            "Silhouettes of the body and of the average, from the front and the side",
            _of_average(subject, stature, units),
        ),
        posture=tuple(posture_texts(values.posture)),
        pairs=_pairs(values, units),
        visits=tuple(when for when, _ in values.visits[-_MOST_VISITS:]),
        trend=_trend(values, units),
        changes=_changes(values, faces, units),
        remarks=tuple(f"{_capital(remark)}." for remark in values.remarks),
        all_rows=tuple(
            row_text(row, units) for row in values.rows if row.name not in _repeated(values)
        ),
        has_percentiles=any(np.isfinite(row.percentile) for row in values.rows),
        population=_population(subject, values, units),
        uncertainty=(
            "± is two standard deviations of repeated scans of an unchanged person. It grows with "
            "the distance between the pose of the scan and the standard pose, in which the body is "
            "measured, as found on five people in ten poses each (FAUST). A percentile is left out "
            "if ± is larger than the standard deviation among people. The weight is the volume "
            "times one kilogram a litre; people's densities differ by a few per cent."
        ),
    )


def _across(definitions: MeasurementSet, subject: SheetSubject) -> Array:
    """Return the direction from the right to the left hip; without hips, the body faces z."""
    places = []
    for name in _HIPS:
        if name not in definitions.landmarks:
            return np.array([1.0, 0.0, 0.0])
        vertices, weights = definitions.landmarks[name]
        places.append(weights @ subject.points[vertices])
    left, right = places
    return np.asarray(left - right)


def badge(subject: SheetSubject, values: SheetValues) -> tuple[str, str]:
    """Return the class and the words of the badge of a body."""
    if subject.is_measurable and values.withheld:
        return "partial", "partly trusted"
    if subject.trusted_vertices is None and subject.is_trusted:
        return "unknown", "registered mesh"
    is_part = np.isnan(subject.matched_share) and subject.known_vertices.mean() < _WHOLE
    return badge_of(subject.is_measurable, bool(subject.message or is_part))


def sentences_of(message: str) -> list[str]:
    """Return what a message of a registration says to a client, as sentences."""
    clauses = [part.replace(" (not trusted)", "").strip() for part in message.split(";")]
    known = dict.fromkeys(clause.rstrip(".") for clause in clauses)
    return [f"{_capital(clause)}." for clause in known if clause and not _CODE.search(clause)]


def _capital(text: str) -> str:
    """Return a text that begins with a capital."""
    return text[:1].upper() + text[1:]


def _about(subject: SheetSubject) -> list[str]:
    sex = "sex not given" if subject.sex == "adult" else subject.sex
    file = subject.file or subject.name
    parts = [sex, subject.visit]
    if subject.further_scans:
        names = [scan.name for scan in (subject, *subject.further_scans)]
        parts.append(f"{len(names)} scans: {join_names(sorted(names), 4)}")
    elif file not in (subject.person, subject.name):
        parts.append(file)
    return [part for part in parts if part]


def _trust(subject: SheetSubject, values: SheetValues, units: str) -> str:
    """Return whether and where to trust the body, in words."""
    said = sentences_of(subject.message)
    if not subject.is_measurable:
        return " ".join(["Do not rely on this body; nothing was measured.", *said])
    sentences = []
    if subject.trusted_vertices is None:
        sentences.append(
            "This body came without its scan, so nothing is known about how well it fits."
        )
    elif said:
        sentences += said
    elif subject.known_vertices.all() and not values.withheld:
        sentences.append("The whole body can be trusted.")
    elif not values.withheld:
        sentences.append(
            "The body can be trusted, except in small places that the scan does not show."
        )
    n_scans = len(subject.measured_scans)
    if n_scans > 1:
        sentences.append(
            f"Measurements are of the mean of {n_scans} scans; the pictures show {subject.name}."
        )
    for group in values.withheld:
        sentences.append(
            f"Measurements of the {group.name} are withheld: {group.reason}. At the next scan, "
            f"{group.advice}."
        )
    rows = [row for row in values.rows if row.name not in _repeated(values)]
    n_missing = sum(bool(row.why_missing) for row in rows)
    if n_missing:
        are = "is" if n_missing == 1 else "are"
        sentences.append(
            f"{n_missing} of {len(rows)} measurements could not be taken reliably and {are} left "
            "blank."
        )
    if np.isfinite(subject.median_distance):
        sentences.append(
            "The median distance of the scan from the body is "
            f"{readable_gap(subject.median_distance, units)}; the scan shows "
            f"{100 * subject.matched_share:.0f} % of the body's surface."
        )
    return " ".join(sentences)


def _population(subject: SheetSubject, values: SheetValues, units: str) -> str:
    people = _PEOPLE[subject.sex]
    stature = values.by_name.get("stature")
    if values.standing is None or stature is None:
        return ""
    if not np.isfinite(stature.value):
        return (
            "There are no percentiles and no average for comparison, because the scan does not "
            "show the stature. It can be typed in."
        )
    if values.average is None:
        unit = _unit("m", units)
        adults = {"woman": "adult women", "man": "adult men"}.get(subject.sex, "adults")
        return (
            "There are no percentiles and no average for comparison: both are for adults, and a "
            f"stature of {_value(stature.value, unit)} {unit.name} is outside the range of "
            f"{adults}."
        )
    limit = largest_body_mass_index(subject.sex)
    return (
        f"A percentile (pctl.) of 24 means that 24 of 100 {people} of this stature measure less "
        f"(for the stature itself: of all {people.rstrip(',')}). The darker part of a bar is the "
        "middle half. The people are US soldiers (ANSUR II, 2012), who are fitter and younger than "
        "the public, weighted to the body mass index of the US public (NHANES, 2021–2023) up to "
        f"{limit:.0f} kg/m². Measurements without a matching survey have no percentile."
    )


def _of_average(subject: SheetSubject, stature: SheetRow | None, units: str) -> str:
    people = {"woman": "woman", "man": "man", "adult": "adult"}[subject.sex]
    height = "" if stature is None else f" of {_value(stature.value, _unit('m', units))} "
    return f"The average {people}{height}{readable_unit('m', units).name}, in the standard pose."


def _headline(values: SheetValues, units: str) -> tuple[RowText, ...]:
    texts = []
    for name, title in _HEADLINE.items():
        row = values.by_name.get(name)
        if row is not None:
            texts.append(replace(row_text(row, units), title=title))
    value, unit = values.ratios.get("Body mass index", (float("nan"), ""))
    if np.isfinite(value):
        # Behind the stature and the weight, of which it is made.
        texts.insert(2, RowText("Body mass index", f"{value:.1f}", unit, "", "", None, ""))
    return tuple(texts)


def row_text(row: SheetRow, units: str) -> RowText:
    """Return a measurement in everyday units."""
    unit = _unit(row.unit, units)
    is_known = bool(np.isfinite(row.percentile))
    return RowText(
        name=row.name,
        title=row.title,
        value=_value(row.value, unit),
        unit=unit.name if np.isfinite(row.value) else "",
        uncertainty=_uncertainty(row.uncertainty, unit),
        percentile=percentile_text(row.percentile),
        place=float(np.clip(row.percentile, 1.0, 99.0).round(1)) if is_known else None,
        why=row.why_missing,
    )


def _repeated(values: SheetValues) -> tuple[str, ...]:
    """Return measurements that say the same as another: the volume, beside the mass."""
    return ("volume",) if "body mass" in values.by_name else ()


def _groups(values: SheetValues, units: str) -> tuple[tuple[str, tuple[RowText, ...]], ...]:
    """Return the measurements that people ask for, by group, with ratios in the first."""
    groups: list[tuple[str, tuple[RowText, ...]]] = []
    for group, rows in values.key_rows().items():
        texts = [row_text(row, units) for row in rows]
        if not groups:
            for title in _RATIOS:
                ratio, _ = values.ratios.get(title, (float("nan"), ""))
                if np.isfinite(ratio):
                    texts.append(RowText(title, f"{ratio:.2f}", "", "", NOTHING, None, ""))
        groups.append((group, tuple(texts)))
    return tuple(groups)


def _pairs(values: SheetValues, units: str) -> tuple[PairText, ...]:
    unit = _unit("m", units)
    return tuple(
        PairText(
            pair.title,
            _value(pair.left, unit),
            _value(pair.right, unit),
            f"{_value(pair.left - pair.right, unit, '+')} ± {_uncertainty(pair.threshold, unit)}",
            pair.is_significant,
        )
        for pair in values.pairs
    )


def _trend(values: SheetValues, units: str) -> tuple[TrendText, ...]:
    """Return the headline's measurements at all visits, if there are more than two."""
    rows = []
    for name, title in _HEADLINE.items():
        if name not in values.by_name or not values.visits:
            continue
        unit = _unit(values.by_name[name].unit, units)
        series = [known.get(name, float("nan")) for _, known in values.visits[-_MOST_VISITS:]]
        texts = tuple(_value(value, unit) for value in series)
        rows.append(TrendText(title, texts, unit.name, _line_of(np.array(series))))
    return tuple(rows)


def _line_of(series: Array) -> str:
    """Return the points of a line through values, from left to right in a box of 100 by 20."""
    known = np.flatnonzero(np.isfinite(series))
    if len(known) < 2:
        return ""
    low, high = series[known].min(), series[known].max()
    x = 3.0 + 94.0 * known / (len(series) - 1)
    y = 17.0 - 14.0 * (series[known] - low) / (high - low) if high > low else 10.0 + 0.0 * x
    return " ".join(f"{a:.1f},{b:.1f}" for a, b in zip(x, y, strict=True))


def percentile_text(percentile: float) -> str:
    if not np.isfinite(percentile):
        return NOTHING
    if percentile < 1.0:
        return "<1"
    return ">99" if percentile > 99.0 else f"{percentile:.0f}"


@cache
def _unit(unit: str, units: str) -> ReadableUnit:
    """Return a unit with the digits that the uncertainty of measurements justifies."""
    if unit == "m²" and units == "cm":
        return _SQUARE_METRES
    readable = readable_unit(unit, units)
    return replace(readable, digits=_DIGITS.get(readable.name, readable.digits))


def _value(value: float, unit: ReadableUnit, sign: str = "") -> str:
    if not np.isfinite(value):
        return NOTHING
    return unit.text(value, sign=sign).replace("-", _MINUS)


def _uncertainty(value: float, unit: ReadableUnit) -> str:
    """Return an uncertainty, with one more digit if it would be 0; nothing for what is exact."""
    if not np.isfinite(value):
        return ""
    is_small = abs(value * unit.scale) < 0.5 * 10.0**-unit.digits
    return replace(unit, digits=unit.digits + 1).text(value) if is_small else _value(value, unit)


def posture_texts(posture: Mapping[str, float]) -> list[PostureText]:
    """Return angles with their side or direction."""

    def of(title: str, angles: Sequence[float], what: str) -> PostureText:
        is_seen = any(map(np.isfinite, angles))
        return PostureText(title, " / ".join(map(_angle, angles)), what if is_seen else "not seen")

    def directed(name: str, title: str, positive: str, negative: str) -> PostureText:
        angle = posture[name]
        towards = positive if angle > 0.0 else negative
        return of(title, [abs(angle)], towards if abs(angle) >= 0.5 else "level")

    def paired(name: str, title: str, what: str) -> PostureText:
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


def _changes(values: SheetValues, faces: Triangles, units: str) -> ChangesText | None:
    result = values.changes
    picture = change_picture(values, faces)
    if result is None or picture is None:
        return None
    texts = []
    strength = np.nan_to_num(np.abs(result.changes) / result.thresholds)
    key_names = {row.name for rows in values.key_rows().values() for row in rows}
    order = sorted(
        range(len(result.names)),
        key=lambda k: (
            not result.is_significant[k],
            result.names[k] not in key_names,
            -strength[k],
        ),
    )
    for k in order[:_MOST_CHANGES]:
        if not np.isfinite(result.changes[k]) or result.names[k] in _repeated(values):
            continue
        unit = _unit(result.units[k], units)
        texts.append(
            ChangeText(
                values.by_name[result.names[k]].title,
                _value(result.before[k], unit),
                _value(result.after[k], unit),
                _value(result.changes[k], unit, "+"),
                unit.name,
                _uncertainty(result.thresholds[k], unit),
                bool(result.is_significant[k]),
            )
        )
    is_row = np.array([name not in _repeated(values) for name in result.names])
    count = int(result.is_significant[is_row].sum())
    note = (
        f"{count} of {is_row.sum()} measurements changed by more than their noise, two "
        "standard deviations of a difference between poses this far apart; expect about "
        f"{result.expected_by_chance:.0f} by chance alone. {result.pose_advice(units)}"
    ).strip()
    largest = LARGEST_CHANGE / _RULERS[units][1]
    figure = _drawing(
        picture,
        units,
        "The body at this visit, coloured by how far the surface moved",
        f"From blue (inward) to red (outward), {largest:.1g} {units} at the ends.",
    )
    warning = ""
    if values.doubt:
        warning = "The two visits are probably not of the same person: check whose scans they are."
    return ChangesText(values.since, tuple(texts), figure, note, warning)


def _drawing(picture: Picture, units: str, alt: str, caption: str) -> Drawing:
    step, metres_per_unit = _RULERS[units]
    height, width = picture.pixels.shape[:2]
    ruler = round(_RULER_SHARE * height)
    marks = []
    for number in range(int(np.floor(picture.high / step)) + 1):
        y = (picture.high - number * step) / picture.metres_per_pixel
        marks.append(Label(round(y, 1), f"{number * step / metres_per_unit:.0f}"))
    views = [
        Label(round(ruler + middle * width, 1), title)
        for middle, title in zip(picture.middles, picture.titles, strict=True)
    ]
    return Drawing(picture, ruler, tuple(marks), tuple(views), alt, caption)
