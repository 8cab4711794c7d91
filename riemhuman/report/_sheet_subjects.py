"""The bodies of sheets, from files and folders, with the labels of their people."""

from __future__ import annotations

import itertools
import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from datetime import date
from pathlib import Path

import numpy as np

from riemhuman.arrays import Array, Booleans, Points, Triangles
from riemhuman.datasets import RegisteredMeshes, find_meshes
from riemhuman.errors import ArgumentError, FileError, FileFormatError, warn
from riemhuman.io.files import file_path, natural_key
from riemhuman.io.meshes import load_trusted
from riemhuman.io.text_tables import read_rows
from riemhuman.registration import ScanRecord, read_records
from riemhuman.registration.registered_scans import apply_transform
from riemhuman.report.registered_scans import shown_share
from riemhuman.report.sheet_values import SheetSubject

_LABELS = "labels.csv"
_RECORDS = "registrations"
_SEXES = {
    **dict.fromkeys(("woman", "women", "female", "f", "w"), "woman"),
    **dict.fromkeys(("man", "men", "male", "m"), "man"),
    **dict.fromkeys(("", "adult", "unknown", "?"), "adult"),
}
# Columns that may hold the same thing; the first that a table has counts.
_COLUMNS = {
    "person": ("person", "subject", "name"),
    "sex": ("sex", "gender"),
    "visit": ("visit",),
    "date": ("date",),
}


@dataclass(frozen=True)
class PersonLabels:
    """The labels of one file."""

    person: str = ""
    sex: str = "adult"
    visit: str = ""
    day: str = ""

    @property
    def when(self) -> str:
        """The visit and its date, in words."""
        visit = f"visit {self.visit}" if self.visit.isdigit() else self.visit
        return ", ".join(part for part in (visit, self.day) if part)


@dataclass(frozen=True, eq=False)
class _Subjects:
    """The bodies of a file or folder, their triangles, and scans that have no body."""

    subjects: list[SheetSubject]
    faces: list[Triangles]
    failures: list[tuple[str, str]]  # names of scans and the reasons


@dataclass(frozen=True, eq=False)
class LabelledSubjects:
    """The bodies for sheets, their triangles, labels, and scans that have no body."""

    subjects: list[SheetSubject]
    faces: list[Triangles]
    labels: list[PersonLabels]
    failures: list[tuple[str, str]]

    def earlier(self, number: int) -> int | None:
        """Return the same person's visit before this body's, if the labels name it."""
        order = self._visits(number)
        place = order.index(number) if order else 0
        return order[place - 1] if place else None

    def is_without_order(self, number: int) -> bool:
        """Return whether a person has several bodies that labels do not order."""
        return len(self._bodies_of_person(number)) > 1 and not self._visits(number)

    def _bodies_of_person(self, number: int) -> list[int]:
        person = self.labels[number].person
        return [k for k, label in enumerate(self.labels) if person and label.person == person]

    def _visits(self, number: int) -> list[int]:
        """Return the bodies of a person in the order of their dates or visits, if all differ."""
        same = self._bodies_of_person(number)
        for field in ("day", "visit"):
            texts = {k: getattr(self.labels[k], field) for k in same}
            if all(texts.values()) and len(set(texts.values())) == len(same):
                return sorted(same, key=lambda k: natural_key(texts[k]))
        return []


def find_subjects(
    paths: Sequence[Path],
    labels: str | os.PathLike[str] | None,
    *,
    unit: str | None = None,
    up: str | None = None,
) -> LabelledSubjects:
    """Return the bodies in mesh files and folders; registered scans with their records."""
    subjects: list[SheetSubject] = []
    faces: list[Triangles] = []
    failures: list[tuple[str, str]] = []
    for place in paths:
        is_folder = place.is_dir()
        in_place = _in_folder(place, unit, up) if is_folder else _in_files([place], unit, up)
        subjects += in_place.subjects
        faces += in_place.faces
        failures += in_place.failures
    if not subjects and not failures:
        raise FileError("there are no bodies to make sheets for")
    table = _table_of(paths, labels)
    people = {} if table is None else read_people(table)
    labels_of_subjects = []
    n_labelled = 0
    for k, subject in enumerate(subjects):
        label = people.get(subject.file.casefold()) or people.get(subject.name.casefold())
        n_labelled += label is not None
        label = label or PersonLabels()
        labels_of_subjects.append(label)
        subjects[k] = replace(subject, person=label.person, sex=label.sex, visit=label.when)
    if table is not None:
        _warn_of_missing_labels(table, len(subjects), n_labelled)
    return LabelledSubjects(subjects, faces, labels_of_subjects, failures)


def read_people(table: Path) -> dict[str, PersonLabels]:
    """Return what a table says about files, by their names with and without an ending.

    Its first line names the columns: ``file`` and any of person (or subject), sex, visit and date.
    """
    _, rows = read_rows(table)
    header = [name.lower() for name in rows[0][1]] if rows else []
    if "file" not in header:
        raise FileFormatError(
            f"{table} has no column file; its first line must name file and any of person, sex, "
            f"visit and date; found {','.join(header)[:60]!r}"
        )
    people = {}
    for line, cells in rows[1:]:
        # Empty cells at the end of a line may be left out.
        texts = dict(itertools.zip_longest(header, cells[: len(header)], fillvalue=""))
        where = f"{table}, line {line}"
        label = PersonLabels(
            person=_text_of(texts, "person"),
            sex=_sex(_text_of(texts, "sex"), where),
            visit=_text_of(texts, "visit"),
            day=_day(_text_of(texts, "date"), where),
        )
        file = texts["file"]
        if file.casefold() in people:
            raise FileFormatError(f"{where}: {file} has another line above")
        for name in (file, Path(file).stem):
            people[name.casefold()] = label
    return people


