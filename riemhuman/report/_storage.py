"""The folder of a report, and the results of its steps, kept between runs."""

from __future__ import annotations

import hashlib
import json
import os
import time
from collections.abc import Callable, Mapping
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy import ndarray

from riemhuman.errors import FileError, FileFormatError
from riemhuman.io.arrays import load_arrays, save_arrays
from riemhuman.io.files import convert_errors, file_path, write_text

_MARKER = "provenance.json"
_MADE_BY = "riemhuman report"
_SUBFOLDERS = ("figures", "tables", "results", "results/figures")
_LONGEST_RECORD = 2**23  # characters

Progress = Callable[[str], AbstractContextManager[Any]]
Computed = tuple[Mapping[str, ndarray], Mapping[str, Any]]


def check_folder(path: str | os.PathLike[str]) -> Path:
    """Return the folder of a report; raise an error if it holds anything else. Write nothing."""
    folder = file_path(path, "output", "folder")
    if folder.exists() and not folder.is_dir():
        raise FileError(f"{folder} is a file; the report needs a folder of its own")
    with convert_errors(folder, "cannot be read"):
        is_used = folder.is_dir() and any(folder.iterdir())
    if is_used and not _is_report(folder):
        raise FileError(
            f"{folder} holds other files; the report needs a new or empty folder, or one with an "
            "earlier report"
        )
    return folder


def _is_report(folder: Path) -> bool:
    try:
        record = json.loads((folder / _MARKER).read_text(encoding="utf-8"))
        return bool(record["made_by"] == _MADE_BY)
    except (OSError, ValueError, KeyError, TypeError):
        return False


def open_folder(path: str | os.PathLike[str]) -> Path:
    """Make or reuse the folder of a report with its subfolders."""
    folder = check_folder(path)
    with convert_errors(folder):
        folder.mkdir(parents=True, exist_ok=True)
        # The marker comes first: after a kill, a folder without it would be refused.
        write_provenance(folder, {"status": "begun"})
        for name in _SUBFOLDERS:
            (folder / name).mkdir(exist_ok=True)
    return folder


def write_provenance(folder: Path, provenance: dict[str, Any]) -> None:
    """Write the provenance of the report, a file that also marks the folder as a report."""
    text = json.dumps({"made_by": _MADE_BY, **provenance}, indent=2, ensure_ascii=False)
    write_text(folder / _MARKER, text + "\n")


@dataclass(frozen=True)
class Step:
    """The result of a step: arrays, and a record that JSON can hold."""

    name: str
    arrays: dict[str, ndarray]
    record: dict[str, Any]
    fingerprint: str
    seconds: float  # of the computation, in this run or an earlier one
    title: str
    is_reused: bool


class ResultStore:
    """Keeps the result of each step in a file, and reads it back while the inputs are the same."""

    def __init__(self, folder: Path, common: Any, progress: Progress = nullcontext) -> None:
        self.steps: list[Step] = []
        # All results depend on `common`: the versions and the source code of the library.
        self._folder, self._common, self._progress = folder, common, progress

    def step(
        self, name: str, inputs: Mapping[str, Any], compute: Callable[[], Computed], title: str
    ) -> Step:
        """Return the result of a step, computed unless its file holds one from the same inputs."""
        key = fingerprint({"step": name, "common": self._common, "inputs": dict(inputs)})
        file = self._folder / f"{name}.npz"
        step = _read(file, name, key, title)
        if step is None:
            with self._progress(title):
                start = time.perf_counter()
                arrays, record = compute()
                seconds = time.perf_counter() - start
            header = {"fingerprint": key, "seconds": seconds, "record": record}
            save_arrays(file, {**arrays, "about": np.array(json.dumps(header))})
            step = Step(name, dict(arrays), dict(record), key, seconds, title, is_reused=False)
        self.steps.append(step)
        return step


def fingerprint(value: Any) -> str:
    """Return a fingerprint of a value made of what JSON can hold, arrays and steps."""
    text = json.dumps(value, sort_keys=True, default=_plain)
    return hashlib.sha256(text.encode()).hexdigest()


def _plain(value: Any) -> Any:
    if isinstance(value, Step):
        return value.fingerprint
    array = np.ascontiguousarray(value)
    if array.dtype.hasobject:
        raise TypeError(f"{type(value).__name__} has no fingerprint")
    return [array.dtype.str, array.shape, hashlib.sha256(array.tobytes()).hexdigest()]


def _read(file: Path, name: str, key: str, title: str) -> Step | None:
    """Return the step in a file, or None if the file holds no step with this fingerprint."""
    if not file.is_file():
        return None
    try:
        arrays = load_arrays(file, ["about"])
        about = str(arrays.pop("about"))
        # Parsed JSON takes far more memory than its text, which itself was compressed.
        header = json.loads(about[:_LONGEST_RECORD])
        if header["fingerprint"] == key:
            seconds = header["seconds"]
            return Step(name, arrays, header["record"], key, seconds, title, is_reused=True)
    except (FileError, FileFormatError, ValueError, KeyError, TypeError, RecursionError):
        return None
    return None
