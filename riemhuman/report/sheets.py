"""The sheet of a person: what the body measures, whether to trust it, and what has changed."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from html import escape

import numpy as np

from riemhuman.arrays import ArrayLike, Points
from riemhuman.bodies import BodyModel
from riemhuman.checks import checked, choice, real_array, real_number
from riemhuman.checks.labels import text
from riemhuman.datasets import load_open_model
from riemhuman.errors import ArgumentError
from riemhuman.io.files import file_path, suffix_of, write_text
from riemhuman.measurements import Measurements, VisitComparison
from riemhuman.measurements.adults import check_values
from riemhuman.readable_units import READABLE_UNITS
from riemhuman.registration import RegisteredScan, ScanRecord
from riemhuman.registration.folders import record_of
from riemhuman.report._sheet_page import Content, logo_source
from riemhuman.report.printing import printing_browser
from riemhuman.report.sheet_values import (
    SheetRow,
    SheetSubject,
    values_of,
    with_changes,
)


def a_stature(value: float, name: str) -> float:
    """Check a stature in metres."""
    stature = real_number(value, name, minimum=0.0, strict=True)
    check_values({"stature": stature})
    return stature


@dataclass(frozen=True, eq=False, repr=False)
class Sheet:
    """The sheet of a person: an HTML page, or a two-page PDF.

    A notebook shows it.

    Attributes
    ----------
    name, sex : str
        Name of the person or body, and "woman", "man" or "adult".
    badge : str
        "trusted", "partly trusted" if parts of the body or values of the head, hands or feet are
        in doubt, "not trusted", or "registered mesh" if nothing is known about a scan.
    measurements : tuple of SheetRow
        Values with uncertainties and percentiles.
    posture : dict of str to float
        Angles in degrees, see `rh.measurements.posture_angles`.
    changes : VisitComparison or None
        Changes since the earlier visit, if one was given.
    content : Content
        The values and drawings of the page.

    Examples
    --------
    See `sheet`.
    """

    name: str
    sex: str
    badge: str
    measurements: tuple[SheetRow, ...]
    posture: dict[str, float]
    changes: VisitComparison | None
    content: Content

    def __repr__(self) -> str:
        known = sum(bool(np.isfinite(row.value)) for row in self.measurements)
        return f"<Sheet: {self.name}, {self.sex}, {self.badge}, {known} measurements>"

    def _repr_html_(self) -> str:
        page = escape(self.html, quote=True)
        style = "width:100%;height:60rem;border:0"
        return f'<iframe srcdoc="{page}" style="{style}" title="{escape(self.name)}"></iframe>'

    @cached_property
    def html(self) -> str:
        """The page."""
        return self.content.html()

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write the page (.html), or the two-page PDF (.pdf), by Chromium, Chrome or Edge.

        Parameters
        ----------
        path : path_like
            File to write; an existing one is replaced.
        """
        file = file_path(path)
        if suffix_of(file, (".html", ".pdf")) == ".html":
            write_text(file, self.html)
        else:
            self.content.save_pdf(file, printing_browser())


