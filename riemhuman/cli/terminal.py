"""What the command line says: results on standard output, everything else on standard error."""

from __future__ import annotations

import io
import json
import os
import sys
import time
import warnings
from collections.abc import Iterator
from contextlib import contextmanager, nullcontext
from typing import TYPE_CHECKING, Any

from riemhuman.errors import ConvergenceWarning, FileError

if TYPE_CHECKING:
    from riemhuman.solvers.results import Result


def say(text: str = "") -> None:
    """Write lines of a result to standard output.

    Parameters
    ----------
    text : str
        The lines, without the last line break.

    Raises
    ------
    FileError
        If they cannot be written, as on a full disk.
    """
    with _output_errors():
        sys.stdout.write(f"{text}\n")


def flush_output() -> None:
    """See that what was said has arrived.

    Raises
    ------
    FileError
        If it cannot be written, as on a full disk.
    """
    with _output_errors():
        sys.stdout.flush()


@contextmanager
def _output_errors() -> Iterator[None]:
    try:
        yield
    except BrokenPipeError:
        raise
    except OSError as error:
        discard_output()
        raise FileError(f"standard output cannot be written: {error.strerror or error}") from error


def say_json(record: Any) -> None:
    """Write a result to standard output as JSON, floats with all their digits.

    Parameters
    ----------
    record : object
        What JSON knows, NumPy numbers and arrays; NaN and infinite numbers become null.
    """
    say(as_json(record))


def as_json(record: Any) -> str:
    """Return a result as JSON text, floats with all their digits.

    Parameters
    ----------
    record : object
        What JSON knows, NumPy numbers and arrays; NaN and infinite numbers become null.

    Returns
    -------
    str
    """
    return json.dumps(_plain(record), indent=2, allow_nan=False, ensure_ascii=False)


def note(text: str) -> None:
    """Write one line to standard error, above the bars and in place of a task's name.

    Parameters
    ----------
    text : str
        The line; it begins with the name of the program.
    """
    tqdm = sys.modules.get("tqdm")  # which nothing but a bar imports
    with tqdm.tqdm.external_write_mode(sys.stderr) if tqdm else nullcontext():
        begin = "\r\x1b[K" if sys.stderr.isatty() else ""
        sys.stderr.write(f"{begin}riemhuman: {' '.join(text.split())}\n")


def tolerate_ascii() -> None:
    """Let λ and its kin come out as ``?`` where the terminal knows no Unicode."""
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper) and "utf" not in stream.encoding.lower():
            stream.reconfigure(errors="replace")


def discard_output() -> None:
    """Send what is still to be written to standard output nowhere: nobody can have it."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


class Reporter:
    """Says on standard error what a command is doing, unless asked to be quiet.

    Parameters
    ----------
    quiet : bool
        Whether to say nothing.
    """

    def __init__(self, quiet: bool) -> None:
        self._quiet = quiet

    @property
    def bars(self) -> bool:
        """Whether progress bars are wanted: nobody watches them in a log file."""
        return not self._quiet and sys.stderr.isatty()

    @contextmanager
    def task(self, name: str) -> Iterator[None]:
        """Say what is being done, and then how long it took.

        Parameters
        ----------
        name : str
            What is done.
        """
        start = time.perf_counter()
        if self.bars:
            sys.stderr.write(f"{name} ...")
            sys.stderr.flush()
        try:
            yield
        except BaseException:
            if self.bars:
                sys.stderr.write("\n")
            raise
        if not self._quiet:
            # On a terminal, in place of what was written there.
            begin = "\r" if self.bars else ""
            sys.stderr.write(f"{begin}{name}: {time.perf_counter() - start:.1f} s\n")


def convergence(result: Result) -> str:
    """Return in words whether a solver has converged.

    Parameters
    ----------
    result : Result
        What the solver returned.

    Returns
    -------
    str
    """
    iterations = "iteration" if result.n_iterations == 1 else "iterations"
    return f"{'yes' if result.converged else 'no'}, after {result.n_iterations} {iterations}"


@contextmanager
def short_warnings() -> Iterator[None]:
    """Show warnings in one line each, without the place in the code they come from."""

    def show(message: Warning | str, *others: object, **more: object) -> None:
        note(f"warning: {message}")

    with warnings.catch_warnings():
        warnings.simplefilter("always", ConvergenceWarning)
        warnings.showwarning = show
        yield


def _plain(value: Any) -> Any:
    """Return a value in the types JSON knows."""
    if isinstance(value, dict):
        return {str(key): _plain(each) for key, each in value.items()}
    if hasattr(value, "tolist"):
        return _plain(value.tolist())
    if isinstance(value, (list, tuple)):
        return [_plain(each) for each in value]
    if isinstance(value, float) and not abs(value) < float("inf"):
        return None
    return os.fspath(value) if isinstance(value, os.PathLike) else value
