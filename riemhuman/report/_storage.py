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

import numpy as np

from riemhuman.arrays import JSONRecord, JSONValue, Values
from riemhuman.errors import FileError, FileFormatError
from riemhuman.io.arrays import load_arrays, save_arrays
from riemhuman.io.files import convert_errors, file_path, is_of_system, write_text
from riemhuman.io.fingerprint import describe

_MARKER = "provenance.json"
_MADE_BY = "riemhuman report"
_SUBFOLDERS = ("figures", "tables", "views", "results")

Progress = Callable[[str], AbstractContextManager[object]]
Computed = tuple[Mapping[str, Values], Mapping[str, JSONValue]]


def check_folder(path: str | os.PathLike[str]) -> Path:
    """Return the folder of a report; raise an error if it holds anything else. Write nothing."""
    folder = file_path(path, "output", "folder")
    if folder.exists() and not folder.is_dir():
        raise FileError(f"{folder} is a file; the report needs a folder of its own")
    marker = folder / _MARKER
    with convert_errors(folder, "cannot be read"):
        entries = list(os.scandir(folder)) if folder.is_dir() else []
        is_used = not all(map(is_of_system, entries))
        is_ours = marker.is_file() and _MADE_BY.encode() in marker.read_bytes()
    if is_used and not is_ours:
        raise FileError(
            f"{folder} holds other files; the report needs a new or empty folder, or one with an "
            "earlier report"
        )
    return folder


def open_folder(path: str | os.PathLike[str]) -> Path:
    """Make or reuse the folder of a report with its subfolders."""
    folder = check_folder(path)
    with convert_errors(folder):
        folder.mkdir(parents=True, exist_ok=True)
        # The marker comes first: if the process is killed, a folder without it would be refused.
        write_provenance(folder, {"status": "begun"})
        for name in _SUBFOLDERS:
            (folder / name).mkdir(exist_ok=True)
    return folder


def write_provenance(folder: Path, provenance: JSONRecord) -> None:
    """Write the provenance of the report, a file that also marks the folder as a report."""
    text = json.dumps({"made_by": _MADE_BY, **provenance}, indent=2, ensure_ascii=False)
    write_text(folder / _MARKER, text + "\n")


@dataclass(frozen=True)
class Step:
    """The result of a step: arrays, and a record that JSON can hold."""

    name: str
    arrays: dict[str, Values]
    record: JSONRecord
    fingerprint: str
    seconds: float  # of the computation, in this run or an earlier one
    title: str
    is_reused: bool


class ResultStore:
    """Keeps the result of each step in a file, and reads it back while the inputs are the same."""

    def __init__(self, folder: Path, common: JSONRecord, progress: Progress = nullcontext) -> None:
        self.steps: list[Step] = []
        self._folder = folder
        self._progress = progress
        # What all results depend on: the library's source, its dependencies and the bodies.
        self._common = common

    def step(
        self, name: str, compute: Callable[[], Computed], title: str, **inputs: object
    ) -> Step:
        """Return the result of a step, computed unless its file holds one from the same inputs."""
        key = fingerprint({"step": name, "common": self._common, "inputs": inputs})
        file = self._folder / f"{name}.npz"
        stored = _read(file, key)
        if stored is None:
            with self._progress(title):
                start = time.perf_counter()
                arrays, record = compute()
                seconds = time.perf_counter() - start
            header: JSONRecord = {"fingerprint": key, "seconds": seconds, "record": record}
            save_arrays(file, {**arrays, "about": np.array(json.dumps(header))})
        else:
            header, arrays = stored
        seconds, record = header["seconds"], header["record"]
        step = Step(name, dict(arrays), record, key, seconds, title, stored is not None)
        self.steps.append(step)
        return step


def fingerprint(value: object) -> str:
    """Return a fingerprint of a value, see `describe`."""
    return hashlib.sha256(json.dumps(describe(value), sort_keys=True).encode()).hexdigest()


def _read(file: Path, key: str) -> tuple[JSONRecord, dict[str, Values]] | None:
    """Return the header and the arrays of a step, or None if the file holds another or none."""
    try:
        arrays = load_arrays(file, ["about"])
        header = json.loads(str(arrays.pop("about")))
        return (header, arrays) if header["fingerprint"] == key else None
    except (FileError, FileFormatError, ValueError, KeyError, TypeError, RecursionError):
        return None