@checked(
    sex=choice("adult", "woman", "man"),
    name=text,
    visit=text,
    stature=a_stature,
    units=choice(*READABLE_UNITS),
)
def sheet(
    body: RegisteredScan | ScanRecord | ArrayLike | Sequence[RegisteredScan | ScanRecord],
    *,
    model: BodyModel | Measurements | None = None,
    name: str = "",
    sex: str = "adult",
    visit: str = "",
    stature: float | None = None,
    before: RegisteredScan
    | ScanRecord
    | ArrayLike
    | Sequence[RegisteredScan | ScanRecord]
    | None = None,
    units: str = "cm",
    logo: str | os.PathLike[str] | None = None,
) -> Sheet:
    """Make the sheet of a person.

    It shows the scan and the body from three sides, whether and where to trust them, measurements
    in the standard pose with uncertainties and percentiles among adults of the same sex and stature
    (see `rh.measurements.percentiles`), the silhouette over that of the average body, the posture,
    and changes since an earlier visit.

    Parameters
    ----------
    body : RegisteredScan, ScanRecord, or array_like, shape (V, 3) or (n_scans, V, 3)
        A registered scan, its record, or a body of the model, metres, y up. Several of them, as a
        list or along the first axis, are scans of one visit: their mean is measured, see
        `rh.measurements.person_in_standard_pose`, and one is shown.
    model : BodyModel or Measurements, optional
        The body model, or measurements of it; by default the open model with these triangles.
    name : str
        Name of the person.
    sex : {"adult", "woman", "man"}
        Population for comparison; "adult" means women and men together.
    visit : str
        Number or date of the visit.
    stature : float, optional
        The stature as measured by hand, metres, for percentiles and the average body; by default
        that of the scan.
    before : RegisteredScan, ScanRecord, or array_like, optional
        The same person at an earlier visit; one or several scans.
    units : {"cm", "in"}
        Centimetres, kilograms and litres, or inches and pounds.
    logo : path_like, optional
        A picture for the top of the sheet, such as a PNG file.

    Examples
    --------
    >>> bodies = rh.datasets.load_open_bodies("coarse")
    >>> sheet = rh.report.sheet(bodies[0], name="Emma", sex="woman")
    >>> sheet.badge, sheet.measurements[0].name
    ('registered mesh', 'stature')
    >>> sheet.save("emma.html")
    """
    subject = _subject(body, "body", name, sex, visit)
    if stature is not None:
        subject = replace(subject, stature=stature)
    measurements = _measurements_of(model, subject.points)
    _check_vertices(subject, "body", measurements)
    (values,) = values_of(measurements, [subject])
    if before is not None:
        first = _subject(before, "before", name, sex, "the earlier visit")
        _check_vertices(first, "before", measurements)
        values = with_changes(measurements, values, first, subject)
    content = Content.of(measurements.definitions, subject, values, units, logo_source(logo))
    return Sheet(
        name=subject.person or subject.name,
        sex=subject.sex,
        badge=content.badge[1],
        measurements=values.rows,
        posture=dict(values.posture),
        changes=values.changes,
        content=content,
    )


def _subject(body: object, argument: str, name: str, sex: str, visit: str) -> SheetSubject:
    """Return what is known about a person at a visit, from whatever holds the scan or scans."""
    scans: list[object]
    if isinstance(body, RegisteredScan | ScanRecord):
        scans = [body]
    elif isinstance(body, list | tuple) and any(
        isinstance(scan, RegisteredScan | ScanRecord) for scan in body
    ):
        scans = list(body)
    else:
        points = real_array(body, argument, ("n_vertices", 3))
        if points.ndim > 3 or not points.size:
            raise ArgumentError(
                f"{argument} must be one body, or the scans of one visit, shape (n_scans, V, 3); "
                f"found shape {points.shape}"
            )
        scans = list(points.reshape(-1, *points.shape[-2:]))
    names = [name or "body"]
    if len(scans) > 1:
        names = [f"{name or 'scan'} {number}" for number in range(1, len(scans) + 1)]
    subjects = [
        replace(_scan_subject(scan, argument, text), person=name, sex=sex, visit=visit, file="")
        for scan, text in zip(scans, names, strict=True)
    ]
    return SheetSubject.of_visit(subjects)


def _scan_subject(scan: object, argument: str, name: str) -> SheetSubject:
    if isinstance(scan, RegisteredScan):
        scan = record_of(name, scan)
    if isinstance(scan, ScanRecord):
        return SheetSubject.of_record(scan)
    points = real_array(scan, argument, ("n_vertices", 3), batched=False)
    return SheetSubject(name=name, points=points)


def _check_vertices(subject: SheetSubject, argument: str, measurements: Measurements) -> None:
    shape = (measurements.definitions.n_vertices, 3)
    for scan in subject.scans:
        real_array(scan.points, argument, shape, batched=False)


def _measurements_of(model: BodyModel | Measurements | None, points: Points) -> Measurements:
    if isinstance(model, Measurements):
        return model
    if model is not None:
        return Measurements(model)
    for resolution in ("coarse", "full"):
        open_model = load_open_model(resolution)
        if len(points) == open_model.n_vertices:
            return Measurements(open_model)
    raise ArgumentError(
        "body must be a body of the open body model, or model must be given; found "
        f"{len(points)} vertices"
    )
