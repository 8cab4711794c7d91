"""Named arrays in .npz files, which appear whole or not at all and are read without unpickling.

The size that a file declares for an array is compared with the size of its data before any memory
is allocated.
"""

from __future__ import annotations

import math
import os
import zipfile
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from typing import IO, Any

import numpy as np

from riemhuman.errors import FileError, FileFormatError
from riemhuman.io.files import atomic_file, check_file, file_path, short_message

# Numbers rarely compress further than this factor; zeros do, hence the fixed allowance in bytes.
_MOST_COMPRESSED, _ROOM = 64, 2**27
# Bytes of memory for an entry: a number in double precision, or the overhead of a Python string.
_NUMBER, _TEXT = 8, 64
_COMPRESSIONS = (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED)
_ENDING = ".npy"
_LAST_CHARACTER = 0x10FFFF


def save_arrays(
    path: str | os.PathLike[str], arrays: Mapping[str, Any], *, compressed: bool = False
) -> None:
    """Write named arrays to an .npz file, which appears whole or not at all.

    Parameters
    ----------
    path : path_like
        The file, with its suffix; an existing file is replaced.
    arrays : mapping of str to array
        The arrays by name.
    compressed : bool
        Whether the file is compressed.

    Raises
    ------
    ArgumentTypeError
        If `path` is not a path.
    FileError
        If the file cannot be written.
    """
    compression = zipfile.ZIP_DEFLATED if compressed else zipfile.ZIP_STORED
    # `np.savez` of NumPy 2.0 would leave the archive open when the disk is full.
    with (
        atomic_file(file_path(path)) as neighbour,
        zipfile.ZipFile(neighbour, "w", compression) as archive,
    ):
        for name, array in arrays.items():
            with archive.open(name + _ENDING, "w", force_zip64=True) as member:
                np.lib.format.write_array(member, np.asanyarray(array), allow_pickle=False)


def load_arrays(
    path: str | os.PathLike[str], required: Sequence[str], optional: Sequence[str] | None = None
) -> dict[str, np.ndarray]:
    """Read the named arrays of an .npz file; pickled objects are refused.

    Parameters
    ----------
    path : path_like
        The file.
    required : sequence of str
        Arrays that the file must contain.
    optional : sequence of str, optional
        Arrays to read if the file contains them; by default all. Others are left unread.

    Raises
    ------
    ArgumentTypeError
        If `path` is not a path.
    FileError
        If the file is missing or cannot be read.
    FileFormatError
        If it is not an .npz archive of plain arrays, lacks a required array, or declares more data
        than a file of its size may hold.
    """
    with open_archive(path) as archive:
        found = archive.names
        wanted = found if optional is None else [*required, *optional]
        arrays = archive.arrays([name for name in found if name in wanted])
    missing = [name for name in required if name not in found]
    if missing:
        listed = ", ".join(name[:60] for name in sorted(found)[:20])
        raise FileFormatError(
            f"{path} lacks the fields {', '.join(missing)}; found {listed or 'none'}"
        )
    return arrays


class ArrayArchive:
    """The arrays of an .npz file that is open for reading.

    Parameters
    ----------
    archive : zipfile.ZipFile
        The archive.
    size : int
        Bytes of the file.
    """

    def __init__(self, archive: zipfile.ZipFile, size: int) -> None:
        self._archive = archive
        self._left = self._most = memory_limit(size)
        self._members: dict[str, zipfile.ZipInfo] = {}
        names: set[str] = set()
        for member in archive.infolist():
            name = member.filename.removesuffix(_ENDING)
            # NumPy would prefer a member without the suffix.
            if name in names:
                raise FileFormatError(f"it holds {name[:60]} twice")
            names.add(name)
            if name != member.filename:
                self._members[name] = member

    @property
    def names(self) -> list[str]:
        """Names of the arrays, in the order of the file."""
        return list(self._members)

    def shape(self, name: str) -> tuple[int, ...]:
        """Return the shape of an array without reading its data.

        Parameters
        ----------
        name : str
            Name of the array.
        """
        return self._header(name)[0]

    def _header(self, name: str) -> tuple[tuple[int, ...], np.dtype[Any]]:
        member = self._members[name]
        if member.compress_type not in _COMPRESSIONS:
            raise FileFormatError(f"{name[:60]} is compressed by another method than deflate")
        with self._archive.open(member) as stream:
            shape, _, dtype = read_array_header(stream, member.file_size)
        if memory_size(shape, dtype) > self._most:
            raise FileFormatError("its arrays take far more room than a file of its size may")
        return shape, dtype

    def arrays(self, names: Sequence[str]) -> dict[str, np.ndarray]:
        """Read arrays.

        Parameters
        ----------
        names : sequence of str
            Names of the arrays.
        """
        found = {}
        for name in names:
            self._left -= memory_size(*self._header(name))
            if self._left < 0:
                raise FileFormatError("its arrays take far more room than a file of its size may")
            with self._archive.open(self._members[name]) as stream:
                found[name] = np.lib.format.read_array(stream, allow_pickle=False)
            check_text(found[name])
        return found


