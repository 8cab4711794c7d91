"""PDF files of pages, by a browser of the machine."""

from __future__ import annotations

import os
import secrets
import shutil
import subprocess
import tempfile
from pathlib import Path

from riemhuman.errors import FileError, MissingDependencyError
from riemhuman.io.files import write_text

__all__ = ["find_browser", "printing_browser", "save_pdf"]

_BROWSERS = (
    "chromium",
    "chromium-browser",
    "google-chrome",
    "google-chrome-stable",
    "chrome",
    "msedge",
    "microsoft-edge",
)
_MAC = (
    "/Applications/Google Chrome.app/Contents/MacOS/Google Chrome",
    "/Applications/Chromium.app/Contents/MacOS/Chromium",
    "/Applications/Microsoft Edge.app/Contents/MacOS/Microsoft Edge",
)
_WINDOWS = (
    r"C:\Program Files (x86)\Microsoft\Edge\Application\msedge.exe",
    r"C:\Program Files\Google\Chrome\Application\chrome.exe",
)
_OPTIONS = ("--headless", "--disable-gpu", "--no-first-run", "--no-pdf-header-footer")
_SECONDS = 90  # that printing may take; a page takes a few


def find_browser() -> str | None:
    """Return the program of Chromium or a browser of its family, or None."""
    for name in _BROWSERS:
        program = shutil.which(name)
        if program is not None:
            return program
    return next((program for program in (*_MAC, *_WINDOWS) if os.access(program, os.X_OK)), None)


def printing_browser() -> str:
    """Return the program of a browser that prints, or raise an error if there is none."""
    browser = find_browser()
    if browser is None:
        raise MissingDependencyError(
            "PDF files are printed by Chromium, Chrome or Edge, which were not found; write .html, "
            "which any browser prints on two pages"
        )
    return browser


def save_pdf(file: Path, html: str, browser: str) -> None:
    """Write a page as a PDF file by a browser."""
    # In the same folder, because a browser in a container may see no other.
    page = file.with_name(f"print-{secrets.token_hex(4)}.html")
    write_text(page, html)
    try:
        print_page(browser, page, file)
    finally:
        page.unlink(missing_ok=True)


def print_page(browser: str, page: Path, pdf: Path) -> None:
    """Print a page into a PDF file."""
    with tempfile.TemporaryDirectory(prefix="riemhuman-") as profile:
        # A profile of its own, since browsers that share one wait for each other.
        command = [browser, *_OPTIONS, f"--user-data-dir={profile}", f"--print-to-pdf={pdf}"]
        if hasattr(os, "geteuid") and os.geteuid() == 0:
            # Chromium refuses its sandbox to root, and the page is ours.
            command.append("--no-sandbox")
        command.append(page.resolve().as_uri())
        try:
            process = subprocess.run(
                command, capture_output=True, timeout=_SECONDS, stdin=subprocess.DEVNULL
            )
        except (OSError, subprocess.TimeoutExpired) as error:
            raise FileError(f"{pdf} was not printed by {browser}: {error}") from error
    if process.returncode != 0 or not pdf.is_file() or not pdf.stat().st_size:
        said = process.stderr.decode(errors="replace").strip().splitlines()[-1:]
        raise FileError(f"{pdf} was not printed by {browser}: {' '.join(said) or 'it is empty'}")
