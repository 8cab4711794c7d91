"""The page of registered scans: each scan, its body and its distances, the worst first."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from urllib.parse import quote

import numpy as np

from riemhuman.checks import checked, choice
from riemhuman.io.files import convert_errors, write_text
from riemhuman.measurements import readable_gap
from riemhuman.plots.figures import SIGNED_COLORS
from riemhuman.plots.rendering import image_source
from riemhuman.plots.scan_views import colour_end, scan_pictures, view_scan
from riemhuman.plots.viewer import web_file
from riemhuman.readable_units import READABLE_UNITS, ReadableUnit, gap_unit
from riemhuman.registration import ScanRecord, lay_over_body, read_records
from riemhuman.report._page import Image, Section, fill, page

_HEIGHT = 300  # pixels
_VIEWS = "views"  # folder of the pages of scans over their bodies


@checked(units=choice(*READABLE_UNITS))
def scan_page(folder: str | os.PathLike[str], *, units: str = "cm") -> Path:
    """Write a page, ``index.html``, that shows the registered scans of a folder.

    Each scan also has a page on which it can be turned and cut over its body, in the folder
    ``views``.

    Parameters
    ----------
    folder : path_like
        The output of `riemhuman.registration.register_folder`.
    units : {"cm", "in"}
        Millimetres or inches for distances.

    Examples
    --------
    >>> page = rh.report.scan_page("bodies")  # doctest: +SKIP
    """
    records = read_records(folder)
    views = _write_views(Path(folder), records, units)
    trusted = sum(record.trusted for record in records)
    text = page(
        "Registered scans",
        "Each scan and its registered body, the worst first.",
        [(str(len(records)), "scans"), (str(trusted), "trusted")],
        [scan_section(records, views, units)],
        "",
    )
    place = Path(folder) / "index.html"
    write_text(place, text)
    return place


def _write_views(folder: Path, records: Sequence[ScanRecord], units: str) -> dict[str, str]:
    """Write the pages of scans over their bodies, and return their addresses by names of scans."""
    views = {}
    for record in records:
        if not record.arrays:
            continue
        with convert_errors(folder / _VIEWS, "cannot be made"):
            (folder / _VIEWS).mkdir(exist_ok=True)
        viewer = view_scan(record, system=units)
        title = f"{record.name}: {viewer.title[0].lower()}{viewer.title[1:]}"
        replace(viewer, title=title).save(folder / _VIEWS / f"{record.name}.html")
        views[record.name] = f"{_VIEWS}/{quote(record.name)}.html"
    return views


def scan_section(
    records: Sequence[ScanRecord], views: Mapping[str, str] | None = None, units: str = "cm"
) -> Section:
    """Return the section of a page that shows registered scans in the order of their records.

    `views` are the addresses of the pages of scans over their bodies, by names of scans.
    """
    unit = gap_unit(units)
    gaps = [np.abs(record.arrays["shown_distances"]) for record in records if record.arrays]
    limit = colour_end(gaps, unit)
    html = fill(
        "scans",
        css=web_file("report", "scans.css"),
        records=[(record, _pictures(record, limit, unit)) for record in records],
        views=views or {},
        badge=_badge,
        n_partial=sum(_badge(record)[0] == "partial" for record in records),
        n_trusted=sum(record.trusted for record in records),
        colors=SIGNED_COLORS,
        gap=partial(readable_gap, system=units),
        limit=f"{limit:g} {unit.name}",
    )
    return Section("scans", "Scans and their bodies", "Scans", html)


def badge_of(trusted: bool, limited: bool) -> tuple[str, str]:
    """Return the class and the words of a badge; some parts of a limited body are in doubt."""
    if not trusted:
        return "untrusted", "not trusted"
    if limited:
        return "partial", "partly trusted"
    return "trusted", "trusted"


def _badge(record: ScanRecord) -> tuple[str, str]:
    return badge_of(record.trusted, bool(record.message))


def _pictures(record: ScanRecord, limit: float, gap: ReadableUnit) -> list[tuple[Image, str]]:
    """Return pictures of the scan, the body and the distances, at one scale and in one light."""
    if not record.arrays:
        return []
    pictures, _ = scan_pictures(lay_over_body(record), limit, gap, _HEIGHT)
    titles = {
        "scan": f"points of the scan {record.name}",
        "body": f"body registered to the scan {record.name}",
        "distances": f"mean distances of the scan {record.name} from its body",
    }
    images = []
    for name, picture in pictures.items():
        height, width = picture.shape[:2]
        images.append((Image(image_source(picture), width, height), titles[name]))
    return images
