"""The page of a report: sections, figures and tables in one self-contained HTML file."""

from __future__ import annotations

import csv
import io
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from html import escape
from importlib.resources import files
from pathlib import Path
from typing import Any
from urllib.parse import quote

import jinja2
import numpy as np

from riemhuman.io.files import write_bytes, write_text
from riemhuman.io.text_tables import csv_cell
from riemhuman.plots.figures import figure_files, new_figure
from riemhuman.plots.viewer import page_scripts, page_styles
from riemhuman.report._storage import Computed, ResultStore


@cache
def web_file(name: str) -> str:
    """Return a text file of the folder ``web``."""
    return (files("riemhuman.report") / "web" / name).read_text(encoding="utf-8")


@cache
def _environment() -> jinja2.Environment:
    loader = jinja2.FunctionLoader(web_file)
    found = jinja2.Environment(loader=loader, autoescape=True, undefined=jinja2.StrictUndefined)
    found.filters |= {"written": written, "missing": is_missing}
    return found


def fill(macro: str, *arguments: Any) -> str:
    """Return HTML from a macro of ``parts.html``."""
    return str(getattr(_environment().get_template("parts.html").module, macro)(*arguments))


@dataclass(frozen=True)
class Section:
    """A section of the page: its anchor, its heading there and in the contents, HTML parts."""

    identifier: str
    title: str
    short: str
    parts: Sequence[str]


def page(
    title: str, lead: str, facts: Sequence[tuple[str, str]], sections: Sequence[Section], end: str
) -> str:
    """Return the page; `lead` is HTML, `facts` are the sizes of the data with their names."""
    return (
        _environment()
        .get_template("page.html")
        .render(
            title=title,
            lead=lead,
            facts=facts,
            sections=sections,
            end=end,
            css=web_file("page.css"),
            viewer_styles=page_styles(),
            scripts=page_scripts(),
        )
    )


def paragraph(html: str) -> str:
    return f"<p>{html}</p>"


def heading(text: str) -> str:
    return f"<h3>{escape(text)}</h3>"


def viewer_figure(fragment: str, caption: str) -> str:
    """Return a viewer with its caption; both are HTML."""
    return f'<figure class="live">{fragment}<figcaption>{caption}</figcaption></figure>'


def side_by_side(*parts: str) -> str:
    """Return parts that stand beside each other if the window is wide enough."""
    return f'<div class="pair">{"".join(f"<div>{part}</div>" for part in parts)}</div>'


@dataclass(frozen=True)
class Image:
    """An image within the page, with its size, so that nothing moves when it is loaded."""

    alt: str
    source: str
    width: int
    height: int
    name: str = ""


@dataclass(frozen=True)
class Column:
    """A column of a table: its key in the file, its title on the page, a format of its numbers.

    `best` marks the "highest" or "lowest" value; columns that are not shown are in the file only.
    """

    key: str
    title: str
    form: str = ""
    best: str = ""
    is_shown: bool = True
    style: str = ""

    def text(self, value: Any) -> str:
        if is_missing(value):
            return "–"
        return format(value, self.form).replace("-", "−") if self.form else str(value)


@dataclass(frozen=True)
class Table:
    """A table on the page and in a CSV file; NaN and None are missing values."""

    name: str
    caption: str
    columns: Sequence[Column]
    rows: Sequence[Mapping[str, Any]]

    def csv(self) -> str:
        """Return the CSV file: a line of keys, and a line per row, numbers with all digits."""
        stream = io.StringIO()
        writer = csv.writer(stream, lineterminator="\n")
        writer.writerow(column.key for column in self.columns)
        for row in self.rows:
            values = [row[column.key] for column in self.columns]
            writer.writerow(csv_cell(v) if isinstance(v, str) else written(v) for v in values)
        return stream.getvalue()

    def html(self) -> str:
        """Return the table as part of a page; each number carries all its digits as data."""
        return fill("table", self)

    def number(self, row: int, key: str) -> str:
        """Return a number of the table for running text, with a reference to its cell."""
        return fill("number", self, row, next(c for c in self.columns if c.key == key))

    def shown_columns(self) -> list[Column]:
        """Return the columns on the page: those that have a value."""
        return [c for c in self.columns if c.is_shown and self.values(c)]

    def values(self, column: Column) -> list[Any]:
        return [row[column.key] for row in self.rows if not is_missing(row[column.key])]

    def is_best(self, row: int, column: Column) -> bool:
        values = self.values(column)
        if not column.best or len(values) < 2:
            return False
        best = max(values) if column.best == "highest" else min(values)
        return bool(self.rows[row][column.key] == best)


def written(value: Any) -> str:
    """Return a value as written in files: numbers with all their digits, nothing if missing."""
    if is_missing(value):
        return ""
    if isinstance(value, (bool, np.bool_)):
        return "yes" if value else "no"
    return repr(float(value)) if isinstance(value, (float, np.floating)) else str(value)


def is_missing(value: Any) -> bool:
    return value is None or (isinstance(value, (float, np.floating)) and bool(np.isnan(value)))


@dataclass(frozen=True)
class Output:
    """Writes the figures and tables of a report when its sections request them."""

    folder: Path
    figures: ResultStore
    digest: str

    def figure(
        self,
        name: str,
        alt: str,
        caption: str,
        draw: Callable[..., Any],
        *arguments: Any,
        size: tuple[float, float] | None = None,
        wide: bool = False,
        **settings: Any,
    ) -> str:
        """Return a figure, which is drawn unless the store has one of the same arguments.

        With a size in inches, `draw` fills the axes `ax`; else it returns a figure. Arguments are
        what JSON and fingerprints can describe, and the bodies of the report. A narrow window
        scrolls a wide figure instead of shrinking it.
        """

        def compute() -> Computed:
            if size is None:
                figure = draw(*arguments, **settings)
            else:
                figure = new_figure(*size)
                draw(*arguments, **settings, ax=figure.subplots())
            svg, png = figure_files(figure)
            return {"png": np.frombuffer(png, dtype=np.uint8)}, {"svg": svg}

        given = [None if hasattr(argument, "points") else argument for argument in arguments]
        inputs = {"draw": draw.__name__, "bodies": self.digest, "arguments": given, "size": size}
        step = self.figures.step(name, inputs | settings, compute, f"Figure {name}")
        svg = step.record["svg"]
        write_text(self.folder / "figures" / f"{name}.svg", svg)
        write_bytes(self.folder / "figures" / f"{name}.png", step.arrays["png"].tobytes())
        *_, width, height = re.findall(r"[\d.]+", svg.split('viewBox="')[1].split('"')[0])
        # Pictures of bodies within the SVG are base64 already; twice would add a third.
        source = f"data:image/svg+xml,{quote(svg, safe='/+=:;, ()')}"
        image = Image(alt, source, round(float(width)), round(float(height)), name)
        return fill("figure", image, caption, wide)

    def table(self, table: Table) -> str:
        """Write a table to its file and return its HTML."""
        write_text(self.folder / "tables" / f"{table.name}.csv", table.csv())
        return table.html()
