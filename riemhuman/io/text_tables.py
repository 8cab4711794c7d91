"""Numbers, rows and cells of text files."""

from __future__ import annotations

import csv
import io
import unicodedata
from array import array
from pathlib import Path

from riemhuman.errors import FileFormatError
from riemhuman.io.files import read_bytes


def parse_float(word: bytes) -> float:
    """Return a word of a file as a real number.

    Parameters
    ----------
    word : bytes
        The word.

    Raises
    ------
    ValueError
        If it spells none.
    """
    if b"_" in word:
        raise ValueError
    return float(word)


def parse_int(word: bytes) -> int:
    """Return a word of a file as a whole number.

    Parameters
    ----------
    word : bytes
        The word.

    Raises
    ------
    ValueError
        If it spells none.
    """
    if b"_" in word:
        raise ValueError
    return int(word)


def read_text(file: Path) -> str:
    """Read a file of text in UTF-8, with or without a byte order mark.

    Parameters
    ----------
    file : Path
        The file.

    Raises
    ------
    FileError
        If it is missing, a folder, a device or a pipe, or cannot be read.
    FileFormatError
        If it is in another encoding.
    """
    try:
        return read_bytes(file).decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise FileFormatError(f"{file} is not text in UTF-8: {error}") from error


def read_named_rows(file: Path, title: str) -> dict[str, array[float]]:
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
    rows = csv.reader(io.StringIO(read_text(file), newline=""), strict=True)
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
        return parse_float(field.encode())
    except ValueError as error:
        raise FileFormatError(f"{where}: {field[:60]!r} is not a number") from error


_FORMULA = ("=", "+", "-", "@")


def csv_cell(text: str) -> str:
    """Return a text as a csv_cell of a table that is safe to open in a spreadsheet.

    Parameters
    ----------
    text : str
        Any text, such as a file name or a label from somebody else.

    Returns
    -------
    str
        The text with spaces for control characters and line ends, with backslash escapes for bytes
        that are not text, and with an apostrophe before it if a spreadsheet would compute it.
    """
    known = text.encode("utf-8", "backslashreplace").decode("utf-8")
    line = "".join(" " if unicodedata.category(c) in ("Cc", "Zl", "Zp") else c for c in known)
    return f"'{line}" if line.lstrip().startswith(_FORMULA) else line
