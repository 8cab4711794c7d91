"""A person's sheet drawn by matplotlib, for machines without a browser that prints."""

from __future__ import annotations

import math
import textwrap
from collections.abc import Sequence
from pathlib import Path
from types import ModuleType

from riemhuman.io.files import atomic_file
from riemhuman.optional import import_matplotlib
from riemhuman.report._sheet_content import ChangesText, Content, Drawing, PostureText, RowText

# A4, millimetres.
_WIDTH = 210.0
_HEIGHT = 297.0
# The edges of what is written and drawn, from the upper left corner.
_LEFT = 13.0
_RIGHT = 197.0
_TOP = 12.0
_BOTTOM = 285.0
_GUTTER = 8.0  # between two columns
_COLUMN = (_RIGHT - _LEFT - _GUTTER) / 2
_POINTS = 72.0 / 25.4  # in a millimetre
_INK = "#16191d"
_QUIET = "#565d66"
_LINE = "#d5d9de"
_ACCENT = "#23608f"
_BAND = "#cfd9e2"  # the middle half of the people
_TRACK = "#e9edf0"
_LARGER = "#c4622d"
_SMALLER = "#3f7fbf"
_BADGES = {"trusted": "#2b6e46", "partial": "#8a5a00", "untrusted": "#b3362a", "unknown": _QUIET}
# Heights of rows, millimetres.
_ROW = 5.3
_TIGHT_ROW = 4.3
_SMALL_ROW = 3.55
_LETTER = 0.188  # mean width of a letter, millimetres over its size in points
_PAGE_NUMBER = 45.0  # of the line below a page, for the version and the number of the page


def save_figure_pdf(content: Content, version: str, file: Path) -> None:
    """Write both sides of a sheet into a PDF file."""
    import_matplotlib()
    backend: ModuleType = import_matplotlib("backends.backend_pdf")
    pages = [_first_side(content), _second_side(content)]
    with (
        atomic_file(file) as temporary,
        backend.PdfPages(temporary, metadata={"Title": content.title, "Creator": None}) as pdf,
    ):
        for number, side in enumerate(pages, start=1):
            side.rule(_BOTTOM - 2.0)
            name = f"{content.title} · {content.when}" if content.when else content.title
            size = _fitting_size(name, 7.0, _RIGHT - _LEFT - _PAGE_NUMBER)
            side.text(_LEFT, _BOTTOM + 1.5, name, size=size)
            side.text(
                _RIGHT, _BOTTOM + 1.5, f"riemhuman {version} · page {number} of 2", align="right"
            )
            pdf.savefig(side.figure)


class _Side:
    """A page with items placed in millimetres from its upper left corner."""

    def __init__(self) -> None:
        module = import_matplotlib("figure")
        self.figure = module.Figure(figsize=(_WIDTH / 25.4, _HEIGHT / 25.4))
        self.axes = self.figure.add_axes((0, 0, 1, 1))
        self.axes.set(xlim=(0, _WIDTH), ylim=(_HEIGHT, 0))
        self.axes.axis("off")

    def text(
        self,
        x: float,
        y: float,
        words: str,
        *,
        size: float = 7.0,
        color: str = _QUIET,
        weight: str = "normal",
        align: str = "left",
    ) -> None:
        self.axes.text(
            x,
            y,
            _escaped(words),
            fontsize=size,
            color=color,
            weight=weight,
            ha=align,
            va="baseline",
        )

    def paragraph(
        self, x: float, y: float, words: str, width: float, *, size: float, color: str = _QUIET
    ) -> float:
        """Write lines of text; return where the next line would be."""
        step = 1.32 * size / _POINTS
        for line in textwrap.wrap(words, max(10, int(width / (_LETTER * size)))):
            self.text(x, y, line, size=size, color=color)
            y += step
        return y

    def rule(
        self, y: float, first: float = _LEFT, last: float = _RIGHT, *, color: str = _LINE
    ) -> None:
        self.axes.plot([first, last], [y, y], color=color, linewidth=0.5, solid_capstyle="butt")

    def drawing(self, drawing: Drawing, x: float, y: float, width: float, height: float) -> float:
        """Place a picture with its ruler in a box; return the height that it fills."""
        scale = min(width / drawing.width, height / drawing.height)
        left = x + drawing.ruler * scale
        right = x + drawing.width * scale
        bottom = y + drawing.picture_height * scale
        for mark in drawing.marks:
            self.rule(y + mark.y * scale, left, right)
            self.text(left - 1.0, y + mark.y * scale + 0.7, mark.text, size=5.5, align="right")
        for view in drawing.views:
            self.text(x + view.x * scale, bottom + 2.6, view.text, size=6.0, align="center")
        self.axes.imshow(
            drawing.picture.pixels, extent=(left, right, bottom, y), aspect="auto", zorder=2
        )
        self.axes.set(xlim=(0, _WIDTH), ylim=(_HEIGHT, 0))
        return drawing.height * scale


