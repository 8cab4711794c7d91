"""Files of scans, which hold meshes or loose points."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np
from numpy import ndarray

from riemhuman.errors import FileError, FileFormatError
from riemhuman.io._ply import read_ply
from riemhuman.io.arrays import load_array
from riemhuman.io.files import file_path, read_bytes
from riemhuman.io.meshes import check_not_point_cloud, load_mesh

POINT_SUFFIXES = (".ply", ".obj", ".off", ".stl", ".glb", ".xyz", ".npy")
"""Suffixes of the files that `load_points` reads."""

_Points = tuple[ndarray, "ndarray | None", "ndarray | None"]


def load_points(path: str | os.PathLike[str]) -> tuple[ndarray, ndarray | None, ndarray | None]:
    r"""Read points from a file, with their triangles and normals if it has some.

    Parameters
    ----------
    path : path_like
        A mesh file (PLY, OBJ, OFF, STL or GLB), a PLY file without faces, text with a point a line
        (.xyz) or an array (.npy). Three columns more than the position are taken for normals if
        they have unit length.

    Returns
    -------
    points : array, shape (N, 3)
        In the file's unit.
    faces : array of int, shape (F, 3), or None
    normals : array, shape (N, 3), or None

    Examples
    --------
    >>> import riemhuman as rh
    >>> with open("scan.xyz", "w") as file:
    ...     _ = file.write("0 0 0\n0 1.7 0\n")
    >>> points, faces, normals = rh.io.load_points("scan.xyz")
    >>> points.shape, faces, normals
    ((2, 3), None, None)
    """
    file = file_path(path)
    suffix = file.suffix.lower()
    if suffix not in POINT_SUFFIXES:
        check_not_point_cloud(file)
        raise FileFormatError(
            f"{file}: the ending must be one of {', '.join(POINT_SUFFIXES)}; found "
            f"{file.suffix or 'none'!r}"
        )
    if file.is_dir():
        raise FileError(f"{file} is a folder; a scan was expected")
    if not file.exists():
        raise FileError(f"there is no file {file}")
    if suffix in (".npy", ".xyz"):
        return _split_columns(load_array(file) if suffix == ".npy" else _text_rows(file), file)
    if suffix == ".ply":
        try:
            points, faces, normals = read_ply(file)
        except FileFormatError as error:
            raise FileFormatError(f"{file}: {error}") from error
        if faces is None:
            return _check_finite(points, file), None, normals
    points, faces = load_mesh(file)
    return points, faces, None


def _split_columns(values: ndarray, file: Path) -> _Points:
    """Return points and normals of an array with 3 columns or more."""
    if values.ndim != 2 or values.shape[1] < 3 or values.dtype.kind not in "fiu":
        raise FileFormatError(
            f"{file}: an array of points has numbers in 3 columns, or 6 with normals; found "
            f"shape {values.shape} of {values.dtype}"
        )
    points = _check_finite(np.asarray(values[:, :3], dtype=np.float64), file)
    if values.shape[1] != 6:
        return points, None, None
    normals = np.asarray(values[:, 3:], dtype=np.float64)
    # The last three of six columns are normals or colours.
    lengths = np.linalg.norm(normals, axis=1)
    return points, None, normals if np.all(np.abs(lengths - 1.0) < 0.01) else None


def _text_rows(file: Path) -> ndarray:
    rows: list[list[float]] = []
    for number, line in enumerate(read_bytes(file).decode("latin-1").splitlines(), start=1):
        words = line.replace(",", " ").split()
        if not words or words[0].startswith(("#", "//")):
            continue
        try:
            row = [float(word) for word in words]
        except ValueError:
            row = []
        if len(row) != len(rows[0] if rows else words):
            raise FileFormatError(
                f"{file}: line {number} must hold {len(rows[0] if rows else words)} numbers, as "
                f"the first; found {line.strip()[:60]!r}"
            )
        rows.append(row)
    return np.array(rows)


def _check_finite(points: ndarray, file: Path) -> ndarray:
    is_finite = np.isfinite(points).all(axis=1)
    if not is_finite.all():
        first = int(np.argmin(is_finite))
        raise FileFormatError(
            f"{file}: point {first} (and {int((~is_finite).sum()) - 1} more) is not finite: "
            f"{points[first].tolist()}"
        )
    return points
