"""Sheets of all people in a folder: their pages and PDF files, an index, and tables."""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping, Sequence
from contextlib import nullcontext
from dataclasses import dataclass, replace
from importlib.util import find_spec
from pathlib import Path

import numpy as np

from riemhuman.arrays import Triangles
from riemhuman.checks import checked, choice, flag, instance, items_of
from riemhuman.errors import ArgumentError, FileError, counted, warn
from riemhuman.io.files import file_path, write_text
from riemhuman.io.outputs import FolderContent, atomic_folder, check_output_folder
from riemhuman.kernels.threads import mapped, thread_count
from riemhuman.measurements import Measurements, open_measurements
from riemhuman.plots.viewer import web_file
from riemhuman.readable_units import READABLE_UNITS
from riemhuman.report._page import library_version, template
from riemhuman.report._sheet_subjects import Subjects, find_subjects
from riemhuman.report._sheet_tables import save_workbook, table_text
from riemhuman.report._sheet_words import Numbers, badge
from riemhuman.report._storage import Progress
from riemhuman.report.printing import find_browser, save_pdf
from riemhuman.report.sheet_values import SheetSubject, SheetValues, values_of, with_changes
from riemhuman.report.sheets import Sheet, a_stature, drawn_sheet, logo_source
from riemhuman.surfaces import Template
from riemhuman.surfaces.template import check_body_sizes

_INDEX = "index.html"
_TABLE = "measurements.csv"
_WORKBOOK = "measurements.xlsx"
_CONTENT = FolderContent(r"[^.].*\.(html|pdf)|measurements\.(csv|xlsx)", always=_TABLE)
_BATCH = 8  # bodies whose measurements are taken together
_MOST_BROWSERS = 4


# More than eight arguments: each keyword is an option of the command.
@checked(
    measurements=instance(Measurements, "a Measurements(...)"),
    stature=a_stature,
    units=choice(*READABLE_UNITS),
    replace_output=flag,
)
def make_sheets(
    bodies: str | os.PathLike[str] | Sequence[str | os.PathLike[str]],
    output: str | os.PathLike[str],
    *,
    labels: str | os.PathLike[str] | None = None,
    measurements: Measurements | None = None,
    stature: float | None = None,
    units: str = "cm",
    unit: str | None = None,
    up: str | None = None,
    logo: str | os.PathLike[str] | None = None,
    replace_output: bool = False,
    progress: Progress = nullcontext,
) -> Path:
    """Write the sheets of people into a folder, and return their index page.

    For each body there is a page and, if Chromium, Chrome or Edge is installed, a two-page PDF.
    ``index.html`` lists all of them; ``measurements.csv`` contains the numbers in SI units, and if
    openpyxl is installed, ``measurements.xlsx`` does, too. All files appear at the same time.

    Parameters
    ----------
    bodies : path_like or sequence of path_like
        Folders and files of registered bodies; those of `register_folder` come with their scans.
    output : path_like
        Folder to write.
    labels : path_like, optional
        Table with the column ``file`` and any of ``person`` (or ``subject``), ``sex`` (woman or
        man), ``visit``, ``date`` (as 2026-03-31) and ``stature`` (measured by hand, metres); by
        default ``labels.csv`` next to the bodies.
        Bodies of one person with the same visit and date are scans of one visit, which get one
        sheet: the mean is measured, see `rh.measurements.person_in_standard_pose`. It is compared
        with the previous visit.
    measurements : Measurements, optional
        Measurements of the body model; by default those of the open one.
    stature : float, optional
        The stature of the one body, as measured by hand, metres.
    units : {"cm", "in"}
        Units of the sheets; tables are in SI units.
    unit, up : str, optional
        Unit of the mesh files, and their axis that points up.
    logo : path_like, optional
        A picture for the top of each sheet, such as a PNG file.
    replace_output : bool
        Whether to replace existing sheets in the folder.
    progress : callable
        Takes the name of a task; returns a context manager that is open during the task.

    Raises
    ------
    FileError
        If there are no bodies, or the output folder is not empty.

    Examples
    --------
    >>> page = rh.report.make_sheets("bodies", "sheets")  # doctest: +SKIP
    """
    places = [bodies] if isinstance(bodies, (str, os.PathLike)) else bodies
    paths = [
        file_path(place, "bodies")
        for place in items_of(places, "bodies", "a path or a sequence of paths")
    ]
    folder = file_path(output, "output", "folder")
    check_output_folder(folder, _CONTENT, force=replace_output)
    picture = logo_source(logo)
    browser = find_browser()
    if browser is None:
        warn(
            "no PDF files are written, because Chromium, Chrome and Edge are missing; any browser "
            "prints the pages",
            UserWarning,
        )
    with progress("Reading bodies"):
        subjects = find_subjects(paths, labels, unit=unit, up=up)
    if stature is not None:
        _set_stature(subjects, stature)
    sheets = replace(_measured(subjects, measurements, units, progress), logo=picture)
    with atomic_folder(folder, _CONTENT) as temporary:
        _write(temporary, sheets, browser, progress)
    return folder / _INDEX


