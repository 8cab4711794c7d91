"""Preparation of raw scans: conversion to metres, normals, removal of floor and stray points."""

from __future__ import annotations

import os
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy import ndimage

from riemhuman.checks import one_of, real_array
from riemhuman.errors import ArgumentError
from riemhuman.io.mesh_arrays import check_mesh
from riemhuman.kernels.vertex_normals import unit_vectors, vertex_normals
from riemhuman.registration.scan_files import read_scan
from riemhuman.registration.scan_normals import (
    estimated_normals,
    has_one_side,
    outward,
    smoothed_normals,
)
from riemhuman.registration.surface_points import thinned
from riemhuman.units import UNITS

FEWEST_POINTS = 200
# A fit gains nothing from more points.
MOST_POINTS = 20_000
_FIRST_POINTS = 80_000

# Smallest and largest extent of a body with its surroundings, metres. Their ratio is 10, as between
# centimetres and millimetres, so that one unit fits at most.
_EXTENTS = (0.4, 4.0)
_NOTICED = ("metres", "centimetres", "millimetres")

_CELL_METRES = 0.05
# Separate parts with a smaller share of the points count as strays.
_STRAY = 0.004
_FLOOR_METRES, _NEAR_FLOOR_METRES = 0.01, 0.02
_FLOOR_SHARE, _ABOVE_FLOOR = 0.04, 0.97
_N_PLANES = 200


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


@dataclass(frozen=True, eq=False)
class ReadyScan:
    """Evenly spread points of a scan, ready for registration.

    Attributes
    ----------
    points, normals : array, shape (n, 3)
        Points of the body, metres, and unit normals.
    background : array of bool, shape (N,)
        Which points of the whole scan are floor or strays.
    up : array, shape (3,), or None
        Upward normal of the floor, if there is one.
    estimated : bool
        Whether the normals were estimated from the points alone, so that some may be flipped.
    """

    points: np.ndarray
    normals: np.ndarray
    background: np.ndarray
    up: np.ndarray | None
    estimated: bool


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