def _escaped(words: str) -> str:
    """Return words of which matplotlib takes none for a formula."""
    return words.replace("$", r"\$")


def _text_width(words: str, size: float, weight: str = "normal") -> float:
    """Return the width of a line of text, millimetres."""
    if not words.strip():
        return 0.0
    font = import_matplotlib("font_manager").FontProperties(weight=weight)
    path = import_matplotlib("textpath").TextPath((0, 0), _escaped(words), size=size, prop=font)
    return float(path.get_extents().x1) / _POINTS


def _fitting_size(words: str, largest: float, widest: float, weight: str = "normal") -> float:
    """Return the size at which a line is no wider than it may be, at most the largest."""
    return largest * widest / max(_text_width(words, largest, weight), widest)


def _first_side(content: Content) -> _Side:
    side = _Side()
    kind, words = content.badge
    beside = _text_width(words, 9.5, "bold") + 2 * 3.0
    size = _fitting_size(content.title, 20.0, _RIGHT - _LEFT - beside, "bold")
    side.text(_LEFT, _TOP + 7.0, content.title, size=size, color=_INK, weight="bold")
    size = _fitting_size(content.about, 9.0, _RIGHT - _LEFT)
    side.text(_LEFT, _TOP + 12.5, content.about, size=size)
    side.axes.text(
        _RIGHT - 3.0,
        _TOP + 5.5,
        words,
        fontsize=9.5,
        weight="bold",
        color=_BADGES[kind],
        ha="right",
        bbox={
            "boxstyle": "round,pad=0.35,rounding_size=0.8",
            "facecolor": "none",
            "edgecolor": _BADGES[kind],
        },
    )
    side.rule(_TOP + 15.5, color=_INK)
    y = side.paragraph(_LEFT, _TOP + 20.5, content.trust, _RIGHT - _LEFT, size=8.6, color=_INK)
    y = _headline(side, content.headline, y + 2.0) + 3.0
    if len(content.pictures) > 1:
        width = _COLUMN
        x = _LEFT
    else:
        width = 110.0
        x = (_WIDTH - width) / 2
    tallest = 0.0
    for number, drawing in enumerate(content.pictures):
        left = x + number * (_COLUMN + _GUTTER)
        height = side.drawing(drawing, left, y, width, 85.0)
        side.text(left, y + height + 3.0, drawing.caption)
        tallest = max(tallest, height)
    y += tallest + 9.0
    lowest = y
    for number, groups in enumerate((content.groups[:2], content.groups[2:])):
        below = y
        for name, rows in groups:
            below = _group(side, _LEFT + number * (_COLUMN + _GUTTER), below, name, rows, content)
        lowest = max(lowest, below)
    side.paragraph(_LEFT, lowest + 1.0, content.population, _RIGHT - _LEFT, size=7.2)
    return side