def _set_stature(labelled: Subjects, stature: float) -> None:
    if len(labelled.subjects) != 1:
        raise ArgumentError(
            f"stature is for one body; found {len(labelled.subjects)}: give the labels a column "
            "stature"
        )
    labelled.subjects[0] = replace(labelled.subjects[0], stature=stature)


@dataclass(frozen=True, eq=False)
class _Sheets:
    """The bodies of a folder, their values, and the measurements of each."""

    labelled: Subjects
    values: Sequence[SheetValues]
    measurements: Mapping[int, Measurements]  # by the number of vertices
    units: str
    logo: str = ""

    def drawn(self, number: int) -> Sheet:
        subject = self.labelled.subjects[number]
        definitions = self.measurements[len(subject.points)].definitions
        return drawn_sheet(definitions, subject, self.values[number], self.units, self.logo)


def _measured(
    labelled: Subjects, measurements: Measurements | None, units: str, progress: Progress
) -> _Sheets:
    """Measure all bodies, those of one triangulation together, and compare visits."""
    subjects = labelled.subjects
    numbers_by_size: dict[int, list[int]] = {}
    measurements_by_size: dict[int, Measurements] = {}
    for number, subject in enumerate(subjects):
        faces = subject.faces
        assert faces is not None, "files have triangles"
        n_vertices = len(subject.points)
        if n_vertices not in measurements_by_size:
            measurements_of_size = _measurements_of_file(measurements, subject, faces)
            measurements_by_size[n_vertices] = measurements_of_size
        surface = measurements_by_size[n_vertices].definitions.surface
        surface.check_faces(faces, subject.file)
        for scan in subject.scans:
            check_body_sizes(scan.points, surface, scan.file)
        numbers_by_size.setdefault(n_vertices, []).append(number)
    values: dict[int, SheetValues] = {}
    for n_vertices, numbers in numbers_by_size.items():
        measurements_of_size = measurements_by_size[n_vertices]
        for part, words in _parts(numbers):
            with progress(f"Measurements of {words}"):
                values_of_part = values_of(measurements_of_size, [subjects[k] for k in part])
            values |= dict(zip(part, values_of_part, strict=True))
    for number, subject in enumerate(subjects):
        measurements_of_size = measurements_by_size[len(subject.points)]
        values[number] = _since_earlier(
            labelled, number, values[number], measurements_of_size, progress
        )
    for number in range(len(subjects)):
        order = labelled.visits_until(number)
        if len(order) > 2:
            # Statures in a row are of one kind: typed in for all visits, or of the scans.
            is_typed_in = all(np.isfinite(subjects[k].stature) for k in order)
            named = [at_visit(values[k], is_typed_in=is_typed_in) for k in order]
            visits = tuple((subjects[k].visit, row) for k, row in zip(order, named, strict=True))
            values[number] = replace(values[number], visits=visits)
    ordered = [values[number] for number in range(len(subjects))]
    return _Sheets(labelled, ordered, measurements_by_size, units)


def at_visit(values: SheetValues, *, is_typed_in: bool) -> dict[str, float]:
    """Return measurements by name, with the stature that was typed in or that of the scan."""
    known = {row.name: row.value for row in values.rows}
    if not is_typed_in and "stature" in known:
        known["stature"] = values.scanned_stature
    return known


def _since_earlier(
    labelled: Subjects,
    number: int,
    values: SheetValues,
    measurements: Measurements,
    progress: Progress,
) -> SheetValues:
    """Return the values of a body with its changes since the visit before, if there was one."""
    subject = labelled.subjects[number]
    if labelled.is_without_order(number):
        return _with_remark(
            values,
            "changes since an earlier visit are left out: the labels do not give this "
            "person's bodies different dates or visits",
        )
    *earlier, _ = labelled.visits_until(number)
    if not earlier:
        return values
    before = labelled.subjects[earlier[-1]]
    if len(before.points) != len(subject.points):
        return _with_remark(
            values, f"no comparison with {before.name}: it was registered with another mesh"
        )
    with progress(f"Changes of {subject.name} since {before.name}"):
        values = with_changes(measurements, values, before, subject)
    if values.doubt:
        warn(f"{before.name} and {subject.name} are {values.doubt}", UserWarning)
    return values


