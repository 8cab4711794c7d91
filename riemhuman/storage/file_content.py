"""Reading of regular files; devices and pipes are refused, for they may never end."""

from __future__ import annotations

import errno
import os
import stat
from pathlib import Path

from riemhuman.errors import ArgumentTypeError, FileError

_LONGEST = 300


def file_path(path: str | os.PathLike[str], name: str = "path", kind: str = "file") -> Path:
    """Return a path as `Path`; ``~`` stands for the user's home.

    Parameters
    ----------
    path : path_like
        The path.
    name : str
        Name of the argument, for messages.
    kind : str
        What the path should lead to, for messages.

    Raises
    ------
    ArgumentTypeError
        If it is not a path.
    FileError
        If the path is too long or contains a null character.
    """
    try:
        # `Path.expanduser` would refuse a file ~anna.ply where there is no user anna.ply.
        found = Path(os.path.expanduser(path))
    except TypeError as error:
        raise ArgumentTypeError(f"{name} must be the path of a {kind}; found {path!r}") from error
    try:
        found.lstat()
    except (OSError, ValueError) as error:
        if isinstance(error, ValueError) or error.errno == errno.ENAMETOOLONG:
            raise FileError(
                f"{str(found)[:_LONGEST]!r} cannot be the name of a {kind}: {brief(error)}"
            ) from error
    return found


def check_file(file: Path) -> int:
    """Refuse anything but a regular file or a link to one.

    Parameters
    ----------
    file : Path
        The file.

    Returns
    -------
    size : int
        Its size in bytes.

    Raises
    ------
    FileError
        If it is missing, a folder, a device or a pipe.
    """
    try:
        found = file.stat()
    except (OSError, ValueError) as error:
        raise FileError(f"{file} cannot be read: {brief(error)}") from error
    if not stat.S_ISREG(found.st_mode):
        kind = "a folder" if stat.S_ISDIR(found.st_mode) else "a device or a pipe"
        raise FileError(f"{file} cannot be read: it is {kind}; a file was expected")
    return found.st_size


def file_content(file: Path) -> bytes:
    """Read a file.

    Parameters
    ----------
    file : Path
        The file.

    Raises
    ------
    FileError
        If it is missing, a folder, a device or a pipe, or cannot be read.
    """
    check_file(file)
    try:
        return file.read_bytes()
    except OSError as error:
        raise FileError(f"{file} cannot be read: {brief(error)}") from error


def brief(error: BaseException) -> str:
    """Return the message of an error, shortened because some errors quote a whole file.

    Parameters
    ----------
    error : Exception
        The error.

    Returns
    -------
    text : str
        At most 300 characters.
    """
    text = getattr(error, "strerror", None) or str(error) or type(error).__name__
    return text if len(text) <= _LONGEST else text[: _LONGEST - 3] + "..."
