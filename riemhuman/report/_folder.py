"""The folder of a report, which must be empty or hold an earlier report."""

from __future__ import annotations

import json
import os
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any

from riemhuman.errors import FileError
from riemhuman.io.files import file_path, lock_file, write_text

MARKER = "provenance.json"
_LOCK = ".report.lock"
_BEFORE_MARKER = ".provenance."
_MADE_BY = "riemhuman report"
SUBFOLDERS = ("figures", "tables", "results", "results/figures")


def check_folder(path: str | os.PathLike[str]) -> Path:
    """Refuse a folder that holds anything but a report, and write nothing.

    Parameters
    ----------
    path : path_like
        The folder.

    Returns
    -------
    Path
        The folder, which need not exist yet.

    Raises
    ------
    ArgumentTypeError
        If it is not a path.
    FileError
        If it is a file or holds anything but a report.
    """
    folder = file_path(path, "output", "folder")
    if folder.exists() and not folder.is_dir():
        raise FileError(f"{folder} is a file; the report needs a folder of its own")
    if folder.is_dir() and not _is_new(folder) and not _is_report(folder):
        raise FileError(
            f"{folder} holds other files; the report needs a new or empty folder, or one with "
            "an earlier report"
        )
    return folder


@contextmanager
def opened_folder(path: str | os.PathLike[str]) -> Iterator[Path]:
    """Make or reuse the folder of a report, and lock it against other processes.

    Parameters
    ----------
    path : path_like
        The folder.

    Yields
    ------
    Path
        The folder with its subfolders and its marker, which says that the report is unfinished.

    Raises
    ------
    ArgumentTypeError
        If it is not a path.
    FileError
        If it is a file, holds anything but a report, cannot be written, or another process is at
        work in it.
    """
    folder = check_folder(path)
    with ExitStack() as stack:
        try:
            folder.mkdir(parents=True, exist_ok=True)
            busy = f"{folder} is in use: another process makes a report in it"
            stack.enter_context(lock_file(folder / _LOCK, busy))
            check_folder(folder)
            # Comes first: after a kill, a folder without its marker would be refused.
            write_provenance(folder, {"status": "begun"})
            for name in SUBFOLDERS:
                _make_folder(folder / name)
        except OSError as error:
            if isinstance(error, FileError):
                raise
            raise FileError(f"{folder} cannot be written: {error.strerror}") from error
        yield folder


def _make_folder(path: Path) -> None:
    if path.is_symlink():
        raise FileError(f"{path} is a link, which is not followed to write; move it away")
    path.mkdir(exist_ok=True)


def write_provenance(folder: Path, provenance: dict[str, Any]) -> None:
    """Write the provenance of the report, a file that also marks the folder as a report.

    Parameters
    ----------
    folder : Path
        The folder.
    provenance : dict
        Any values that JSON can hold.

    Raises
    ------
    FileError
        If the file cannot be written.
    """
    text = json.dumps({"made_by": _MADE_BY, **provenance}, indent=2, ensure_ascii=False)
    write_text(folder / MARKER, text + "\n")


def _is_new(folder: Path) -> bool:
    """Tell whether a folder holds only what is written before the marker."""
    try:
        names = [entry.name for entry in folder.iterdir()]
    except OSError as error:
        raise FileError(f"{folder} cannot be read: {error.strerror}") from error
    return all(name == _LOCK or name.startswith(_BEFORE_MARKER) for name in names)


def _is_report(folder: Path) -> bool:
    try:
        found = json.loads((folder / MARKER).read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return False
    return isinstance(found, dict) and found.get("made_by") == _MADE_BY
