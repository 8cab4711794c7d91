"""Tables of all people with sheets: a CSV file, and a workbook with openpyxl."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from types import ModuleType
from typing import TYPE_CHECKING

import numpy as np

from riemhuman.io.files import atomic_file
from riemhuman.io.text_tables import csv_cell, csv_text
from riemhuman.optional import import_optional
from riemhuman.report._sheet_words import badge
from riemhuman.report.sheet_values import SheetRow, SheetSubject, SheetValues

if TYPE_CHECKING:
    from openpyxl import Workbook

Cell = str | float | None
Rows = list[list[Cell]]
Sheets = Sequence[tuple[SheetSubject, SheetValues]]

# Widths of columns, characters.
_WIDEST = 40
_NARROWEST = 9


def table_text(sheets: Sheets) -> str:
    """Return a row per body as comma-separated text: SI units, which the header names."""
    rows = _people(sheets)
    for numbers in (_VALUES, _PERCENTILES, _UNCERTAINTIES):
        rows = _beside(rows, _rows_of(sheets, numbers))
    return csv_text(_beside(rows, _posture(sheets)))


def save_workbook(sheets: Sheets, file: Path) -> None:
    """Write the same as a workbook with a page for each kind of number, and one of changes."""
    openpyxl = import_optional("openpyxl", "sheet")
    book = openpyxl.Workbook()
    book.remove(book.active)
    people = _people(sheets)
    pages = {
        "Measurements": _rows_of(sheets, _VALUES),
        "Percentiles": _rows_of(sheets, _PERCENTILES),
        "Uncertainty": _rows_of(sheets, _UNCERTAINTIES),
        "Posture": _posture(sheets),
    }
    for title, rows in pages.items():
        _add_page(openpyxl, book, title, _beside(people, rows))
    changes = _changes(sheets)
    if len(changes) > 1:
        _add_page(openpyxl, book, "Changes", changes)
    with atomic_file(file) as temporary:
        book.save(temporary)


def _beside(left: Rows, right: Rows) -> Rows:
    return [first + second for first, second in zip(left, right, strict=True)]


def _people(sheets: Sheets) -> Rows:
    rows: Rows = [
        [
            "name",
            "person",
            "sex",
            "visit",
            "file",
            "trust",
            "message",
            "distance from the scan (m)",
            "matched share",
        ]
    ]
    for subject, values in sheets:
        _, trust = badge(subject, values)
        withheld = [f"{group.name} withheld: {group.reason}" for group in values.withheld]
        rows.append(
            [
                subject.name,
                subject.person,
                subject.sex,
                subject.visit,
                "; ".join(scan.file for scan in subject.scans),
                trust,
                "; ".join(filter(None, [subject.message, *withheld])),
                _number(subject.median_distance),
                _number(subject.matched_share),
            ]
        )
    return rows


@dataclass(frozen=True)
class _Numbers:
    """One number of each measurement, and the title of its column."""

    title: str
    of: Callable[[SheetRow], float]


_VALUES = _Numbers("{name} ({unit})", lambda row: row.value)
_PERCENTILES = _Numbers("{name}, percentile", lambda row: row.percentile)
_UNCERTAINTIES = _Numbers("{name}, ± ({unit})", lambda row: row.uncertainty)


def _rows_of(sheets: Sheets, numbers: _Numbers) -> Rows:
    names: dict[str, str] = {}
    for _, values in sheets:
        names |= {row.name: row.unit for row in values.rows}
    title = numbers.title
    header: list[Cell] = [title.format(name=name, unit=unit) for name, unit in names.items()]
    rows = [header]
    for _, values in sheets:
        cells: list[Cell] = []
        for name in names:
            row = values.by_name.get(name)
            cells.append(None if row is None else _number(numbers.of(row)))
        rows.append(cells)
    return rows


def _posture(sheets: Sheets) -> Rows:
    names = list(dict.fromkeys(name for _, values in sheets for name in values.posture))
    rows: Rows = [[f"{name} (°)" for name in names]]
    for _, values in sheets:
        rows.append([_number(values.posture.get(name, float("nan"))) for name in names])
    return rows


def _changes(sheets: Sheets) -> Rows:
    header = ["name", "person", "visit", "since", "measurement", "unit"]
    header += ["before", "after", "change", "noise, ±", "changed"]
    rows: Rows = [[*header]]
    for subject, values in sheets:
        result = values.changes
        if result is None:
            continue
        for k, name in enumerate(result.names):
            rows.append(
                [
                    subject.name,
                    subject.person,
                    subject.visit,
                    values.since,
                    name,
                    result.units[k],
                    _number(result.before[k]),
                    _number(result.after[k]),
                    _number(result.changes[k]),
                    _number(result.thresholds[k]),
                    "yes" if result.is_significant[k] else "no",
                ]
            )
    return rows


def _number(value: float) -> float | None:
    return float(value) if np.isfinite(value) else None


def _add_page(openpyxl: ModuleType, book: Workbook, title: str, rows: Rows) -> None:
    page = book.create_sheet(title)
    for row in rows:
        page.append([csv_cell(cell) if isinstance(cell, str) else cell for cell in row])
    bold = openpyxl.styles.Font(bold=True)
    for cell in page[1]:
        cell.font = bold
    for column in range(len(rows[0])):
        longest = max(len(str(row[column])) for row in rows if row[column] is not None)
        letter = openpyxl.utils.get_column_letter(column + 1)
        page.column_dimensions[letter].width = min(max(longest + 1, _NARROWEST), _WIDEST)
    page.freeze_panes = "B2"
    page.auto_filter.ref = page.dimensions
