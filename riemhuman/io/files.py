"""Reading of whole files, atomic writes and locks."""

from __future__ import annotations

import errno
import os
import shutil
import stat
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress
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
                f"{str(found)[:_LONGEST]!r} cannot be the name of a {kind}: {short_message(error)}"
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
        raise FileError(f"{file} cannot be read: {short_message(error)}") from error
    if not stat.S_ISREG(found.st_mode):
        kind = "a folder" if stat.S_ISDIR(found.st_mode) else "a device or a pipe"
        raise FileError(f"{file} cannot be read: it is {kind}; a file was expected")
    return found.st_size


def read_bytes(file: Path) -> bytes:
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
        raise FileError(f"{file} cannot be read: {short_message(error)}") from error


def short_message(error: BaseException) -> str:
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


# Without these flags, as on Windows, only the check before the opening refuses links.
_NO_LINK = getattr(os, "O_NOFOLLOW", 0)
_BINARY = getattr(os, "O_BINARY", 0)


def open_own(file: Path, flags: int = os.O_RDWR) -> int:
    """Open a file that the library has made, without following links.

    Parameters
    ----------
    file : Path
        The file.
    flags : int
        As of `os.open`.

    Returns
    -------
    int
        Descriptor.

    Raises
    ------
    FileError
        If it is a symbolic link, a folder or a device, or has a second name (a hard link), under
        which somebody else may use it.
    OSError
        If it cannot be opened.
    """
    try:
        found = file.lstat()
    except FileNotFoundError:
        pass
    else:
        _refuse_others(file, found)
    descriptor = os.open(file, flags | _NO_LINK | _BINARY, 0o666)
    try:
        _refuse_others(file, os.fstat(descriptor))
    except BaseException:
        os.close(descriptor)
        raise
    return descriptor


def make_own(file: Path) -> int:
    """Make a new file and open it for writing.

    Parameters
    ----------
    file : Path
        The file.

    Returns
    -------
    int
        Descriptor.

    Raises
    ------
    OSError
        If the name is taken, even by a link to nothing, or the file cannot be made.
    """
    return os.open(file, os.O_RDWR | os.O_CREAT | os.O_EXCL | _NO_LINK | _BINARY, 0o666)


def open_lock(file: Path) -> int:
    """Open a lock file, which is empty, or make it.

    Parameters
    ----------
    file : Path
        The lock file.

    Returns
    -------
    int
        Descriptor.

    Raises
    ------
    FileError
        If something else has this name.
    OSError
        If the file cannot be opened.
    """
    descriptor = open_own(file, os.O_RDWR | os.O_CREAT)
    if os.fstat(descriptor).st_size:
        os.close(descriptor)
        raise FileError(f"{file} is no lock of this library: it holds something; move it away")
    return descriptor


def _refuse_others(file: Path, found: os.stat_result) -> None:
    if stat.S_ISLNK(found.st_mode):
        raise FileError(f"{file} is a link, which is not followed to write; move it away")
    if not stat.S_ISREG(found.st_mode):
        raise FileError(f"{file} is not a regular file; move it away")
    # The count is 0 if another process has removed the file since it was opened.
    if found.st_nlink > 1:
        raise FileError(f"{file} has a second name, under which it may be in use; move it away")


if sys.platform == "win32":
    import msvcrt

    def lock(descriptor: int) -> None:
        """Lock an open file, or raise an error if another process has locked it.

        Parameters
        ----------
        descriptor : int
            The file.

        Raises
        ------
        BlockingIOError
            If another process has locked it.
        """
        try:
            msvcrt.locking(descriptor, msvcrt.LK_NBLCK, 1)
        except OSError as error:
            raise BlockingIOError(error.errno, error.strerror) from error

else:
    import fcntl

    def lock(descriptor: int) -> None:
        """Lock an open file or folder, or raise an error if another process has locked it.

        Parameters
        ----------
        descriptor : int
            The file or folder.

        Raises
        ------
        BlockingIOError
            If another process has locked it.
        OSError
            If it cannot be locked, as on some network file systems.
        """
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)


@contextmanager
def lock_file(file: Path, busy: str) -> Iterator[None]:
    """Hold a lock file, which keeps other processes out, and remove it in the end.

    Parameters
    ----------
    file : Path
        The lock file; the one of a killed process is reused.
    busy : str
        Message of the error if another process holds it.

    Raises
    ------
    FileError
        If another process holds it, or something else has this name.
    OSError
        If the file cannot be made.
    """
    while True:
        descriptor = open_lock(file)
        try:
            lock(descriptor)
        except BlockingIOError as error:
            os.close(descriptor)
            raise FileError(busy) from error
        except BaseException:
            os.close(descriptor)
            raise
        if is_at(os.fstat(descriptor), file):
            break
        os.close(descriptor)  # removed by its holder between the opening and the locking
    try:
        yield
    finally:
        # Removed while it is held: later, it might be another process that holds it.
        with suppress(OSError):
            file.unlink()
        os.close(descriptor)


def is_at(found: os.stat_result, path: Path) -> bool:
    """Tell whether a path still leads to the same file or folder.

    Parameters
    ----------
    found : os.stat_result
        Status of the file or folder.
    path : Path
        The path.
    """
    try:
        return os.path.samestat(found, path.stat(follow_symlinks=False))
    except OSError:
        return False


# Windows can neither rename an open file nor lock a folder.
_CAN_LOCK = sys.platform != "win32"
_NO_LOCK = -1
_own_folders: list[Path] = []


@contextmanager
def atomic_file(file: Path) -> Iterator[Path]:
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
        raise FileError(f"{file} cannot be written: {short_message(error)}") from error


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
    with atomic_file(file_path(path)) as neighbour:
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
