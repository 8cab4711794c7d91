"""Opening of the library's own files, which follows no links and writes to no other files."""

from __future__ import annotations

import os
import stat
from pathlib import Path

from riemhuman.errors import FileError

# Without these flags, as on Windows, only the check before the opening refuses links.
_NO_LINK = getattr(os, "O_NOFOLLOW", 0)
_BINARY = getattr(os, "O_BINARY", 0)


def open_own(file: Path, flags: int = os.O_RDWR) -> int:
    """Open a file that the library has made, without following links.

    Parameters
    ----------
    file : Path
        The file.
    flags : int
        As of `os.open`.

    Returns
    -------
    int
        Descriptor.

    Raises
    ------
    FileError
        If it is a symbolic link, a folder or a device, or has a second name (a hard link), under
        which somebody else may use it.
    OSError
        If it cannot be opened.
    """
    try:
        found = file.lstat()
    except FileNotFoundError:
        pass
    else:
        _refuse_others(file, found)
    descriptor = os.open(file, flags | _NO_LINK | _BINARY, 0o666)
    try:
        _refuse_others(file, os.fstat(descriptor))
    except BaseException:
        os.close(descriptor)
        raise
    return descriptor


def make_own(file: Path) -> int:
    """Make a new file and open it for writing.

    Parameters
    ----------
    file : Path
        The file.

    Returns
    -------
    int
        Descriptor.

    Raises
    ------
    OSError
        If the name is taken, even by a link to nothing, or the file cannot be made.
    """
    return os.open(file, os.O_RDWR | os.O_CREAT | os.O_EXCL | _NO_LINK | _BINARY, 0o666)


def open_lock(file: Path) -> int:
    """Open a lock file, which is empty, or make it.

    Parameters
    ----------
    file : Path
        The lock file.

    Returns
    -------
    int
        Descriptor.

    Raises
    ------
    FileError
        If something else has this name.
    OSError
        If the file cannot be opened.
    """
    descriptor = open_own(file, os.O_RDWR | os.O_CREAT)
    if os.fstat(descriptor).st_size:
        os.close(descriptor)
        raise FileError(f"{file} is no lock of this library: it holds something; move it away")
    return descriptor


def _refuse_others(file: Path, found: os.stat_result) -> None:
    if stat.S_ISLNK(found.st_mode):
        raise FileError(f"{file} is a link, which is not followed to write; move it away")
    if not stat.S_ISREG(found.st_mode):
        raise FileError(f"{file} is not a regular file; move it away")
    # The count is 0 if another process has removed the file since it was opened.
    if found.st_nlink > 1:
        raise FileError(f"{file} has a second name, under which it may be in use; move it away")
