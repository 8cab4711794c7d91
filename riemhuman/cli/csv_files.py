"""Tables that verbs write as comma-separated text."""

from __future__ import annotations

import csv
import io
from collections.abc import Iterable, Sequence
from pathlib import Path

from riemhuman.io.text_tables import csv_cell


def csv_text(rows: Iterable[Sequence[object]]) -> str:
    """Return rows as comma-separated text, numbers with all their digits.

    Parameters
    ----------
    rows : iterable of sequence
        Cells of each row. Spreadsheets must not run text as a formula, see
        `riemhuman.io.text_tables.cell`.

    Returns
    -------
    str
    """
    stream = io.StringIO()
    writer = csv.writer(stream, lineterminator="\n")
    writer.writerows([csv_cell(x) if isinstance(x, str) else x for x in row] for row in rows)
    return stream.getvalue()


def write_csv(path: Path, rows: Iterable[Sequence[object]]) -> None:
    """Write a table to a CSV file, whole or not at all.

    Parameters
    ----------
    path : Path
        The file.
    rows : iterable of sequence
        Cells of each row.
    """
    from riemhuman.io.files import write_text

    write_text(path, csv_text(rows))
