"""Tables of points as text: a point a line, with separators that cannot be taken for decimals."""

from __future__ import annotations

import re
import warnings
from codecs import BOM_UTF8

import numpy as np

from riemhuman.arrays import Array
from riemhuman.errors import FileFormatError

# What begins a comment, and what is a number in decimal notation with a point.
_COMMENT = re.compile(r"#|//")
_NUMBER = re.compile(
    r"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?|[+-]?(nan|inf|infinity)", re.IGNORECASE
)
_POSITION, _NORMAL = ("x", "y", "z"), ("nx", "ny", "nz")
_SHOWN = 60  # characters of a line in messages
_ADVICE = "write decimals with a point, and spaces, tabs or semicolons between numbers"


def read_points_text(content: bytes) -> Array:
    """Return positions, and what follows them in other columns, shape (N, C)."""
    text = content.removeprefix(BOM_UTF8).decode("latin-1")
    lines = [_COMMENT.split(line, maxsplit=1)[0].strip() for line in text.splitlines()]
    numbered = [(number, line) for number, line in enumerate(lines, start=1) if line]
    if not numbered:
        return np.zeros((0, 3))
    separator = _separator(numbered)
    columns = _named_columns(*numbered[0])
    if _is_count(numbered) and int(numbered[0][1]) != len(numbered) - 1:
        raise FileFormatError(
            f"its first line declares {numbered[0][1]} points, and {len(numbered) - 1} follow"
        )
    numbered = numbered[0 if columns is None and not _is_count(numbered) else 1 :]
    if separator == ";":
        numbered = [(number, row.removesuffix(";")) for number, row in numbered]
    if separator == ",":
        _refuse_decimal_commas([row for _, row in numbered])
    values = _numbers(numbered, separator)
    if columns is not None:
        return values[:, columns]
    n_rows, n_columns = values.shape
    is_counted = n_columns > 3 and n_rows > 2 and values[0, 0] in (0, 1)
    if is_counted and np.array_equal(values[:, 0], values[0, 0] + np.arange(n_rows)):
        raise FileFormatError(
            "the first column numbers the points; leave it out, or name the columns in a first "
            "line: id x y z"
        )
    return values


def _separator(numbered: list[tuple[int, str]]) -> str | None:
    """Return the separator of numbers, None for spaces and tabs."""
    if any(";" in line for _, line in numbered):
        return ";"
    return "," if any("," in line for _, line in numbered) else None


def _named_columns(number: int, line: str) -> list[int] | None:
    """Return the columns of positions and normals if the first line names them."""
    fields = [field.strip("\"'").lower() for field in re.split(r"[\s,;]+", line) if field]
    if any(map(_NUMBER.fullmatch, fields)):
        return None
    names = [*_POSITION, *(_NORMAL if set(_NORMAL) <= set(fields) else ())]
    if any(fields.count(name) != 1 for name in names):
        raise FileFormatError(
            f"line {number} is not valid: {line[:_SHOWN]!r}; it should hold numbers, "
            "or name the columns x, y and z"
        )
    return [fields.index(name) for name in names]


def _refuse_decimal_commas(rows: list[str]) -> None:
    """Raise an error where commas may stand for decimals, as in 0,5,0,1,0,2."""
    table = [row.split(",") for row in rows]
    for row in table:
        for field in row:
            if len(field.split()) > 1:
                raise FileFormatError(f"{','.join(row)[:_SHOWN]!r} is ambiguous: {_ADVICE}")
    n_columns = len(table[0]) if table else 0
    if n_columns <= 3:
        return

    def has_fractions(columns: tuple[int, ...]) -> bool:
        return any(
            re.search(r"[.eE]", row[column]) for row in table for column in columns[: len(row)]
        )

    alternate = (0, 2, 4) if n_columns > 4 else (0, 2)
    if any(len(row) != n_columns for row in table) or not has_fractions(alternate):
        raise FileFormatError(f"{rows[0][:_SHOWN]!r} is ambiguous: {_ADVICE}")


def _is_count(numbered: list[tuple[int, str]]) -> bool:
    """Return whether the first line says how many points follow."""
    return re.fullmatch(r"\d{1,18}", numbered[0][1]) is not None and len(numbered) > 1


def _numbers(numbered: list[tuple[int, str]], separator: str | None) -> Array:
    rows = [row for _, row in numbered]
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # of a file without points
            return np.loadtxt(rows, comments=None, delimiter=separator, ndmin=2)
    except ValueError as error:
        if any("," in row for row in rows):
            first = next(row for row in rows if "," in row)
            raise FileFormatError(f"{first[:_SHOWN]!r} is not valid: {_ADVICE}") from error
        n_columns = len(rows[0].split(separator))
        for number, row in numbered:
            fields = row.split(separator)
            where = f"line {number} is not valid: {row[:_SHOWN]!r}"
            if len(fields) != n_columns:
                raise FileFormatError(
                    f"{where}; it has {len(fields)} numbers, and line {numbered[0][0]} has "
                    f"{n_columns}"
                ) from error
            if not all(_NUMBER.fullmatch(field.strip()) for field in fields):
                raise FileFormatError(f"{where}; it should hold numbers") from error
        raise
