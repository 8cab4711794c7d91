"""The pages of people's sheets: a page or PDF file for a person, and the index of a folder."""

from __future__ import annotations

import os
import secrets
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from urllib.parse import quote

import numpy as np
import PIL.Image

from riemhuman.errors import FileError
from riemhuman.io.files import file_path, write_text
from riemhuman.plots.rendering import image_source
from riemhuman.plots.viewer import web_file
from riemhuman.report._page import library_version, template
from riemhuman.report._sheet_content import NOTHING, Content, row_text
from riemhuman.report.printing import print_page
from riemhuman.report.sheet_values import SheetSubject, SheetValues

_THUMBNAIL = 150  # pixels
_LOGO = (900, 300)  # pixels at most, three times what the page shows


def save_pdf(content: Content, file: Path, browser: str) -> None:
    """Write a two-page PDF by a browser."""
    # In the same folder, because a browser in a container may see no other.
    page = file.with_name(f"print-{secrets.token_hex(4)}.html")
    write_text(page, sheet_page(content, printed=True))
    try:
        print_page(browser, page, file)
    finally:
        page.unlink(missing_ok=True)


def sheet_page(content: Content, *, printed: bool = False, index: str = "") -> str:
    """Return the page of a sheet; for printing, with all its tables unfolded.

    `index` is the address of the page of all people, if there is one.
    """
    return template("sheet.html").render(
        **vars(content),
        css=web_file("report", "sheet.css"),
        version=library_version(),
        printed=printed,
        index=index,
    )


def logo_source(path: str | os.PathLike[str] | None) -> str:
    """Return the address of a picture for the top of sheets; none without a path."""
    if path is None:
        return ""
    file = file_path(path, "logo")
    try:
        with PIL.Image.open(file) as opened:
            picture = opened.convert("RGBA")
    except FileNotFoundError:
        raise
    except (OSError, ValueError, SyntaxError, PIL.Image.DecompressionBombError) as error:
        raise FileError(f"{file} cannot be read as a picture, such as a PNG file") from error
    picture.thumbnail(_LOGO)
    return image_source(np.asarray(picture))


@dataclass(frozen=True)
class Entry:
    """A person in the index: pictures, links, words, and numbers in the order of the titles."""

    name: str
    person: str
    sex: str
    visit: str
    badge: tuple[str, str]
    page: str
    pdf: str
    thumbnail: str
    numbers: tuple[tuple[str, float | None], ...]  # as people read them, and to sort by
    changed: str

    @classmethod
    def of(
        cls, subject: SheetSubject, values: SheetValues, content: Content, page: str, pdf: str
    ) -> Entry:
        numbers: list[tuple[str, float | None]] = []
        for name in INDEX_NUMBERS:
            row = values.by_name.get(name)
            if row is None:
                numbers.append((NOTHING, None))
                continue
            text = row_text(row, content.units)
            value = row.value if np.isfinite(row.value) else None
            numbers.append((f"{text.value} {text.unit}".strip(), value))
        changes = values.changes
        return cls(
            name=subject.name,
            person=subject.person,
            sex=subject.sex if subject.sex != "adult" else "",
            visit=subject.visit,
            badge=content.badge,
            page=quote(page),
            pdf=quote(pdf),
            thumbnail=_thumbnail(content),
            numbers=tuple(numbers),
            changed="" if changes is None else f"{int(changes.is_significant.sum())}",
        )


INDEX_NUMBERS = {
    "stature": "Stature",
    "body mass": "Weight",
    "chest girth": "Chest",
    "waist girth": "Waist",
    "hip girth": "Hip",
    "inside leg height": "Inside leg",
}


def _thumbnail(content: Content) -> str:
    """Return the address of a small picture of the body from the front."""
    picture = PIL.Image.fromarray(content.pictures[-1].picture.first_view)
    picture.thumbnail((_THUMBNAIL, _THUMBNAIL))
    return image_source(np.asarray(picture))


def _counts(entries: Sequence[Entry]) -> list[str]:
    """Return how many bodies have each kind of badge, in words."""
    kinds = {
        "trusted": "trusted",
        "partial": "partly",
        "untrusted": "not trusted",
        "unknown": "without a scan",
    }
    counts = []
    for kind, words in kinds.items():
        count = sum(entry.badge[0] == kind for entry in entries)
        if count:
            counts.append(f"{count} {words}")
    return counts


def index_page(
    entries: Sequence[Entry],
    failures: Sequence[tuple[str, str]],
    tables: Sequence[str],
) -> str:
    """Return the page of all people, with scans that have no body and the reasons."""
    return template("sheets.html").render(
        entries=entries,
        failures=failures,
        tables=tables,
        titles=list(INDEX_NUMBERS.values()),
        css=web_file("report", "sheet.css"),
        version=library_version(),
        has_sex=any(entry.sex for entry in entries),
        has_visits=any(entry.visit for entry in entries),
        has_changes=any(entry.changed for entry in entries),
        counts=_counts(entries),
    )
