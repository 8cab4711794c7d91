"""Outputs of verbs: looked at before the work begins, and written whole or not at all."""

from __future__ import annotations

import os
import shutil
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

from riemhuman.errors import FileError, FileFormatError


def check_file(path: Path, endings: Sequence[str], *, force: bool) -> None:
    """Refuse a file that could not be written once the work is done.

    Parameters
    ----------
    path : Path
        The file.
    endings : sequence of str
        What it may end in.
    force : bool
        Whether a file that is there may be replaced.

    Raises
    ------
    FileFormatError
        If it has another ending.
    FileError
        If it is a folder, is there and may not be replaced, or its folder cannot be written to.
    """
    if path.suffix.lower() not in endings:
        found = f"found {path.suffix!r}" if path.suffix else "found none"
        raise FileFormatError(f"{path}: the ending must be {' or '.join(endings)}; {found}")
    if path.is_dir():
        raise FileError(
            f"{path} is a folder; name a file in it, such as {path / 'out'}{endings[0]}"
        )
    if os.path.lexists(path) and not force:
        raise FileError(f"{path} exists; --force replaces it")
    _check_parent(path)


def check_folder(path: Path, is_ours: Callable[[str], bool], *, force: bool) -> None:
    """Refuse a folder that could not be written once the work is done.

    Parameters
    ----------
    path : Path
        The folder.
    is_ours : callable
        Tells whether a file name is one that this verb writes.
    force : bool
        Whether a folder that holds nothing but such files may be replaced.

    Raises
    ------
    FileError
        If it is a file, holds something else, is there and may not be replaced, or its folder
        cannot be written to.
    """
    if os.path.lexists(path):
        if not path.is_dir():
            raise FileError(f"{path} is a file; name a folder that does not exist yet")
        try:
            names = sorted(os.listdir(path))
        except OSError as error:
            raise FileError(f"{path} cannot be read: {error.strerror}") from error
        others = [name for name in names if not is_ours(name)]
        if others:
            raise FileError(
                f"{path} holds something else ({others[0]}); name a folder that does not exist yet"
            )
        if names and not force:
            raise FileError(f"{path} holds an earlier result; --force replaces it")
    _check_parent(path)


@contextmanager
def whole_file(path: Path) -> Iterator[Path]:
    """Yield a neighbour of a file to write, which then takes its place.

    Parameters
    ----------
    path : Path
        The file.

    Yields
    ------
    Path
        A path with the same ending; what is there is removed should anything go wrong.

    Raises
    ------
    FileError
        If the file cannot be written.
    """
    temporary = path.with_name(f".{path.stem}.{os.getpid()}.part{path.suffix}")
    try:
        yield temporary
        os.replace(temporary, path)
    except OSError as error:
        _refuse(path, error)
    finally:
        temporary.unlink(missing_ok=True)


@contextmanager
def whole_folder(path: Path) -> Iterator[Path]:
    """Yield a new folder to write files into, which then takes its place.

    Parameters
    ----------
    path : Path
        The folder.

    Yields
    ------
    Path
        A folder beside it, removed with all it holds should anything go wrong.

    Raises
    ------
    FileError
        If the folder cannot be written.
    """
    path = Path(os.path.abspath(path))
    temporary = path.with_name(f".{path.name}.{os.getpid()}.part")
    replaced = path.with_name(f".{path.name}.{os.getpid()}.old")
    try:
        temporary.mkdir()
        yield temporary
        if path.exists():
            os.rename(path, replaced)
        try:
            os.rename(temporary, path)
        except BaseException:
            if replaced.exists():
                os.rename(replaced, path)
            raise
    except OSError as error:
        _refuse(path, error)
    finally:
        shutil.rmtree(temporary, ignore_errors=True)
        shutil.rmtree(replaced, ignore_errors=True)


def _check_parent(path: Path) -> None:
    parent = Path(os.path.abspath(path)).parent
    if not parent.is_dir():
        if parent.exists():
            raise FileError(f"{path} cannot be written: {parent} is a file, not a folder")
        raise FileError(f"there is no folder {parent}; make it first: mkdir -p '{parent}'")
    if not os.access(parent, os.W_OK | os.X_OK):
        raise FileError(f"{path} cannot be written: no permission in {parent}; name another place")


def _refuse(path: Path, error: OSError) -> None:
    """Say that a file cannot be written, unless that has been said already."""
    if isinstance(error, (FileError, BrokenPipeError)):
        raise error
    raise FileError(
        f"{path} cannot be written: {error.strerror or error}; is there space, and permission?"
    ) from error
