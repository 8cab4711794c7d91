"""Paths, reading of whole files, atomic writes and locks.

A file is written beside its place and then renamed, so that a killed process leaves the old file
or the new one. Only regular files are read: a device or a pipe may never end.
"""

from __future__ import annotations

import os
import re
import secrets
import stat
from codecs import BOM_UTF16_BE, BOM_UTF16_LE
from collections.abc import Collection, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from riemhuman.errors import (
    ArgumentTypeError,
    FileError,
    FileFormatError,
    RiemhumanError,
    shown,
)

# How to convert point clouds that the library cannot read.
_POINT_CLOUDS = {
    ".pcd": "open3d.io.write_point_cloud('scan.ply', open3d.io.read_point_cloud('scan.pcd'))",
    ".e57": "CloudCompare -SILENT -O scan.e57 -C_EXPORT_FMT PLY -SAVE_CLOUDS",
}
# What file managers of macOS, Windows and KDE write into folders.
_OF_SYSTEMS = (".DS_Store", "Thumbs.db", "desktop.ini", ".directory")
# Some errors quote a whole file.
_LONGEST_MESSAGE = 300
_NEIGHBOUR = re.compile(r"\..+\.[0-9a-f]{8}\.part(\.[^.]*)?")


def file_path(path: str | os.PathLike[str], name: str = "path", kind: str = "file") -> Path:
    """Return a path; ``~`` is the user's home, and `name` and `kind` are for messages."""
    try:
        # `Path.expanduser` would refuse a file ~anna.ply where there is no user anna.ply.
        return Path(os.path.expanduser(path))
    except TypeError as error:
        raise ArgumentTypeError(
            f"{name} must be the path of a {kind}; found {shown(path)}"
        ) from error


def suffix_of(file: Path, suffixes: Collection[str]) -> str:
    """Return the suffix of a file, in lower case, or raise an error if it is none of `suffixes`."""
    suffix = file.suffix.lower()
    if suffix in suffixes:
        return suffix
    if suffix in _POINT_CLOUDS:
        raise FileFormatError(
            f"{file}: {suffix} files cannot be read; convert it to PLY first, for example with "
            f"{_POINT_CLOUDS[suffix]}"
        )
    listed = " or ".join(suffixes) if len(suffixes) < 3 else f"one of {', '.join(suffixes)}"
    ending = repr(file.suffix) if suffix else "none"
    raise FileFormatError(f"{file}: the ending must be {listed}; found {ending}")


def check_file(file: Path) -> int:
    """Return the size of a file in bytes; raise an error unless it is a regular file."""
    try:
        status = file.stat()
    except FileNotFoundError as error:
        raise FileError(f"there is no file {file}") from error
    except (OSError, ValueError) as error:
        raise FileError(f"{file} cannot be read: {short_message(error)}") from error
    if not stat.S_ISREG(status.st_mode):
        kind = "a folder" if stat.S_ISDIR(status.st_mode) else "a device or a pipe"
        raise FileError(f"{file} cannot be read: it is {kind}; a file was expected")
    return status.st_size


def read_bytes(file: Path) -> bytes:
    """Return the content of a regular file."""
    check_file(file)
    try:
        return file.read_bytes()
    except OSError as error:
        raise FileError(f"{file} cannot be read: {short_message(error)}") from error


def read_in_utf8(file: Path) -> bytes:
    """Return the content of a file; text as PowerShell writes it, in UTF-16, becomes UTF-8."""
    content = read_bytes(file)
    if content.startswith((BOM_UTF16_LE, BOM_UTF16_BE)):
        with suppress(UnicodeDecodeError):
            return content.decode("utf-16").encode()
    return content


def read_text(file: Path) -> str:
    """Return the content of a text file in UTF-8, or UTF-16 if a byte order mark says so."""
    content = read_bytes(file)
    encoding = "utf-16" if content.startswith((BOM_UTF16_LE, BOM_UTF16_BE)) else "utf-8-sig"
    try:
        return content.decode(encoding)
    except UnicodeDecodeError as error:
        raise FileFormatError(
            f"{file} is not text in UTF-8: {error}; a spreadsheet can save it as CSV UTF-8"
        ) from error


def short_message(error: BaseException) -> str:
    """Return the message of an error in at most 300 characters."""
    text = getattr(error, "strerror", None) or str(error) or type(error).__name__
    return text if len(text) <= _LONGEST_MESSAGE else text[: _LONGEST_MESSAGE - 3] + "..."


