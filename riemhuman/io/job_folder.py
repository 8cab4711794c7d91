"""The folder of a job: one process works in it at a time, and a kill leaves it consistent."""

from __future__ import annotations

import json
import math
import os
import shutil
import zlib
from collections.abc import Iterator, Mapping
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import IO, Any

import numpy as np
from numpy import ndarray

from riemhuman.errors import ArgumentError, FileError, FileFormatError
from riemhuman.io.arrays import map_array
from riemhuman.io.files import file_path, lock_file, make_own, open_own, read_bytes, short_message

# A mark holds these bits beside the checksum: no single flipped bit turns 0 into a mark.
_DONE, _SHIFT = 0xA5, 32


def checksums(rows: ndarray) -> ndarray:
    """Return the checksum (CRC-32) of every row of an array.

    Parameters
    ----------
    rows : array, shape (n, ...)
        Any array; its order in memory does not matter.

    Returns
    -------
    array of uint32, shape (n,)
    """
    plain = np.ascontiguousarray(rows).reshape(len(rows), -1).view(np.uint8)
    return np.array([zlib.crc32(row.data) for row in plain], dtype=np.uint32)


def mark(block: ndarray) -> int:
    """Return the mark of a finished tile, which holds its checksum.

    Parameters
    ----------
    block : array, shape (n_rows, n_columns)
        Its distances.

    Returns
    -------
    int
        Never 0.
    """
    return _DONE << _SHIFT | zlib.crc32(np.ascontiguousarray(block).data)


def are_marks(marks: ndarray) -> bool:
    """Tell whether all numbers are marks of finished tiles, or 0.

    Parameters
    ----------
    marks : array of uint64
        The numbers; 0 stands for an unfinished tile.
    """
    return bool(np.all((marks == 0) | (marks >> np.uint64(_SHIFT) == _DONE)))


MANIFEST = "manifest.json"
LOCK = "job.lock"
_UNFINISHED = ".part"
# The beginning of every manifest.
_BEGINNING = b'{\n "format": "riemhuman pairwise job'


