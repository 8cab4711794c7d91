"""What a person's sheet says: measurements, percentiles, posture, and changes since a visit."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from riemhuman.arrays import Array, Booleans, Points, Triangles
from riemhuman.errors import ArgumentError
from riemhuman.measurements import (
    Measurements,
    VisitComparison,
    average_adult,
    compare_visits,
    in_standard_pose,
    noise_of_measurements,
    person_distance,
    posture_angles,
)
from riemhuman.measurements.populations import percentages
from riemhuman.report._everyday_names import KEY_GROUPS, everyday_name

# Quotients of two measurements, and powers of the second.
_RATIOS = {
    "Body mass index": ("body mass", "stature", 2, "kg/m²"),
    "Waist to hip": ("waist girth", "hip girth", 1, ""),
    "Waist to stature": ("waist girth", "stature", 1, ""),
}
# Trunks that lean more lie, or point along another axis than the one that should be up.
_LARGEST_LEAN = 60.0
# Two standard deviations: of 100 repeated measurements, about 95 lie within.
_DEVIATIONS = 2.0


@dataclass(frozen=True)
class SheetRow:
    """A measurement of a person.

    Attributes
    ----------
    name, title : str
        Its name in the library, and the name shown to people.
    unit : str
        "m", "m²", "m³" or "kg".
    value : float
        The value in the standard pose; NaN if it was not measured.
    uncertainty : float
        Two standard deviations over poses of simulated people, registered from scans.
    percentile : float
        Percentage of adults of the same sex and stature with smaller values, see
        `rh.measurements.percentiles`.
    why_missing : str
        Why the value is NaN.

    Examples
    --------
    >>> row = rh.report.SheetRow("stature", "Stature", "m", 1.7, 0.01, 60.0)
    >>> row.value
    1.7
    """

    name: str
    title: str
    unit: str
    value: float
    uncertainty: float
    percentile: float
    why_missing: str = ""


@dataclass(frozen=True, eq=False)
class SheetSubject:
    """A body of which a sheet is made, and what is known about its person and its scan."""

    name: str
    points: Points
    person: str = ""
    sex: str = "adult"
    visit: str = ""  # which, or when
    file: str = ""
    trusted_vertices: Booleans | None = None  # None if nothing is known
    is_trusted: bool = True
    message: str = ""
    scan: Points | None = None  # points in the axes of the body
    median_distance: float = float("nan")
    matched_share: float = float("nan")  # of the surface

    @property
    def is_measurable(self) -> bool:
        return self.is_trusted and (
            self.trusted_vertices is None or bool(self.trusted_vertices.any())
        )

    @property
    def known_vertices(self) -> Booleans:
        if self.trusted_vertices is None:
            return np.ones(len(self.points), dtype=bool)
        return self.trusted_vertices


@dataclass(frozen=True, eq=False)
class SheetValues:
    """What is known about a body; lengths in metres, angles in degrees."""

    rows: tuple[SheetRow, ...]
    ratios: Mapping[str, tuple[float, str]]
    posture: Mapping[str, float]
    standing: Points | None  # the body in the standard pose
    average: Points | None  # that of the sex and stature
    average_faces: Triangles | None
    remarks: tuple[str, ...] = ()
    changes: VisitComparison | None = None
    since: str = ""
    doubt: str = ""  # whether both visits are of one person

    @cached_property
    def by_name(self) -> dict[str, SheetRow]:
        return {row.name: row for row in self.rows}

    def key_rows(self) -> dict[str, list[SheetRow]]:
        """Return the rows of measurements that people ask for, by group."""
        groups = {
            group: [self.by_name[name] for name in names if name in self.by_name]
            for group, names in KEY_GROUPS.items()
        }
        return {group: rows for group, rows in groups.items() if rows}


def values_of(
    measurements: Measurements, subjects: Sequence[SheetSubject], average: Average
) -> list[SheetValues]:
    """Return what is known about bodies, whose measurements are taken together."""
    measurable = [number for number, subject in enumerate(subjects) if subject.is_measurable]
    standing: dict[int, Points] = {}
    measured = None
    if measurable:
        points = np.stack([subjects[number].points for number in measurable])
        straight = in_standard_pose(measurements.definitions, points)
        standing = dict(zip(measurable, straight, strict=True))
        measured = measurements.measure(
            straight,
            axes="space",
            missing="nan",
            trusted_vertices=np.stack([subjects[number].known_vertices for number in measurable]),
        )
    results = []
    for number, subject in enumerate(subjects):
        if measured is None or number not in standing:
            values = np.full(len(measurements.names), np.nan)
            reasons = dict.fromkeys(measurements.names, "the registration is not trusted")
        else:
            place = measurable.index(number)
            values = measured.values[place]
            reasons = {
                name: reason for (k, name), reason in measured.why_missing.items() if k == place
            }
        results.append(
            _values(measurements, subject, values, reasons, standing.get(number), average)
        )
    return results


class Average:
    """Average adults for comparison, made once for a stature in millimetres and a sex."""

    def __init__(self, resolution: str, faces: Triangles) -> None:
        self.faces = faces
        self._resolution = resolution
        self._bodies: dict[tuple[int, str], Points] = {}

    def of(self, stature: float, sex: str) -> Points | None:
        """Return the average body, or None if the stature is unknown or no adult has it."""
        if not np.isfinite(stature):
            return None
        millimetres = round(1000 * stature)
        key = (millimetres, sex)
        if key not in self._bodies:
            try:
                self._bodies[key] = average_adult(millimetres / 1000, sex, self._resolution)
            except ArgumentError:
                return None
        return self._bodies[key]


def _values(
    measurements: Measurements,
    subject: SheetSubject,
    values: Array,
    reasons: Mapping[str, str],
    standing: Points | None,
    average: Average,
) -> SheetValues:
    named = dict(zip(measurements.names, values.tolist(), strict=True))
    stature = named.get("stature", float("nan"))
    percentiles_by_name = percentages(named, subject.sex, stature)
    noise = noise_of_measurements(measurements.names)
    rows = tuple(
        SheetRow(
            name,
            everyday_name(name),
            unit,
            named[name],
            _DEVIATIONS * deviation,
            percentiles_by_name.get(name, float("nan")),
            reasons.get(name, ""),
        )
        for name, unit, deviation in zip(
            measurements.names, measurements.units, noise.tolist(), strict=True
        )
    )
    posture, remarks = _posture(measurements, subject)
    body = average.of(stature, subject.sex) if standing is not None else None
    return SheetValues(
        rows=rows,
        ratios=_ratios(named),
        posture=posture,
        standing=standing,
        average=body,
        average_faces=average.faces,
        remarks=tuple(remarks),
    )


def _ratios(named: Mapping[str, float]) -> dict[str, tuple[float, str]]:
    ratios = {}
    for title, (above, below, power, unit) in _RATIOS.items():
        if above in named and below in named:
            ratios[title] = (named[above] / named[below] ** power, unit)
    return ratios


def _posture(
    measurements: Measurements, subject: SheetSubject
) -> tuple[dict[str, float], list[str]]:
    """Return angles, and what is to be said about them."""
    if not subject.is_measurable:
        return {}, []
    try:
        angles = posture_angles(
            measurements, subject.points, trusted_vertices=subject.known_vertices
        )
    except ArgumentError:
        return {}, []  # another set, without these landmarks
    posture = {name: float(angle) for name, angle in angles.items()}
    leans = [posture["trunk lean forward"], posture["trunk lean to the left"]]
    if np.nanmax(np.abs(leans), initial=0.0) > _LARGEST_LEAN:
        return {}, ["posture is left out: the body is lying, or another axis points up (see --up)"]
    return posture, []


def with_changes(
    measurements: Measurements,
    values: SheetValues,
    before: SheetSubject,
    after: SheetSubject,
) -> SheetValues:
    """Return values with the changes since an earlier visit."""
    since = before.visit or before.name
    if not (before.is_measurable and after.is_measurable):
        remark = f"no comparison with {since}: one of the two bodies is not trusted"
        return replace(values, remarks=(*values.remarks, remark))
    comparison = compare_visits(
        measurements,
        before.points,
        after.points,
        trusted_vertices=np.stack([before.known_vertices, after.known_vertices]),
    )
    people = person_distance(before.points, after.points, measurements.definitions.faces)
    doubt = people.text if people.is_hardly_one_person else ""
    return replace(values, changes=comparison, since=since, doubt=doubt)