@contextmanager
def atomic_file(file: Path) -> Iterator[Path]:
    """Yield a temporary file that takes the place of the file unless an error occurs."""
    with convert_errors(file):
        file = Path(os.path.realpath(file))
        if not file.parent.is_dir():
            raise FileError(f"{file} cannot be written: there is no folder {file.parent}")
        check_replaceable(file)
        temporary = neighbour(file)
        try:
            temporary.touch(exist_ok=False)
            yield temporary
            # On the disk before the rename; otherwise a power failure may leave an empty file.
            with temporary.open("rb+") as stream:
                os.fsync(stream.fileno())
            if file.exists():
                keep_permissions(file, temporary)
            os.replace(temporary, file)
        finally:
            temporary.unlink(missing_ok=True)


def keep_permissions(old: Path, new: Path) -> None:
    """Give a file or folder the permissions of the one whose place it takes."""
    permissions = stat.S_IMODE(old.stat().st_mode)
    # Disks for several systems have the same for all files, and refuse to set any.
    if stat.S_IMODE(new.stat().st_mode) != permissions:
        new.chmod(permissions)


def check_replaceable(file: Path) -> None:
    """Raise an error if something else than a regular file has the place of a file to write."""
    if file.exists() and not file.is_file():
        raise FileError(f"{file} cannot be written: it is not a regular file")


def neighbour(path: Path) -> Path:
    """Return an unused hidden name in the folder of a path, with the same suffix."""
    return path.with_name(f".{path.stem[:40]}.{secrets.token_hex(4)}.part{path.suffix}")


def is_being_written(name: str) -> bool:
    """Return whether a hidden name is one by `neighbour`."""
    return _NEIGHBOUR.fullmatch(name) is not None


def is_of_system(entry: os.DirEntry[str]) -> bool:
    """Return whether a file manager has added a file to a folder that somebody looked into."""
    return entry.name in _OF_SYSTEMS and entry.is_file(follow_symlinks=False)


def visible_files(folder: Path, *endings: str, deep: bool = False) -> list[Path]:
    """Return the files of a folder with these suffixes, with `deep` those of its folders, too.

    Hidden ones are left out: what systems and version control add, and what is being written.
    """
    files = []
    for file in folder.rglob("*") if deep else folder.iterdir():
        is_hidden = any(name.startswith(".") for name in file.relative_to(folder).parts)
        if file.suffix.lower() in endings and not is_hidden and not file.is_dir():
            files.append(file)
    return sorted(files)


@contextmanager
def convert_errors(path: Path, problem: str = "cannot be written") -> Iterator[None]:
    """Raise errors of the system as `FileError` with the path and the problem."""
    try:
        yield
    except (FileError, BrokenPipeError):
        raise
    except OSError as error:
        raise FileError(f"{path} {problem}: {short_message(error)}") from error


@contextmanager
def format_errors(file: Path | str, kind: str) -> Iterator[None]:
    """Raise what goes wrong while a file of a kind is read as an error that names it."""
    try:
        yield
    except (FileError, ImportError, MemoryError):
        raise
    except RiemhumanError as error:
        raise FileFormatError(f"{file}: {error}") from error
    except Exception as error:  # a damaged file can make a parser raise any error
        if isinstance(error, OSError) and error.errno:
            raise FileError(f"{file} cannot be read: {short_message(error)}") from error
        raise FileFormatError(f"{file}: damaged, or not {kind}: {short_message(error)}") from error


def write_text(path: str | os.PathLike[str], text: str) -> None:
    """Write a text file in UTF-8 atomically."""
    write_bytes(path, text.encode("utf-8"))


def write_bytes(path: str | os.PathLike[str], content: bytes) -> None:
    """Write a file atomically."""
    with atomic_file(file_path(path)) as temporary:
        temporary.write_bytes(content)


@contextmanager
def lock_file(file: Path, message: str) -> Iterator[None]:
    """Lock a file until the process ends, or raise `FileError` if another process has the lock."""
    from filelock import FileLock, Timeout  # takes 60 ms

    lock = FileLock(file, timeout=0)
    with convert_errors(file, "cannot be locked"):
        try:
            lock.acquire()
        except Timeout as error:
            raise FileError(message) from error
        except NotImplementedError as error:  # of older versions, in a folder without locks
            raise FileError(f"{file} cannot be locked: {error}") from error
    try:
        yield
    finally:
        # While it is locked: later, another process may use it. Windows cannot remove open files.
        with suppress(OSError):
            file.unlink()
        lock.release()


def natural_key(name: str) -> tuple[list[str | tuple[int, str]], str]:
    """Return a sorting key that compares numbers within names as numbers."""
    # Text and numbers alternate, so that text is compared with text. A number with more digits is
    # larger; Python refuses to convert thousands of digits.
    parts = re.split(r"([0-9]+)", name.casefold())
    digits = [part.lstrip("0") for part in parts]
    return [(len(digits[k]), digits[k]) if k % 2 else part for k, part in enumerate(parts)], name
