"""Tables as comma-separated text: rows of numbers with names, and cells safe for spreadsheets."""

from __future__ import annotations

import csv
import io
import unicodedata
from collections.abc import Iterable, Sequence
from pathlib import Path

import numpy as np

from riemhuman.errors import FileFormatError
from riemhuman.io.files import read_text

_FORMULA = ("=", "+", "-", "@")


def read_named_rows(file: Path, title: str) -> dict[str, np.ndarray]:
    """Return the rows of a .csv file with a name and equally many numbers in each line."""
    table: dict[str, np.ndarray] = {}
    length = 0
    rows = csv.reader(io.StringIO(read_text(file), newline=""), strict=True)
    try:
        for row in rows:
            name, *fields = [field.strip() for field in row] or [""]
            where = f"{file}, line {rows.line_num}"
            if not any([name, *fields]) or (not table and name.lower() == title):
                continue
            if not name:
                raise FileFormatError(f"{where}: the {title} is missing")
            if name in table:
                raise FileFormatError(f"{where}: the {title} {name[:60]!r} is repeated")
            if not fields or (table and len(fields) != length):
                expected = f"{length} expected" if table else "at least one expected"
                raise FileFormatError(f"{where}: {len(fields)} numbers found, {expected}")
            length = len(fields)
            table[name] = np.array([_number(field, where) for field in fields])
    except csv.Error as error:
        raise FileFormatError(f"{file}, line {rows.line_num}: {error}") from error
    if not table:
        raise FileFormatError(f"{file} holds no rows of a name and numbers")
    return table


def _number(field: str, where: str) -> float:
    try:
        # Of ASCII alone, since Python also reads 1_0 and the digits of every script.
        return float(field.replace("_", "x").encode("ascii"))
    except ValueError as error:
        raise FileFormatError(f"{where}: {field[:60]!r} is not a number") from error


def csv_text(rows: Iterable[Sequence[object]]) -> str:
    """Return rows as comma-separated text: numbers with all digits, nothing for None."""
    stream = io.StringIO()
    writer = csv.writer(stream, lineterminator="\n")
    writer.writerows([csv_cell(x) if isinstance(x, str) else x for x in row] for row in rows)
    return stream.getvalue()


def csv_cell(text: str) -> str:
    """Return a text as one line that no spreadsheet runs as a formula."""
    known = text.encode("utf-8", "backslashreplace").decode("utf-8")
    line = "".join(" " if unicodedata.category(c) in ("Cc", "Zl", "Zp") else c for c in known)
    return f"'{line}" if line.lstrip().startswith(_FORMULA) else line