def _text_of(texts: Mapping[str, str], key: str) -> str:
    """Return a text of a line, from the first of the columns that may hold it."""
    for name in _COLUMNS[key]:
        if name in texts:
            return texts[name]
    return ""


def _warn_of_missing_labels(table: Path, n_subjects: int, n_labelled: int) -> None:
    """Warn if a table of labels does not name all bodies."""
    if n_labelled == n_subjects:
        return
    names = f"{n_labelled or 'none'} of the {n_subjects} bodies"
    warn(
        f"{table} names {names}; bodies without labels are compared with adults of both sexes",
        UserWarning,
    )


def _sex(text: str, where: str) -> str:
    sex = _SEXES.get(text.casefold())
    if sex is None:
        raise FileFormatError(f"{where}: sex must be woman, man or empty; found {text[:40]!r}")
    return sex


def _day(text: str, where: str) -> str:
    if not text:
        return ""
    try:
        return date.fromisoformat(text).isoformat()
    except ValueError as error:
        raise FileFormatError(
            f"{where}: date must be written as 2026-03-31; found {text[:40]!r}"
        ) from error


def _table_of(paths: Sequence[Path], labels: str | os.PathLike[str] | None) -> Path | None:
    if labels is not None:
        table = file_path(labels, "labels")
        if not table.is_file():
            raise FileError(f"there is no table of labels {table}")
        return table
    beside = (paths[0] if paths[0].is_dir() else paths[0].parent) / _LABELS
    return beside if beside.is_file() else None


def _in_folder(folder: Path, unit: str | None, up: str | None) -> _Subjects:
    """Return the bodies of a folder, also those that `register` did not trust."""
    if not (folder / _RECORDS).is_dir():
        return _in_files(find_meshes(folder), unit, up)
    records = sorted(read_records(folder), key=lambda record: natural_key(record.name))
    subjects = [subject_of_record(record) for record in records if record.arrays]
    faces = [record.arrays["faces"] for record in records if record.arrays]
    failures = [(record.name, record.message) for record in records if not record.arrays]
    names = {record.name for record in records}
    try:
        unregistered = [file for file in find_meshes(folder) if file.stem not in names]
    except FileError:  # all of them are in its subfolders
        unregistered = []
    if unregistered:
        meshes = _in_files(unregistered, unit, up)
        subjects += meshes.subjects
        faces += meshes.faces
    return _Subjects(subjects, faces, failures)


def _in_files(files: Sequence[Path], unit: str | None, up: str | None) -> _Subjects:
    """Return the bodies of mesh files; those of registered scans with their records."""
    subjects = []
    faces = []
    records_of_folders: dict[Path, dict[str, ScanRecord]] = {}
    for file in files:
        record = _record_beside(file, records_of_folders)
        if record is not None:
            subjects.append(subject_of_record(record))
            faces.append(record.arrays["faces"])
            continue
        meshes = RegisteredMeshes([file], scale=None, unit=unit, up=up)
        trusted = load_trusted(file)
        subjects.append(
            SheetSubject(
                name=file.stem,
                points=meshes[0],
                file=file.name,
                trusted_vertices=trusted,
                is_trusted=trusted is None or bool(trusted.any()),
            )
        )
        faces.append(meshes.faces)
    return _Subjects(subjects, faces, [])


def _record_beside(
    file: Path, records_of_folders: dict[Path, dict[str, ScanRecord]]
) -> ScanRecord | None:
    """Return the record of the registered scan in a file, if `register` kept one.

    Records that are read are added to those of folders.
    """
    for folder in (file.parent, file.parent.parent):
        if (folder / _RECORDS / f"{file.stem}.npz").is_file():
            if folder not in records_of_folders:
                records = {record.name: record for record in read_records(folder)}
                records_of_folders[folder] = records
            record = records_of_folders[folder][file.stem]
            return record if record.arrays else None
    return None


def subject_of_record(record: ScanRecord) -> SheetSubject:
    """Return the body of a registered scan, or raise an error if it has none."""
    if not record.arrays:
        raise ArgumentError(f"{record.name} was not registered: {record.message}")
    arrays = record.arrays
    return subject_of_scan(
        record.name,
        arrays["points"],
        arrays["transform"],
        arrays["shown"],
        arrays["trusted_vertices"].astype(bool),
        is_trusted=record.trusted,
        message=record.message,
        median_distance=record.median_distance,
        matched_share=shown_share(record),
    )


# More than eight arguments: what results of registration and records on disk share.
def subject_of_scan(
    name: str,
    points: Points,
    transform: Array,
    scan: Points,
    trusted_vertices: Booleans,
    *,
    is_trusted: bool,
    message: str,
    median_distance: float,
    matched_share: float,
) -> SheetSubject:
    """Return a registered scan in upright axes."""
    return SheetSubject(
        name=name,
        points=apply_transform(transform, np.asarray(points, dtype=np.float64)),
        file=name,
        trusted_vertices=trusted_vertices,
        is_trusted=is_trusted,
        message=message,
        scan=apply_transform(transform, np.asarray(scan, dtype=np.float64)),
        median_distance=median_distance,
        matched_share=matched_share,
    )
