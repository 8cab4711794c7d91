"""Tables of labels: who and what is in which file.

A table is text separated by commas, semicolons or tabs; its first line names the columns.
"""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from riemhuman.checks.labels import is_missing_label, plain_text
from riemhuman.errors import FileError, FileFormatError
from riemhuman.io.text_tables import read_rows
from riemhuman.representation import join_names

LABELS = "labels.csv"
"""The table that is read if none is named."""

# The columns that are read, and what they may be called; the first that a table has counts.
_COLUMNS = {
    "file": ("file",),
    "subject": ("subject", "person", "name"),
    "pose": ("pose",),
    "sex": ("sex", "gender"),
    "visit": ("visit",),
    "date": ("date",),
    "stature": ("stature", "height"),
}
# Endings of bodies, scans and arrays; anything else after a dot belongs to the name, as in anna.v2.
_ENDINGS = (".ply", ".obj", ".off", ".stl", ".glb", ".xyz", ".npy", ".npz")
_SHOWN = 60  # characters of a name or a line in messages


@dataclass(frozen=True)
class LabelRow:
    """What a table says about one file; `texts` are empty where a label is missing, such as NA."""

    file: str
    line: int
    texts: Mapping[str, str]


def read_label_rows(
    table: Path, required: Sequence[str], optional: Sequence[str] = ()
) -> list[LabelRow]:
    """Return the rows of a table with the columns ``file``, the required and the optional ones."""
    if not table.exists():
        raise FileError(
            f"there is no table of labels {table}; write one with the columns "
            f"{', '.join(('file', *required))}, or give its path"
        )
    _, rows = read_rows(table)
    columns = _checked_columns(table, rows[0][1] if rows else [], required)
    names = (*required, *optional)
    labels: dict[str, LabelRow] = {}
    for line, cells in rows[1:]:
        if len(cells) != len(rows[0][1]):
            advice = (
                "names that contain the separator need quotes"
                if len(cells) > len(rows[0][1])
                else "empty cells need their separators, too"
            )
            raise FileFormatError(
                f"{table}, line {line}: {len(cells)} fields found, {len(rows[0][1])} expected, as "
                f"in the first line; {advice}"
            )
        texts = {name: cells[number] for name, number in columns.items()}
        texts = {name: "" if is_missing_label(text) else text for name, text in texts.items()}
        file = cells[columns["file"]]  # which may be called NA
        if not file:
            raise FileFormatError(f"{table}, line {line}: no file given")
        if file in labels:
            raise FileFormatError(
                f"{table}, line {line}: {file[:_SHOWN]} already has a label, on line "
                f"{labels[file].line}"
            )
        labels[file] = LabelRow(file, line, {name: texts.get(name, "") for name in names})
    return list(labels.values())


def label_columns(header: Sequence[str]) -> dict[str, int]:
    """Return the numbers of the columns that are read, by what they are called here."""
    names = [name.casefold() for name in header]
    columns = {}
    for column, spellings in _COLUMNS.items():
        spelling = next((spelling for spelling in spellings if spelling in names), None)
        if spelling is not None:
            columns[column] = names.index(spelling)
    return columns


def _checked_columns(table: Path, header: Sequence[str], required: Sequence[str]) -> dict[str, int]:
    counts = Counter(name.casefold() for name in header if name)
    repeated = [name for name, count in counts.items() if count > 1]
    if repeated:
        raise FileFormatError(f"{table} has the column {repeated[0][:_SHOWN]} more than once")
    columns = label_columns(header)
    missing = [column for column in ("file", *required) if column not in columns]
    if missing:
        raise FileFormatError(
            f"{table} lacks the columns {', '.join(missing)}; its first line must name "
            f"{', '.join(('file', *required))}; found {','.join(header)[:_SHOWN]!r}"
        )
    return columns


def rows_of_files(
    table: Path, rows: Sequence[LabelRow], files: Sequence[str]
) -> tuple[dict[int, LabelRow], list[LabelRow]]:
    """Return the rows of files by their numbers, and the rows of no file.

    A row names a file in full, or without the ending of a mesh, or with the ending that its scan
    had. Names are compared as whole texts, in one Unicode form.
    """
    row_of_file: dict[int, LabelRow] = {}
    left = list(rows)
    for spelling in (plain_text, without_ending):
        numbers = defaultdict(list)
        for number, file in enumerate(files):
            numbers[spelling(file)].append(number)
        # A row with another ending is of no file that has a row of its own.
        named = set(row_of_file)
        waiting, left = left, []
        for row in waiting:
            candidates = numbers[spelling(row.file)]
            has_ending = without_ending(row.file) != plain_text(row.file)
            if not candidates or (candidates[0] in named and has_ending):
                left.append(row)
                continue
            where = f"{table}, line {row.line}: {row.file[:_SHOWN]}"
            if len(candidates) > 1:
                several = join_names([files[number] for number in candidates], 5)
                raise FileFormatError(f"{where} may refer to {several}; name one")
            if candidates[0] in row_of_file:
                line = row_of_file[candidates[0]].line
                raise FileFormatError(f"{where} already has a label, on line {line}")
            row_of_file[candidates[0]] = row
    return row_of_file, left


def without_ending(name: str) -> str:
    """Return the name of a file without the ending of a mesh, in one Unicode form."""
    name = plain_text(name)
    ending = Path(name).suffix
    return name.removesuffix(ending) if ending.lower() in _ENDINGS else name
