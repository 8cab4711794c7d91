"""What a person's sheet says: measurements, percentiles, posture, and changes since a visit."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache, cached_property
from pathlib import Path

import numpy as np
from scipy.spatial import cKDTree

from riemhuman.arrays import Array, Booleans, JSONValue, Points, Triangles
from riemhuman.datasets import load_open_model
from riemhuman.errors import ArgumentError
from riemhuman.measurements import (
    Measurements,
    MeasurementSet,
    VisitComparison,
    average_adult,
    compare_visits,
    in_standard_pose,
    measurement_from_dict,
    noise_of_measurements,
    person_distance,
    person_in_standard_pose,
    posture_angles,
)
from riemhuman.measurements.plausibility import Group, implausible_groups
from riemhuman.measurements.populations import (
    has_percentiles,
    is_of_adults,
    percentages,
    spread_of_adults,
)
from riemhuman.measurements.uncertainty import pose_distance_of_visits
from riemhuman.registration import ScanRecord, read_records
from riemhuman.registration.folders import RECORDS
from riemhuman.registration.registered_scans import apply_transform
from riemhuman.report._everyday_names import KEY_GROUPS, everyday_name

# Quotients of two measurements, and powers of the second.
_RATIOS = {
    "Body mass index": ("body mass", "stature", 2),  # kg/m²
    "Waist to hip": ("waist girth", "hip girth", 1),
    "Waist to height": ("waist girth", "stature", 1),
}
# Trunks that lean more lie, or point along another axis than the one that should be up.
_LARGEST_LEAN = 60.0
# Two standard deviations: of 100 repeated measurements, about 95 lie within.
_DEVIATIONS = 2.0
# Standard deviation of a scan over that among adults, up to which there is a percentile.
_LARGEST_NOISE = 0.5
# Where thighs touch, or a scanner closes its scan between them, nobody sees the crotch. It is
# hidden if it is farther from the scan than this, metres, and than so many times the median vertex.
_HIDDEN_METRES, _HIDDEN_TIMES = 0.02, 3.0
CROTCH = Group(
    "inside leg and crotch",
    {},
    "the scan does not show the crotch, as when the thighs touch",
    "stand with the feet further apart",
    (
        "inside leg height",
        "crotch length (omphalion)",
        "posterior crotch length (omphalion)",
        "vertical trunk girth",
    ),
)
_OPPOSITE = {"right": "left", "left": "right"}
# Measurements of the right side that are also taken on the left.
LEFT_AND_RIGHT = (
    "upper arm girth",
    "forearm girth",
    "wrist girth",
    "thigh girth",
    "knee girth",
    "calf girth",
    "ankle girth",
    "foot length",
)


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
        Two standard deviations of a scan in this pose, see
        `rh.measurements.noise_of_measurements`.
    percentile : float
        Percentage of adults of the same sex and stature with smaller values, see
        `rh.measurements.percentiles`. NaN if the uncertainty is larger than the standard deviation
        among these adults.
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


@dataclass(frozen=True)
class PairedRow:
    """A measurement of the left and of the right side, in metres."""

    title: str
    left: float
    right: float
    threshold: float  # two standard deviations of the difference

    @property
    def is_significant(self) -> bool:
        return abs(self.left - self.right) > self.threshold


@dataclass(frozen=True, eq=False)
class SheetSubject:
    """A body of which a sheet is made, and what is known about its person and its scan.

    Of several scans of one visit, this one is shown, and the mean of all is measured.
    """

    name: str
    points: Points
    person: str = ""
    sex: str = "adult"
    visit: str = ""  # which, or when
    number: str = ""  # of the visit, and its day, by which labels order visits
    day: str = ""
    file: str = ""
    faces: Triangles | None = None  # those of the file
    trusted_vertices: Booleans | None = None  # None if nothing is known
    is_trusted: bool = True
    message: str = ""
    scan: Points | None = None  # points in the axes of the body
    median_distance: float = float("nan")
    matched_share: float = float("nan")  # of the surface
    stature: float = float("nan")  # typed in, metres
    further_scans: tuple[SheetSubject, ...] = ()  # of the same visit

    @classmethod
    def of_record(cls, record: ScanRecord) -> SheetSubject:
        """Return the body of a registered scan, upright; raise an error if it has none."""
        arrays = record.arrays
        if not arrays:
            raise ArgumentError(f"{record.name} was not registered: {record.message}")
        points, scan = (
            apply_transform(arrays["transform"], np.asarray(arrays[name], dtype=np.float64))
            for name in ("points", "shown")
        )
        return cls(
            name=record.name,
            points=points,
            file=record.name,
            faces=arrays["faces"],
            trusted_vertices=arrays["trusted_vertices"].astype(bool),
            is_trusted=record.trusted,
            message=record.message,
            scan=scan,
            median_distance=record.median_distance,
            matched_share=record.matched_share,
        )

    @classmethod
    def of_visit(cls, scans: Sequence[SheetSubject]) -> SheetSubject:
        """Return one subject for the scans of a visit: the scan that shows most of the body."""
        best = max(scans, key=lambda scan: (scan.is_measurable, scan.known_vertices.mean()))
        typed_in = [scan.stature for scan in scans if np.isfinite(scan.stature)]
        return replace(
            best,
            stature=typed_in[0] if typed_in else best.stature,
            further_scans=tuple(scan for scan in scans if scan is not best),
        )

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

    @property
    def scans(self) -> tuple[SheetSubject, ...]:
        """All scans of this visit."""
        return self, *self.further_scans

    @property
    def measured_scans(self) -> tuple[SheetSubject, ...]:
        """The scans of this visit that can be measured."""
        return tuple(scan for scan in self.scans if scan.is_measurable)

    def measured_points(self) -> Points:
        """Return the bodies of the measured scans, shape (n_scans, V, 3)."""
        return np.stack([scan.points for scan in self.measured_scans])

    def measured_vertices(self) -> Booleans:
        """Return what each of the measured scans shows, shape (n_scans, V)."""
        return np.stack([scan.known_vertices for scan in self.measured_scans])


@dataclass(frozen=True, eq=False)
class SheetValues:
    """What is known about a body; lengths in metres, angles in degrees."""

    rows: tuple[SheetRow, ...]
    ratios: Mapping[str, float]
    posture: Mapping[str, float]
    standing: Points | None  # the body in the standard pose
    average: Points | None  # that of the sex and stature
    average_faces: Triangles | None
    remarks: tuple[str, ...] = ()
    changes: VisitComparison | None = None
    since: str = ""
    doubt: str = ""  # whether both visits are of one person
    withheld: tuple[Group, ...] = ()  # groups whose measurements are left blank
    pairs: tuple[PairedRow, ...] = ()  # of the left and the right side
    visits: tuple[tuple[str, Mapping[str, float]], ...] = ()  # up to this one, if more than two
    scanned_stature: float = float("nan")

    @cached_property
    def by_name(self) -> dict[str, SheetRow]:
        return {row.name: row for row in self.rows}

    @property
    def shown_rows(self) -> list[SheetRow]:
        """All rows but the volume if there is the mass, which says the same."""
        repeated = "volume" if "body mass" in self.by_name else ""
        return [row for row in self.rows if row.name != repeated]

    def key_rows(self) -> dict[str, list[SheetRow]]:
        """Return the rows of measurements that people ask for, by group."""
        groups = {
            group: [self.by_name[name] for name in names if name in self.by_name]
            for group, names in KEY_GROUPS.items()
        }
        return {group: rows for group, rows in groups.items() if rows}


def record_beside(
    file: Path, records_of_folders: dict[Path, dict[str, ScanRecord]]
) -> ScanRecord | None:
    """Return the record of the registered scan in a file, if `register` kept one.

    Records that are read are added to those of folders.
    """
    for folder in (file.parent, file.parent.parent):
        if (folder / RECORDS / f"{file.stem}.npz").is_file():
            if folder not in records_of_folders:
                records = {record.name: record for record in read_records(folder)}
                records_of_folders[folder] = records
            record = records_of_folders[folder][file.stem]
            return record if record.arrays else None
    return None


def values_of(measurements: Measurements, subjects: Sequence[SheetSubject]) -> list[SheetValues]:
    """Return what is known about bodies, whose measurements are taken together."""
    measurable = [number for number, subject in enumerate(subjects) if subject.is_measurable]
    standing: dict[int, Points] = {}
    measured = None
    if measurable:
        shown = [subjects[number] for number in measurable]
        straight = _in_standard_pose(measurements.definitions, shown)
        standing = dict(zip(measurable, straight, strict=True))
        measured = measurements.measure(
            straight,
            axes="space",
            missing="nan",
            trusted_vertices=np.stack([subject.measured_vertices().any(0) for subject in shown]),
        )
    left_sides = _left_sides(measurements.definitions)
    results = []
    for number, subject in enumerate(subjects):
        if measured is None or number not in standing:
            values = np.full(len(measurements.names), np.nan)
            reasons = dict.fromkeys(measurements.names, "the registration is not trusted")
            results.append(_values(measurements, subject, values, reasons, None))
            continue
        place = measurable.index(number)
        reasons = {name: reason for (k, name), reason in measured.why_missing.items() if k == place}
        known = _values(measurements, subject, measured.values[place], reasons, standing[number])
        results.append(replace(known, pairs=_pairs(known, left_sides, subject)))
    return results


def _in_standard_pose(definitions: MeasurementSet, subjects: Sequence[SheetSubject]) -> Array:
    """Return the bodies of people in the standard pose; of several scans, the mean."""
    straight = in_standard_pose(definitions, np.stack([subject.points for subject in subjects]))
    for number, subject in enumerate(subjects):
        if len(subject.measured_scans) > 1:
            straight[number] = person_in_standard_pose(
                definitions,
                subject.measured_points(),
                trusted_vertices=subject.measured_vertices(),
            )
    return straight


@cache
def _left_sides(definitions: MeasurementSet) -> Measurements | None:
    """Return the measurements of the left side, by their names on the right, where there are."""
    mirrored = [
        measurement_from_dict(_mirrored(definition.to_dict()))
        for definition in definitions.measurements
        if definition.name in LEFT_AND_RIGHT
    ]
    if not mirrored:
        return None
    try:
        return Measurements(definitions.with_measurements(mirrored))
    except ArgumentError:  # another set, without these landmarks
        return None


def _mirrored(record: JSONValue) -> JSONValue:
    """Return a record in which what is named right is named left, and the other way round."""
    if isinstance(record, str):
        return re.sub("right|left", lambda side: _OPPOSITE[side[0]], record)
    if isinstance(record, Mapping):
        return {_mirrored(key): _mirrored(value) for key, value in record.items()}
    return [_mirrored(entry) for entry in record] if isinstance(record, list) else record


def _pairs(
    values: SheetValues, left_sides: Measurements | None, subject: SheetSubject
) -> tuple[PairedRow, ...]:
    """Return measurements of both sides, where both were measured."""
    if left_sides is None or values.standing is None:
        return ()
    measured = left_sides.measure(
        values.standing,
        axes="space",
        missing="nan",
        trusted_vertices=subject.measured_vertices().any(axis=0),
    )
    rows = []
    for name, left in zip(measured.names, measured.values.tolist(), strict=True):
        row = values.by_name[name]
        if np.isfinite(left * row.value):
            threshold = np.sqrt(2.0) * row.uncertainty
            rows.append(PairedRow(row.title, left, row.value, threshold))
    return tuple(rows)


@cache
def _average_body(millimetres: int, sex: str, resolution: str) -> Points | None:
    """Return the average body of a stature and sex, or None if no adult has the stature."""
    try:
        return average_adult(millimetres / 1000, sex, resolution)
    except ArgumentError:
        return None


def _values(
    measurements: Measurements,
    subject: SheetSubject,
    values: Array,
    reasons: Mapping[str, str],
    standing: Points | None,
) -> SheetValues:
    named = dict(zip(measurements.names, values.tolist(), strict=True))
    distance, n_scans = 0.0, 1
    if standing is not None:
        scans = subject.measured_points()
        distance = pose_distance_of_visits(measurements.definitions, scans, standing[np.newaxis])
        n_scans = len(scans)
    noise = noise_of_measurements(measurements.names, distance, n_scans)
    deviations = dict(zip(measurements.names, noise.tolist(), strict=True))
    measured_stature = named.get("stature", float("nan"))
    is_typed_in = bool(np.isfinite(subject.stature))
    stature = subject.stature if is_typed_in else measured_stature
    remarks = _remarks_on_scans(subject, measurements.definitions.faces)
    if is_typed_in:
        named["stature"] = stature
        reasons = {name: reason for name, reason in reasons.items() if name != "stature"}
        if abs(measured_stature - stature) > _DEVIATIONS * deviations.get("stature", np.nan):
            remarks.append("the stature of the scan differs from the one typed in")
    withheld = []
    if standing is not None:
        withheld = _withheld(named, deviations, subject, measurements.definitions)
    for group in withheld:
        for name in named.keys() & {*group.measurements}:
            named[name] = float("nan")
            reasons = {**reasons, name: group.reason}
    shares = percentages(named, subject.sex, stature)
    rows = tuple(
        SheetRow(
            name,
            everyday_name(name),
            unit,
            named[name],
            float("nan") if name == "stature" and is_typed_in else _DEVIATIONS * deviations[name],
            shares[name]
            if _is_sharp(name, named[name], deviations[name], subject.sex)
            else float("nan"),
            reasons.get(name, ""),
        )
        for name, unit in zip(measurements.names, measurements.units, strict=True)
    )
    posture, said = _posture(measurements, subject)
    is_coarse = len(subject.points) == load_open_model("coarse").n_vertices
    resolution = "coarse" if is_coarse else "full"
    average = None
    if standing is not None and np.isfinite(stature):
        average = _average_body(round(1000 * stature), subject.sex, resolution)
    return SheetValues(
        rows=rows,
        ratios=_ratios(named),
        posture=posture,
        standing=standing,
        average=average,
        average_faces=load_open_model(resolution).faces,
        remarks=(*remarks, *said),
        withheld=tuple(withheld),
        scanned_stature=measured_stature,
    )


def _remarks_on_scans(subject: SheetSubject, faces: Triangles) -> list[str]:
    """Return which of several scans of a visit are left out, or show another person."""
    remarks = []
    for scan in subject.further_scans:
        if not scan.is_measurable:
            remarks.append(f"{scan.name} is not trusted and left out")
        elif (
            subject.is_measurable
            and person_distance(subject.points, scan.points, faces).is_hardly_one_person
        ):
            remarks.append(f"{subject.name} and {scan.name} are probably not of one person")
    return remarks


def _withheld(
    named: Mapping[str, float],
    deviations: Mapping[str, float],
    subject: SheetSubject,
    definitions: MeasurementSet,
) -> list[Group]:
    """Return groups that no scan shows, and those that no adult combines; none for children."""
    is_measured = any(np.isfinite(named.get(name, np.nan)) for name in CROTCH.measurements)
    groups = [CROTCH] if is_measured and is_crotch_hidden(subject, definitions) else []
    if is_of_adults(named.get("stature", float("nan")), subject.sex):
        groups += implausible_groups(named, deviations, subject.sex)
    return groups


def is_crotch_hidden(subject: SheetSubject, definitions: MeasurementSet) -> bool:
    """Return whether a body is known by scans alone, of which none has points near its crotch."""
    if "crotch" not in definitions.landmarks:
        return False
    vertices, weights = definitions.landmarks["crotch"]
    for body in subject.measured_scans:
        if body.scan is None or not len(body.scan):
            return False
        tree = cKDTree(body.scan)
        gaps, _ = tree.query(body.points[body.known_vertices])
        gap, _ = tree.query(weights @ body.points[vertices])
        if gap < max(_HIDDEN_METRES, _HIDDEN_TIMES * np.median(gaps)):
            return False
    return True


def _is_sharp(name: str, value: float, deviation: float, sex: str) -> bool:
    """Return whether people differ so much more than scans of one that a percentile says something.

    With half their deviation, 7 per cent of people seem to be below the 5th percentile.
    """
    if not has_percentiles(name, sex) or not np.isfinite(value * deviation):
        return False
    return bool(deviation <= _LARGEST_NOISE * spread_of_adults(name, sex) * value)


def _ratios(named: Mapping[str, float]) -> dict[str, float]:
    ratios = {}
    for title, (above, below, power) in _RATIOS.items():
        if above in named and below in named:
            ratios[title] = named[above] / named[below] ** power
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
        return {}, ["posture is left out: the body is lying, or another axis points up"]
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
        before.measured_points(),
        after.measured_points(),
        trusted_vertices=[before.measured_vertices(), after.measured_vertices()],
    )
    people = person_distance(before.points, after.points, measurements.definitions.faces)
    doubt = people.text if people.is_hardly_one_person else ""
    deviations = dict(zip(comparison.names, comparison.noise.tolist(), strict=True))
    earlier = dict(zip(comparison.names, comparison.before.tolist(), strict=True))
    blank = {
        name
        for group in (
            *values.withheld,
            *_withheld(earlier, deviations, before, measurements.definitions),
        )
        for name in group.measurements
    }
    is_known = np.array([name not in blank for name in comparison.names])
    comparison = replace(
        comparison,
        before=np.where(is_known, comparison.before, np.nan),
        after=np.where(is_known, comparison.after, np.nan),
    )
    return replace(values, changes=comparison, since=since, doubt=doubt)
