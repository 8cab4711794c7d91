"""Named arrays in .npz files and single arrays in .npy files, without pickled objects.

The size that a file declares for an array is compared with the size of its data before any memory
is allocated.
"""

from __future__ import annotations

import io
import math
import os
import zipfile
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import MISSING, Field, fields
from typing import IO, TYPE_CHECKING, Any, Literal, TypeAlias, overload

import numpy as np

from riemhuman.arrays import DType, MemoryMap, Values
from riemhuman.checks import checked, flag, instance
from riemhuman.checks.labels import texts_of
from riemhuman.errors import ArgumentTypeError, FileFormatError
from riemhuman.io.files import atomic_file, check_file, file_path, format_errors

if TYPE_CHECKING:
    from _typeshed import DataclassInstance

StoredField: TypeAlias = Any  # type: ignore[explicit-any]  # of the type that its field has
"""An array, a number or a text."""

# Numbers rarely compress further than this factor; zeros do, hence the fixed allowance in bytes.
_LARGEST_COMPRESSION = 64
_ALLOWANCE = 2**27
# Bytes of memory for an entry: a number in double precision, or the overhead of a Python string.
_BYTES_OF_NUMBER = 8
_BYTES_OF_STRING = 64
_SUFFIX = ".npy"
_LONGEST_HEADER = 2**16
_LAST_CHARACTER = 0x10FFFF


@checked(arrays=instance(Mapping, "a mapping of names to arrays"), compressed=flag)
def save_arrays(
    path: str | os.PathLike[str], arrays: Mapping[str, object], *, compressed: bool = False
) -> None:
    """Write named arrays to an .npz file atomically.

    Parameters
    ----------
    path : path_like
        The file, with its suffix; an existing file is replaced.
    arrays : mapping of str to array_like
    compressed : bool

    Examples
    --------
    >>> rh.io.save_arrays("lengths.npz", {"arms": [0.61, 0.63]})
    >>> rh.io.load_arrays("lengths.npz", ["arms"])["arms"]
    array([0.61, 0.63])
    """
    plain = {name: _plain_array(array, name) for name, array in arrays.items()}
    for name, array in plain.items():
        if array.dtype.hasobject:
            raise ArgumentTypeError(f"{name} must hold numbers or text; found {arrays[name]!r:.60}")
    compression = zipfile.ZIP_DEFLATED if compressed else zipfile.ZIP_STORED
    # `np.savez` of NumPy 2.0 would leave the archive open when the disk is full.
    with (
        atomic_file(file_path(path)) as temporary,
        zipfile.ZipFile(temporary, "w", compression) as archive,
    ):
        for name, array in plain.items():
            with archive.open(name + _SUFFIX, "w", force_zip64=True) as member:
                np.lib.format.write_array(member, array, allow_pickle=False)


def _plain_array(array: object, name: str) -> Values:
    try:
        return np.asanyarray(array)
    except ValueError as error:
        raise ArgumentTypeError(f"{name} must be an array; its items differ in shape") from error


def fields_of(item: DataclassInstance) -> dict[str, object]:
    """Return the fields of a data class by name, as `save_arrays` takes them."""
    return {field.name: getattr(item, field.name) for field in fields(item)}


def stored_fields(
    cls: type[DataclassInstance], arrays: Mapping[str, Values]
) -> dict[str, StoredField]:
    """Return stored fields of a data class by name: arrays, and numbers and texts as scalars.

    Fields with defaults may be missing, as in files of earlier releases.
    """
    required = [field.name for field in fields(cls) if not _has_default(field)]
    check_fields(arrays, required)
    found = {field.name: arrays[field.name] for field in fields(cls) if field.name in arrays}
    return {name: array if array.ndim else array.item() for name, array in found.items()}


def _has_default(field: Field[object]) -> bool:
    return field.default is not MISSING or field.default_factory is not MISSING


@checked(required=texts_of, optional=texts_of)
def load_arrays(
    path: str | os.PathLike[str], required: Sequence[str], optional: Sequence[str] | None = None
) -> dict[str, Values]:
    """Read the named arrays of an .npz file.

    Parameters
    ----------
    path : path_like
    required : sequence of str
        Arrays that the file must contain.
    optional : sequence of str, optional
        Arrays to read if the file contains them; by default all. Others are not read.

    Examples
    --------
    >>> rh.io.save_arrays("lengths.npz", {"arms": [0.61, 0.63], "legs": [0.9, 0.88]})
    >>> list(rh.io.load_arrays("lengths.npz", ["arms"], optional=[]))
    ['arms']
    """
    arrays = {}
    with _open_archive(path) as (archive, members, limit):
        names = members if optional is None else [*required, *optional]
        check_fields(members, required)
        for name, member in members.items():
            if name in names:
                limit -= memory_size(*_header(archive, member, limit))
                with archive.open(member) as stream:
                    arrays[name] = np.lib.format.read_array(stream, allow_pickle=False)
                check_characters(arrays[name])
    return arrays


