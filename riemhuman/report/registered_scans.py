"""The page of registered scans: each scan, its body and its distances, the worst first."""

from __future__ import annotations

import base64
import os
from collections.abc import Sequence
from html import escape
from pathlib import Path

import numpy as np
from numpy import ndarray
from scipy.spatial.transform import Rotation

from riemhuman.io.files import write_text
from riemhuman.plots._colors import VALUE_COLORS, value_colors
from riemhuman.plots.rendering import png_bytes
from riemhuman.registration.folders import ScanRecord, read_records
from riemhuman.report.page import Section, page, paragraph, web_file
from riemhuman.report.scan_pictures import body_picture, points_picture, shared_window

# Distance of the last colour, also used for larger distances.
LARGEST_METRES = 0.02
_HEIGHT = 300
_UNSEEN, _SEEN = (0.62, 0.68, 0.76), (0.83, 0.78, 0.73)


def scan_page(folder: str | os.PathLike[str]) -> Path:
    """Write a page that shows the registered scans of a folder.

    Parameters
    ----------
    folder : path_like
        The output of `riemhuman.registration.register_folder`.

    Returns
    -------
    Path
        The page, ``index.html`` in the folder, for any browser without a network connection.

    Raises
    ------
    FileError
        If the folder holds no registered scans, or the page cannot be written.
    FileFormatError
        If a record is damaged.

    Examples
    --------
    >>> import riemhuman as rh
    >>> page = rh.report.scan_page("bodies")  # doctest: +SKIP
    """
    records = read_records(folder)
    trusted = sum(record.trusted for record in records)
    text = page(
        "Registered scans",
        "Each scan and its registered body, the worst first.",
        [(str(len(records)), "scans"), (str(trusted), "trusted")],
        [scan_section(records)],
        "",
    )
    place = Path(folder) / "index.html"
    write_text(place, text)
    return place


def scan_section(records: Sequence[ScanRecord]) -> Section:
    """Return the section of a page that shows registered scans.

    Parameters
    ----------
    records : sequence of ScanRecord
        Records of the scans, in the order in which they are shown.

    Returns
    -------
    Section
    """
    doubtful = [record for record in records if not record.trusted]
    lead = (
        f"{len(records) - len(doubtful)} of {len(records)} scans are registered and trusted. "
        "From left to right: the scan, the body, and the scan coloured by its distance from the "
        "body. Parts of the body without a counterpart in the scan are blue-grey."
    )
    cards = "".join(_card(record) for record in records)
    return Section(
        "scans",
        "Scans and their bodies",
        "Scans",
        [
            f"<style>{web_file('scans.css')}</style>",
            paragraph(lead),
            _colour_scale(),
            f'<div class="scans">{cards}</div>',
        ],
    )


def _card(record: ScanRecord) -> str:
    mark = "" if record.trusted else ' <strong class="doubt">not trusted</strong>'
    facts = ""
    if record.arrays:
        facts = (
            f"<p>{1000 * record.median_distance:.1f} mm from the scan in the median, "
            f"{100 * record.matched_share:.0f} % of the vertices matched</p>"
        )
    reason = f"<p>{escape(_sentence(record.message))}</p>" if record.message else ""
    kind = "scan" if record.trusted else "scan doubtful"
    return (
        f'<figure class="{kind}"><figcaption><h3>{escape(record.name)}{mark}</h3>{facts}{reason}'
        f"</figcaption>{_pictures(record)}</figure>"
    )


def _sentence(message: str) -> str:
    """Return a message as a sentence; a name of a file at its beginning stays as it is."""
    if message.partition(" ")[0].isalpha():
        message = message[0].upper() + message[1:]
    return message if message.endswith(".") else f"{message}."


def _colour_scale() -> str:
    """Return the bar of the colours of distances, between its ends."""
    return (
        '<p class="colour-bar">Distance: 0 '
        f'<i style="background: linear-gradient(to right, {", ".join(VALUE_COLORS)})"></i> '
        f"{1000 * LARGEST_METRES:.0f} mm and more</p>"
    )


def _pictures(record: ScanRecord) -> str:
    if not record.arrays:
        return ""
    body, scan = (
        _facing(record, record.arrays[name].astype(float)) for name in ("points", "shown")
    )
    faces, distances = record.arrays["faces"], record.arrays["shown_distances"]
    window = shared_window(body, scan)
    seen = record.arrays["matched"][faces].any(axis=1)
    colors = np.where(seen[:, np.newaxis], _SEEN, _UNSEEN)
    errors = value_colors(distances, LARGEST_METRES)
    pictures = (
        (points_picture(scan, window, _HEIGHT), f"points of the scan {record.name}"),
        (
            body_picture(body, faces, window, _HEIGHT, colors),
            f"body registered to the scan {record.name}",
        ),
        (
            points_picture(scan, window, _HEIGHT, errors),
            f"distances of the scan {record.name} from its body",
        ),
    )
    return "".join(_image(picture, what) for picture, what in pictures)


def _image(picture: ndarray, what: str) -> str:
    data = base64.b64encode(png_bytes(picture)).decode("ascii")
    height, width = picture.shape[:2]
    return (
        f'<img alt="{escape(what, quote=True)}" src="data:image/png;base64,{data}" '
        f'width="{width}" height="{height}" loading="lazy" decoding="async">'
    )


def _facing(record: ScanRecord, points: ndarray) -> ndarray:
    """Return points with y up and, if the pose is known, with the body facing the viewer."""
    upright = _upright(points, record.arrays["up"])
    if "pose" not in record.arrays:
        return upright
    # The pelvis, which comes first; models face z.
    forward = Rotation.from_rotvec(record.arrays["pose"][0]).apply([0.0, 0.0, 1.0])
    x, _, z = _upright(forward, record.arrays["up"])
    return upright @ Rotation.from_rotvec([0.0, -np.arctan2(x, z), 0.0]).as_matrix().T


def _upright(points: ndarray, up: ndarray) -> ndarray:
    """Return points with y up."""
    axis = int(np.argmax(np.abs(up)))
    # Cyclic exchanges of axes are rotations; if the axis points down, half a turn follows.
    turned = np.roll(points, 1 - axis, axis=-1)
    return turned * [1.0, -1.0, -1.0] if up[axis] < 0 else turned