def _headline(side: _Side, rows: Sequence[RowText], y: float) -> float:
    step = (_RIGHT - _LEFT) / max(len(rows), 1)
    for number, row in enumerate(rows):
        x = _LEFT + number * step
        side.text(x, y, row.title, size=7.4)
        side.text(x, y + 6.2, row.value, size=14.0, color=_INK, weight="bold")
        uncertainty = f" ± {row.uncertainty}" if row.uncertainty and row.unit else ""
        side.text(x, y + 9.8, f"{row.unit}{uncertainty}", size=7.0)
    return y + 11.0


def _group(
    side: _Side, x: float, y: float, name: str, rows: Sequence[RowText], content: Content
) -> float:
    """Draw a table of measurements; return where it ends."""
    ends = {"value": x + 44.0, "uncertainty": x + 51.5, "percentile": x + _COLUMN}
    side.text(x, y, name, size=8.8, color=_INK, weight="bold")
    side.text(ends["value"], y, content.length_unit, align="right")
    side.text(ends["uncertainty"], y, "±", align="right")
    if content.has_percentiles:
        side.text(ends["percentile"], y, "pctl.", align="right")
    side.rule(y + 1.3, x, x + _COLUMN, color=_QUIET)
    for row in rows:
        y += _ROW
        side.text(x, y, row.title, size=8.6, color=_INK)
        side.rule(y + 1.5, x, x + _COLUMN)
        if row.why:
            side.text(ends["percentile"], y, "not measured", size=8.0, align="right")
            continue
        unit = "" if row.unit == content.length_unit else f" {row.unit}"
        side.text(ends["value"], y, row.value + unit, size=8.6, color=_INK, weight="bold",
                  align="right")  # fmt: skip
        side.text(ends["uncertainty"], y, row.uncertainty, align="right")
        if content.has_percentiles:
            side.text(ends["percentile"], y, row.percentile, size=8.6, color=_INK, align="right")
        if row.place is not None:
            _bar(side, x + 53.5, y - 1.0, 25.0, row.place)
    return y + 9.0


def _bar(side: _Side, x: float, y: float, width: float, place: float) -> None:
    for first, last, color in ((0.0, 1.0, _TRACK), (0.25, 0.75, _BAND)):
        side.axes.plot(
            [x + first * width, x + last * width], [y, y], color=color, linewidth=3.6,
            solid_capstyle="butt",
        )  # fmt: skip
    side.axes.plot(
        [x + place / 100 * width], [y], "o", color=_ACCENT, markersize=5.0, markeredgecolor="white",
        markeredgewidth=0.5,
    )  # fmt: skip


def _second_side(content: Content) -> _Side:
    side = _Side()
    y = _TOP + 5.0
    right = _LEFT + _COLUMN + _GUTTER
    size = 62.0 if content.changes else 92.0
    lowest = y
    if content.silhouette is not None:
        _heading(side, _LEFT, y, "Compared with the average")
        height = side.drawing(content.silhouette, _LEFT, y + 3.0, _COLUMN, size)
        below = y + height + 7.0
        x = _LEFT
        for words, color in (("outside the average", _LARGER), ("inside it", _SMALLER)):
            side.axes.plot([x + 1.0], [below - 0.8], "s", color=color, markersize=5)
            side.text(x + 3.0, below, words)
            x += 34.0
        below = side.paragraph(_LEFT, below + 3.6, content.silhouette.caption, _COLUMN, size=7.0)
        lowest = max(lowest, below)
    if content.posture:
        lowest = max(lowest, _posture(side, right, y, content.posture))
    y = lowest + 5.0 if lowest > y else y
    if content.changes is not None:
        if content.changes.warning:
            color = _BADGES["untrusted"]
            warning = content.changes.warning
            y = side.paragraph(_LEFT, y, warning, _RIGHT - _LEFT, size=8.0, color=color) + 2.0
        y = _changes(side, y, right, content.changes) + 3.0
    for remark in content.remarks:
        y = side.paragraph(_LEFT, y, remark, _RIGHT - _LEFT, size=7.2) + 1.0
    y = _all_rows(side, y, content.all_rows, has_percentiles=content.has_percentiles)
    side.paragraph(_LEFT, y + 3.0, content.uncertainty, _RIGHT - _LEFT, size=7.0)
    return side


