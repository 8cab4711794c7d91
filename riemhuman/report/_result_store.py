"""Results of steps, kept between runs with fingerprints of their inputs."""

from __future__ import annotations

import hashlib
import json
import time
from collections.abc import Callable, Mapping
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy import ndarray

from riemhuman.errors import FileError, FileFormatError
from riemhuman.io.arrays import load_arrays, save_arrays
from riemhuman.io.fingerprint import describe

_LONGEST_RECORD = 2**23

Progress = Callable[[str], AbstractContextManager[Any]]
Computed = tuple[Mapping[str, ndarray], Mapping[str, Any]]


@dataclass(frozen=True)
class Step:
    """The result of a step.

    Attributes
    ----------
    name : str
        Its name.
    arrays : dict of str to array
        Arrays.
    record : dict
        Numbers and words.
    fingerprint : str
        Fingerprint of its inputs.
    seconds : float
        Wall time of the computation, in this run or an earlier one.
    reused : bool
        Whether it was read from the file of an earlier run.
    title : str
        Description of the step.
    """

    name: str
    arrays: dict[str, ndarray]
    record: dict[str, Any]
    fingerprint: str
    seconds: float
    reused: bool
    title: str = ""


class ResultStore:
    """Keeps the result of each step in a file, and reads it back while the inputs are the same.

    Parameters
    ----------
    folder : Path
        Folder of the files.
    common : mapping
        What all steps depend on, such as the version; values that JSON can hold.
    progress : callable, optional
        Called with the description of a step; returns a context that is entered during the step.
    """

    def __init__(
        self, folder: Path, common: Mapping[str, Any], progress: Progress | None = None
    ) -> None:
        self.steps: list[Step] = []
        self._folder = folder
        self._common = dict(common)
        self._progress = progress or (lambda name: nullcontext())

    def step(
        self,
        name: str,
        inputs: Mapping[str, Any],
        compute: Callable[[], Computed],
        title: str | None = None,
    ) -> Step:
        """Return the result of a step, computed unless the file holds one from the same inputs.

        Parameters
        ----------
        name : str
            Name of the step and of its file.
        inputs : mapping
            What the result depends on: values that JSON can hold, arrays and other steps.
        compute : callable
            Returns arrays by name, and numbers and words by name.
        title : str, optional
            Description of the step, for `progress`; by default its name.

        Raises
        ------
        FileError
            If the file cannot be written.
        """
        wanted = fingerprint({"step": name, "common": self._common, "inputs": dict(inputs)})
        file = self._folder / f"{name}.npz"
        step = _read(file, name, wanted)
        if step is None:
            with self._progress(title or name):
                began = time.perf_counter()
                arrays, record = compute()
                seconds = time.perf_counter() - began
            header = {
                "fingerprint": wanted,
                "seconds": seconds,
                "record": dict(record),
                "arrays": sorted(arrays),
            }
            save_arrays(file, {**arrays, "about": np.array(json.dumps(header))}, compressed=True)
            step = Step(name, dict(arrays), dict(record), wanted, seconds, reused=False)
        step = replace(step, title=title or name)
        self.steps.append(step)
        return step


def fingerprint(value: Any) -> str:
    """Return a fingerprint of a value.

    Parameters
    ----------
    value : object
        Made of values that JSON can hold, arrays and steps.

    Returns
    -------
    str
        64 hexadecimal digits.
    """
    text = json.dumps(value, sort_keys=True, default=_plain)
    return hashlib.sha256(text.encode()).hexdigest()


def _plain(value: Any) -> Any:
    if isinstance(value, Step):
        return value.fingerprint
    return describe(np.asarray(value))


def _read(file: Path, name: str, wanted: str) -> Step | None:
    """Return the step in a file, or None if the file holds no step with this fingerprint."""
    if not file.is_file():
        return None
    try:
        arrays = load_arrays(file, ["about"])
        about = str(arrays.pop("about"))
        # Parsed JSON takes far more memory than its text, which itself was compressed.
        if len(about) > _LONGEST_RECORD:
            return None
        header = json.loads(about)
        found, seconds, record = (header[key] for key in ("fingerprint", "seconds", "record"))
        complete = sorted(arrays) == header["arrays"]
    except (FileError, FileFormatError, ValueError, KeyError, TypeError, RecursionError):
        return None
    if found != wanted or not complete:
        return None
    return Step(name, arrays, record, found, seconds, reused=True)
