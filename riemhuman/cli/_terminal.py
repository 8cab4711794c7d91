"""Output of the command line: results on standard output, all else on standard error."""

from __future__ import annotations

import argparse
import io
import json
import os
import sys
import time
import warnings
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, nullcontext
from dataclasses import is_dataclass
from types import FrameType
from typing import TYPE_CHECKING, Any

from riemhuman.cli._commands import Answer
from riemhuman.errors import ConvergenceWarning

if TYPE_CHECKING:
    from riemhuman.arrays import JSONRecord
    from riemhuman.solvers import Result


def as_json(record: Any) -> str:
    """Return a result as JSON with all digits; NaN and infinity become null."""
    return json.dumps(_plain(record), indent=2, allow_nan=False, ensure_ascii=False)


def _plain(value: Any) -> Any:
    """Return a value in types that JSON can hold."""
    if is_dataclass(value):
        value = vars(value)
    if isinstance(value, dict):
        return {str(key): _plain(item) for key, item in value.items()}
    if hasattr(value, "tolist"):
        return _plain(value.tolist())
    if isinstance(value, (list, tuple)):
        return [_plain(item) for item in value]
    if isinstance(value, float) and not abs(value) < float("inf"):
        return None
    return os.fspath(value) if isinstance(value, os.PathLike) else value


def matrix_text(names: Sequence[str], matrix: Any, corner: str = "file") -> str:
    """Return a square matrix with names as comma-separated text."""
    from riemhuman.io.text_tables import csv_text

    rows = zip(names, matrix.tolist(), strict=True)
    return csv_text([[corner, *names], *([name, *row] for name, row in rows)])


def lines(values: Mapping[str, object]) -> str:
    """Return a line for each value that is not None, with its name; values in one column."""
    given = {k.replace("_", " "): _plain(v) for k, v in values.items() if v is not None}
    width = max(map(len, given))
    said = []
    for name, value in given.items():
        rows = value if isinstance(value, list) and len(value) > 4 else [_readable(value)]
        names = [name] + [""] * (len(rows) - 1)
        said += [f"{title:<{width}}  {row}" for title, row in zip(names, rows, strict=True)]
    return "\n".join(said)


def _readable(value: object) -> str:
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, list):
        return ", ".join(map(_readable, value))
    if isinstance(value, float):
        return f"{value:.8g}"
    return f"{value:,}" if isinstance(value, int) else str(value)


def solved(result: Result, text: JSONRecord, **record: object) -> Answer:
    """Return the answer of a solver, with whether and how it has converged."""
    iterations = "iteration" if result.n_iterations == 1 else "iterations"
    said = f"{'yes' if result.converged else 'no'}, after {result.n_iterations} {iterations}"
    how = {name: getattr(result, name) for name in ("n_iterations", "converged", "message")}
    return Answer({**text, "converged": said}, record | text | how, bool(result.converged))


def note(text: str) -> None:
    """Write one line to standard error, above progress bars and in place of the task's name."""
    tqdm = sys.modules.get("tqdm")  # only progress bars import it
    with tqdm.tqdm.external_write_mode(sys.stderr) if tqdm else nullcontext():
        begin = "\r\x1b[K" if sys.stderr.isatty() else ""
        sys.stderr.write(f"{begin}riemhuman: {' '.join(text.split())}\n")


def say_compilation() -> None:
    """Say what the first run of a command on a machine waits for."""
    note("compiling, once on this machine: up to half a minute; later runs start at once")


# When the process was interrupted from the keyboard, if at all.
_interruptions: list[float] = []


def interrupt(number: int, frame: FrameType | None) -> None:
    """Handle the signal of an interruption from the keyboard."""
    _interruptions.append(time.perf_counter())
    raise KeyboardInterrupt


def was_interrupted() -> bool:
    """Return whether `interrupt` has been called: some libraries replace its exception."""
    return bool(_interruptions)


def tolerate_ascii() -> None:
    """Print λ and similar characters as ``?`` on terminals without Unicode."""
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper) and "utf" not in stream.encoding.lower():
            stream.reconfigure(errors="replace")


def discard_output() -> None:
    """Discard the rest of standard output, which nothing can receive."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


@contextmanager
def task(options: argparse.Namespace, name: str) -> Iterator[None]:
    """Report a task on standard error with the time that it took, on a terminal as it begins."""
    start = time.perf_counter()
    if options.bars:
        sys.stderr.write(f"{name} ...")
        sys.stderr.flush()
    yield
    if not options.quiet:
        # On a terminal, this replaces the name of the task.
        begin = "\r" if options.bars else ""
        sys.stderr.write(f"{begin}{name}: {time.perf_counter() - start:.1f} s\n")


@contextmanager
def short_warnings() -> Iterator[list[Warning | str]]:
    """Show each warning in one line, without its place in the code; return those of searches."""
    unconverged: list[Warning | str] = []

    def show(message: Warning | str, *rest: object, **settings: object) -> None:
        note(f"warning: {message}")
        if isinstance(message, ConvergenceWarning):
            unconverged.append(message)

    with warnings.catch_warnings():
        warnings.simplefilter("always", ConvergenceWarning)
        warnings.showwarning = show
        yield unconverged
