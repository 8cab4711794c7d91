"""The sheet of a person: what the body measures, whether to trust it, and what has changed."""

from __future__ import annotations

import os
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
from riemhuman.measurements.readable_units import READABLE_UNITS
from riemhuman.registration import RegisteredScan, ScanRecord
from riemhuman.registration.folders import record_of
from riemhuman.report._sheet_content import Content, badge, content_of
from riemhuman.report._sheet_page import save_pdf, sheet_page
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
        "trusted", "partly seen: 66 %", "partly trusted" if values of the head, hands or feet are
        withheld, "not trusted", or "registered mesh" if nothing is known about a scan.
    measurements : tuple of SheetRow
        Values with uncertainties and percentiles.
    posture : dict of str to float
        Angles in degrees, see `rh.measurements.posture_angles`.
    changes : VisitComparison or None
        Changes since the earlier visit, if one was given.
    content : Content
        The text and drawings of the page.

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
        return sheet_page(self.content)

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
            save_pdf(self.content, file, printing_browser())


@checked(
    sex=choice("adult", "woman", "man"),
    name=text,
    visit=text,
    stature=a_stature,
    units=choice(*READABLE_UNITS),
)
def sheet(
    body: RegisteredScan | ScanRecord | ArrayLike,
    *,
    model: BodyModel | Measurements | None = None,
    name: str = "",
    sex: str = "adult",
    visit: str = "",
    stature: float | None = None,
    before: RegisteredScan | ScanRecord | ArrayLike | None = None,
    units: str = "cm",
) -> Sheet:
    """Make the sheet of a person.

    It shows the scan and the body from three sides, whether and where to trust them, measurements
    in the standard pose with uncertainties and percentiles among adults of the same sex and stature
    (see `rh.measurements.percentiles`), the silhouette over that of the average body, the posture,
    and changes since an earlier visit.

    Parameters
    ----------
    body : RegisteredScan, ScanRecord, or array_like, shape (V, 3)
        A registered scan, its record, or a body of the model, metres, y up.
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
        The same person at an earlier visit.
    units : {"cm", "in"}
        Centimetres, kilograms and litres, or inches and pounds.

    Examples
    --------
    >>> bodies = rh.datasets.load_open_bodies("coarse")
    >>> sheet = rh.report.sheet(bodies[0], name="Emma", sex="woman")
    >>> sheet.badge, sheet.measurements[0].name
    ('registered mesh', 'stature')
    >>> sheet.save("emma.html")
    """
    points, subject = _subject(body, "body", name, sex, visit)
    if stature is not None:
        subject = replace(subject, stature=stature)
    measurements = _measurements_of(model, points)
    real_array(points, "body", (measurements.definitions.n_vertices, 3), batched=False)
    (values,) = values_of(measurements, [subject])
    if before is not None:
        earlier, first = _subject(before, "before", name, sex, "the earlier visit")
        real_array(earlier, "before", points.shape, batched=False)
        values = with_changes(measurements, values, first, subject)
    return Sheet(
        name=subject.person or subject.name,
        sex=subject.sex,
        badge=badge(subject, values)[1],
        measurements=values.rows,
        posture=dict(values.posture),
        changes=values.changes,
        content=content_of(measurements.definitions, subject, values, units),
    )


def _subject(
    body: object, argument: str, name: str, sex: str, visit: str
) -> tuple[Points, SheetSubject]:
    """Return a body and what is known about it, from whatever holds it."""
    if isinstance(body, RegisteredScan):
        body = record_of(name or "body", body)
    if isinstance(body, ScanRecord):
        subject = SheetSubject.of_record(body)
    else:
        points = real_array(body, argument, ("n_vertices", 3), batched=False)
        subject = SheetSubject(name=name or "body", points=points)
    return subject.points, replace(subject, person=name, sex=sex, visit=visit, file="")


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
