"""Results kept between runs, each with a fingerprint of its inputs.

Whole files of finished steps; `job_folder` holds tables that are filled in place.
"""

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
from riemhuman.storage.array_files import load_arrays, save_arrays
from riemhuman.storage.fingerprint import describe

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
        What it was computed from, in short.
    seconds : float
        Wall time of the computation, whenever that was.
    reused : bool
        Whether it was read from the file of an earlier run.
    title : str
        What was done, in words.
    """

    name: str
    arrays: dict[str, ndarray]
    record: dict[str, Any]
    fingerprint: str
    seconds: float
    reused: bool
    title: str = ""


class ResultStore:
    """Keeps the result of every step in a file, and reads it back while its inputs are the same.

    Parameters
    ----------
    folder : Path
        Folder of the files.
    common : mapping
        What all steps depend on, such as the version; made of what JSON knows.
    progress : callable, optional
        Takes what is being done to a context that lasts as long.
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
        """Return the result of a step, computed unless the file holds that of the same inputs.

        Parameters
        ----------
        name : str
            Name of the step and of its file.
        inputs : mapping
            What the result depends on, made of what JSON knows and of other steps.
        compute : callable
            Returns arrays by name, and numbers and words by name.
        title : str, optional
            What is being done, for `progress`.

        Returns
        -------
        Step

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
        Made of what JSON knows, of arrays and of steps.

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
    """Return the step in a file, nothing if it is another or none."""
    if not file.is_file():
        return None
    try:
        arrays = load_arrays(file, ["about"])
        about = str(arrays.pop("about"))
        # Lists of JSON take far more memory than their text, which may be compressed as well.
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
