"""The page of a report: sections from templates, figures and tables in one self-contained file."""

from __future__ import annotations

import base64
import io
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache
from importlib import metadata
from pathlib import Path
from typing import TypeAlias
from urllib.parse import quote

import jinja2
import numpy as np
import PIL.features
import PIL.Image

from riemhuman.arrays import JSONValue
from riemhuman.errors import FileFormatError
from riemhuman.io.files import write_bytes, write_text
from riemhuman.io.text_tables import csv_text
from riemhuman.plots.figures import figure_files, new_figure
from riemhuman.plots.viewer import Viewer, page_scripts, page_styles, web_file, web_templates
from riemhuman.readable_units import gap_unit
from riemhuman.report._storage import Progress

_UNSAFE = re.compile(r"[^\w/+=:;, ().-]+", re.ASCII)  # in the address of an image
# The width and the height in the view box of an SVG file, behind its corner.
_SIZE = re.compile(r'viewBox="[\d.-]+ [\d.-]+ (?P<width>[\d.]+) (?P<height>[\d.]+)"')
# Size of images within a figure; smaller ones are colour scales, which are kept.
_PICTURE = re.compile(r"data:image/png;base64,([\w+/=\s]{4000,})")
_QUALITY = 88  # per cent, of WebP
_quoted = cache(quote)  # the same characters come thousands of times


@cache
def library_version() -> str:
    try:
        return metadata.version("riemhuman")
    except metadata.PackageNotFoundError:
        return "from its source folder"


def template(name: str) -> jinja2.Template:
    environment = web_templates("report")
    environment.filters |= {"written": written, "missing": is_missing, "shown": _shown}
    return environment.get_template(name)


def fill(macro: str, **values: object) -> str:
    """Return HTML from a macro of ``sections.html``."""
    return str(getattr(template("sections.html").module, macro)(**values))


# Functions that draw into axes, or return a figure, from any arguments.
Drawing: TypeAlias = Callable[..., object]  # type: ignore[explicit-any]


@dataclass(frozen=True)
class Section:
    """A section of the page: its anchor, its heading there and in the contents, and its HTML."""

    identifier: str
    title: str
    short: str
    html: str


def page(
    title: str, lead: str, facts: Sequence[tuple[str, str]], sections: Sequence[Section], end: str
) -> str:
    """Return the page; `lead` is HTML, `facts` are the sizes of the data with their names."""
    return template("page.html").render(
        title=title,
        lead=lead,
        facts=facts,
        sections=sections,
        end=end,
        css=web_file("report", "page.css"),
        viewer_styles=page_styles(),
        scripts=page_scripts(),
    )


@dataclass(frozen=True)
class Image:
    """An image within the page, with its size, so that nothing moves when it is loaded."""

    source: str
    width: int
    height: int
    name: str = ""


@dataclass(frozen=True)
class Table:
    """The rows of a table on the page and in a CSV file; NaN and None are missing values.

    Values are in SI units, which the CSV file names; the page shows some in those of people.
    """

    name: str
    rows: Sequence[Mapping[str, JSONValue]]
    units: Mapping[str, str] = field(default_factory=dict)

    def heading(self, key: str) -> str:
        """Return the heading of a column in the CSV file."""
        return f"{key} ({self.units[key]})" if key in self.units else key

    def csv(self) -> str:
        """Return the CSV file: a line of headings, and a line per row, numbers with all digits."""
        keys = list(self.rows[0])
        rows = ([written(row[key]) for key in keys] for row in self.rows)
        return csv_text([[self.heading(key) for key in keys], *rows])

    def values(self, key: str) -> list[JSONValue]:
        """Return the values of a column that are not missing."""
        return [row[key] for row in self.rows if not is_missing(row.get(key))]

    def having_values(
        self, columns: Sequence[tuple[str | float, ...]]
    ) -> list[tuple[str | float, ...]]:
        """Return the columns that have a value: key, title, format, which is best, and scale."""
        defaults = ("", "", "", "", 1.0)
        with_defaults = []
        for column in columns:
            if self.values(str(column[0])):
                with_defaults.append((*column, *defaults[len(column) :]))
        return with_defaults

    def is_best(self, row: int, key: str, best: str) -> bool:
        """Return whether a row has the highest or the lowest of several values."""
        values = self.values(key)
        limit = max(values) if best == "highest" else min(values)
        return len(values) > 1 and bool(self.rows[row][key] == limit)


