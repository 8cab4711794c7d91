"""Named arrays in .npz files: written whole or not at all, read without unpickling."""

from __future__ import annotations

import io
import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from riemhuman.errors import ArgumentTypeError, FileError, FileFormatError


def save_arrays(
    path: str | os.PathLike[str], arrays: Mapping[str, Any], *, compressed: bool = False
) -> None:
    """Write named arrays to an .npz file; a temporary neighbour is written first.

    Parameters
    ----------
    path : path_like
        The file, with its ending; an existing file is replaced.
    arrays : mapping of str to array
        The fields.
    compressed : bool
        Whether the file is compressed.

    Raises
    ------
    ArgumentTypeError
        If `path` is not a path.
    FileError
        If the file cannot be written.
    """
    file = _as_path(path)
    temporary = file.parent / f".{file.name}.{os.getpid()}.part"
    try:
        try:
            with temporary.open("wb") as stream:
                write = np.savez_compressed if compressed else np.savez
                write(stream, **arrays)
            os.replace(temporary, file)
        finally:
            temporary.unlink(missing_ok=True)
    except OSError as error:
        raise FileError(f"{file} cannot be written: {error.strerror}") from error


def load_arrays(
    path: str | os.PathLike[str],
    required: Sequence[str],
    optional: Sequence[str] | None = None,
) -> dict[str, np.ndarray]:
    """Read the named arrays of an .npz file; pickled objects are refused.

    Parameters
    ----------
    path : path_like
        The file.
    required : sequence of str
        Fields that must be there.
    optional : sequence of str, optional
        Fields to read if they are there; by default all. Others are left unread.

    Returns
    -------
    arrays : dict of str to array

    Raises
    ------
    ArgumentTypeError
        If `path` is not a path.
    FileError
        If the file is missing or cannot be read.
    FileFormatError
        If it is not an .npz archive of plain arrays, or lacks a field.
    """
    file = _as_path(path)
    try:
        content = file.read_bytes()
    except OSError as error:
        raise FileError(f"{file} cannot be read: {error.strerror}") from error
    try:
        archive = np.load(io.BytesIO(content), allow_pickle=False)
        found = archive.files if isinstance(archive, np.lib.npyio.NpzFile) else []
        wanted = found if optional is None else [*required, *optional]
        arrays = {name: archive[name] for name in found if name in wanted}
    except Exception as error:  # whatever a damaged archive makes a parser stumble over
        raise FileFormatError(f"{file} is not an .npz archive of plain arrays: {error}") from error
    missing = [name for name in required if name not in found]
    if missing:
        raise FileFormatError(
            f"{file} lacks the fields {', '.join(missing)}; "
            f"found {', '.join(sorted(found)) or 'none'}"
        )
    return arrays


def _as_path(path: str | os.PathLike[str]) -> Path:
    try:
        return Path(path).expanduser()
    except TypeError as error:
        raise ArgumentTypeError(f"path must be the path of a file; found {path!r}") from error
