"""Memory: an estimate before large tables, samples and jobs are begun."""

from __future__ import annotations

import math
import os
from pathlib import Path

from riemhuman.errors import OutOfMemoryError

USE_LESS = "compare fewer bodies at a time, or coarser ones"
"""What to do about a lack of memory, where nothing better is known."""

_UNITS = ("bytes", "kB", "MB", "GB", "TB", "PB")
# Limits of containers: of Linux' second and first version of control groups.
_LIMITS = (
    Path("/sys/fs/cgroup/memory.max"),
    Path("/sys/fs/cgroup/memory/memory.limit_in_bytes"),
)


def check_memory(n_bytes: float, task: str, remedy: str = USE_LESS) -> None:
    """Raise an error if a task needs more bytes than are left."""
    left = available_memory()
    if n_bytes > left:
        raise OutOfMemoryError(
            f"{task} needs {size_text(n_bytes)} of memory, and {size_text(left)} are left; {remedy}"
        )


def size_text(n_bytes: float) -> str:
    """Return a number of bytes in a unit in which it has at most three digits before the point."""
    power = min(max(0, math.floor(math.log10(max(n_bytes, 1.0)) / 3)), len(_UNITS) - 1)
    return f"{n_bytes / 1000.0**power:.{min(power, 1)}f} {_UNITS[power]}"


def available_memory() -> float:
    """Return the most bytes that this process may still take; infinity if that is unknown."""
    return max(0.0, min(_free_memory(), _container_limit() - _own_memory()))


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


def _container_limit() -> float:
    """Return the bytes of memory that the container may have."""
    for file in _LIMITS:
        try:
            return float(file.read_text(encoding="ascii"))
        except (OSError, ValueError):  # no container, or "max"
            continue
    return math.inf
