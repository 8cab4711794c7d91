"""The bodies of sheets, from files and folders, with the labels of their people."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass, replace
from datetime import date
from pathlib import Path

from riemhuman.arrays import Triangles
from riemhuman.datasets import RegisteredMeshes, find_meshes
from riemhuman.errors import ArgumentError, FileError, FileFormatError, warn
from riemhuman.io.files import file_path, natural_key
from riemhuman.io.label_tables import LABELS, LabelRow, read_label_rows, rows_of_files
from riemhuman.io.meshes import load_trusted
from riemhuman.measurements.adults import check_values
from riemhuman.registration import ScanRecord, read_records
from riemhuman.registration.folders import RECORDS
from riemhuman.report.registered_scans import record_beside
from riemhuman.report.sheet_values import SheetSubject
from riemhuman.representation import join_names

_SEXES = {
    **dict.fromkeys(("woman", "women", "female", "f", "w"), "woman"),
    **dict.fromkeys(("man", "men", "male", "m"), "man"),
    **dict.fromkeys(("", "adult", "unknown", "?"), "adult"),
}
_COLUMNS = ("subject", "sex", "visit", "date", "stature")


@dataclass(frozen=True)
class PersonLabels:
    """The labels of one file."""

    person: str = ""
    sex: str = "adult"
    visit: str = ""
    day: str = ""
    stature: float = float("nan")  # metres

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

    def visits_until(self, number: int) -> list[int]:
        """Return the same person's bodies up to this one in the order of visits, if labels do."""
        order = self._visits(number)
        return order[: order.index(number) + 1] if order else [number]

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
    files = list(dict.fromkeys(subject.file for subject in subjects))
    people = {} if table is None else _people_of_files(table, files)
    labels_of_subjects = [people.get(subject.file, PersonLabels()) for subject in subjects]
    for k, label in enumerate(labels_of_subjects):
        subjects[k] = replace(
            subjects[k],
            person=label.person,
            sex=label.sex,
            visit=label.when,
            stature=label.stature,
        )
    return _one_per_visit(LabelledSubjects(subjects, faces, labels_of_subjects, failures))


def _one_per_visit(labelled: LabelledSubjects) -> LabelledSubjects:
    """Return one subject for all scans of a person with the same visit and date."""
    scans_of_visits: dict[tuple[object, ...], list[int]] = {}
    for number, label in enumerate(labelled.labels):
        visit = (label.person, label.when) if label.person and label.when else (number,)
        key = (*visit, labelled.faces[number].tobytes())
        scans_of_visits.setdefault(key, []).append(number)
    subjects, faces, labels = [], [], []
    for numbers in scans_of_visits.values():
        subjects.append(SheetSubject.of_visit([labelled.subjects[number] for number in numbers]))
        faces.append(labelled.faces[numbers[0]])
        labels.append(labelled.labels[numbers[0]])
    return LabelledSubjects(subjects, faces, labels, labelled.failures)


def read_people(table: Path) -> dict[str, PersonLabels]:
    """Return what a table says about files, by the names that it gives them.

    Its first line names the columns: ``file`` and any of person (or subject), sex, visit, date and
    stature.
    """
    return {row.file: _labels_of(table, row) for row in read_label_rows(table, (), _COLUMNS)}


def _labels_of(table: Path, row: LabelRow) -> PersonLabels:
    where = f"{table}, line {row.line}"
    return PersonLabels(
        person=row.texts["subject"],
        sex=_sex(row.texts["sex"], where),
        visit=row.texts["visit"],
        day=_day(row.texts["date"], where),
        stature=_stature(row.texts["stature"], where),
    )


def _people_of_files(table: Path, files: Sequence[str]) -> dict[str, PersonLabels]:
    """Return what a table says about bodies by their files; warn if it does not name all."""
    row_of_file, _ = rows_of_files(table, read_label_rows(table, (), _COLUMNS), files)
    unnamed = [file for number, file in enumerate(files) if number not in row_of_file]
    if unnamed:
        warn(
            f"{table} names {len(row_of_file) or 'none'} of the {len(files)} bodies, not "
            f"{join_names(unnamed, 5)}; bodies without labels are compared with adults of both "
            "sexes",
            UserWarning,
        )
    return {files[number]: _labels_of(table, row) for number, row in row_of_file.items()}


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


def _stature(text: str, where: str) -> float:
    if not text:
        return float("nan")
    try:
        stature = float(text.replace(",", "."))
        check_values({"stature": stature})
    except ValueError as error:  # also what nobody has
        reason = error if isinstance(error, ArgumentError) else f"found {text[:40]!r}"
        raise FileFormatError(f"{where}: stature must be a number of metres: {reason}") from error
    return stature


def _table_of(paths: Sequence[Path], labels: str | os.PathLike[str] | None) -> Path | None:
    if labels is not None:
        table = file_path(labels, "labels")
        if not table.is_file():
            raise FileError(f"there is no table of labels {table}")
        return table
    beside = (paths[0] if paths[0].is_dir() else paths[0].parent) / LABELS
    return beside if beside.is_file() else None


def _in_folder(folder: Path, unit: str | None, up: str | None) -> _Subjects:
    """Return the bodies of a folder, also those that `register` did not trust."""
    if not (folder / RECORDS).is_dir():
        return _in_files(find_meshes(folder), unit, up)
    records = sorted(read_records(folder), key=lambda record: natural_key(record.name))
    subjects = [SheetSubject.of_record(record) for record in records if record.arrays]
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
        record = record_beside(file, records_of_folders)
        if record is not None:
            subjects.append(SheetSubject.of_record(record))
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
