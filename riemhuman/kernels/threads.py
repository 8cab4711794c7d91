"""Threads and tiles for bulk work, whose results do not depend on how many threads run.

Rows of features are filled up with zeros, which add nothing to a distance, to whole vector
registers: F⁺ is F rounded up to a multiple of `LANES`. Sums run over chunks of triangles, always
the same ones, and over chunks in double precision: the bits of a distance depend on its two points
alone, not on other points, tiles or threads.
"""

from __future__ import annotations

import functools
import math
import os
import sys
import threading
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from typing import TypeAlias, TypeVar, TypeVarTuple

import numpy as np
from scipy import sparse
from threadpoolctl import ThreadpoolController

from riemhuman.arrays import Array, Integers, TangentVectors
from riemhuman.checks import whole_number
from riemhuman.errors import ArgumentError

N_CHUNKS = 4

# Columns of long rows that BLAS multiplies at a time, after copying them within the cache.
_IN_CACHE = 16384

# With fewer numbers, starting threads takes longer than they save.
_FEWEST_FOR_THREADS = 500_000

Run: TypeAlias = "slice[int, int, None]"
"""Consecutive numbers of a range."""

Item = TypeVar("Item")
Result = TypeVar("Result")
Sums = TypeVarTuple("Sums")
Kind = TypeVar("Kind", Array, Integers)


def in_chunks(task: Callable[[int, int], Result], size: int, *, threaded: bool) -> list[Result]:
    """Return the results of a task on `N_CHUNKS` consecutive parts of range(size)."""
    ends = np.linspace(0, size, N_CHUNKS + 1).astype(np.int64)
    run = _pool().map if threaded else map
    return list(run(task, ends[:-1], ends[1:]))


def in_runs(task: Callable[[Run], Result], n: int, size: int) -> list[Result]:
    """Return the results of a task on consecutive runs of range(n), in threads."""
    runs = list(slices(n, size))
    return list((_pool().map if len(runs) > 1 else map)(task, runs))


def sums_in_chunks(
    task: Callable[[int, int], tuple[*Sums]], size: int, *, threaded: bool
) -> tuple[*Sums]:
    """Return the sums of what a task returns for parts of range(size), numbers and arrays."""
    parts = in_chunks(task, size, threaded=threaded)
    sums = []
    for values in zip(*parts, strict=True):
        total = values[0]
        for value in values[1:]:
            total += value  # in place, if it is an array
        sums.append(total)
    return tuple(sums)


def thread_count(n_jobs: int | None) -> int:
    """Return the number of threads that `n_jobs` asks for."""
    if n_jobs is None:
        return 1
    n_jobs = whole_number(n_jobs, "n_jobs")
    if n_jobs == -1:
        return os.cpu_count() or 1
    if n_jobs < 1:
        raise ArgumentError(f"n_jobs must be -1, or at least 1; found {n_jobs}")
    return n_jobs


def mapped(
    task: Callable[[Item], Result], items: Iterable[Item], n_threads: int
) -> Iterator[Result]:
    """Yield the results of a task in the order of its items; after a failure no task begins.

    An interrupt from the keyboard reaches the main thread alone: tasks of other threads, whose
    results nobody will see, then end at their next `check_interrupt`, as after a failure.
    """
    if n_threads == 1:
        yield from map(task, items)
        return
    stopped = threading.Event()

    def run(item: Item) -> Result:
        _in_thread.stopped = stopped
        return task(item)

    pool = ThreadPoolExecutor(n_threads)
    try:
        yield from pool.map(run, items)
    except BaseException:  # an interruption, too, ends the other threads
        stopped.set()
        raise
    finally:
        pool.shutdown(cancel_futures=True)


_in_thread = threading.local()


def is_abandoned() -> bool:
    """Return whether this is a task of `mapped` whose results nobody will see."""
    stopped = getattr(_in_thread, "stopped", None)
    return stopped is not None and stopped.is_set()


def check_interrupt() -> None:
    """Raise a KeyboardInterrupt in a task of `mapped` whose results nobody will see."""
    if is_abandoned():
        raise KeyboardInterrupt


_lock = threading.Lock()
_n_limited = 0
_restore_limits: Callable[[], object] | None = None


@contextmanager
def single_threaded_libraries() -> Iterator[None]:
    """Keep libraries in the calling thread: for code with threads of its own, or small products."""
    # Idle threads of OpenBLAS and OpenMP wait in a busy loop, on cores that others need.
    global _n_limited, _restore_limits
    with _lock:
        # One limit shared by all users: overlapping limits would restore each other's settings.
        if _n_limited == 0:
            limiter = _controller(len(sys.modules)).limit(limits=1)
            _restore_limits = limiter.restore_original_limits
        _n_limited += 1
    try:
        yield
    finally:
        with _lock:
            _n_limited -= 1
            if _n_limited == 0 and _restore_limits is not None:
                _restore_limits()


@functools.lru_cache(maxsize=1)
def _controller(n_modules: int) -> ThreadpoolController:
    # Looking for libraries takes milliseconds; imports alone load new ones.
    return ThreadpoolController()


