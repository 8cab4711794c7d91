"""Threads for bulk work: fixed chunks, so that results do not depend on how many threads run."""

from __future__ import annotations

import os
import threading
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from functools import cache
from typing import Any, TypeVar

import numpy as np
from numpy import ndarray
from scipy import sparse
from threadpoolctl import ThreadpoolController

from riemhuman.checks import whole_number
from riemhuman.errors import ArgumentError

N_CHUNKS = 4

# Columns of long rows that BLAS multiplies at a time: it copies them before, within the cache.
_IN_CACHE = 16384

Item = TypeVar("Item")
Result = TypeVar("Result")


def in_chunks(task: Callable[[int, int], Result], size: int, *, threaded: bool) -> list[Result]:
    """Return the results of a task on `N_CHUNKS` consecutive parts of range(size).

    Parameters
    ----------
    task : callable
        Called with the first and last + 1 index of each part; should release the interpreter lock.
    size : int
        Number of items.
    threaded : bool
        Whether to run in threads; small tasks are faster without.

    Returns
    -------
    list
        In the order of the parts.
    """
    ends = np.linspace(0, size, N_CHUNKS + 1).astype(np.int64)
    run = _pool().map if threaded else map
    return list(run(task, ends[:-1], ends[1:]))


def sums_in_chunks(
    task: Callable[[int, int], tuple[Any, ...]], size: int, *, threaded: bool
) -> tuple[Any, ...]:
    """Return the sums of what a task returns for parts of range(size).

    Parameters
    ----------
    task : callable
        Called with the first and last + 1 index of each part, returns numbers and new arrays.
    size : int
        Number of items.
    threaded : bool
        Whether to run in threads.

    Returns
    -------
    tuple
    """
    first, *others = in_chunks(task, size, threaded=threaded)
    totals = list(first)
    for part in others:
        for k, value in enumerate(part):
            totals[k] += value
    return tuple(totals)


def thread_count(n_jobs: int | None) -> int:
    """Return the number of threads that `n_jobs` asks for.

    Parameters
    ----------
    n_jobs : int or None
        Number of threads: None is 1, -1 is one a core.

    Returns
    -------
    int

    Raises
    ------
    ArgumentTypeError
        If the number is not an integer.
    ArgumentError
        If it is 0 or below -1.
    """
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

    Parameters
    ----------
    task : callable
        Takes an item.
    items : iterable
        Items.
    n_threads : int
        Number of threads; one is the calling thread.

    Yields
    ------
    object
        What the task returns for an item.
    """
    if n_threads == 1:
        yield from map(task, items)
        return
    pool = ThreadPoolExecutor(n_threads)
    try:
        yield from pool.map(task, items)
    finally:
        pool.shutdown(cancel_futures=True)


def for_each(task: Callable[[Item], Any], items: Iterable[Item], n_threads: int) -> None:
    """Do a task for every item, as `mapped` does.

    Parameters
    ----------
    task : callable
        Takes an item.
    items : iterable
        Items.
    n_threads : int
        Number of threads; one is the calling thread.
    """
    for _ in mapped(task, items, n_threads):
        pass


@contextmanager
def single_threaded_libraries() -> Iterator[None]:
    """Keep libraries in the calling thread, for code that runs threads of its own.

    Idle threads of OpenBLAS and OpenMP wait in a busy loop, on cores that others need.

    Yields
    ------
    None
    """
    _limit.enter()
    try:
        yield
    finally:
        _limit.leave()


class _SharedLimit:
    """One limit for all who are in it at once: the first sets it, the last takes it back.

    Limits that overlap in time would each restore what another has set.
    """

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._users: list[int] = []
        self._limiter: Any = None

    def enter(self) -> None:
        with self._lock:
            if not self._users:
                limiter = ThreadpoolController().limit(limits=1)
                # After a fork, what was there before is known to the limit of the parent.
                self._limiter = self._limiter or limiter
            self._users.append(threading.get_ident())

    def leave(self) -> None:
        with self._lock:
            self._users.remove(threading.get_ident())
            if not self._users:
                self._limiter.restore_original_limits()
                self._limiter = None

    def keep_own(self) -> None:
        """Continue in a child process, where only the thread that forked exists.

        A limit set by other threads stays until the next user leaves.
        """
        self._lock = threading.Lock()
        self._users = [user for user in self._users if user == threading.get_ident()]


_limit = _SharedLimit()


def combine_rows(coefficients: ndarray, rows: ndarray) -> ndarray:
    """Return coefficients @ rows for long rows.

    Parameters
    ----------
    coefficients : array, shape (m, K)
        Coefficients.
    rows : array, shape (K, n)
        Long rows, C-contiguous.

    Returns
    -------
    array, shape (m, n)
    """
    combined = np.empty((len(coefficients), rows.shape[1]))

    def task(first: int, last: int) -> None:
        np.matmul(coefficients, rows[:, first:last], out=combined[:, first:last])

    in_chunks(task, rows.shape[1], threaded=_is_large(rows))
    return combined


def pair_with_rows(vectors: ndarray, rows: ndarray) -> ndarray:
    """Return vectors @ rows.T for long rows.

    Parameters
    ----------
    vectors : array, shape (m, n)
        Long vectors.
    rows : array, shape (K, n)
        Long rows, C-contiguous.

    Returns
    -------
    array, shape (m, K)
    """

    def task(first: int, last: int) -> ndarray:
        total = np.zeros((len(vectors), len(rows)))
        for start in range(first, last, _IN_CACHE):
            part = slice(start, min(start + _IN_CACHE, last))
            total += vectors[:, part] @ rows[:, part].T
        return total

    return np.add.reduce(in_chunks(task, rows.shape[1], threaded=_is_large(rows)))


def quadratic_form(matrix: sparse.csr_array, rows: ndarray) -> ndarray:
    """Return rows @ matrix @ rows.T for long rows.

    Parameters
    ----------
    matrix : csr_array, shape (n, n)
        Sparse matrix.
    rows : array, shape (K, n)
        Long rows, C-contiguous.

    Returns
    -------
    array, shape (K, K)
    """
    columns = np.empty((rows.shape[1], rows.shape[0]))
    threaded = _is_large(rows)

    def transpose(first: int, last: int) -> None:
        columns[first:last] = rows[:, first:last].T

    def task(first: int, last: int) -> ndarray:
        return rows[:, first:last] @ (matrix[first:last] @ columns)

    in_chunks(transpose, len(columns), threaded=threaded)
    with single_threaded_libraries():
        return np.add.reduce(in_chunks(task, len(columns), threaded=threaded))


def _is_large(rows: ndarray) -> bool:
    return rows.size > 500_000


@cache
def _pool() -> ThreadPoolExecutor:
    return ThreadPoolExecutor(N_CHUNKS, thread_name_prefix="riemhuman-kernels")


if hasattr(os, "register_at_fork"):
    # Threads do not survive a fork: the child makes a pool of its own.
    os.register_at_fork(after_in_child=_pool.cache_clear)
    # Nor does whoever holds the lock of the limit.
    os.register_at_fork(after_in_child=_limit.keep_own)