@contextmanager
def open_archive(path: str | os.PathLike[str]) -> Iterator[ArrayArchive]:
    """Open an .npz file for reading.

    Parameters
    ----------
    path : path_like
        The file.

    Raises
    ------
    ArgumentTypeError
        If `path` is not a path.
    FileError
        If the file is missing or cannot be read.
    FileFormatError
        If it is not an .npz archive of plain arrays, at the opening or when an array is read.
    """
    file = file_path(path)
    size = check_file(file)
    try:
        with file.open("rb") as stream, zipfile.ZipFile(stream) as archive:
            stream.seek(0)
            if stream.read(2) != b"PK":
                raise FileFormatError("the archive does not begin at the first byte")
            yield ArrayArchive(archive, size)
    except OSError as error:
        raise FileError(f"{file} cannot be read: {short_message(error)}") from error
    except Exception as error:  # a damaged archive can make the parser raise any error
        raise FileFormatError(
            f"{file} is not an .npz archive of plain arrays: {short_message(error)}"
        ) from error


def load_array(path: str | os.PathLike[str], *, mode: Any = None) -> np.ndarray:
    """Read or map the array of an .npy file; pickled objects are refused.

    Parameters
    ----------
    path : path_like
        The file.
    mode : {"r", "r+"}, optional
        Mode of a memory map; by default the array is read.

    Raises
    ------
    ArgumentTypeError
        If `path` is not a path.
    FileError
        If the file is missing or cannot be read.
    FileFormatError
        If it is not an .npy file of a plain array.
    """
    file = file_path(path)
    size = check_file(file)
    try:
        with file.open("rb") as stream:
            read_array_header(stream, size)
        array = np.load(file, mmap_mode=mode, allow_pickle=False)
        check_text(array)
        return array
    except OSError as error:
        raise FileError(f"{file} cannot be read: {short_message(error)}") from error
    except Exception as error:  # whatever a damaged file makes a parser stumble over
        raise FileFormatError(
            f"{file} is not an .npy file of a plain array: {short_message(error)}"
        ) from error


def memory_limit(size: int) -> int:
    """Return how many bytes of memory the content of a compressed file may take.

    Parameters
    ----------
    size : int
        Bytes of the file.
    """
    return _ROOM + _MOST_COMPRESSED * size


def memory_size(shape: Sequence[int], dtype: np.dtype[Any]) -> int:
    """Return how many bytes an array takes in memory, as double precision or as Python strings.

    Parameters
    ----------
    shape : sequence of int
        Its shape.
    dtype : dtype
        Type of its entries in the file.
    """
    of_one = dtype.itemsize + _TEXT if dtype.kind in "SU" else max(dtype.itemsize, _NUMBER)
    return math.prod(map(int, shape)) * of_one


def map_array(stream: IO[bytes], mode: Any) -> np.memmap:
    """Map the array of an open .npy file into memory.

    Parameters
    ----------
    stream : file object
        The file, at its beginning.
    mode : {"r", "r+"}
        Mode of the memory map, and of the file.

    Raises
    ------
    FileFormatError
        If it is not an .npy file of a plain array of numbers.
    """
    try:
        shape, in_columns, dtype = read_array_header(stream, os.fstat(stream.fileno()).st_size)
        order: Any = "F" if in_columns else "C"
        return np.memmap(stream, dtype, mode, offset=stream.tell(), shape=shape, order=order)
    except (OSError, FileFormatError):
        raise
    except Exception as error:  # whatever a damaged file makes a parser stumble over
        raise FileFormatError(
            f"it is not an .npy file of a plain array: {short_message(error)}"
        ) from error


def check_text(array: np.ndarray) -> None:
    """Refuse an array of text with code points beyond Unicode.

    Parameters
    ----------
    array : array
        Any array.
    """
    if array.dtype.kind != "U" or array.size == 0 or array.dtype.itemsize == 0:
        return
    plain = np.ascontiguousarray(array).reshape(-1)
    codes = plain.view(np.dtype(np.uint32).newbyteorder(array.dtype.byteorder))
    if codes.max() > _LAST_CHARACTER:
        raise FileFormatError(f"its text holds characters that do not exist, as {codes.max():#x}")


def read_array_header(stream: IO[bytes], size: int) -> tuple[tuple[int, ...], bool, np.dtype[Any]]:
    """Read the header of an .npy file and compare it with the size of the file.

    Parameters
    ----------
    stream : file object
        The file, at its beginning; afterwards at the data.
    size : int
        Bytes of the file.

    Returns
    -------
    shape : tuple of int
    in_columns : bool
        Whether the first index runs fastest.
    dtype : dtype

    Raises
    ------
    FileFormatError
        If the array holds Python objects, or the amount of data does not match its shape and type.
    """
    is_old = np.lib.format.read_magic(stream) == (1, 0)
    start = stream.tell()
    length = int.from_bytes(stream.read(2 if is_old else 4), "little")
    if length > size:
        raise FileFormatError(f"its header claims {length} bytes")
    stream.seek(start)
    read = np.lib.format.read_array_header_1_0 if is_old else np.lib.format.read_array_header_2_0
    shape, in_columns, dtype = read(stream)
    if dtype.hasobject:
        raise FileFormatError("it holds objects of Python")
    needed, found = math.prod(shape) * dtype.itemsize, size - stream.tell()
    # Entries of zero bytes need no data, so that a few bytes could declare any number of them.
    if min(shape, default=0) < 0 or needed != found or math.prod(shape) > size:
        raise FileFormatError(
            f"an array of shape {shape} and type {dtype} takes {needed} bytes; found {found}"
        )
    return shape, in_columns, dtype
