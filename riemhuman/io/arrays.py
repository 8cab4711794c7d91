"""Named arrays in .npz files and single arrays in .npy files, without pickled objects."""

from __future__ import annotations

import os
import zipfile
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import MISSING, Field, fields
from typing import TYPE_CHECKING, Any, Literal, TypeAlias, overload

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

_SUFFIX = ".npy"


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
    with _open_archive(path) as (archive, members):
        names = members if optional is None else [*required, *optional]
        check_fields(members, required)
        for name, member in members.items():
            if name in names:
                with archive.open(member) as stream:
                    arrays[name] = np.lib.format.read_array(stream, allow_pickle=False)
    return arrays


def array_names(path: str | os.PathLike[str]) -> list[str]:
    """Return the names of all arrays of an .npz file."""
    with _open_archive(path) as (_, members):
        return list(members)


def array_headers(
    path: str | os.PathLike[str], names: Sequence[str]
) -> dict[str, tuple[tuple[int, ...], DType]]:
    """Return shapes and types of those arrays of an .npz file that are there, without data."""
    headers = {}
    with _open_archive(path) as (archive, members):
        for name in members.keys() & set(names):
            with archive.open(members[name]) as stream:
                is_old = np.lib.format.read_magic(stream) == (1, 0)
                read = (
                    np.lib.format.read_array_header_1_0
                    if is_old
                    else np.lib.format.read_array_header_2_0
                )
                shape, _, dtype = read(stream)
                headers[name] = shape, dtype
    return headers


def check_fields(fields: Iterable[str], required: Iterable[str]) -> None:
    """Raise an error if a file lacks some fields."""
    missing = [name for name in required if name not in fields]
    if missing:
        listed = ", ".join(name[:60] for name in sorted(fields)[:20])
        raise FileFormatError(f"lacks the fields {', '.join(missing)}; found {listed or 'none'}")


@contextmanager
def _open_archive(
    path: str | os.PathLike[str],
) -> Iterator[tuple[zipfile.ZipFile, dict[str, zipfile.ZipInfo]]]:
    """Open an .npz file; yield it and its members by name."""
    file = file_path(path)
    check_file(file)
    with (
        format_errors(file, "an .npz archive of plain arrays"),
        zipfile.ZipFile(file) as archive,
    ):
        members = {
            member.filename.removesuffix(_SUFFIX): member
            for member in archive.infolist()
            if member.filename.endswith(_SUFFIX)
        }
        yield archive, members


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
    check_file(file)
    with format_errors(file, "an .npy file of a plain array"):
        array: Values = np.load(file, mmap_mode=mode, allow_pickle=False)
        return array
