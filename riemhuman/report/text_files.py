"""Files of text and bytes, written whole or not at all."""

from __future__ import annotations

import os

from riemhuman.surfaces.file_content import file_path
from riemhuman.surfaces.whole_files import whole_file


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
    with whole_file(file_path(path)) as neighbour:
        neighbour.write_bytes(content)
