"""Files of measurement sets: JSON with one entry per line."""

from __future__ import annotations

import json
import os
from collections.abc import Callable, Mapping, Sequence
from typing import Any, TypeVar

import numpy as np
from numpy import ndarray

from riemhuman.errors import ArgumentError, FileFormatError
from riemhuman.io.files import atomic_file, file_path, read_bytes
from riemhuman.measurements.definitions import measurement_from_dict
from riemhuman.measurements.moved_landmarks import Landmark

_FORMAT = 1

Found = TypeVar("Found")


def write_set(
    path: str | os.PathLike[str], description: Any, landmarks: Mapping[str, Landmark]
) -> None:
    """Write a measurement set.

    Parameters
    ----------
    path : path_like
        File to write; an existing file is replaced.
    description : MeasurementSet
        The set.
    landmarks : mapping of str to pair
        Those of its landmarks that are not joints of its body model.

    Raises
    ------
    FileError
        If it cannot be written.
    """
    pose = description.standard_pose
    record = {
        "format": _FORMAT,
        "n_vertices": description.n_vertices,
        "n_faces": len(description.faces),
        "measurements": [measurement.to_dict() for measurement in description.measurements],
        "landmarks": {
            name: {"vertices": vertices.tolist(), "weights": weights.tolist()}
            for name, (vertices, weights) in landmarks.items()
        },
        "parts": {name: _runs(faces) for name, faces in description.parts.items()},
        "frame": list(description.frame),
        "axes": description.axes.tolist(),
        "standard_pose": {name: np.asarray(turn).tolist() for name, turn in pose.items()},
    }
    with atomic_file(file_path(path)) as file:
        file.write_text(_json_text(record), encoding="utf-8")


def read_set(
    path: str | os.PathLike[str], sizes: tuple[int, int], make: Callable[[dict[str, Any]], Found]
) -> Found:
    """Read a measurement set that `write_set` has written.

    Parameters
    ----------
    path : path_like
        The file.
    sizes : pair of int
        Numbers of vertices and triangles of the template.
    make : callable
        Takes a dictionary of the parameters of `MeasurementSet` other than the template.

    Returns
    -------
    object
        The result of `make`.

    Raises
    ------
    FileError
        If the file is missing or cannot be read.
    FileFormatError
        If the file does not hold measurements, or is for another template.
    """
    try:
        record = json.loads(read_bytes(file_path(path)))
        found = (record["n_vertices"], record["n_faces"])
        if found != sizes:
            raise ArgumentError(
                f"it is for {found[0]} vertices and {found[1]} triangles; the template has "
                f"{sizes[0]} and {sizes[1]}"
            )
        fields = {name: record[name] for name in ("frame", "axes", "standard_pose")}
        fields["measurements"] = [measurement_from_dict(entry) for entry in record["measurements"]]
        fields["landmarks"] = {
            name: (np.array(mark["vertices"]), np.array(mark["weights"]))
            for name, mark in record["landmarks"].items()
        }
        fields["parts"] = {name: _numbers(runs) for name, runs in record["parts"].items()}
        return make(fields)
    except (KeyError, TypeError, ValueError, AttributeError) as error:
        reason = f"it lacks {error}" if isinstance(error, KeyError) else str(error)
        raise FileFormatError(f"{file_path(path)} does not hold measurements: {reason}") from error


def _runs(numbers: ndarray) -> list[list[int]]:
    """Return whole numbers as the first and last of each run of consecutive ones."""
    ordered = np.unique(numbers)
    breaks = np.flatnonzero(np.diff(ordered) > 1)
    firsts = np.concatenate([ordered[:1], ordered[breaks + 1]])
    lasts = np.concatenate([ordered[breaks], ordered[-1:]])
    return np.stack([firsts, lasts], axis=1).tolist()


def _numbers(runs: Sequence[Sequence[int]]) -> ndarray:
    ranges = [np.arange(first, last + 1) for first, last in runs]
    return np.concatenate(ranges) if ranges else np.empty(0, dtype=np.int64)


def _json_text(record: Mapping[str, Any]) -> str:
    """Return JSON with one entry per line, two levels deep."""
    lines = []
    for key, value in record.items():
        if isinstance(value, dict) and value:
            inner = ",\n".join(
                f"  {json.dumps(k)}: {json.dumps(v, ensure_ascii=False)}" for k, v in value.items()
            )
            lines.append(f" {json.dumps(key)}: {{\n{inner}\n }}")
        elif isinstance(value, list) and value and isinstance(value[0], dict):
            inner = ",\n".join(f"  {json.dumps(entry, ensure_ascii=False)}" for entry in value)
            lines.append(f" {json.dumps(key)}: [\n{inner}\n ]")
        else:
            lines.append(f" {json.dumps(key)}: {json.dumps(value)}")
    return "{\n" + ",\n".join(lines) + "\n}\n"