def _with_remark(values: SheetValues, remark: str) -> SheetValues:
    return replace(values, remarks=(*values.remarks, remark))


def _parts(numbers: Sequence[int]) -> Iterator[tuple[Sequence[int], str]]:
    """Yield some numbers at a time, with words that say which of how many bodies these are."""
    count = len(numbers)
    for first in range(0, count, _BATCH):
        part = numbers[first : first + _BATCH]
        last = first + len(part)
        if count <= _BATCH:
            yield part, counted(count, "body", "bodies")
        else:
            yield part, f"bodies {first + 1}–{last} of {count}"


@dataclass(frozen=True, eq=False)
class _Entry:
    """A person in the index, with the files of the sheet."""

    subject: SheetSubject
    values: SheetValues
    thumbnail: str
    page: str
    pdf: str

    @property
    def badge(self) -> tuple[str, str]:
        """Its class and its words."""
        return badge(self.subject, self.values)


def _write(folder: Path, sheets: _Sheets, browser: str | None, progress: Progress) -> None:
    """Write all files of a folder of sheets."""
    subjects = sheets.labelled.subjects
    names = _file_names([subject.name for subject in subjects])
    files = [(f"{name}.html", f"{name}.pdf" if browser else "") for name in names]
    entries: list[_Entry] = []
    # Pictures take memory: those of a part are written before the next is drawn.
    for part, words in _parts(range(len(subjects))):
        with progress(f"Pictures of {words}"):
            drawn = list(mapped(sheets.drawn, part, thread_count(-1)))
        with progress(f"Pages and PDF files of {words}"):
            _write_files(folder, drawn, [files[number] for number in part], browser)
        for number, sheet in zip(part, drawn, strict=True):
            entries.append(_Entry(sheet.subject, sheet.values, sheet.thumbnail(), *files[number]))
    tables = _write_tables(folder, list(zip(subjects, sheets.values, strict=True)))
    index = template("sheets.html").render(
        entries=entries,
        failures=sheets.labelled.failures,
        tables=tables,
        number=Numbers(sheets.units),
        css=web_file("report", "sheet.css"),
        version=library_version(),
    )
    write_text(folder / _INDEX, index)


def _write_files(
    folder: Path,
    sheets: Sequence[Sheet],
    files: Sequence[tuple[str, str]],
    browser: str | None,
) -> None:
    """Write pages and, by several browsers at a time, PDF files."""

    def write(number: int) -> None:
        page, pdf = files[number]
        write_text(folder / page, sheets[number].page(index=_INDEX))
        if browser:
            save_pdf(folder / pdf, sheets[number].page(printed=True), browser)

    list(mapped(write, range(len(files)), min(_MOST_BROWSERS, thread_count(-1))))


def _write_tables(folder: Path, sheets: Sequence[tuple[SheetSubject, SheetValues]]) -> list[str]:
    """Write the tables of all numbers, a workbook where openpyxl is installed; return the names."""
    write_text(folder / _TABLE, table_text(sheets))
    if find_spec("openpyxl") is None:
        return [_TABLE]
    save_workbook(sheets, folder / _WORKBOOK)
    return [_TABLE, _WORKBOOK]


def _file_names(names: Sequence[str]) -> list[str]:
    """Return names of files that differ on every file system, and from that of the index."""
    used = {"index"}
    file_names = []
    for name in names:
        plain = name.lstrip(".") or "body"
        file_name = plain
        number = 1
        while file_name.casefold() in used:
            number += 1
            file_name = f"{plain}_{number}"
        used.add(file_name.casefold())
        file_names.append(file_name)
    return file_names


def _measurements_of_file(
    measurements: Measurements | None, subject: SheetSubject, faces: Triangles
) -> Measurements:
    if measurements is not None:
        return measurements
    definitions = open_measurements(Template(subject.points, faces))
    if definitions is None:
        raise FileError(
            f"{subject.file} has {len(subject.points)} vertices and {len(faces)} triangles, "
            "unlike the open body model; register it first: riemhuman register SCAN -o "
            "body.ply, or give --model and --definitions"
        )
    return Measurements(definitions)
