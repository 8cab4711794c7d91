"""Tiles of a distance matrix, computed from features on disk."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy import ndarray

from riemhuman.errors import FileError, FileFormatError
from riemhuman.geometry import RiemannianMetric
from riemhuman.geometry.pairwise import squared_dist_rectangle
from riemhuman.io.arrays import load_array
from riemhuman.kernels.tiles import slices

POINTS = "points.npy"
"""Name of the file of points, if a job keeps them."""

# Numbers of eight bytes in memory for each pair of a tile while it is computed and mirrored.
_COPIES = 6


@dataclass(frozen=True)
class Tile:
    """A rectangle of the upper triangle of a distance matrix.

    Parameters
    ----------
    rows, columns : slice
        Numbers of points: the same on the diagonal, otherwise the columns follow the rows.
    """

    rows: slice
    columns: slice

    @property
    def n_pairs(self) -> int:
        """Number of pairs of different points."""
        n_rows = self.rows.stop - self.rows.start
        if self.rows == self.columns:
            return n_rows * (n_rows - 1) // 2
        return n_rows * (self.columns.stop - self.columns.start)


def tiles_of(n_points: int, size: int) -> Iterator[Tile]:
    """Divide the upper triangle of a distance matrix into tiles, row by row.

    Parameters
    ----------
    n_points : int
        Number of points.
    size : int
        Points on a side of a tile.
    """
    sides = list(slices(n_points, size))
    for i, rows in enumerate(sides):
        for columns in sides[i:]:
            yield Tile(rows, columns)


def memory_of_tile(n_bytes: int, size: int) -> int:
    """Return how many bytes of memory a tile takes while it is computed.

    Parameters
    ----------
    n_bytes : int
        Bytes kept for one point.
    size : int
        Points on a side of the tile.
    """
    return 2 * n_bytes * size + 8 * _COPIES * size**2


def largest_tile(n_bytes: int, memory: int) -> int:
    """Return the largest side of a tile for which `memory_of_tile` is within a budget.

    Parameters
    ----------
    n_bytes : int
        Bytes kept for one point.
    memory : int
        Bytes of memory.

    Returns
    -------
    int
        Points on a side; 0 if the budget is too small for any tile.
    """
    square = 8 * _COPIES
    return int((math.sqrt(n_bytes**2 + square * memory) - n_bytes) / square)


def feature_file(number: int) -> str:
    """Return the name of the file of the k-th features.

    Parameters
    ----------
    number : int
        k.
    """
    return f"features_{number}.npy"


@dataclass
class TileReader:
    """Computes tiles from the files of a job, in this process or in a worker of a cluster.

    Parameters
    ----------
    folder : str
        Folder of the job.
    n_features : int
        Number of files of features.
    n_jobs : int or None
        Number of threads.
    """

    folder: str
    n_features: int
    n_jobs: int | None
    _rows: tuple[slice, tuple[ndarray, ...]] | None = field(
        default=None, init=False, repr=False, compare=False
    )

    def distances(self, metric: RiemannianMetric, tile: Tile) -> ndarray:
        """Return the distances of a tile.

        Parameters
        ----------
        metric : RiemannianMetric
            The metric.
        tile : Tile
            Which distances to compute.

        Returns
        -------
        array, shape (n_rows, n_columns)

        Raises
        ------
        FileError
            If a file of the job cannot be read.
        FileFormatError
            If a file of the job is damaged.
        ArgumentError
            If a distance overflows double precision.
        """
        # Tiles come row by row, so that many of them share the features of their rows.
        if self._rows is None or self._rows[0] != tile.rows:
            self._rows = (tile.rows, self._features(tile.rows))
        rows = self._rows[1]
        columns = rows if tile.columns == tile.rows else self._features(tile.columns)
        points = self._points()
        squared = squared_dist_rectangle(
            metric, rows, columns, points[tile.rows], points[tile.columns], self.n_jobs
        )
        return np.sqrt(squared)

    def _features(self, part: slice) -> tuple[ndarray, ...]:
        # Copied, since compiled loops take no memory maps, whose pages need not stay in memory.
        names = map(feature_file, range(self.n_features))
        return tuple(np.array(self._open(name)[part], order="C") for name in names)

    def _points(self) -> ndarray:
        """Return the points if the job keeps them, otherwise an empty array that is not used."""
        if (Path(self.folder) / POINTS).exists():
            return self._open(POINTS)
        return np.empty(0)

    def _open(self, name: str) -> Any:
        file = Path(self.folder) / name
        try:
            return load_array(file, mode="r")
        except FileError as error:
            raise FileError(
                f"{error}; the folder of a job must be on a file system that all workers share"
            ) from error
        except FileFormatError as error:
            raise FileFormatError(f"{file} is not a table of a job: {error}") from error