def as_scan(scan: Any, unit: str | None = None) -> Scan:
    """Return a scan in metres.

    Parameters
    ----------
    scan : Scan, path, array_like or pair
        A scan; a file; points, shape (N, 3), or with normals after them, shape (N, 6); or
        vertices and faces.
    unit : {"metres", "centimetres", "millimetres", "inches"}, optional
        Its unit; by default it is inferred from the size.

    Raises
    ------
    RiemhumanError
        As for `load_scan`, or if an array does not hold points.
    """
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
    """Return a scan in metres, whose unit is given or inferred from its size.

    Parameters
    ----------
    points : array, shape (N, 3)
        Points.
    faces : array of int, shape (F, 3), or None
        Triangles.
    normals : array, shape (N, 3), or None
        Normals.
    unit : str or None
        The unit, if it is known.
    name : str
        Name of the scan, for messages.

    Raises
    ------
    ArgumentError
        If there are too few points, or the size is not that of a body in any unit.
    """
    if len(points) < FEWEST_POINTS:
        raise ArgumentError(f"{name} has {len(points)} points; at least {FEWEST_POINTS} are needed")
    # Percentiles, because a few strays may be far away.
    low, high = np.percentile(points, [1.0, 99.0], axis=0)
    extent = float((high - low).max())
    if unit is None:
        fitting = [
            each
            for each in _NOTICED
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


def made_ready(scan: Scan, *, surroundings: bool = True) -> ReadyScan:
    """Return the points of the body, spread evenly, with normals.

    Parameters
    ----------
    scan : Scan
        A scan.
    surroundings : bool
        Whether to remove a floor and strays.

    Raises
    ------
    ArgumentError
        If too few points are left.
    """
    rng = np.random.default_rng(0)
    numbers = np.arange(len(scan.points))
    if scan.faces is not None:
        numbers = np.unique(scan.faces)
    if len(numbers) > _FIRST_POINTS:
        numbers = np.sort(rng.choice(numbers, _FIRST_POINTS, replace=False))
    numbers = numbers[thinned(scan.points[numbers], MOST_POINTS, rng)]
    points = scan.points[numbers]
    estimated = scan.normals is None and (scan.faces is None or not has_one_side(scan.faces))
    normals = estimated_normals(points) if estimated else _normals(scan, numbers)
    background = np.zeros(len(scan.points), dtype=bool)
    if not surroundings:
        return ReadyScan(points, normals, background, None, estimated)
    floor = _floor(points, normals, rng)
    up = None
    if floor is not None:
        up, height = floor
        background |= scan.points @ up < height + _NEAR_FLOOR_METRES
        keep = ~background[numbers]
        points, normals, numbers = points[keep], normals[keep], numbers[keep]
    background |= _strays(scan.points, ~background)
    keep = ~background[numbers]
    if keep.sum() < FEWEST_POINTS:
        raise ArgumentError(
            f"scan has {int(keep.sum())} points without the floor and strays; at least "
            f"{FEWEST_POINTS} are needed"
        )
    points, normals = points[keep], normals[keep]
    if estimated and background.any():
        normals = estimated_normals(points)  # the background may have flipped signs
    return ReadyScan(points, normals, background, up, estimated)


def _normals(scan: Scan, numbers: np.ndarray) -> np.ndarray:
    """Return the normals of a scan or of its triangles, smoothed and outward."""
    points = scan.points[numbers]
    if scan.normals is not None:
        normals = scan.normals[numbers]
    else:
        assert scan.faces is not None
        normals = vertex_normals(scan.points, scan.faces)[numbers]
    normals = smoothed_normals(points, normals)
    return normals if outward(points, normals) else -normals


def _floor(
    points: np.ndarray, normals: np.ndarray, rng: np.random.Generator
) -> tuple[np.ndarray, float] | None:
    """Return the upward normal and the height of a wide plane with all other points above it."""
    best, support = None, _FLOOR_SHARE * len(points)
    for start in rng.choice(len(points), min(_N_PLANES, len(points)), replace=False):
        across = normals[start]
        heights = points @ across
        near = np.abs(heights - heights[start]) < _FLOOR_METRES
        near &= np.abs(normals @ across) > 0.9
        if near.sum() > support:
            best, support = start, near.sum()
    if best is None:
        return None
    up = normals[best]
    near = np.abs((points - points[best]) @ up) < _FLOOR_METRES
    centre = points[near].mean(axis=0)
    up = np.linalg.svd(points[near] - centre, full_matrices=False)[2][2]
    heights = (points - centre) @ up
    if np.median(heights[~near]) < 0:
        up, heights = -up, -heights
    above = heights[~near] > -_NEAR_FLOOR_METRES
    spread = points[near].std(axis=0)
    is_wide = np.sort(spread)[1] > 0.2
    if above.mean() < _ABOVE_FLOOR or not is_wide:
        return None
    return up, float(centre @ up)


def _strays(points: np.ndarray, wanted: np.ndarray) -> np.ndarray:
    """Tell which points belong to small separate parts."""
    strays = np.zeros(len(points), dtype=bool)
    chosen = points[wanted]
    if not len(chosen):
        return strays
    low, high = np.percentile(chosen, [0.5, 99.5], axis=0)
    low, high = low - 0.5, high + 0.5
    inside = ((chosen >= low) & (chosen <= high)).all(axis=1)
    cells = np.floor((chosen[inside] - low) / _CELL_METRES).astype(np.int64)
    grid = np.zeros(np.ceil((high - low) / _CELL_METRES).astype(int) + 1, dtype=bool)
    grid[tuple(cells.T)] = True
    labels, _ = ndimage.label(grid, structure=np.ones((3, 3, 3)))
    own = labels[tuple(cells.T)]
    sizes = np.bincount(own)
    is_stray = np.ones(len(chosen), dtype=bool)
    is_stray[inside] = sizes[own] < _STRAY * len(chosen)
    strays[wanted] = is_stray
    return strays