def array_names(path: str | os.PathLike[str]) -> list[str]:
    """Return the names of all arrays of an .npz file."""
    with _open_archive(path) as (_, members, _):
        return list(members)


def array_headers(
    path: str | os.PathLike[str], names: Sequence[str]
) -> dict[str, tuple[tuple[int, ...], DType]]:
    """Return shapes and types of those arrays of an .npz file that are there, without data."""
    with _open_archive(path) as (archive, members, limit):
        return {name: _header(archive, members[name], limit) for name in names if name in members}


def check_fields(fields: Iterable[str], required: Iterable[str]) -> None:
    """Raise an error if a file lacks some fields."""
    missing = [name for name in required if name not in fields]
    if missing:
        listed = ", ".join(name[:60] for name in sorted(fields)[:20])
        raise FileFormatError(f"lacks the fields {', '.join(missing)}; found {listed or 'none'}")


@contextmanager
def _open_archive(
    path: str | os.PathLike[str],
) -> Iterator[tuple[zipfile.ZipFile, dict[str, zipfile.ZipInfo], int]]:
    """Open an .npz file; yield it, its members by name, and the memory that they may take."""
    file = file_path(path)
    limit = memory_limit(check_file(file))
    with (
        format_errors(file, "an .npz archive of plain arrays"),
        zipfile.ZipFile(file) as archive,
    ):
        members = {
            member.filename.removesuffix(_SUFFIX): member
            for member in archive.infolist()
            if member.filename.endswith(_SUFFIX)
        }
        yield archive, members, limit


def _header(
    archive: zipfile.ZipFile, member: zipfile.ZipInfo, limit: int
) -> tuple[tuple[int, ...], DType]:
    """Return the shape and type of an array that takes at most `limit` bytes of memory."""
    with archive.open(member) as stream:
        shape, dtype = _read_header(stream, member.file_size)
    if memory_size(shape, dtype) > limit:
        raise FileFormatError(
            "its arrays would take far more memory than a file of this size should"
        )
    return shape, dtype


@overload
def load_array(path: str | os.PathLike[str], *, mode: None = None) -> Values: ...
@overload
def load_array(path: str | os.PathLike[str], *, mode: Literal["r", "r+"]) -> MemoryMap: ...
def load_array(path: str | os.PathLike[str], *, mode: Literal["r", "r+"] | None = None) -> Values:
    """Read the array of an .npy file, or map it into memory.

    Parameters
    ----------
    path : path_like
    mode : {"r", "r+"}, optional
        Mode of a memory map; by default the array is read.

    Examples
    --------
    >>> np.save("heights.npy", [1.68, 1.81])
    >>> rh.io.load_array("heights.npy")
    array([1.68, 1.81])
    """
    file = file_path(path)
    size = check_file(file)
    with format_errors(file, "an .npy file of a plain array"):
        with file.open("rb") as stream:
            _read_header(stream, size)
        array: Values = np.load(file, mmap_mode=mode, allow_pickle=False)
        check_characters(array)
        return array


def memory_limit(size: int) -> int:
    """Return how many bytes of memory the content of a compressed file of `size` bytes may take."""
    return _ALLOWANCE + _LARGEST_COMPRESSION * size


def memory_size(shape: Sequence[int], dtype: DType) -> int:
    """Return how many bytes an array takes in memory, as double precision or as Python strings."""
    if dtype.kind in "SU":
        return math.prod(map(int, shape)) * (dtype.itemsize + _BYTES_OF_STRING)
    return math.prod(map(int, shape)) * max(dtype.itemsize, _BYTES_OF_NUMBER)


def check_characters(array: Values) -> None:
    """Raise an error if an array of text has code points beyond Unicode, which crash Python."""
    if array.dtype.kind != "U" or array.size == 0 or array.dtype.itemsize == 0:
        return
    plain = np.ascontiguousarray(array).reshape(-1)
    codes = plain.view(np.dtype(np.uint32).newbyteorder(array.dtype.byteorder))
    if codes.max() > _LAST_CHARACTER:
        raise FileFormatError(
            f"its text contains invalid characters, such as code {codes.max():#x}"
        )


def _read_header(stream: IO[bytes], size: int) -> tuple[tuple[int, ...], DType]:
    """Return the shape and type of an array; check them against the size of its file."""
    start = io.BytesIO(stream.read(_LONGEST_HEADER))  # which may claim any length
    is_old = np.lib.format.read_magic(start) == (1, 0)
    read = np.lib.format.read_array_header_1_0 if is_old else np.lib.format.read_array_header_2_0
    shape, _, dtype = read(start)
    if dtype.hasobject:
        raise FileFormatError("it holds Python objects")
    needed, available = math.prod(shape) * dtype.itemsize, size - start.tell()
    # Entries of zero bytes need no data, so that a few bytes could declare any number of them.
    if min(shape, default=0) < 0 or needed != available or math.prod(shape) > size:
        raise FileFormatError(
            f"an array of shape {shape} and type {dtype} takes {needed} bytes; found {available}"
        )
    return shape, dtype
