"""Memory: how much is left, and errors that say how much was needed and what to do."""

from __future__ import annotations

import errno
import math
import os
import re
from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache
from pathlib import Path

from riemhuman.errors import OutOfMemoryError

USE_LESS = "compare fewer bodies at a time, or coarser ones"
"""What to do about a lack of memory, where nothing better is known."""
_FREE_SOME = "close other programs, or raise the limit of this one (ulimit -v)"

# How C libraries report a lack of memory in errors other than `MemoryError`.
_NO_MEMORY = re.compile(
    r"(can(no|')t|unable to|failed to|could not) (allocate|map segment)|out of memory|"
    r"memory allocation failed|error -4 while",  # of zlib
    re.IGNORECASE,
)
# Bytes that OpenBLAS allocates for a thread when it is first called, at most.
_BUFFER = 2**26
_UNITS = ("bytes", "kB", "MB", "GB", "TB", "PB")
# Limits of containers: of Linux' second and first version of control groups.
_LIMITS = (
    Path("/sys/fs/cgroup/memory.max"),
    Path("/sys/fs/cgroup/memory/memory.limit_in_bytes"),
)


def lack_of_memory(error: BaseException, *kinds: type[BaseException]) -> BaseException | None:
    """Return the error, or the one behind it, that came from a lack of memory, if any.

    Errors of these kinds count if they say so.
    """
    cause: BaseException | None = error
    while cause is not None:
        if isinstance(cause, MemoryError) or getattr(cause, "errno", None) == errno.ENOMEM:
            return cause
        if isinstance(cause, kinds) and _NO_MEMORY.search(str(cause)) is not None:
            return cause
        cause = cause.__cause__ or cause.__context__
    return None


@contextmanager
def enough_memory(task: str, remedy: str = USE_LESS) -> Iterator[None]:
    """Raise a lack of memory in a block as an error that names the task and a remedy.

    Of nested tasks the outermost, which is what a user asked for, says what to do.
    """
    try:
        _keep_buffers()
        yield
    except OutOfMemoryError as error:
        if error.remedy in ("", remedy):
            raise
        raise _too_little(task, error.need, remedy) from error
    except MemoryError as error:
        raise too_little(task, error, remedy) from error
    except (ImportError, OSError, RuntimeError) as error:
        # A thread does not start if there is no memory for its stack.
        no_thread = str(error) == "can't start new thread"
        if no_thread or lack_of_memory(error, ImportError, OSError) is not None:
            raise too_little(task, error, remedy) from error
        raise


@contextmanager
def memory_to_import(name: str) -> Iterator[None]:
    """Raise a lack of memory while a module is imported as an error that names the module."""
    try:
        yield
    except OutOfMemoryError:
        raise
    except (ImportError, MemoryError, OSError) as error:
        if lack_of_memory(error, ImportError, OSError) is not None:
            raise too_little(f"the import of {name}", error, _FREE_SOME) from error
        raise


@cache
def _keep_buffers() -> None:
    """Let NumPy's and SciPy's copies of OpenBLAS allocate the buffers that they keep.

    OpenBLAS does this in its first call, and tries again forever if it gets no memory.
    """
    import numpy as np  # here: the command line imports this file before it needs NumPy
    from scipy.linalg import lapack

    matrix = np.eye(2)
    for solve in (np.linalg.inv, lapack.dgetrf):
        np.empty(_BUFFER, np.uint8)  # raises an error if there is too little
        solve(matrix)


def too_little(task: str, error: BaseException, remedy: str = USE_LESS) -> OutOfMemoryError:
    """Return the error of a task that got no memory, with what the allocation asked for."""
    asked = " ".join(str(error).split())
    return _too_little(task, asked, remedy, f"{task}: {asked}" if asked else task)


def _too_little(task: str, detail: str, remedy: str, need: str = "") -> OutOfMemoryError:
    in_brackets = f" ({detail})" if detail else ""
    message = f"memory is too short for {task}{in_brackets}; {remedy}"
    return OutOfMemoryError(message, need or detail, remedy)


def check_memory(n_bytes: float, task: str, remedy: str = USE_LESS) -> None:
    """Raise an error if a task needs more bytes than are left."""
    left = available_memory()
    if n_bytes > left:
        need = f"{task} needs {size_text(n_bytes)} of memory, and {size_text(left)} are left"
        raise OutOfMemoryError(f"{need}; {remedy}", need, remedy)


def size_text(n_bytes: float) -> str:
    """Return a number of bytes in a unit in which it has at most three digits before the point."""
    power = min(max(0, math.floor(math.log10(max(n_bytes, 1.0)) / 3)), len(_UNITS) - 1)
    return f"{n_bytes / 1000.0**power:.{min(power, 1)}f} {_UNITS[power]}"


def available_memory() -> float:
    """Return the most bytes that this process may still take; infinity if that is unknown."""
    # Addresses of the process that have no memory behind them can be used again.
    return max(0.0, min(_free_memory(), min(address_limit(), _container_limit()) - _own_memory()))


def _free_memory() -> float:
    """Return the unused bytes of the machine's memory and swap space."""
    try:
        lines = Path("/proc/meminfo").read_text(encoding="ascii").splitlines()
    except OSError:
        return math.inf
    sizes = {}
    for line in lines:
        name, _, size = line.partition(":")
        sizes[name] = size.split()[0]
    if "MemAvailable" not in sizes:
        return math.inf
    return 1024.0 * (int(sizes["MemAvailable"]) + int(sizes.get("SwapFree", 0)))


def _own_memory() -> float:
    """Return the bytes of memory that the process has."""
    try:
        pages = Path("/proc/self/statm").read_text(encoding="ascii").split()
    except OSError:
        return 0.0
    return float(os.sysconf("SC_PAGE_SIZE") * int(pages[1]))


def address_limit() -> float:
    """Return the bytes of addresses that the process may have."""
    try:
        import resource
    except ImportError:  # on Windows
        return math.inf
    limit, _ = resource.getrlimit(resource.RLIMIT_AS)
    return math.inf if limit == resource.RLIM_INFINITY else float(limit)


def _container_limit() -> float:
    """Return the bytes of memory that the container may have."""
    for file in _LIMITS:
        try:
            return float(file.read_text(encoding="ascii"))
        except (OSError, ValueError):  # no container, or "max"
            continue
    return math.inf
