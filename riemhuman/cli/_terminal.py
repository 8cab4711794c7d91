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
from typing import TYPE_CHECKING, TextIO

from riemhuman.cli._commands import Answer, one_line
from riemhuman.errors import ConvergenceWarning, counted

if TYPE_CHECKING:
    from riemhuman.arrays import Array, JSONRecord, JSONValue
    from riemhuman.solvers import Result


# Longer lists take a line for each item.
_MOST_IN_LINE = 4


def as_json(record: object) -> str:
    """Return a result as JSON with all digits; NaN and infinity become null."""
    return json.dumps(_plain(record), indent=2, allow_nan=False, ensure_ascii=False)


def _plain(value: object) -> JSONValue:
    """Return a value in types that JSON can hold."""
    if is_dataclass(value):
        value = vars(value)  # its fields, which may hold further data classes
    if isinstance(value, dict):
        return {str(key): _plain(item) for key, item in value.items()}
    if hasattr(value, "tolist"):
        return _plain(value.tolist())
    if isinstance(value, (list, tuple)):
        return [_plain(item) for item in value]
    if isinstance(value, float) and not abs(value) < float("inf"):
        return None
    return os.fspath(value) if isinstance(value, os.PathLike) else value


def matrix_text(names: Sequence[str], matrix: Array, corner: str = "file") -> str:
    """Return a square matrix with names as comma-separated text."""
    from riemhuman.io.text_tables import csv_text

    rows = zip(names, matrix.tolist(), strict=True)
    return csv_text([[corner, *names], *([name, *row] for name, row in rows)])


def lines(values: Mapping[str, object]) -> str:
    """Return a line for each value that is not None, with its name; values in one column."""
    texts = {k.replace("_", " "): _plain(v) for k, v in values.items() if v is not None}
    width = max(map(len, texts))
    lines = []
    for name, value in texts.items():
        rows = value if isinstance(value, list) and len(value) > _MOST_IN_LINE else [value]
        for number, row in enumerate(rows):
            title = name if number == 0 else ""
            lines.append(f"{title:<{width}}  {_readable(row)}")
    return "\n".join(lines)


def _readable(value: object) -> str:
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, list):
        return ", ".join(map(_readable, value))
    if isinstance(value, float):
        return f"{value:.8g}"
    return f"{value:,}" if isinstance(value, int) else str(value)


def convergence(result: Result) -> str:
    """Return whether a solver converged, and after how many iterations."""
    iterations = counted(result.n_iterations, "iteration", "iterations")
    return f"{'yes' if result.converged else 'no'}, after {iterations}"


def solved(result: Result, text: JSONRecord, **record: object) -> Answer:
    """Return the answer of a solver, with whether and how it has converged."""
    outcome = {
        "n_iterations": result.n_iterations,
        "converged": result.converged,
        "message": result.message,
    }
    return Answer(
        {**text, "converged": convergence(result)},
        record | text | outcome,
        trusted=bool(result.converged),
    )


def say(text: str) -> None:
    """Write to standard error; no work ends because its disk is full or its terminal closed."""
    try:
        sys.stderr.write(text)
        sys.stderr.flush()
    except BrokenPipeError:
        raise  # as other programs, end where the reader has left
    except OSError:
        discard(sys.stderr)


def note(text: str) -> None:
    """Write a line to standard error, above progress bars and in place of a task's name."""
    tqdm = sys.modules.get("tqdm")  # only progress bars import it
    with tqdm.tqdm.external_write_mode(sys.stderr) if tqdm else nullcontext():
        say(f"{_line_start()}riemhuman: {one_line(text)}\n")


def _line_start() -> str:
    """Return what wipes out the name of a task on a terminal."""
    return "\r\x1b[K" if sys.stderr.isatty() else ""


def say_compilation() -> None:
    """Say what the first run of a command on a machine waits for."""
    note(
        "compiling, once on this machine; this takes up to half a minute, and later runs start "
        "at once"
    )


def tolerate_ascii() -> None:
    """Print λ and similar characters as ``?`` on terminals without Unicode."""
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper) and "utf" not in stream.encoding.lower():
            stream.reconfigure(errors="replace")


def discard(stream: TextIO) -> None:
    """Discard what a standard stream still holds, and all later output: nobody reads it."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), stream.fileno())


@contextmanager
def task(options: argparse.Namespace, name: str) -> Iterator[None]:
    """Report a task and its duration on standard error; on a terminal, also when it begins."""
    start = time.perf_counter()
    if options.bars:
        say(f"{_line_start()}{name} ...")
    yield
    if not options.quiet:
        say(f"{_line_start()}{name}: {time.perf_counter() - start:.1f} s\n")


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
