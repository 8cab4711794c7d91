"""Checksums of the tables of a job, which reveal damage before the data are used."""

from __future__ import annotations

import zlib

import numpy as np
from numpy import ndarray

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
