"""Reading of files of scans, which hold meshes or loose points."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np

from riemhuman.errors import FileError, FileFormatError
from riemhuman.io._ply import has_ply_faces, read_ply_points
from riemhuman.io.arrays import load_array
from riemhuman.io.files import file_path, read_bytes
from riemhuman.io.meshes import load_mesh

SUFFIXES = (".ply", ".obj", ".off", ".xyz", ".npy")
"""Suffixes of the files of scans."""

_Parts = tuple[np.ndarray, "np.ndarray | None", "np.ndarray | None"]


def read_scan(path: str | os.PathLike[str]) -> _Parts:
    """Return the points, triangles and normals of a file, in its unit.

    Parameters
    ----------
    path : path_like
        The file.

    Returns
    -------
    points : array, shape (N, 3)
    faces : array of int, shape (F, 3), or None
    normals : array, shape (N, 3), or None

    Raises
    ------
    FileError
        If the file is missing or cannot be read.
    FileFormatError
        If the suffix is unknown or the file is damaged.
    """
    file = file_path(path)
    suffix = file.suffix.lower()
    if suffix not in SUFFIXES:
        found = repr(file.suffix) if file.suffix else "none"
        raise FileFormatError(
            f"{file}: the ending must be one of {', '.join(SUFFIXES)}; found {found}"
        )
    if file.is_dir():
        raise FileError(f"{file} is a folder; a scan was expected")
    if not file.exists():
        raise FileError(f"there is no file {file}")
    if suffix == ".npy":
        return _columns(load_array(file), file)
    if suffix == ".xyz":
        return _columns(_text(file), file)
    if suffix == ".ply":
        try:
            content = read_bytes(file)
            if not has_ply_faces(content):
                points, normals = read_ply_points(content)
                return _checked(points.astype(np.float64), file), None, normals
        except FileFormatError as error:
            raise FileFormatError(f"{file}: {error}") from error
    points, faces = load_mesh(file)
    return points, faces, None


def _columns(values: np.ndarray, file: Path) -> _Parts:
    if values.ndim != 2 or values.shape[1] < 3 or values.dtype.kind not in "fiu":
        raise FileFormatError(
            f"{file}: an array of points has numbers in 3 columns, or 6 with normals; found "
            f"shape {values.shape} of {values.dtype}"
        )
    points = _checked(np.asarray(values[:, :3], dtype=np.float64), file)
    if values.shape[1] != 6:
        return points, None, None
    normals = np.asarray(values[:, 3:], dtype=np.float64)
    # The last three of six columns are normals or colours.
    lengths = np.linalg.norm(normals, axis=1)
    return points, None, normals if np.all(np.abs(lengths - 1.0) < 0.01) else None


def _text(file: Path) -> np.ndarray:
    lines = read_bytes(file).decode("latin-1").splitlines()
    rows, width = [], 0
    for number, line in enumerate(lines, start=1):
        words = line.replace(",", " ").split()
        if not words or words[0].startswith(("#", "//")):
            continue
        width = width or len(words)
        try:
            row = [float(word) for word in words]
        except ValueError:
            row = []
        if len(row) != width:
            raise FileFormatError(
                f"{file}: line {number} must hold {width} numbers, as the first; found "
                f"{line.strip()[:60]!r}"
            )
        rows.append(row)
    return np.array(rows)


def _checked(points: np.ndarray, file: Path) -> np.ndarray:
    finite = np.isfinite(points).all(axis=1)
    if not finite.all():
        first = int(np.argmin(finite))
        raise FileFormatError(
            f"{file}: point {first} (and {int((~finite).sum()) - 1} more) is not finite: "
            f"{points[first].tolist()}"
        )
    return points