def _shown(value: JSONValue, form: str, scale: float = 1.0) -> str:
    if is_missing(value):
        return "–"
    if scale != 1.0:
        value = scale * value
    return format(value, form).replace("-", "−") if form else str(value)


def written(value: object) -> object:
    """Return a value whose text has all digits; None if it is missing."""
    if is_missing(value):
        return None
    if isinstance(value, (bool, np.bool_)):
        return "yes" if value else "no"
    return value.item() if isinstance(value, np.generic) else value


def gap_format(units: str) -> dict[str, str | float]:
    """Return the name, the format and the scale of gaps between surfaces, for templates."""
    unit = gap_unit(units)
    return {"name": unit.name, "form": f".{unit.digits}f", "scale": unit.scale}


def is_missing(value: object) -> bool:
    return value is None or (isinstance(value, (float, np.floating)) and bool(np.isnan(value)))


def _smaller(svg: str) -> str:
    """Return a figure whose pictures of bodies are WebP, for browsers; others want PNG."""
    if not PIL.features.check("webp"):
        return svg

    def webp(png: re.Match[str]) -> str:
        content = io.BytesIO()
        with PIL.Image.open(io.BytesIO(base64.b64decode(png[1]))) as picture:
            picture.save(content, format="WEBP", quality=_QUALITY)
        return f"data:image/webp;base64,{base64.b64encode(content.getvalue()).decode('ascii')}"

    return _PICTURE.sub(webp, svg)


@dataclass(frozen=True)
class Output:
    """Writes the figures, views and tables of a report when its sections request them."""

    folder: Path
    dots_an_inch: int
    progress: Progress

    def figure(
        self,
        name: str,
        draw: Drawing,
        *arguments: object,
        size: tuple[float, float] | None = None,
        **settings: object,
    ) -> Image:
        """Return a figure: with a size in inches, `draw` fills the axes `ax`."""
        with self.progress(f"Figure {name}"):
            if size is None:
                figure = draw(*arguments, **settings)
            else:
                figure = new_figure(*size)
                draw(*arguments, **settings, ax=figure.subplots())
            svg, png = figure_files(figure, self.dots_an_inch)
        write_text(self.folder / "figures" / f"{name}.svg", svg)
        write_bytes(self.folder / "figures" / f"{name}.png", png)
        shown = _smaller(svg)
        size_of_svg = _SIZE.search(shown)
        if size_of_svg is None:
            raise FileFormatError(f"the figure {name} is an SVG file without a view box")
        # Pictures of bodies within the SVG are base64 already; twice would add a third.
        quoted = _UNSAFE.sub(lambda characters: _quoted(characters[0]), shown)
        width = round(float(size_of_svg["width"]))
        height = round(float(size_of_svg["height"]))
        return Image(f"data:image/svg+xml,{quoted}", width, height, name)

    def view(self, name: str, viewer: Viewer) -> str:
        """Return the address of a page of bodies, which is written."""
        with self.progress(f"Page {name}"):
            viewer.save(self.folder / "views" / f"{name}.html")
        return f"views/{name}.html"

    def table(
        self,
        name: str,
        rows: Sequence[Mapping[str, JSONValue]],
        units: Mapping[str, str] | None = None,
    ) -> Table:
        """Return a table, which is also written to its file; units are those of columns."""
        table = Table(name, rows, units or {})
        write_text(self.folder / "tables" / f"{name}.csv", table.csv())
        return table
