"""Tables, written from the same numbers on the page and in CSV files."""

from __future__ import annotations

import csv
import io
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from html import escape
from typing import Any

import numpy as np

from riemhuman.io.text_tables import csv_cell


@dataclass(frozen=True)
class Column:
    """A column of a table.

    Parameters
    ----------
    key : str
        Name in the file.
    title : str
        Heading on the page.
    form : str
        Format of numbers on the page, as for `format`; empty for text.
    best : {"", "highest", "lowest"}
        Value of the column that is marked.
    shown : bool
        Whether the column is also on the page, or only in the file.
    whole : bool
        Whether to keep its text on one line.
    """

    key: str
    title: str
    form: str = ""
    best: str = ""
    shown: bool = True
    whole: bool = False


@dataclass(frozen=True)
class Table:
    """A table on the page and in a CSV file.

    Parameters
    ----------
    name : str
        Name of the file, without its ending.
    caption : str
        Caption of the table.
    columns : sequence of Column
        Columns; the first contains the names of the rows.
    rows : sequence of mapping
        Values by the keys of columns; NaN and None are missing values.
    """

    name: str
    caption: str
    columns: Sequence[Column]
    rows: Sequence[Mapping[str, Any]]

    def csv(self) -> str:
        """Return the CSV file: a line of keys, and a line per row, numbers with all their digits.

        Returns
        -------
        str
        """
        stream = io.StringIO()
        writer = csv.writer(stream, lineterminator="\n")
        writer.writerow(column.key for column in self.columns)
        for row in self.rows:
            writer.writerow(_in_file(row[column.key]) for column in self.columns)
        return stream.getvalue()

    def html(self) -> str:
        """Return the table as part of a page; each number carries all its digits as data.

        Columns without values are left out.

        Returns
        -------
        str
        """
        columns = [column for column in self.columns if column.shown and self._holds(column)]
        heads = "".join(
            f'<th scope="col"{_kind(column)}>{escape(column.title)}</th>' for column in columns
        )
        best = {column.key: self._best(column) for column in columns}
        body = []
        for index, row in enumerate(self.rows):
            cells = [self._cell(index, column, row[column.key], best) for column in columns]
            body.append(f"<tr>{''.join(cells)}</tr>")
        return (
            f'<div class="table" role="region" tabindex="0" '
            f'aria-label="{escape(self.caption, quote=True)}">'
            f"<table><caption>{escape(self.caption)} {self.link()}</caption>"
            f"<thead><tr>{heads}</tr></thead><tbody>{''.join(body)}</tbody></table></div>"
        )

    def link(self, text: str = "CSV") -> str:
        """Return a link to the file.

        Parameters
        ----------
        text : str
            Text of the link.

        Returns
        -------
        str
        """
        named = f"{text} of the table {self.name}"
        return (
            f'<a href="tables/{self.name}.csv" download aria-label="{escape(named)}">'
            f"{escape(text)}</a>"
        )

    def number(self, row: int, key: str) -> str:
        """Return a number of the table for running text, with a reference to its csv_cell.

        Parameters
        ----------
        row : int
            Number of the row.
        key : str
            Key of the column.

        Returns
        -------
        str
        """
        column = next(column for column in self.columns if column.key == key)
        return self._data(row, column, self.rows[row][key])

    def _cell(self, index: int, column: Column, value: Any, best: Mapping[str, Any]) -> str:
        text = self._data(index, column, value)
        if column is self.columns[0]:
            return f'<th scope="row">{text}</th>'
        if best[column.key] is not None and value == best[column.key]:
            return f'<td{_kind(column)}><strong title="best of the column">{text}</strong></td>'
        return f"<td{_kind(column)}>{text}</td>"

    def _data(self, index: int, column: Column, value: Any) -> str:
        if not column.form:
            return escape(_nothing(value) or str(value))
        if _nothing(value):
            return "–"
        shown = escape(format(value, column.form).replace("-", "−"))
        return (
            f'<data value="{written(value)}" data-table="{self.name}" data-row="{index}" '
            f'data-column="{column.key}">{shown}</data>'
        )

    def _holds(self, column: Column) -> bool:
        """Return whether any row has a value in a column."""
        return not all(_nothing(row[column.key]) for row in self.rows)

    def _best(self, column: Column) -> Any:
        values = [row[column.key] for row in self.rows if not _nothing(row[column.key])]
        if not column.best or len(values) < 2:
            return None
        return max(values) if column.best == "highest" else min(values)


def written(value: Any) -> str:
    """Return a value as written in files: numbers with all their digits.

    Parameters
    ----------
    value : object
        A number or text; None or NaN if missing.

    Returns
    -------
    str
    """
    if _nothing(value):
        return ""
    if isinstance(value, (bool, np.bool_)):
        return "yes" if value else "no"
    if isinstance(value, (int, np.integer)):
        return str(int(value))
    if isinstance(value, (float, np.floating)):
        return repr(float(value))
    return str(value)


def _in_file(value: Any) -> str:
    return csv_cell(value) if isinstance(value, str) else written(value)


def _nothing(value: Any) -> str:
    """Return the sign for a missing value, or nothing if there is a value."""
    missing = value is None or (isinstance(value, (float, np.floating)) and np.isnan(value))
    return "–" if missing else ""


def _kind(column: Column) -> str:
    if column.form:
        return ' class="number"'
    return ' class="whole"' if column.whole else ""