def combine_rows(coefficients: Array, rows: Array) -> Array:
    """Return coefficients @ rows for long rows."""
    combined = np.empty((len(coefficients), rows.shape[1]))

    def task(first: int, last: int) -> None:
        np.matmul(coefficients, rows[:, first:last], out=combined[:, first:last])

    in_chunks(task, rows.shape[1], threaded=_is_large(rows))
    return combined


def pair_with_rows(vectors: TangentVectors, rows: Array) -> Array:
    """Return vectors @ rows.T for long rows."""

    def task(first: int, last: int) -> Array:
        total = np.zeros((len(vectors), len(rows)))
        for start in range(first, last, _IN_CACHE):
            part = slice(start, min(start + _IN_CACHE, last))
            total += vectors[:, part] @ rows[:, part].T
        return total

    products: Array = np.add.reduce(in_chunks(task, rows.shape[1], threaded=_is_large(rows)))
    return products


def quadratic_form(matrix: sparse.csr_array, rows: Array) -> Array:
    """Return rows @ matrix @ rows.T for long rows."""
    columns = np.empty((rows.shape[1], rows.shape[0]))
    threaded = _is_large(rows)

    def transpose(first: int, last: int) -> None:
        columns[first:last] = rows[:, first:last].T

    def task(first: int, last: int) -> Array:
        part: Array = rows[:, first:last] @ (matrix[first:last] @ columns)
        return part

    in_chunks(transpose, len(columns), threaded=threaded)
    with single_threaded_libraries():
        form: Array = np.add.reduce(in_chunks(task, len(columns), threaded=threaded))
    return form


def _is_large(rows: Array) -> bool:
    return rows.size > _FEWEST_FOR_THREADS


@functools.cache
def _pool() -> ThreadPoolExecutor:
    return ThreadPoolExecutor(N_CHUNKS, thread_name_prefix="riemhuman-kernels")


if hasattr(os, "register_at_fork"):
    # Threads do not survive a fork: the child makes a pool of its own.
    os.register_at_fork(after_in_child=_pool.cache_clear)


LANES = 64
"""Rows of features are as long as a multiple of this."""

CHUNK = 512
"""Triangles summed in the precision of the features before they join the sum over all."""

LARGEST, SMALLEST = 1e15, 1e-15
"""Squares of numbers beyond these, and their products, leave the range of single precision."""

UNDERFLOW = 1e-34
"""Bound on the square of a number that single precision rounds to zero."""

# Pairs times values of one tile, so that features, which are slow to load, are used often.
_TILE_WORK = 320_000_000
# Tiles per thread, so that all threads end at nearly the same time.
_TILES_A_THREAD = 4


def slices(n: int, size: int) -> Iterator[Run]:
    """Yield consecutive parts of range(n), all but the last of one size."""
    for start in range(0, n, size):
        yield slice(start, min(start + size, n))


def of_one_kind(array: Kind) -> Kind:
    """Return a read-only C-contiguous array, the kind that loops are compiled for."""
    # Loops over another type would be compiled again, and could add in another order.
    view = np.ascontiguousarray(array).view()
    view.flags.writeable = False
    return view


def in_tiles(
    run: Callable[[tuple[tuple[Array, ...], tuple[Array, ...]]], Array],
    a: Sequence[Array],
    b: Sequence[Array],
    n_threads: int,
) -> Array:
    """Return sums over all pairs of two sets, from their features, tile by tile in threads."""
    within = all(array_a is array_b for array_a, array_b in zip(a, b, strict=True))
    n_a, n_b = len(a[0]), len(b[0])
    n_values = max(1, *(array[:1].size for array in a))
    n_pairs = _TILE_WORK / n_values
    if n_threads > 1:
        n_pairs = min(n_pairs, n_a * n_b / (_TILES_A_THREAD * n_threads))
    # Whole blocks of four, by which some loops go.
    size = 4 * int(np.clip(0.25 * math.sqrt(n_pairs) + 0.5, 2, 16))

    a = [of_one_kind(array) for array in a]
    b = a if within else [of_one_kind(array) for array in b]
    places, parts = [], []
    for row in range(0, n_a, size):
        rows = slice(row, row + size)
        part_a = tuple(array[rows] for array in a)
        # Within a set, tiles below the diagonal are left out, and on it both parts are one object.
        for column in range(row if within else 0, n_b, size):
            columns = slice(column, column + size)
            is_diagonal = within and column == row
            part_b = part_a if is_diagonal else tuple(array[columns] for array in b)
            places.append((rows, columns))
            parts.append((part_a, part_b))
    squared = np.zeros((n_a, n_b))
    for (rows, columns), tile in zip(places, mapped(run, parts, n_threads), strict=True):
        if within and columns == rows:
            tile = np.triu(tile, 1)
            tile += tile.T
        elif within:
            squared[columns, rows] = tile.T
        squared[rows, columns] = tile
    return squared
