"""The folder of a job: one process works in it at a time, and a kill leaves it consistent.

Tables are single .npy files, written in full at first, so that a disk that is too small is found at
once. A file is laid out under a name that ends in ``.part`` and then renamed, so
that a file without this suffix is complete. Entries of a table are filled in place, and count only
when the record beside the table marks them; a record is written after its entries have been
flushed.
"""

from __future__ import annotations

import json
import math
import os
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import TypeAlias

import numpy as np
from numpy.typing import ArrayLike, DTypeLike

from riemhuman.arrays import DType, JSONRecord, JSONValue, MemoryMap
from riemhuman.errors import ArgumentError, FileFormatError
from riemhuman.io.arrays import load_array
from riemhuman.io.files import (
    convert_errors,
    file_path,
    format_errors,
    is_being_written,
    is_of_system,
    lock_file,
    read_bytes,
    write_text,
)

MANIFEST = "manifest.json"
_LOCK = "job.lock"
_UNFINISHED = ".part"
_BLOCK = 2**20  # bytes that are written at a time


Index: TypeAlias = "int | slice[int, int, None] | tuple[int | slice[int, int, None], ...]"
"""Where entries of a table lie."""


class JobFolder:
    """A folder that holds one job; it must be empty or hold a job, and is made if need be."""

    def __init__(self, path: str | os.PathLike[str]) -> None:
        place = file_path(path, "folder", "folder")
        with convert_errors(place, "cannot be used as the folder of a job"):
            self.path = place.absolute()
            self.path.mkdir(parents=True, exist_ok=True)
            names = {entry.name for entry in os.scandir(self.path) if not is_of_system(entry)}
        # Beside its lock, a process killed at the start may have left an unnamed manifest;
        # and the output of the command may be there, too.
        ours = (_LOCK, *(n for n in names if n.startswith(".manifest.") or is_being_written(n)))
        foreign = sorted(names.difference(ours))
        if MANIFEST in names:
            self._manifest()
        elif foreign:
            more = f" and {len(foreign) - 1} more" if len(foreign) > 1 else ""
            raise ArgumentError(
                f"folder must be empty, or hold an earlier job; {self.path} holds "
                f"{foreign[0]}{more}"
            )

    @contextmanager
    def locked(self) -> Iterator[None]:
        """Keep other processes out; the system releases the lock when the process ends."""
        message = f"{self.path} is in use: another process is working on the job in it"
        with lock_file(self.path / _LOCK, message):
            yield

    def claim(
        self, described: Mapping[str, JSONValue], layout: Mapping[str, JSONValue]
    ) -> JSONRecord:
        """Write the manifest of a new job, or check that of an earlier run; return its layout."""
        file = self.path / MANIFEST
        with convert_errors(self.path):
            # Nobody else writes in a locked folder: these are of processes that were killed.
            for leftover in self.path.glob(f".manifest.*{_UNFINISHED}.json"):
                leftover.unlink(missing_ok=True)
        if not file.exists():
            write_text(file, json.dumps({**described, "layout": dict(layout)}, indent=1))
        manifest = self._manifest()
        stored_layout: JSONRecord = manifest.pop("layout")
        is_count = [type(count) is int and count >= 1 for count in stored_layout.values()]
        if stored_layout.keys() != layout.keys() or not all(is_count):
            raise FileFormatError(
                f"{file} is not the manifest of this job: its layout must give {', '.join(layout)} "
                "as whole numbers of at least 1"
            )
        difference = _first_difference(dict(described), manifest)
        if difference:
            raise ArgumentError(
                f"folder must be that of the same job; that in {self.path} differs: {difference}"
            )
        return stored_layout

    def exists(self, name: str) -> bool:
        """Return whether a table exists."""
        return (self.path / name).exists()

    def make_tables(self, tables: Mapping[str, tuple[tuple[int, ...], DTypeLike]]) -> None:
        """Make the tables that do not exist yet, of these shapes and types, filled with zeros."""
        missing = {name: table for name, table in tables.items() if not self.exists(name)}
        with convert_errors(self.path):
            for name in missing:
                (self.path / (name + _UNFINISHED)).unlink(missing_ok=True)
            for name, (shape, dtype) in missing.items():
                unfinished = self.path / (name + _UNFINISHED)
                try:
                    _allocate(unfinished, shape, np.dtype(dtype))
                    os.replace(unfinished, self.path / name)
                except BaseException:  # an interruption, too, leaves no unfinished table
                    unfinished.unlink(missing_ok=True)
                    raise

    def read(self, name: str) -> MemoryMap:
        """Return a table as a read-only memory map."""
        return load_array(self.path / name, mode="r")

    def write(self, name: str, *entries: tuple[Index, ArrayLike]) -> None:
        """Fill entries of a table, given as (index, values), and flush them to the disk."""
        # Opened each time: pages of a closed table no longer count as memory of the process.
        table = load_array(self.path / name, mode="r+")
        with convert_errors(self.path):
            for index, values in entries:
                table[index] = values
            table.flush()

    def rename(self, name: str, to: str) -> None:
        """Rename a table."""
        with convert_errors(self.path):
            os.replace(self.path / name, self.path / to)

    def remove(self, *names: str) -> None:
        """Remove tables, if they exist."""
        with convert_errors(self.path):
            for name in names:
                (self.path / name).unlink(missing_ok=True)

    def _manifest(self) -> JSONRecord:
        file = self.path / MANIFEST
        with format_errors(file, "the manifest of a job"):
            manifest = json.loads(read_bytes(file))
            if not isinstance(manifest, dict) or not isinstance(manifest.get("layout"), dict):
                raise FileFormatError("not the manifest of a job: it holds no layout")
            return manifest


def _allocate(file: Path, shape: tuple[int, ...], dtype: DType) -> None:
    """Write a table of zeros."""
    descr = np.lib.format.dtype_to_descr(dtype)
    header = {"descr": descr, "fortran_order": False, "shape": tuple(shape)}
    with file.open("wb") as stream:
        np.lib.format.write_array_header_1_0(stream, header)
        # The zeros are written: if the file had holes, a full disk would later kill the process.
        n_blocks, rest = divmod(math.prod(shape) * dtype.itemsize, _BLOCK)
        block = bytes(_BLOCK)
        for _ in range(n_blocks):
            stream.write(block)
        stream.write(bytes(rest))
        os.fsync(stream.fileno())


def _first_difference(expected: JSONValue, actual: JSONValue, where: str = "") -> str:
    """Return a sentence on the first place where two descriptions differ; empty if none does."""
    if isinstance(expected, dict) and isinstance(actual, dict):
        for key in [*expected, *(key for key in actual if key not in expected)]:
            difference = _first_difference(
                expected.get(key), actual.get(key), f"{where}.{key}" if where else key
            )
            if difference:
                return difference
        return ""
    if type(expected) is type(actual) and expected == actual:
        return ""
    return f"{where} is {actual!r:.200} there, {expected!r:.200} here"
