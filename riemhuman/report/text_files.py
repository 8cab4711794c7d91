"""Files of text and bytes, written whole or not at all."""

from __future__ import annotations

import os
from pathlib import Path

from riemhuman.errors import ArgumentTypeError, FileError


def write_text(path: str | os.PathLike[str], text: str) -> None:
    """Write a text file; a temporary neighbour is written first.

    Parameters
    ----------
    path : path_like
        The file; an existing file is replaced.
    text : str
        Its content.

    Raises
    ------
    ArgumentTypeError
        If `path` is not a path.
    FileError
        If the file cannot be written.
    """
    write_bytes(path, text.encode("utf-8"))


def write_bytes(path: str | os.PathLike[str], content: bytes) -> None:
    """Write a file; a temporary neighbour is written first.

    Parameters
    ----------
    path : path_like
        The file; an existing file is replaced.
    content : bytes
        Its content.

    Raises
    ------
    ArgumentTypeError
        If `path` is not a path.
    FileError
        If the file cannot be written.
    """
    try:
        file = Path(path).expanduser()
    except TypeError as error:
        raise ArgumentTypeError(f"path must be the path of a file; found {path!r}") from error
    temporary = file.with_name(f".{file.name}.{os.getpid()}.part")
    try:
        try:
            temporary.write_bytes(content)
            os.replace(temporary, file)
        finally:
            temporary.unlink(missing_ok=True)
    except OSError as error:
        raise FileError(f"{file} cannot be written: {error.strerror}") from error
