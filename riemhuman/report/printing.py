"""PDF files of pages, by a browser of the machine where there is one."""

from __future__ import annotations

import os
import shutil
import subprocess
import tempfile
from pathlib import Path

from riemhuman.optional import import_matplotlib

__all__ = ["check_printing", "find_browser", "print_page"]

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
_OPTIONS = ("--headless", "--disable-gpu", "--no-first-run", "--no-pdf-header-footer")
_SECONDS = 90  # that printing may take; a page takes a few


def find_browser() -> str | None:
    """Return the program of Chromium or a browser of its family, or None."""
    for name in _BROWSERS:
        program = shutil.which(name)
        if program is not None:
            return program
    return next((program for program in _MAC if os.access(program, os.X_OK)), None)


def check_printing() -> None:
    """Raise an error unless PDF files can be written: by a browser, or by matplotlib."""
    if find_browser() is None:
        import_matplotlib()


def print_page(browser: str, page: Path, pdf: Path) -> bool:
    """Print a page into a PDF file; return whether the browser did so."""
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
        except (OSError, subprocess.TimeoutExpired):
            return False
    is_written = pdf.is_file() and pdf.stat().st_size > 0
    return process.returncode == 0 and is_written
