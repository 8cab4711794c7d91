"""Tables as comma-separated text: rows of numbers with names, and cells safe for spreadsheets."""

from __future__ import annotations

import csv
import io
import re
import unicodedata
from collections.abc import Iterable, Sequence
from pathlib import Path

import numpy as np

from riemhuman.arrays import Values
from riemhuman.checks.labels import plain_text
from riemhuman.errors import FileFormatError
from riemhuman.io.files import read_text

SEPARATORS = (";", "\t", ",")
"""What may separate the cells of a table; of equally many, the first, as in 0,62;1,31."""

TABLE_ENDINGS = (".csv", ".tsv", ".txt")
"""Endings of files that are read as tables."""

_FORMULA = ("=", "+", "-", "@")
_ADVICE = (
    "write decimals with a point, and separate numbers by semicolons or tabs to be unambiguous"
)


def read_named_rows(file: Path, title: str, columns: Sequence[str] = ()) -> dict[str, Values]:
    """Return the rows of a text table with a name and equally many numbers in each line.

    Commas, semicolons or tabs separate them. A first line without numbers is a header; if it names
    all the columns, these are returned in their order.
    """
    table: dict[str, Values] = {}
    length = 0
    has_fractions = False
    named_columns: list[int] | None = None
    separator, rows = read_rows(file)
    for number, (line, (name, *fields)) in enumerate(rows):
        where = f"{file}, line {line}"
        is_header = name.lower() == title or (fields and not any(map(_is_number, fields)))
        if number == 0 and is_header:
            named_columns = _columns_by_name(fields, columns)
            continue
        if not name:
            raise FileFormatError(f"{where}: the {title} is missing")
        if name in table:
            raise FileFormatError(f"{where}: the {title} {name[:60]!r} is repeated")
        if not fields or (table and len(fields) != length):
            expected = f"{length} expected" if table else "at least one expected"
            raise FileFormatError(f"{where}: {len(fields)} numbers found, {expected}")
        length = len(fields)
        has_fractions |= any(c in field for field in fields for c in ".eE")
        table[name] = np.array([_number(field, where) for field in fields])
    if not table:
        raise FileFormatError(f"{file} holds no rows of a name and numbers")
    if separator == "," and length > 3 and not has_fractions:
        raise FileFormatError(
            f"{file}: commas may be decimals or separate {length} whole numbers; {_ADVICE}"
        )
    if named_columns is not None and max(named_columns) < length:
        return {name: numbers[named_columns] for name, numbers in table.items()}
    return table


def read_matrix(file: Path) -> tuple[list[str], Values]:
    """Return the names and the numbers of a square table with names in its first line and column.

    Columns may be in another order than rows.
    """
    _, rows = read_rows(file)
    if len(rows) < 2:
        raise FileFormatError(f"{file} holds no matrix: names in the first line, then rows")
    header = rows[0][1][1:]
    names = [cells[0] for _, cells in rows[1:]]
    if sorted(header) != sorted(names) or len(set(names)) < len(names) or not all(names):
        raise FileFormatError(
            f"{file}: the rows and the columns of a matrix must have the same names, each once; "
            f"found {len(set(names))} different names in {len(names)} rows, and "
            f"{len(set(header))} in {len(header)} columns"
        )
    numbers = []
    for line, (_, *fields) in rows[1:]:
        where = f"{file}, line {line}"
        if len(fields) != len(header):
            raise FileFormatError(f"{where}: {len(fields)} numbers found, {len(header)} expected")
        numbers.append([_number(field, where) for field in fields])
    return names, np.array(numbers)[:, [header.index(name) for name in names]]


def read_rows(file: Path) -> tuple[str, list[tuple[int, list[str]]]]:
    """Return the separator of a table, and the cells of rows that are not blank, by line.

    Cells are in one Unicode form, see `plain_text`.
    """
    text = read_text(file)
    hint = re.match(r"sep=([;\t,])\r?\n", text)  # which Excel writes and hides
    separator = hint[1] if hint else separator_of(text)
    reader = csv.reader(
        io.StringIO(text, newline=""), delimiter=separator, skipinitialspace=True, strict=True
    )
    rows = []
    try:
        for row in reader:
            cells = [plain_text(cell) for cell in row]
            if any(cells) and not (hint and reader.line_num == 1):
                rows.append((reader.line_num, cells))
    except csv.Error as error:
        raise FileFormatError(f"{file}, line {reader.line_num}: {error}") from error
    return separator, rows


def separator_of(text: str) -> str:
    """Return the separator of a table, the most frequent one in its first line with any."""
    for line in text.splitlines():
        if any(separator in line for separator in SEPARATORS):
            return max(SEPARATORS, key=line.count)
    return ","


def _columns_by_name(fields: Sequence[str], columns: Sequence[str]) -> list[int] | None:
    names = [field.lower() for field in fields]
    if not columns or any(names.count(column) != 1 for column in columns):
        return None
    return [names.index(column) for column in columns]


def _is_number(field: str) -> bool:
    return bool(re.match(r"[+-]?[.,]?\d", field)) or field.lower() in ("nan", "inf", "-inf", "")


def _number(field: str, where: str) -> float:
    try:
        # ASCII only, and no underscores: Python also reads 1_0 and the digits of every script.
        return float(field.replace("_", "x").encode("ascii"))
    except ValueError as error:
        advice = f"; {_ADVICE}" if "," in field else ""
        raise FileFormatError(f"{where}: {field[:60]!r} is not a number{advice}") from error


def csv_text(rows: Iterable[Sequence[object]]) -> str:
    """Return rows as comma-separated text: numbers with all digits, nothing for None."""
    stream = io.StringIO()
    writer = csv.writer(stream, lineterminator="\n")
    writer.writerows([csv_cell(x) if isinstance(x, str) else x for x in row] for row in rows)
    return stream.getvalue()


def csv_cell(text: str) -> str:
    """Return a text as one line that no spreadsheet runs as a formula."""
    # Surrogates cannot be written; control characters and separators of lines become spaces.
    encodable = text.encode("utf-8", "backslashreplace").decode("utf-8")
    line = "".join(" " if unicodedata.category(c) in ("Cc", "Zl", "Zp") else c for c in encodable)
    return f"'{line}" if line.lstrip().startswith(_FORMULA) else line
