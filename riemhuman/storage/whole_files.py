"""Files that appear whole or not at all: a neighbour is written, and then takes their place.

A process that is killed leaves its neighbour behind. Neighbours are locked for as long as their
process lives, so that whoever writes the same file next takes over those that are not.
"""

from __future__ import annotations

import os
import shutil
import stat
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from riemhuman.errors import FileError
from riemhuman.storage.file_content import brief, file_path
from riemhuman.storage.file_locks import is_at, lock

# Elsewhere an open file cannot be renamed, and a folder cannot be locked.
_CAN_LOCK = sys.platform != "win32"
_NO_LOCK = -1
_own_folders: list[Path] = []


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
        The neighbour, with the same ending; it is removed should anything go wrong.

    Raises
    ------
    FileError
        If the file is a link or cannot be written.
    """
    _refuse_links(file)
    if file.is_symlink():
        raise FileError(f"{file} is a link, which is not followed to write; name another file")
    try:
        with _neighbour(file, folder=False) as neighbour:
            keep_mode(file, neighbour, writable=True)
            yield neighbour
            _flush(neighbour)
            keep_mode(file, neighbour)
            os.replace(neighbour, file)
    except OSError as error:
        if isinstance(error, (FileError, BrokenPipeError)):
            raise
        raise FileError(f"{file} cannot be written: {brief(error)}") from error


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


def keep_mode(path: Path, new: Path, *, writable: bool = False) -> None:
    """Give what takes the place of a file or folder the permissions that it has, if it is there.

    Parameters
    ----------
    path : Path
        The file or folder.
    new : Path
        What takes its place.
    writable : bool
        Whether its owner may write to it at any rate, until it does.
    """
    try:
        mode = path.stat(follow_symlinks=False).st_mode
    except OSError:
        return
    if not stat.S_ISLNK(mode):
        new.chmod(stat.S_IMODE(mode) | (stat.S_IRUSR | stat.S_IWUSR if writable else 0))


@contextmanager
def own_folder(folder: Path) -> Iterator[None]:
    """Write no file below a folder through a link, though one may take a subfolder's place.

    Parameters
    ----------
    folder : Path
        The folder, which may itself be reached through links.
    """
    _own_folders.append(folder)
    try:
        yield
    finally:
        _own_folders.remove(folder)


def _refuse_links(file: Path) -> None:
    for folder in _own_folders:
        if file.is_relative_to(folder):
            below = [file, *file.parents][: len(file.parts) - len(folder.parts)]
            for path in below:
                if path.is_symlink():
                    raise FileError(
                        f"{path} is a link, which is not followed to write; move it away"
                    )


@contextmanager
def new_folder(path: Path) -> Iterator[Path]:
    """Yield an empty folder beside a path, to take its place.

    Parameters
    ----------
    path : Path
        The path.

    Yields
    ------
    Path
        The folder; what is there in the end is removed.

    Raises
    ------
    OSError
        If there can be no such folder.
    """
    with _neighbour(path, folder=True) as neighbour:
        yield neighbour


@contextmanager
def _neighbour(path: Path, *, folder: bool) -> Iterator[Path]:
    """Make a neighbour, keep it locked, and remove it if it is still there in the end."""
    number = 0
    while (descriptor := _taken(_name(path, number, folder), folder)) is None:
        number += 1
    neighbour = _name(path, number, folder)
    made = neighbour.stat()
    try:
        while os.path.lexists(left := _name(path, number + 1, folder)) and _remove_abandoned(left):
            number += 1
        yield neighbour
    finally:
        # Once it has been renamed, the name is free for other processes.
        if is_at(made, neighbour):
            _remove(neighbour)
        if descriptor != _NO_LOCK:
            os.close(descriptor)


def _name(path: Path, number: int, folder: bool) -> Path:
    kind = "folder" if folder else "part"
    return path.with_name(f".{path.stem}.{number}.{kind}{path.suffix}")


def _taken(neighbour: Path, folder: bool) -> int | None:
    """Make a neighbour and return what keeps it locked, or nothing if another process has it."""
    while True:
        try:
            if folder:
                neighbour.mkdir()
            else:
                neighbour.touch(exist_ok=False)
        except FileExistsError:
            if not _remove_abandoned(neighbour):
                return None
            continue
        try:
            return _locked(neighbour)
        except (BlockingIOError, FileNotFoundError):
            pass  # taken for abandoned by another process before it was locked
        except OSError:
            return _NO_LOCK


def _remove_abandoned(neighbour: Path) -> bool:
    """Remove a neighbour, unless its process lives, or where there are no locks to tell."""
    try:
        descriptor = _locked(neighbour)
    except FileNotFoundError:
        return True
    except OSError:
        return False
    _remove(neighbour)
    os.close(descriptor)
    return not os.path.lexists(neighbour)


def _locked(neighbour: Path) -> int:
    """Return a locked descriptor of a neighbour."""
    if not _CAN_LOCK:
        raise OSError("no locks")
    descriptor = os.open(neighbour, os.O_RDONLY | os.O_NOFOLLOW)
    try:
        lock(descriptor)
        if not is_at(os.fstat(descriptor), neighbour):
            raise FileNotFoundError(neighbour)
    except BaseException:
        os.close(descriptor)
        raise
    return descriptor


def _remove(path: Path) -> None:
    if path.is_dir() and not path.is_symlink():
        shutil.rmtree(path, ignore_errors=True)
    else:
        with suppress(OSError):
            path.unlink()


def _flush(file: Path) -> None:
    """See that the content is on the disk before the name: power may fail between the two."""
    with file.open("rb+") as stream:
        os.fsync(stream.fileno())
