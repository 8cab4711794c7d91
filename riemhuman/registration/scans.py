"""Scans and their landmarks: files, arrays and units."""

from __future__ import annotations

import os
from dataclasses import dataclass

import numpy as np

from riemhuman.arrays import Array, Triangles
from riemhuman.checks import UNITS, check_resolution, is_human_size, one_of, real_array
from riemhuman.errors import ArgumentError, FileFormatError
from riemhuman.io.files import file_path
from riemhuman.io.kinds_of_files import AFTER, BY_SCAN, FileKind, reads
from riemhuman.io.mesh_arrays import check_triangles
from riemhuman.io.meshes import POINT_SUFFIXES, WRITTEN_SUFFIXES, as_arrays, load_points
from riemhuman.io.text_tables import read_named_rows

FEWEST_POINTS = 200

_INFERRED_UNITS = ("metres", "centimetres", "millimetres")
# Coordinates beyond this multiple of the scan's size are mistakes in a file, not strays.
_LARGEST_OUTLIER = 1e6


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
        Normals in the file or array of loose points, of any length.
    unit : str
        The original unit of the scan.

    Examples
    --------
    >>> scan = rh.registration.Scan(rh.datasets.load_open_bodies("coarse")[0])
    >>> len(scan), scan.unit
    (1202, 'metres')
    """

    points: Array
    faces: Triangles | None = None
    normals: Array | None = None
    unit: str = "metres"

    def __post_init__(self) -> None:
        points = real_array(self.points, "points", ("N", 3), batched=False)
        values: dict[str, object] = {"points": points}
        if self.faces is not None:
            values["faces"] = check_triangles(self.faces, len(points))
        if self.normals is not None:
            values["normals"] = real_array(self.normals, "normals", (len(points), 3), batched=False)
        one_of(self.unit, "unit", tuple(UNITS))
        # As the class is frozen; what was checked takes the place of what was given.
        vars(self).update(values)

    def __len__(self) -> int:
        return len(self.points)


@reads(
    FileKind(
        "a raw scan",
        "registration.load_scan",
        POINT_SUFFIXES,
        registered=BY_SCAN,
        measured=AFTER,
        written=WRITTEN_SUFFIXES,
    )
)
def load_scan(path: str | os.PathLike[str], unit: str | None = None) -> Scan:
    """Read a scan from a file, in metres.

    Parameters
    ----------
    path : path_like
        A mesh (PLY, OBJ, OFF, STL or GLB) or loose points (PLY, XYZ or NPY), by its suffix. XYZ and
        NPY files hold x, y, z and possibly a unit normal.
    unit : {"metres", "centimetres", "millimetres", "inches"}, optional
        Unit of the file; by default it is inferred from the size.

    Raises
    ------
    ArgumentError
        If there are fewer than 200 points, or if the scan does not have the size of a body in any
        unit.

    Examples
    --------
    >>> bodies = rh.datasets.load_open_bodies("coarse")
    >>> rh.save_mesh("scan.ply", 1000.0 * bodies[0], bodies.template.faces)
    >>> rh.registration.load_scan("scan.ply").unit
    'millimetres'
    """
    return _in_metres(*load_points(path), unit, os.fspath(path))


def load_landmarks(path: str | os.PathLike[str]) -> dict[str, Array]:
    """Read landmarks of a scan, shape (3,) each, for `ScanRegistration.solve`.

    Parameters
    ----------
    path : path_like
        A .csv file with a line ``name,x,y,z`` for each landmark: a joint of the body model, and its
        position in the unit of the scan, with decimal points; semicolons or tabs may replace the
        commas. A first line without numbers is a header.

    Examples
    --------
    >>> with open("landmarks.csv", "w") as file:
    ...     print("left_wrist,0.62,1.31,0.05", file=file)
    >>> rh.registration.load_landmarks("landmarks.csv")["left_wrist"].tolist()
    [0.62, 1.31, 0.05]
    """
    file = file_path(path)
    rows = read_named_rows(file, "name", ("x", "y", "z"))
    try:
        positions = real_array(list(rows.values()), "landmarks", (len(rows), 3), batched=False)
    except ArgumentError as error:
        raise FileFormatError(f"{file}: {error}") from error
    return dict(zip(rows, positions, strict=True))


def as_scan(scan: object, unit: str | None = None) -> Scan:
    """Return a scan in metres."""
    if isinstance(scan, Scan):
        return scan
    if isinstance(scan, (str, os.PathLike)):
        return load_scan(scan, unit)
    is_pair = isinstance(scan, tuple) and len(scan) == 2
    if is_pair or hasattr(scan, "faces") or hasattr(scan, "cells"):
        vertices, faces = as_arrays(scan)
        check_resolution(vertices, "scan")
        return _in_metres(vertices, faces, None, unit)
    values = real_array(scan, "scan", ("N", "C"), batched=False)
    if values.shape[1] not in (3, 6):
        raise ArgumentError(
            f"scan must have 3 columns, or 6 with normals; found shape {values.shape}"
        )
    check_resolution(values[:, :3], "scan", getattr(scan, "dtype", None))
    normals = values[:, 3:] if values.shape[1] == 6 else None
    return _in_metres(values[:, :3], None, normals, unit)


def _in_metres(
    points: Array,
    faces: Triangles | None,
    normals: Array | None,
    unit: str | None,
    name: str = "scan",
) -> Scan:
    """Return a scan in metres, whose unit is given or inferred from its size."""
    if len(points) < FEWEST_POINTS:
        raise ArgumentError(f"{name} has {len(points)} points; at least {FEWEST_POINTS} are needed")
    # Percentiles, because a few strays may be far away.
    low, high = np.percentile(points, [1.0, 99.0], axis=0)
    extent = float((high - low).max())
    farthest = np.abs(points - np.median(points, axis=0)).max(axis=1)
    if farthest.max() > _LARGEST_OUTLIER * extent:
        raise ArgumentError(
            f"{name}: point {int(farthest.argmax())} is {farthest.max():.3g} away from a scan of "
            f"size {extent:.3g}"
        )
    if unit is None:
        fitting = [
            candidate
            for candidate in _INFERRED_UNITS
            if is_human_size(extent, unit=UNITS[candidate])
        ]
        if not fitting:
            raise ArgumentError(
                f"{name} is {extent:.3g} long, which is not the size of a body in metres, "
                "centimetres or millimetres; set its unit with unit="
            )
        (unit,) = fitting
    size = UNITS[one_of(unit, "unit", tuple(UNITS))]
    return Scan(points / size, faces, normals, unit)
