"""Scans and their landmarks: files, arrays and units."""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from riemhuman.checks import one_of, real_array
from riemhuman.errors import ArgumentError, FileError, FileFormatError
from riemhuman.io._ply import has_ply_faces, read_ply_points
from riemhuman.io.arrays import load_array
from riemhuman.io.files import file_path, read_bytes
from riemhuman.io.mesh_arrays import check_mesh
from riemhuman.io.meshes import load_mesh
from riemhuman.io.text_tables import read_named_rows
from riemhuman.kernels.vertex_normals import unit_vectors
from riemhuman.units import UNITS

# Suffixes of the files of scans.
SUFFIXES = (".ply", ".obj", ".off", ".xyz", ".npy")
FEWEST_POINTS = 200

# Smallest and largest extent of a body with its surroundings, metres. Their ratio is 10, as between
# centimetres and millimetres, so that one unit fits at most.
_EXTENTS = (0.4, 4.0)
_INFERRED_UNITS = ("metres", "centimetres", "millimetres")

_Parts = tuple[np.ndarray, "np.ndarray | None", "np.ndarray | None"]


@dataclass(frozen=True, eq=False)
class Scan:
    """A scan in metres.

    Attributes
    ----------
    points : array, shape (N, 3)
        Points, metres.
    faces : array of int, shape (F, 3), or None
        Triangles of a mesh.
    normals : array, shape (N, 3), or None
        Normals in the file or array of loose points.
    unit : str
        The original unit of the scan.

    Examples
    --------
    >>> import riemhuman as rh
    >>> scan = rh.registration.Scan(rh.datasets.load_open_bodies("coarse")[0])
    >>> len(scan), scan.unit
    (1202, 'metres')
    """

    points: np.ndarray
    faces: np.ndarray | None = None
    normals: np.ndarray | None = None
    unit: str = "metres"

    def __len__(self) -> int:
        return len(self.points)


def load_scan(path: str | os.PathLike[str], unit: str | None = None) -> Scan:
    """Read a scan from a file.

    Parameters
    ----------
    path : path_like
        A mesh (PLY, OBJ or OFF) or loose points (PLY, XYZ or NPY), by its suffix. A line of an XYZ
        file holds x, y, z and possibly a unit normal; other values are ignored. An NPY file holds
        an array, shape (N, 3), or (N, 6) with unit normals.
    unit : {"metres", "centimetres", "millimetres", "inches"}, optional
        Unit of the file; by default it is inferred from the size.

    Returns
    -------
    scan : Scan
        In metres.

    Raises
    ------
    ArgumentError
        If there are fewer than 200 points, or the size is not that of a body in any unit.
    FileError
        If the file is missing or cannot be read.
    FileFormatError
        If the suffix is unknown, the file is damaged, or a coordinate is not finite.

    Examples
    --------
    >>> import riemhuman as rh
    >>> bodies = rh.datasets.load_open_bodies("coarse")
    >>> rh.save_mesh("scan.ply", 1000.0 * bodies[0], bodies.template.faces)
    >>> scan = rh.registration.load_scan("scan.ply")
    >>> len(scan), scan.unit
    (1202, 'millimetres')
    """
    return in_metres(*read_scan(path), unit=unit, name=os.fspath(path))


def load_landmarks(path: str | os.PathLike[str]) -> dict[str, np.ndarray]:
    """Read landmarks of a scan for `ScanRegistration.solve`.

    Parameters
    ----------
    path : path_like
        A .csv file with a line ``name,x,y,z`` for each landmark: a joint of the body model, and its
        position in the scan, in the unit of the scan. A first line that begins with ``name`` is a
        header.

    Returns
    -------
    dict of str to array, shape (3,)

    Raises
    ------
    ArgumentTypeError
        If `path` is not a path.
    FileError
        If the file is missing or cannot be read.
    FileFormatError
        If a name is missing or repeated, or a line has no three finite numbers.

    Examples
    --------
    >>> import riemhuman as rh
    >>> with open("landmarks.csv", "w") as file:
    ...     print("left_wrist,0.62,1.31,0.05", file=file)
    >>> rh.registration.load_landmarks("landmarks.csv")["left_wrist"].tolist()
    [0.62, 1.31, 0.05]
    """
    file = file_path(path)
    rows = read_named_rows(file, "name")
    try:
        positions = real_array(list(rows.values()), "landmarks", (len(rows), 3), batched=False)
    except ArgumentError as error:
        raise FileFormatError(f"{file}: {error}") from error
    return dict(zip(rows, positions, strict=True))


def as_scan(scan: Any, unit: str | None = None) -> Scan:
    """Return a scan in metres."""
    if isinstance(scan, Scan):
        return scan
    if isinstance(scan, (str, os.PathLike)):
        return in_metres(*read_scan(scan), unit=unit, name=os.fspath(scan))
    if isinstance(scan, tuple) and len(scan) == 2:
        vertices, faces = check_mesh(*scan, names=("the vertices of scan", "the faces of scan"))
        return in_metres(vertices, faces, None, unit=unit)
    values = np.asarray(real_array(scan, "scan", ("N", "C"), batched=False), dtype=np.float64)
    if values.shape[1] not in (3, 6):
        raise ArgumentError(
            f"scan must have 3 columns, or 6 with normals; found shape {values.shape}"
        )
    normals = values[:, 3:] if values.shape[1] == 6 else None
    return in_metres(values[:, :3], None, normals, unit=unit)


def in_metres(
    points: np.ndarray,
    faces: np.ndarray | None,
    normals: np.ndarray | None,
    *,
    unit: str | None,
    name: str = "scan",
) -> Scan:
    """Return a scan in metres, whose unit is given or inferred from its size."""
    if len(points) < FEWEST_POINTS:
        raise ArgumentError(f"{name} has {len(points)} points; at least {FEWEST_POINTS} are needed")
    # Percentiles, because a few strays may be far away.
    low, high = np.percentile(points, [1.0, 99.0], axis=0)
    extent = float((high - low).max())
    if unit is None:
        fitting = [
            each
            for each in _INFERRED_UNITS
            if _EXTENTS[0] * UNITS[each] <= extent < _EXTENTS[1] * UNITS[each]
        ]
        if not fitting:
            raise ArgumentError(
                f"{name} is {extent:.3g} long, which is the size of a body neither in metres nor "
                "in centimetres nor in millimetres; unit= says which unit it is in"
            )
        (unit,) = fitting
    size = UNITS[one_of(unit, "unit", tuple(UNITS))]
    return Scan(points / size, faces, None if normals is None else unit_vectors(normals), unit)


def read_scan(path: str | os.PathLike[str]) -> _Parts:
    """Return the points, triangles and normals of a file, in its unit."""
    file = file_path(path)
    suffix = file.suffix.lower()
    if suffix not in SUFFIXES:
        raise FileFormatError(
            f"{file}: the ending must be one of {', '.join(SUFFIXES)}; "
            f"found {file.suffix or 'none'!r}"
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
