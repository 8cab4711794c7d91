"""Files that appear whole or not at all: a neighbour is written, and then takes their place."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from riemhuman.errors import FileError


@contextmanager
def whole_file(file: Path) -> Iterator[Path]:
    """Yield the path of a neighbour to write, which then replaces the file.

    Parameters
    ----------
    file : Path
        The file; an existing one is replaced.

    Yields
    ------
    Path
        The neighbour; it is removed should anything go wrong.

    Raises
    ------
    FileError
        If the file cannot be written.
    """
    neighbour = file.with_name(f".{file.name}.{os.getpid()}.part")
    try:
        try:
            yield neighbour
            os.replace(neighbour, file)
        finally:
            neighbour.unlink(missing_ok=True)
    except OSError as error:
        if isinstance(error, FileError):
            raise
        raise FileError(f"{file} cannot be written: {error.strerror}") from error
