"""The pages of people's sheets: a page or PDF file for a person, and the index of a folder."""

from __future__ import annotations

import os
import secrets
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np
import PIL.Image

from riemhuman.errors import FileError
from riemhuman.io.files import file_path, write_text
from riemhuman.measurements import MeasurementSet, readable_gap
from riemhuman.measurements.populations import largest_body_mass_index
from riemhuman.plots.rendering import image_source
from riemhuman.plots.viewer import web_file
from riemhuman.report._page import library_version, template
from riemhuman.report._sheet_pictures import (
    LARGEST_CHANGE,
    Picture,
    body_pictures,
    change_picture,
    front_of,
    silhouette_picture,
)
from riemhuman.report._sheet_words import (
    WHOLE,
    Numbers,
    badge,
    changes_in_order,
    line_of,
    percentile_text,
    posture_texts,
    sentence,
    sentences_of,
)
from riemhuman.report.printing import print_page
from riemhuman.report.sheet_values import SheetSubject, SheetValues
from riemhuman.representation import join_names

_THUMBNAIL = 150  # pixels
_LOGO = (900, 300)  # pixels at most, three times what the page shows


@dataclass(frozen=True, eq=False)
class Content:
    """What a sheet shows: a person, what is known about the body, and pictures, drawn once."""

    subject: SheetSubject
    values: SheetValues
    units: str
    scan: Picture | None
    body: Picture
    silhouette: Picture | None
    moved: Picture | None  # where the surface moved since the earlier visit
    logo: str = ""  # its address

    @classmethod
    def of(
        cls,
        definitions: MeasurementSet,
        subject: SheetSubject,
        values: SheetValues,
        units: str,
        logo: str = "",
    ) -> Content:
        faces = definitions.faces
        scan, body = body_pictures(subject, faces, front_of(subject.points, definitions))
        silhouette = silhouette_picture(values, faces)
        moved = change_picture(values, faces)
        return cls(subject, values, units, scan, body, silhouette, moved, logo)

    @cached_property
    def badge(self) -> tuple[str, str]:
        """Its class and its words."""
        return badge(self.subject, self.values)

    @property
    def thumbnail(self) -> str:
        """The address of a small picture of the body from the front."""
        picture = PIL.Image.fromarray(self.body.first_view)
        picture.thumbnail((_THUMBNAIL, _THUMBNAIL))
        return image_source(np.asarray(picture))

    def html(self, *, printed: bool = False, index: str = "") -> str:
        """Return the page; for printing, with all its tables unfolded.

        `index` is the address of the page of all people, if there is one.
        """
        subject, values = self.subject, self.values
        return template("sheet.html").render(
            subject=subject,
            values=values,
            units=self.units,
            number=Numbers(self.units),
            badge=self.badge,
            scan=self.scan,
            body=self.body,
            silhouette=self.silhouette,
            moved=self.moved,
            logo=self.logo,
            said=sentences_of(subject.message),
            join_names=join_names,
            is_whole=bool(subject.known_vertices.mean() >= WHOLE),
            remarks=[sentence(remark) for remark in values.remarks],
            posture=posture_texts(values.posture),
            changes_in_order=changes_in_order(values),
            largest_change=LARGEST_CHANGE,
            largest_body_mass_index=largest_body_mass_index(subject.sex),
            gap=readable_gap,
            line_of=line_of,
            percentile=percentile_text,
            css=web_file("report", "sheet.css"),
            version=library_version(),
            printed=printed,
            index=index,
        )

    def save_pdf(self, file: Path, browser: str) -> None:
        """Write a two-page PDF by a browser."""
        # In the same folder, because a browser in a container may see no other.
        page = file.with_name(f"print-{secrets.token_hex(4)}.html")
        write_text(page, self.html(printed=True))
        try:
            print_page(browser, page, file)
        finally:
            page.unlink(missing_ok=True)


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


@dataclass(frozen=True, eq=False)
class Entry:
    """A person in the index, with the files of the sheet."""

    subject: SheetSubject
    values: SheetValues
    badge: tuple[str, str]
    thumbnail: str
    page: str
    pdf: str


def index_page(
    entries: Sequence[Entry],
    failures: Sequence[tuple[str, str]],
    tables: Sequence[str],
    units: str,
) -> str:
    """Return the page of all people, with scans that have no body and the reasons."""
    return template("sheets.html").render(
        entries=entries,
        failures=failures,
        tables=tables,
        number=Numbers(units),
        css=web_file("report", "sheet.css"),
        version=library_version(),
    )
