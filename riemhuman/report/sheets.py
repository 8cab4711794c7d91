"""The sheet of a person: what the body measures, whether to trust it, and what has changed."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from html import escape

import numpy as np
import PIL.Image

from riemhuman.arrays import ArrayLike, Points
from riemhuman.bodies import BodyModel
from riemhuman.checks import checked, choice, real_array, real_number
from riemhuman.checks.labels import text
from riemhuman.datasets import load_open_model
from riemhuman.errors import ArgumentError, FileError
from riemhuman.io.files import file_path, suffix_of, write_text
from riemhuman.measurements import Measurements, MeasurementSet, VisitComparison, readable_gap
from riemhuman.measurements.adults import check_values
from riemhuman.measurements.populations import largest_body_mass_index
from riemhuman.plots.rendering import image_source
from riemhuman.plots.viewer import web_file
from riemhuman.readable_units import READABLE_UNITS
from riemhuman.registration import RegisteredScan, ScanRecord
from riemhuman.registration.folders import record_of
from riemhuman.report._page import library_version, template
from riemhuman.report._sheet_pictures import (
    LARGEST_CHANGE,
    Picture,
    body_pictures,
    change_picture,
    front_of,
    silhouette_picture,
)
from riemhuman.report._sheet_words import (
    WHOLE,
    Numbers,
    badge,
    changes_in_order,
    line_of,
    percentile_text,
    posture_texts,
    sentence,
    sentences_of,
)
from riemhuman.report.printing import printing_browser, save_pdf
from riemhuman.report.sheet_values import (
    SheetRow,
    SheetSubject,
    SheetValues,
    values_of,
    with_changes,
)
from riemhuman.representation import join_names

_THUMBNAIL = 150  # pixels
_LOGO = (900, 300)  # pixels at most, three times what the page shows


def a_stature(value: float, name: str) -> float:
    """Check a stature in metres."""
    stature = real_number(value, name, minimum=0.0, strict=True)
    check_values({"stature": stature})
    return stature


@dataclass(frozen=True, eq=False, repr=False)
class Sheet:
    """The sheet of a person: an HTML page, or a two-page PDF.

    A notebook shows it. Its pictures are drawn once, for both.

    Attributes
    ----------
    subject : SheetSubject
        The body that is shown, and what is known about its person and its scan.
    values : SheetValues
        What is known about the body.
    units : {"cm", "in"}
    scan : Picture or None
    body : Picture
    silhouette : Picture or None
    moved : Picture or None
        Where the surface moved since the earlier visit.
    logo : str
        The address of the picture at the top.

    Examples
    --------
    See `sheet`.
    """

    subject: SheetSubject
    values: SheetValues
    units: str
    scan: Picture | None
    body: Picture
    silhouette: Picture | None
    moved: Picture | None
    logo: str = ""

    @property
    def name(self) -> str:
        """Name of the person or body."""
        return self.subject.person or self.subject.name

    @property
    def sex(self) -> str:
        """One of "woman", "man" and "adult"."""
        return self.subject.sex

    @property
    def badge(self) -> str:
        """One of "trusted", "partly trusted", "not trusted" and "registered mesh".

        It is "partly trusted" if parts of the body or values of the head, hands or feet are in
        doubt, and "registered mesh" if nothing is known about a scan.
        """
        return badge(self.subject, self.values)[1]

    @property
    def measurements(self) -> tuple[SheetRow, ...]:
        """Values with uncertainties and percentiles."""
        return self.values.rows

    @property
    def posture(self) -> Mapping[str, float]:
        """Angles in degrees, see `rh.measurements.posture_angles`."""
        return self.values.posture

    @property
    def changes(self) -> VisitComparison | None:
        """Changes since the earlier visit, if one was given."""
        return self.values.changes

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
        return self.page()

    def page(self, *, printed: bool = False, index: str = "") -> str:
        """Return the page, for example with a link to others.

        Parameters
        ----------
        printed : bool
            Whether all tables are unfolded, for paper.
        index : str
            The address of the page of all people, if there is one.
        """
        subject, values = self.subject, self.values
        return template("sheet.html").render(
            subject=subject,
            values=values,
            units=self.units,
            number=Numbers(self.units),
            badge=badge(subject, values),
            scan=self.scan,
            body=self.body,
            silhouette=self.silhouette,
            moved=self.moved,
            logo=self.logo,
            said=sentences_of(subject.message),
            join_names=join_names,
            is_whole=bool(subject.known_vertices.mean() >= WHOLE),
            remarks=[sentence(remark) for remark in values.remarks],
            posture=posture_texts(values.posture),
            changes_in_order=changes_in_order(values),
            largest_change=LARGEST_CHANGE,
            largest_body_mass_index=largest_body_mass_index(subject.sex),
            gap=readable_gap,
            line_of=line_of,
            percentile=percentile_text,
            css=web_file("report", "sheet.css"),
            version=library_version(),
            printed=printed,
            index=index,
        )

    def thumbnail(self) -> str:
        """Return the address of a small picture of the body from the front."""
        picture = PIL.Image.fromarray(self.body.first_view)
        picture.thumbnail((_THUMBNAIL, _THUMBNAIL))
        return image_source(np.asarray(picture))

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
            save_pdf(file, self.page(printed=True), printing_browser())


def drawn_sheet(
    definitions: MeasurementSet,
    subject: SheetSubject,
    values: SheetValues,
    units: str,
    logo: str = "",
) -> Sheet:
    """Return the sheet of a person whose values are known, with its pictures."""
    faces = definitions.faces
    scan, body = body_pictures(subject, faces, front_of(subject.points, definitions))
    silhouette = silhouette_picture(values, faces)
    moved = change_picture(values, faces)
    return Sheet(subject, values, units, scan, body, silhouette, moved, logo)


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
    return drawn_sheet(measurements.definitions, subject, values, units, logo_source(logo))


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


def logo_source(path: str | os.PathLike[str] | None) -> str:
    """Return the address of a picture for the top of sheets; none without a path."""
    if path is None:
        return ""
    file = file_path(path, "logo")
    try:
        with PIL.Image.open(file) as opened:
            picture = opened.convert("RGBA")
    except FileNotFoundError:
        raise
    except (OSError, ValueError, SyntaxError, PIL.Image.DecompressionBombError) as error:
        raise FileError(f"{file} cannot be read as a picture, such as a PNG file") from error
    picture.thumbnail(_LOGO)
    return image_source(np.asarray(picture))
