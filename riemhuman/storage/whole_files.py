"""Files that appear whole or not at all: a temporary neighbour is written and then renamed.

A killed process leaves its neighbour behind. A neighbour is locked while its process lives, so the
next process that writes the same file can tell abandoned neighbours and removes them.
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

# Windows can neither rename an open file nor lock a folder.
_CAN_LOCK = sys.platform != "win32"
_NO_LOCK = -1
_own_folders: list[Path] = []


@contextmanager
def whole_file(file: Path) -> Iterator[Path]:
    """Yield the path of a temporary neighbour to write, which then replaces the file.

    Parameters
    ----------
    file : Path
        The file; an existing one is replaced.

    Yields
    ------
    Path
        The neighbour, with the same suffix; it is removed if an error occurs.

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
    """Write a text file in UTF-8, which appears whole or not at all.

    Parameters
    ----------
    path : path_like
        The file; an existing file is replaced.
    text : str
        Its content.
    """
    write_bytes(path, text.encode("utf-8"))


def write_bytes(path: str | os.PathLike[str], content: bytes) -> None:
    """Write a file, which appears whole or not at all.

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
    """Copy the permissions of a file or folder, if it exists, to its replacement.

    Parameters
    ----------
    path : Path
        The file or folder.
    new : Path
        Its replacement.
    writable : bool
        Whether the owner may read and write the replacement in any case.
    """
    try:
        mode = path.stat(follow_symlinks=False).st_mode
    except OSError:
        return
    if not stat.S_ISLNK(mode):
        new.chmod(stat.S_IMODE(mode) | (stat.S_IRUSR | stat.S_IWUSR if writable else 0))


@contextmanager
def own_folder(folder: Path) -> Iterator[None]:
    """Refuse, within this context, to write files below a folder through links.

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
    """Yield an empty folder beside a path, which is removed in the end unless it was renamed.

    Parameters
    ----------
    path : Path
        The path.

    Raises
    ------
    OSError
        If the folder cannot be made.
    """
    with _neighbour(path, folder=True) as neighbour:
        yield neighbour


@contextmanager
def _neighbour(path: Path, *, folder: bool) -> Iterator[Path]:
    """Make a neighbour, keep it locked, and remove it in the end unless it was renamed."""
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
        # After a rename, another process may use the name.
        if is_at(made, neighbour):
            _remove(neighbour)
        if descriptor != _NO_LOCK:
            os.close(descriptor)


def _name(path: Path, number: int, folder: bool) -> Path:
    kind = "folder" if folder else "part"
    return path.with_name(f".{path.stem}.{number}.{kind}{path.suffix}")


def _taken(neighbour: Path, folder: bool) -> int | None:
    """Make a neighbour and return its locked descriptor, or None if another process holds it."""
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
            pass  # another process took it for abandoned before it was locked
        except OSError:
            return _NO_LOCK


def _remove_abandoned(neighbour: Path) -> bool:
    """Remove a neighbour unless its process lives or there are no locks, and tell whether."""
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
    """Write the content to the disk before the rename, in case power fails between the two."""
    with file.open("rb+") as stream:
        os.fsync(stream.fileno())