class JobFolder:
    """A folder that holds one job.

    Parameters
    ----------
    path : path_like
        The folder, which must be empty or hold a job; it and its parents are made if need be.

    Raises
    ------
    ArgumentTypeError
        If `path` is not a path.
    ArgumentError
        If the folder holds anything but a job.
    FileError
        If the folder cannot be made, or a file of the job is a link or has a second name.
    FileFormatError
        If the manifest of the job is damaged.
    """

    def __init__(self, path: str | os.PathLike[str]) -> None:
        self.path = file_path(path, "folder", "folder").absolute()
        with self._system_errors("cannot be used as the folder of a job"):
            self.path.mkdir(parents=True, exist_ok=True)
            names = {entry.name for entry in self.path.iterdir()}
            for name in names & {LOCK, MANIFEST, MANIFEST + _UNFINISHED}:
                self._opened(name, os.O_RDONLY).close()
        others = sorted(names - {LOCK, MANIFEST + _UNFINISHED})
        if others and MANIFEST not in names:
            raise ArgumentError(
                f"folder must be empty, or hold a job begun before; {self.path} holds {others[0]}"
                + (f" and {len(others) - 1} more" if len(others) > 1 else "")
            )
        if MANIFEST in names:
            self._manifest()

    @contextmanager
    def locked(self) -> Iterator[None]:
        """Keep other processes out; the system releases the lock when the process ends.

        Raises
        ------
        FileError
            If another process is at work in the folder.
        """
        with ExitStack() as stack:
            with self._system_errors("cannot be locked"):
                busy = f"{self.path} is in use: another process is at work on the job in it"
                stack.enter_context(lock_file(self.path / LOCK, busy))
            yield

    def claim(self, described: Mapping[str, Any], layout: Mapping[str, Any]) -> dict[str, Any]:
        """Write the manifest of a new job, or compare the job with the manifest of an earlier run.

        Parameters
        ----------
        described : mapping
            What the job computes, made of values that JSON keeps exactly.
        layout : mapping
            How the tables of a new job are divided.

        Returns
        -------
        dict
            The layout to use: that of the earlier run, if there was one.

        Raises
        ------
        ArgumentError
            If the folder holds another job.
        FileFormatError
            If the manifest is damaged.
        FileError
            If the folder cannot be written.
        """
        file = self.path / MANIFEST
        if not file.exists():
            text = json.dumps({**described, "layout": dict(layout)}, indent=1)
            with self._system_errors("cannot be written"):
                unfinished = self.path / (MANIFEST + _UNFINISHED)
                self._remove_begun(unfinished)
                with open(make_own(unfinished), "w", encoding="utf-8") as stream:
                    stream.write(text)
                    stream.flush()
                    os.fsync(stream.fileno())
                self._rename(unfinished, file)
        found = self._manifest()
        kept = found.pop("layout")
        if kept.keys() != layout.keys() or not all(map(_is_count, kept.values())):
            raise FileFormatError(
                f"{file} is not the manifest of this job: its layout must give {', '.join(layout)} "
                "as whole numbers of at least 1"
            )
        difference = _first_difference(dict(described), found)
        if difference:
            raise ArgumentError(
                f"folder must be that of the same job; that in {self.path} differs: {difference}"
            )
        return kept

    def exists(self, name: str) -> bool:
        """Tell whether a table exists.

        Parameters
        ----------
        name : str
            Name of the file.
        """
        return (self.path / name).exists()

    def make_tables(self, tables: Mapping[str, tuple[tuple[int, ...], Any]]) -> None:
        """Make the tables that do not exist yet, filled with zeros.

        Disk space for all entries is reserved at once, so that a disk that is too small is found
        before anything is computed.

        Parameters
        ----------
        tables : mapping of str to (shape, dtype)
            The tables.

        Raises
        ------
        FileError
            If there is no room for them.
        FileFormatError
            If an existing table has another shape or type.
        """
        missing = {}
        for name, (shape, dtype) in tables.items():
            if not self.exists(name):
                missing[name] = (shape, np.dtype(dtype))
                continue
            table = self.read(name)
            if table.shape != tuple(shape) or table.dtype != dtype:
                raise FileFormatError(
                    f"{self.path / name} is damaged: it must hold {dtype} of shape {shape}; found "
                    f"{table.dtype} of shape {table.shape}"
                )
        with self._system_errors("cannot be written"):
            for name in missing:
                self._remove(name + _UNFINISHED)
            needed = sum(math.prod(shape) * dtype.itemsize for shape, dtype in missing.values())
            free = shutil.disk_usage(self.path).free
            if needed > free:
                raise FileError(
                    f"{self.path} has no room for the job: {needed / 1e9:.3g} GB are needed, "
                    f"{free / 1e9:.3g} GB are free"
                )
            for name, (shape, dtype) in missing.items():
                unfinished = self.path / (name + _UNFINISHED)
                try:
                    _lay_out(unfinished, shape, dtype)
                    self._rename(unfinished, self.path / name)
                except BaseException:
                    unfinished.unlink(missing_ok=True)
                    raise

    def read(self, name: str) -> np.memmap:
        """Open a table for reading.

        Parameters
        ----------
        name : str
            Name of the file.

        Returns
        -------
        memmap
            Read-only.

        Raises
        ------
        FileError
            If the file is missing or cannot be read.
        FileFormatError
            If it is not a table.
        """
        return self._open(name, "r")

    def write(self, name: str, *entries: tuple[Any, Any]) -> None:
        """Fill entries of a table and flush them to the disk.

        Parameters
        ----------
        name : str
            Name of the file.
        *entries : tuple of (index, values)
            Values and where they go.

        Raises
        ------
        FileError
            If the disk fails.
        """
        # Opened each time: pages of a closed table no longer count as memory of the process.
        table = self._open(name, "r+")
        with self._system_errors("cannot be written"):
            for index, values in entries:
                table[index] = values
            table.flush()

    def rename(self, name: str, to: str) -> None:
        """Rename a table.

        Parameters
        ----------
        name, to : str
            Old and new name of the file.

        Raises
        ------
        FileError
            If the file cannot be renamed.
        """
        with self._system_errors("cannot be written"):
            self._rename(self.path / name, self.path / to)

    def remove(self, *names: str) -> None:
        """Remove tables, if they exist.

        Parameters
        ----------
        *names : str
            Names of the files.

        Raises
        ------
        FileError
            If a file cannot be removed.
        """
        with self._system_errors("cannot be written"):
            for name in names:
                self._remove(name)

    def _remove(self, name: str) -> None:
        if os.path.lexists(self.path / name):
            self._opened(name, os.O_RDONLY).close()
            (self.path / name).unlink(missing_ok=True)

    def _opened(self, name: str, flags: int) -> IO[bytes]:
        return open(open_own(self.path / name, flags), "r+b" if flags & os.O_RDWR else "rb")

    def _rename(self, file: Path, to: Path) -> None:
        if os.path.lexists(to):
            raise FileError(f"{to} appeared while the job was at work; move it away")
        os.replace(file, to)

    def _remove_begun(self, unfinished: Path) -> None:
        """Remove the unfinished manifest of a killed process, and nothing else."""
        if not os.path.lexists(unfinished):
            return
        with self._opened(unfinished.name, os.O_RDONLY) as stream:
            found = stream.read(len(_BEGINNING))
        # After a power failure, a file may hold zeros in place of its content.
        if found.strip(b"\0") and found != _BEGINNING[: len(found)]:
            raise FileError(f"{unfinished} is no part of a job; move it away")
        unfinished.unlink()

    def _manifest(self) -> dict[str, Any]:
        file = self.path / MANIFEST
        content = read_bytes(file)
        try:
            found = json.loads(content)
        except (ValueError, RecursionError) as error:
            raise FileFormatError(
                f"{file} is not the manifest of a job: {short_message(error)}"
            ) from error
        if not isinstance(found, dict) or not isinstance(found.get("layout"), dict):
            raise FileFormatError(f"{file} is not the manifest of a job: it holds no layout")
        return found

    def _open(self, name: str, mode: Any) -> Any:
        file = self.path / name
        try:
            with self._opened(name, os.O_RDWR if mode == "r+" else os.O_RDONLY) as stream:
                table = map_array(stream, mode)
            table.filename = str(file)
            return table
        except FileFormatError as error:
            raise FileFormatError(f"{file} is not a table of a job: {error}") from error
        except FileError:
            raise
        except OSError as error:
            raise FileError(f"{file} cannot be opened: {error.strerror or error}") from error

    @contextmanager
    def _system_errors(self, what: str) -> Iterator[None]:
        try:
            yield
        except FileError:
            raise
        except OSError as error:
            raise FileError(f"{self.path} {what}: {error.strerror or error}") from error


