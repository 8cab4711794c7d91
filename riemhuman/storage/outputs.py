"""Outputs of commands: checked before the work begins, and written whole or not at all."""

from __future__ import annotations

import os
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from pathlib import Path

from riemhuman.errors import FileError, FileFormatError
from riemhuman.storage.file_locks import only_one
from riemhuman.storage.whole_files import keep_mode, new_folder, own_folder

# Numbers of the system call renameat2.
_CURRENT_FOLDER, _RENAME_EXCHANGE = -100, 2


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
    if path.is_symlink():
        raise FileError(f"{path} is a link; name a folder that does not exist yet")
    if os.path.lexists(path):
        if not path.is_dir():
            raise FileError(f"{path} is a file; name a folder that does not exist yet")
        if _ours_in(path, is_ours) and not force:
            raise FileError(f"{path} holds an earlier result; --force replaces it")
    _check_parent(path)


def _ours_in(path: Path, is_ours: Callable[[str], bool]) -> list[Path]:
    """Return the files of a folder, or refuse one that holds something else."""
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
def claimed(path: Path) -> Iterator[None]:
    """Keep other processes from writing the same output, from before the work begins.

    Parameters
    ----------
    path : Path
        The file or folder; a lock file lies beside it meanwhile.

    Yields
    ------
    None

    Raises
    ------
    FileError
        If another process is at work on it.
    """
    path = Path(os.path.abspath(path))
    lock_file = path.with_name(f".{path.name}.lock")
    with ExitStack() as stack:
        try:
            busy = f"{path} is in use: another process is at work on it; name another output"
            stack.enter_context(only_one(lock_file, busy))
        except FileError:
            raise
        except OSError:
            pass  # the verb says what is wrong with the place, if it matters
        yield


@contextmanager
def whole_folder(path: Path, is_ours: Callable[[str], bool]) -> Iterator[Path]:
    """Yield a new folder to write files into, which then takes its place.

    Parameters
    ----------
    path : Path
        The folder.
    is_ours : callable
        Tells whether a file name is one that this verb writes; a folder that has come to hold
        anything else is left as it is.

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
    """Rename a folder, so that it takes the place of another at once where the system can."""
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
    """Exchange two names in one step, and tell whether the system did."""
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