def _heading(side: _Side, x: float, y: float, words: str) -> None:
    side.text(x, y, words.upper(), size=7.6, weight="bold")


def _posture(side: _Side, x: float, y: float, rows: Sequence[PostureText]) -> float:
    _heading(side, x, y, "Posture, as the person stood")
    y += 1.5
    for row in rows:
        y += _ROW
        side.text(x, y, row.title, size=8.4, color=_INK)
        side.text(x + 54.0, y, row.value, size=8.4, color=_INK, weight="bold", align="right")
        side.text(x + 57.0, y, row.what, size=8.0)
        side.rule(y + 1.5, x, x + _COLUMN)
    note = "Angles between landmarks, at one moment. They are not a diagnosis."
    return side.paragraph(x, y + 5.0, note, _COLUMN, size=7.0)


def _changes(side: _Side, y: float, right: float, changes: ChangesText) -> float:
    _heading(side, _LEFT, y, f"Changes since {changes.since}")
    _heading(side, right, y, "Where the surface moved")
    ends = (47.0, 57.0, 74.0, 88.0)
    line = y + 4.0
    for title, end in zip(("before", "now", "change", "noise"), ends, strict=True):
        side.text(_LEFT + end, line, title, size=6.5, align="right")
    for row in changes.rows:
        line += _TIGHT_ROW
        weight = "bold" if row.is_significant else "normal"
        side.text(_LEFT, line, row.title, size=7.6, color=_INK, weight=weight)
        texts = (row.before, row.after, f"{row.change} {row.unit}", f"± {row.threshold}")
        for text, end in zip(texts, ends, strict=True):
            side.text(_LEFT + end, line, text, size=7.4, color=_INK, weight=weight, align="right")
        side.rule(line + 1.2, _LEFT, _LEFT + _COLUMN)
    height = side.drawing(changes.figure, right, y + 3.0, _COLUMN, 58.0)
    below = side.paragraph(right, y + height + 6.5, changes.figure.caption, _COLUMN, size=7.0)
    below = side.paragraph(right, below, changes.note, _COLUMN, size=7.0)
    return max(line, below) + 3.0


def _all_rows(side: _Side, y: float, rows: Sequence[RowText], *, has_percentiles: bool) -> float:
    columns = "value, ±, percentile" if has_percentiles else "value, ±"
    _heading(side, _LEFT, y, f"All {len(rows)} measurements: {columns}")
    n_lines = math.ceil(len(rows) / 3)
    width = (_RIGHT - _LEFT - 10.0) / 3
    # They share the rest of the page.
    step = min(_SMALL_ROW, (_BOTTOM - 14.0 - y) / (n_lines + 1))
    size = min(6.6, 6.6 * step / 3.2)
    for number, row in enumerate(rows):
        x = _LEFT + (number // n_lines) * (width + 5.0)
        line = y + (number % n_lines + 1) * step + 1.0
        value = "not measured" if row.why else f"{row.value} {row.unit}"
        texts = [(value, width - 13.0)]
        if not row.why:
            texts.append((row.uncertainty, width - 6.0))
            if has_percentiles:
                texts.append((row.percentile, width))
        for text, end in texts:
            side.text(x + end, line, text, size=size, color=_INK, align="right")
        before_value = width - 13.0 - _text_width(value, size) - 1.0
        title_size = _fitting_size(row.title, size, before_value)
        side.text(x, line, row.title, size=title_size, color=_INK)
        side.rule(line + 0.3 * step, x, x + width)
    return y + (n_lines + 1) * step
