"""The bodies of sheets, from files and folders, with the labels of their people."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass, replace
from datetime import date
from pathlib import Path

import numpy as np

from riemhuman.datasets import RegisteredMeshes, find_meshes
from riemhuman.errors import ArgumentError, FileError, FileFormatError, warn
from riemhuman.io.files import file_path, natural_key
from riemhuman.io.label_tables import LABELS, LabelRow, read_label_rows, rows_of_files
from riemhuman.io.meshes import load_trusted
from riemhuman.measurements.adults import check_values
from riemhuman.registration import ScanRecord, read_records
from riemhuman.registration.folders import RECORDS
from riemhuman.report.sheet_values import SheetSubject, record_beside
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
class Subjects:
    """The bodies for sheets, and scans that have no body."""

    subjects: list[SheetSubject]
    failures: list[tuple[str, str]]  # names of scans and the reasons

    def visits_until(self, number: int) -> list[int]:
        """Return the same person's bodies up to this one in the order of visits, if labels do."""
        order = self._visits(number)
        return order[: order.index(number) + 1] if order else [number]

    def is_without_order(self, number: int) -> bool:
        """Return whether a person has several bodies that labels do not order."""
        return len(self._bodies_of_person(number)) > 1 and not self._visits(number)

    def _bodies_of_person(self, number: int) -> list[int]:
        person = self.subjects[number].person
        return [k for k, body in enumerate(self.subjects) if person and body.person == person]

    def _visits(self, number: int) -> list[int]:
        """Return the bodies of a person in the order of their dates or visits, if all differ."""
        same = self._bodies_of_person(number)
        for texts in (
            {k: self.subjects[k].day for k in same},
            {k: self.subjects[k].number for k in same},
        ):
            if all(texts.values()) and len(set(texts.values())) == len(same):
                return sorted(same, key=lambda k: natural_key(texts[k]))
        return []


def find_subjects(
    paths: Sequence[Path],
    labels: str | os.PathLike[str] | None,
    *,
    unit: str | None = None,
    up: str | None = None,
) -> Subjects:
    """Return the bodies in mesh files and folders; registered scans with their records."""
    subjects: list[SheetSubject] = []
    failures: list[tuple[str, str]] = []
    for place in paths:
        if place.is_dir():
            in_place = _in_folder(place, unit, up)
            subjects += in_place.subjects
            failures += in_place.failures
        else:
            subjects += _in_files([place], unit, up)
    if not subjects and not failures:
        raise FileError("there are no bodies to make sheets for")
    table = _table_of(paths, labels)
    people: dict[str, PersonLabels] = {}
    if table is not None:
        people = people_of_files(table, list(dict.fromkeys(subject.file for subject in subjects)))
    # All scans of a person with the same visit and date are of one visit.
    scans_of_visits: dict[tuple[object, ...], list[SheetSubject]] = {}
    for number, subject in enumerate(subjects):
        label = people.get(subject.file, PersonLabels())
        labelled = replace(
            subject,
            person=label.person,
            sex=label.sex,
            visit=label.when,
            number=label.visit,
            day=label.day,
            stature=label.stature,
        )
        visit = (label.person, label.when) if label.person and label.when else (number,)
        key = (*visit, np.asarray(subject.faces).tobytes())
        scans_of_visits.setdefault(key, []).append(labelled)
    return Subjects(list(map(SheetSubject.of_visit, scans_of_visits.values())), failures)


def _labels_of(table: Path, row: LabelRow) -> PersonLabels:
    where = f"{table}, line {row.line}"
    return PersonLabels(
        person=row.texts["subject"],
        sex=_sex(row.texts["sex"], where),
        visit=row.texts["visit"],
        day=_day(row.texts["date"], where),
        stature=_stature(row.texts["stature"], where),
    )


def people_of_files(table: Path, files: Sequence[str]) -> dict[str, PersonLabels]:
    """Return what a table says about bodies by their files; warn if it does not name all.

    Its first line names the columns: ``file`` and any of person (or subject), sex, visit, date and
    stature.
    """
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


def _in_folder(folder: Path, unit: str | None, up: str | None) -> Subjects:
    """Return the bodies of a folder, also those that `register` did not trust."""
    if not (folder / RECORDS).is_dir():
        return Subjects(_in_files(find_meshes(folder), unit, up), [])
    records = sorted(read_records(folder), key=lambda record: natural_key(record.name))
    subjects = [SheetSubject.of_record(record) for record in records if record.arrays]
    failures = [(record.name, record.message) for record in records if not record.arrays]
    names = {record.name for record in records}
    try:
        unregistered = [file for file in find_meshes(folder) if file.stem not in names]
    except FileError:  # all of them are in its subfolders
        unregistered = []
    return Subjects(subjects + _in_files(unregistered, unit, up), failures)


def _in_files(files: Sequence[Path], unit: str | None, up: str | None) -> list[SheetSubject]:
    """Return the bodies of mesh files; those of registered scans with their records."""
    subjects = []
    records_of_folders: dict[Path, dict[str, ScanRecord]] = {}
    for file in files:
        record = record_beside(file, records_of_folders)
        if record is not None:
            subjects.append(SheetSubject.of_record(record))
            continue
        meshes = RegisteredMeshes([file], scale=None, unit=unit, up=up)
        trusted = load_trusted(file)
        subjects.append(
            SheetSubject(
                name=file.stem,
                points=meshes[0],
                faces=meshes.faces,
                file=file.name,
                trusted_vertices=trusted,
                is_trusted=trusted is None or bool(trusted.any()),
            )
        )
    return subjects
