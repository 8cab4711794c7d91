"""Outputs of commands, which are checked before the work begins and appear whole or not at all."""

from __future__ import annotations

import os
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from pathlib import Path

from riemhuman.errors import FileError, FileFormatError
from riemhuman.io.files import keep_mode, lock_file, new_folder, own_folder

# Numbers of the system call renameat2.
_CURRENT_FOLDER, _RENAME_EXCHANGE = -100, 2


def check_output_file(path: Path, endings: Sequence[str], *, force: bool) -> None:
    """Refuse a file that could not be written after the work.

    Parameters
    ----------
    path : Path
        The file.
    endings : sequence of str
        Suffixes it may have.
    force : bool
        Whether an existing file may be replaced.

    Raises
    ------
    FileFormatError
        If it has another suffix.
    FileError
        If it is a folder, exists and may not be replaced, or its folder is not writable.
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


def check_output_folder(path: Path, is_ours: Callable[[str], bool], *, force: bool) -> None:
    """Refuse a folder that could not be written after the work.

    Parameters
    ----------
    path : Path
        The folder.
    is_ours : callable
        Tells whether the command writes files of a given name.
    force : bool
        Whether an existing folder that holds only such files may be replaced.

    Raises
    ------
    FileError
        If it is a file, holds other files, exists and may not be replaced, or the folder around it
        is not writable.
    """
    if path.is_symlink():
        raise FileError(f"{path} is a link; name a folder that does not exist yet")
    if os.path.lexists(path):
        if not path.is_dir():
            raise FileError(f"{path} is a file; name a folder that does not exist yet")
        if _ours_in(path, is_ours) and not force:
            raise FileError(f"{path} holds an earlier result; --force replaces it")
    _check_parent(path)


def _ours_in(path: Path, is_ours: Callable[[str], bool]) -> list[Path]:
    """Return the files of a folder, or refuse a folder that holds others."""
    try:
        entries = sorted(os.scandir(path), key=lambda entry: entry.name)
    except OSError as error:
        raise FileError(f"{path} cannot be read: {error.strerror}") from error
    for entry in entries:
        if not (is_ours(entry.name) and entry.is_file(follow_symlinks=False)):
            raise FileError(
                f"{path} holds something else ({entry.name}); name a folder that does not exist yet"
            )
    return [Path(entry.path) for entry in entries]


@contextmanager
def lock_output(path: Path) -> Iterator[None]:
    """Keep other processes from writing the same output during the work.

    Parameters
    ----------
    path : Path
        The file or folder; a lock file is kept beside it during the work.

    Raises
    ------
    FileError
        If another process is at work on it.
    """
    path = Path(os.path.abspath(path))
    place = path.with_name(f".{path.name}.lock")
    with ExitStack() as stack:
        try:
            busy = f"{path} is in use: another process is at work on it; name another output"
            stack.enter_context(lock_file(place, busy))
        except FileError:
            raise
        except OSError:
            pass  # where no lock can be made, writing the output itself reports why
        yield


@contextmanager
def atomic_folder(path: Path, is_ours: Callable[[str], bool]) -> Iterator[Path]:
    """Yield a temporary folder to write files into, which then replaces a folder.

    Parameters
    ----------
    path : Path
        The folder to replace.
    is_ours : callable
        Tells whether the command writes files of a given name; a folder that holds other files by
        then is not replaced.

    Yields
    ------
    Path
        The temporary folder; it is removed with its content if an error occurs.

    Raises
    ------
    FileError
        If the folder cannot be written.
    """
    path = Path(os.path.abspath(path))
    try:
        with new_folder(path) as temporary, own_folder(temporary.parent):
            yield temporary
            _replace_folder(temporary, path, is_ours)
    except OSError as error:
        if isinstance(error, (FileError, BrokenPipeError)):
            raise
        raise FileError(
            f"{path} cannot be written: {error.strerror or error}; is there space, and permission?"
        ) from error


def _replace_folder(new: Path, path: Path, is_ours: Callable[[str], bool]) -> None:
    """Replace a folder by another, in one step where the system can."""
    if not os.path.lexists(path):
        os.rename(new, path)
        return
    keep_mode(path, new)
    for file in _ours_in(path, is_ours):
        if (new / file.name).exists():
            keep_mode(file, new / file.name)
    if _exchange(new, path):
        replaced = new
    else:
        replaced = path.with_name(f".{path.name}.{os.getpid()}.old")
        os.rename(path, replaced)
        try:
            os.rename(new, path)
        except BaseException:
            os.rename(replaced, path)
            raise
    for file in _ours_in(replaced, is_ours):
        file.unlink()
    replaced.rmdir()


def _exchange(one: Path, other: Path) -> bool:
    """Exchange two names in one step, and tell whether this succeeded."""
    if not sys.platform.startswith("linux"):
        return False
    import ctypes

    system = ctypes.CDLL(None, use_errno=True)
    if not hasattr(system, "renameat2"):
        return False
    here = _CURRENT_FOLDER
    done = system.renameat2(here, os.fsencode(one), here, os.fsencode(other), _RENAME_EXCHANGE)
    return bool(done == 0)


def _check_parent(path: Path) -> None:
    parent = Path(os.path.abspath(path)).parent
    if not parent.is_dir():
        if parent.exists():
            raise FileError(f"{path} cannot be written: {parent} is a file, not a folder")
        raise FileError(f"there is no folder {parent}; make it first: mkdir -p '{parent}'")
    if not os.access(parent, os.W_OK | os.X_OK):
        raise FileError(f"{path} cannot be written: no permission in {parent}; name another place")
