"""Tables of named rows of numbers, as comma-separated text."""

from __future__ import annotations

import csv
import io
from array import array
from pathlib import Path

from riemhuman.errors import FileFormatError
from riemhuman.storage.number_text import real_field, text_content


def named_rows(file: Path, title: str) -> dict[str, array[float]]:
    """Return the rows of a .csv file with one name a line, and equally many numbers behind it.

    Parameters
    ----------
    file : Path
        The file.
    title : str
        Title of the names, for messages; a first line that begins with it is a header.

    Returns
    -------
    dict of str to array

    Raises
    ------
    FileError
        If the file is missing or cannot be read.
    FileFormatError
        If it holds no row, a name is missing or repeated, a row has another length than the first,
        or an entry is not a number; with the line.
    """
    found: dict[str, array[float]] = {}
    length = 0
    rows = csv.reader(io.StringIO(text_content(file), newline=""), strict=True)
    try:
        for row in rows:
            name, *fields = [field.strip() for field in row] or [""]
            where = f"{file}, line {rows.line_num}"
            if not any([name, *fields]) or (not found and name.lower() == title):
                continue
            if not name:
                raise FileFormatError(f"{where}: the {title} is missing")
            if name in found:
                raise FileFormatError(f"{where}: the {title} {name[:60]!r} is repeated")
            if not fields or (found and len(fields) != length):
                expected = f"{length} expected" if found else "at least one expected"
                raise FileFormatError(f"{where}: {len(fields)} numbers found, {expected}")
            length = len(fields)
            found[name] = array("d", [_number(field, where) for field in fields])
    except csv.Error as error:
        raise FileFormatError(f"{file}, line {rows.line_num}: {error}") from error
    if not found:
        raise FileFormatError(f"{file} holds no rows of a name and numbers")
    return found


def _number(field: str, where: str) -> float:
    try:
        return real_field(field.encode())
    except ValueError as error:
        raise FileFormatError(f"{where}: {field[:60]!r} is not a number") from error
