"""Sums over the triangles of all pairs of surfaces, tile by tile, from their features.

Rows of features are filled up with zeros, which add nothing to a distance, to whole vector
registers: F⁺ is F rounded up to a multiple of `LANES`. Sums run over chunks of triangles, always
the same ones, and over chunks in double precision: the bits of a distance depend on its two points
alone, not on other points, tiles or threads.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence

import numpy as np
from numpy import ndarray

from riemhuman.kernels.threads import mapped

LANES = 64
"""Rows of features are as long as a multiple of this."""

CHUNK = 512
"""Triangles summed in the precision of the features before they join the sum over all."""

LARGEST, SMALLEST = 1e15, 1e-15
"""Squares of numbers beyond these, and their products, leave the range of single precision."""

UNDERFLOW = 1e-34
"""What a square too small for single precision may add to a sum."""

# Pairs times values of one tile, so that features, which come from far in memory, are used often.
_TILE_WORK = 320_000_000
# Tiles for each of several threads, which then end at nearly the same time.
_TILES_A_THREAD = 4


def slices(n: int, size: int) -> Iterator[slice]:
    """Yield consecutive parts of range(n), all but the last of one size.

    Parameters
    ----------
    n, size : int
        Length of the whole and of a part.

    Yields
    ------
    slice
    """
    for start in range(0, n, size):
        yield slice(start, min(start + size, n))


def of_one_kind(array: ndarray) -> ndarray:
    """Return a read-only C-contiguous array, the kind that loops are compiled for.

    Loops over another kind would be compiled again, and could add up in another order.

    Parameters
    ----------
    array : array, shape (...)
        Any array; it is left alone.

    Returns
    -------
    array, shape (...)
    """
    view = np.ascontiguousarray(array).view()
    view.flags.writeable = False
    return view


def padded(shape: tuple[int, ...], precision: str) -> ndarray:
    """Return zeros with rows of whole vector registers.

    Parameters
    ----------
    shape : tuple of int
        The shape without the padding of rows.
    precision : {"single", "double"}
        Precision of the array.

    Returns
    -------
    array
    """
    *leading, length = shape
    whole = -(-length // LANES) * LANES
    return np.zeros((*leading, whole), dtype=np.float32 if precision == "single" else np.float64)


def rounding(gap: float, features: ndarray) -> float:
    """Return a bound on the rounding error of a point's features, as a distance.

    Parameters
    ----------
    gap : float
        Square of the distance, infinite where single precision has no room for the features.
    features : array of float32 or float64
        Features; rounding of double precision counts as none.

    Returns
    -------
    float
    """
    return math.sqrt(gap) if features.dtype == np.float32 else 0.0


def in_tiles(
    run: Callable[[tuple[tuple[ndarray, ...], tuple[ndarray, ...]]], ndarray],
    a: Sequence[ndarray],
    b: Sequence[ndarray],
    n_threads: int,
) -> ndarray:
    """Return sums over pairs, computed tile by tile in threads.

    Parameters
    ----------
    run : callable
        Takes a pair, some rows of all features of each set, and returns the sums over their pairs;
        given the same rows twice, those above the diagonal are enough.
    a, b : sequence of array, each of shape (n_a, ...) and (n_b, ...)
        Features; the same arrays twice for the pairs within one set.
    n_threads : int
        Number of threads.

    Returns
    -------
    array, shape (n_a, n_b)
    """
    within = all(one is other for one, other in zip(a, b, strict=True))
    a, b = tuple(map(of_one_kind, a)), tuple(map(of_one_kind, b))
    n_a, n_b = len(a[0]), len(b[0])
    squared = np.zeros((n_a, n_b))
    n_values = max(1, *(one[:1].size for one in a))
    n_pairs = _TILE_WORK / n_values
    if n_threads > 1:
        n_pairs = min(n_pairs, n_a * n_b / (_TILES_A_THREAD * n_threads))
    # Whole blocks of four, by which some loops go.
    size = 4 * int(np.clip(0.25 * math.sqrt(n_pairs) + 0.5, 2, 16))

    rows = [(i, tuple(one[i] for one in a)) for i in slices(n_a, size)]
    columns = rows if within else [(j, tuple(one[j] for one in b)) for j in slices(n_b, size)]
    places = [
        (row, column)
        for row in rows
        for column in columns
        if not within or row[0].start <= column[0].start
    ]
    tiles = mapped(run, ((row[1], column[1]) for row, column in places), n_threads)
    for ((i, _), (j, _)), tile in zip(places, tiles, strict=True):
        if within and i == j:
            tile = np.triu(tile, 1)
            tile += tile.T
        elif within:
            squared[j, i] = tile.T
        squared[i, j] = tile
    return squared
