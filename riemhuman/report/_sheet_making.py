"""What sheets of one person and of folders share: contents of a body, and the PDF file."""

from __future__ import annotations

import secrets
from functools import cache
from importlib import metadata
from pathlib import Path

import numpy as np

from riemhuman.datasets import load_open_model
from riemhuman.io.files import write_text
from riemhuman.measurements import Measurements
from riemhuman.report._sheet_content import Content, content_of
from riemhuman.report._sheet_page import sheet_page
from riemhuman.report.printing import print_page
from riemhuman.report.sheet_values import Average, SheetSubject, SheetValues

_LEFT_HIP = "left_trochanterion"
_RIGHT_HIP = "right_trochanterion"


@cache
def library_version() -> str:
    try:
        return metadata.version("riemhuman")
    except metadata.PackageNotFoundError:
        return "from its source folder"


def save_pdf(content: Content, file: Path, browser: str) -> None:
    """Write a two-page PDF by a browser."""
    # In the same folder, because a browser in a container may see no other.
    page = file.with_name(f"print-{secrets.token_hex(4)}.html")
    write_text(page, sheet_page(content, library_version(), printed=True))
    try:
        print_page(browser, page, file)
    finally:
        page.unlink(missing_ok=True)


def content_for(
    measurements: Measurements, subject: SheetSubject, values: SheetValues, units: str
) -> Content:
    definitions = measurements.definitions
    across = np.array([1.0, 0.0, 0.0])  # the body faces z
    landmarks = definitions.landmarks
    if _LEFT_HIP in landmarks and _RIGHT_HIP in landmarks:
        left_vertices, left_weights = landmarks[_LEFT_HIP]
        right_vertices, right_weights = landmarks[_RIGHT_HIP]
        left = left_weights @ subject.points[left_vertices]
        right = right_weights @ subject.points[right_vertices]
        across = left - right
    return content_of(subject, values, definitions.faces, across, units)


def average_for(measurements: Measurements) -> Average:
    n_vertices = measurements.definitions.n_vertices
    coarse = load_open_model("coarse")
    if n_vertices == coarse.n_vertices:
        return Average("coarse", coarse.faces)
    return Average("full", load_open_model("full").faces)