def _lay_out(file: Path, shape: tuple[int, ...], dtype: np.dtype[Any]) -> None:
    """Write a table of zeros, all of whose disk space is reserved at once."""
    header = {
        "descr": np.lib.format.dtype_to_descr(dtype),
        "fortran_order": False,
        "shape": tuple(shape),
    }
    size = math.prod(shape) * dtype.itemsize
    with open(make_own(file), "wb") as stream:
        np.lib.format.write_array_header_1_0(stream, header)
        stream.flush()
        if size and hasattr(os, "posix_fallocate"):
            os.posix_fallocate(stream.fileno(), stream.tell(), size)
        else:
            # If the file had holes, a full disk would later kill the process by a signal.
            zeros = bytes(2**20)
            for start in range(0, size, len(zeros)):
                stream.write(zeros[: size - start])
            stream.flush()
        os.fsync(stream.fileno())


def _first_difference(wanted: Any, found: Any, where: str = "") -> str:
    """Describe the first place where two descriptions differ; empty if they are equal."""
    if isinstance(wanted, dict) and isinstance(found, dict):
        for key in [*wanted, *(key for key in found if key not in wanted)]:
            difference = _first_difference(
                wanted.get(key), found.get(key), f"{where}.{key}" if where else key
            )
            if difference:
                return difference
        return ""
    if type(wanted) is type(found) and wanted == found:
        return ""
    return f"{where} is {found!r:.200} there, {wanted!r:.200} here"


def _is_count(value: Any) -> bool:
    return type(value) is int and value >= 1
