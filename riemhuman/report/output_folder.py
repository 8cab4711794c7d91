"""The folder of a report: taken only if it is empty or holds a report already."""

from __future__ import annotations

import json
import os
from pathlib import Path
from typing import Any

from riemhuman.errors import ArgumentTypeError, FileError
from riemhuman.report.text_files import write_text

MARKER = "provenance.json"
_MADE_BY = "riemhuman report"
SUBFOLDERS = ("figures", "tables", "results", "results/figures")


def check_folder(path: str | os.PathLike[str]) -> Path:
    """Refuse a folder that holds something else than a report; nothing is written.

    Parameters
    ----------
    path : path_like
        The folder.

    Returns
    -------
    Path
        The folder, which may not be there yet.

    Raises
    ------
    ArgumentTypeError
        If it is not a path.
    FileError
        If it is a file or holds something else than a report.
    """
    try:
        folder = Path(path).expanduser()
    except TypeError as error:
        raise ArgumentTypeError(f"output must be the path of a folder; found {path!r}") from error
    if folder.exists() and not folder.is_dir():
        raise FileError(f"{folder} is a file; the report needs a folder of its own")
    if folder.is_dir() and any(folder.iterdir()) and not _is_report(folder):
        raise FileError(
            f"{folder} holds something else; the report needs a new or empty folder, or one with "
            "an earlier report"
        )
    return folder


def open_folder(path: str | os.PathLike[str]) -> Path:
    """Make the folder of a report, or take the one that is there.

    Parameters
    ----------
    path : path_like
        The folder.

    Returns
    -------
    Path
        The folder, with its subfolders and its marker.

    Raises
    ------
    ArgumentTypeError
        If it is not a path.
    FileError
        If it is a file, holds something else than a report, or cannot be written.
    """
    folder = check_folder(path)
    try:
        for name in SUBFOLDERS:
            (folder / name).mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise FileError(f"{folder} cannot be written: {error.strerror}") from error
    if not _is_report(folder):
        write_provenance(folder, {"status": "begun"})
    return folder


def write_provenance(folder: Path, provenance: dict[str, Any]) -> None:
    """Write what the report is made of, which also marks the folder as a report's.

    Parameters
    ----------
    folder : Path
        The folder.
    provenance : dict
        What JSON knows.

    Raises
    ------
    FileError
        If the file cannot be written.
    """
    text = json.dumps({"made_by": _MADE_BY, **provenance}, indent=2, ensure_ascii=False)
    write_text(folder / MARKER, text + "\n")


def _is_report(folder: Path) -> bool:
    try:
        found = json.loads((folder / MARKER).read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return False
    return isinstance(found, dict) and found.get("made_by") == _MADE_BY
