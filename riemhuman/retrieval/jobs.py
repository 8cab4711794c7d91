"""Resumable jobs: distances and paths of all pairs of points, computed part by part on disk.

A job is a folder. Its manifest holds the class, the parameters and the arrays of the metric and the
solver, and the version of the library. When a job is resumed, some of its results are computed
again and compared: if they differ, something that the manifest does not hold has changed, such as a
constant in the code of a metric, and the folder is refused.
"""

from __future__ import annotations

import math
import os
import pkgutil
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Protocol, TypeAlias, TypeVar

import numpy as np
from numpy.typing import DTypeLike
from tqdm import tqdm

from riemhuman.arrays import Array, Booleans, JSONRecord, PointsLike
from riemhuman.checks import a_solver, checked, choice, flag, instance, length_of, whole
from riemhuman.errors import ArgumentError, FileError, FileFormatError, RiemhumanError
from riemhuman.geometry import RiemannianMetric
from riemhuman.geometry.pairwise import PRECISIONS, squared_dist_rectangle
from riemhuman.geometry.strategies import GeodesicSolver
from riemhuman.io.arrays import load_array
from riemhuman.io.fingerprint import describe, digest
from riemhuman.io.job_folder import JobFolder
from riemhuman.kernels.threads import slices, thread_count
from riemhuman.retrieval._cluster import Worker, compute_parts
from riemhuman.solvers.path_comparison import (
    N_COLUMNS,
    PairsOfPoints,
    PathDistances,
    distances_of_rows,
    row_of_path,
)
from riemhuman.solvers.paths import solve_pairs

if TYPE_CHECKING:
    import distributed

_RESULT, _UNFINISHED_RESULT = "D.npy", "D.unfinished.npy"
_ROWS, _DONE, _DIGESTS, _POINTS = "rows.npy", "done.npy", "digests.npy", "points.npy"
_FORMAT = "riemhuman job 7"
_DIGEST_BYTES = 32

# Tiles are small enough for an interrupted job to have made progress, and large enough for their
# overhead not to matter.
_TILES_A_ROW, _SMALLEST_TILE = 8, 256

# Points whose features are computed at a time, and copies of a point's arrays in memory meanwhile.
_BLOCK, _COPIES = 64, 32

# Numbers of eight bytes in memory for each pair of a tile while it is computed and mirrored.
_COPIES_OF_PAIRS = 6

# Pairs whose paths are solved and then written at a time.
_PAIRS = 16

# How much rounding changes what is computed again when a job is resumed, relative to the largest.
_ROUNDING = {"single": 1e-5, "double": 1e-9}
_ROUNDING_OF_PATHS = 1e-4

_A_METRIC = instance(RiemannianMetric, "a metric, such as ElasticMetric(space), before the points")

# Rows and columns: a rectangle of the upper triangle of a matrix, or a square on its diagonal.
Tile: TypeAlias = "tuple[slice[int, int, None], slice[int, int, None]]"


@checked(metric=_A_METRIC, precision=choice(*PRECISIONS), memory=whole(minimum=1), progress=flag)
def pairwise_job(
    metric: RiemannianMetric,
    points: PointsLike,
    folder: str | os.PathLike[str],
    *,
    precision: str = "single",
    memory: int = 2**30,
    n_jobs: int | None = None,
    client: distributed.Client | None = None,
    progress: bool = False,
) -> np.memmap[tuple[int, ...], np.dtype[np.float64]]:
    r"""Compute all distances within a set of points into a file, or resume an earlier run.

    The distances, a read-only memory map of shape (n, n), are those of `metric.dist_pairwise`, bit
    for bit, also for sets that do not fit in memory. An interrupted or killed job continues, with
    its finished tiles, when it is called again with the same arguments. When it is complete, the
    folder contains the distances as `D.npy`, and another call opens them. Both recompute some
    distances, and refuse the folder if they differ.

    Parameters
    ----------
    metric : RiemannianMetric
    points : array or sequence, shape (n, \*shape)
        Points: an array, a memory map, or any object that has a length and whose slices are arrays
        of points. Every call reads each point once, and a few twice.
    folder : path_like
        Folder of the job, created if necessary.
    precision : {"single", "double"}
        See `RiemannianMetric.dist_pairwise`.
    memory : int
        Bytes of memory that arrays may take at a time, also on each worker of a cluster. It
        determines the size of the tiles of a new job.
    n_jobs : int, optional
        Number of threads for each tile, -1 for one per core; by default one.
    client : distributed.Client, optional
        Client of a Dask cluster that computes the tiles. Its workers must be able to import the
        library and to read the folder under the same path. They write nothing.
    progress : bool

    Raises
    ------
    ArgumentError
        If the folder holds a job on other points or with another metric, or anything but a job.
    FileError
        If another process is working in the folder, or the disk is too small.
    ClusterError
        If a cluster has had no worker for a minute.

    Examples
    --------
    >>> bodies = rh.datasets.load_open_bodies("coarse")
    >>> space = rh.AlignedSurfaces(bodies.template)
    >>> rh.pairwise_job(space.metric, bodies.points[:6], "distances").shape
    (6, 6)
    """
    n_points = length_of(points, "points")
    if n_points == 0:
        raise ArgumentError("points must hold at least one point; found none")
    thread_count(n_jobs)
    described = _described(metric) | {"n_points": n_points, "precision": precision}
    first = metric.check_points(points[slice(0, 1)])
    features = metric.features(first, precision)
    job = JobFolder(folder)
    with job.locked():
        layout = job.claim(described, _layout(n_points, first, features, memory))
        tiles = tiles_of(n_points, layout["tile"])
        blocks = list(slices(n_points, layout["block"]))
        arrays = _by_file(features, first)
        tables: dict[str, tuple[tuple[int, ...], DTypeLike]]
        tables = {_DIGESTS: ((len(blocks), _DIGEST_BYTES), np.uint8)}
        complete = job.exists(_RESULT)
        if complete:
            tables[_RESULT] = ((n_points, n_points), np.float64)
        else:
            for name, array in arrays.items():
                tables[name] = ((n_points, *array.shape[1:]), array.dtype)
            tables[_DONE] = ((len(tiles),), np.bool_)
            tables[_UNFINISHED_RESULT] = ((n_points, n_points), np.float64)
        job.make_tables(tables)

        known: Booleans = np.asarray(np.any(job.read(_DIGESTS), axis=1))
        if complete and not known.all():
            raise FileFormatError(f"{job.path / _DIGESTS} is damaged: it lacks digests of points")
        points_of_job = _PointsOfJob(job, metric, points, precision, n_jobs)
        known_numbers = np.flatnonzero(known).tolist()
        for number in known_numbers:
            points_of_job.read(number, blocks[number])
        if known_numbers:
            last = blocks[known_numbers[-1]].stop - 1
            is_done = complete or bool(job.read(_DONE).all())
            points_of_job.recompute(last, is_done)
        for number in tqdm(
            np.flatnonzero(~known),
            desc="Points",
            disable=not progress,
            unit=" blocks",
        ):
            points_of_job.write(number, blocks[number])
        if not complete:
            reader = TileReader(job.path, _feature_files(len(features)), n_jobs)
            _compute(job, metric, reader, tiles, client, progress)
            job.rename(_UNFINISHED_RESULT, _RESULT)
        job.remove(_DONE, *arrays)
        return job.read(_RESULT)


@checked(solver=a_solver, metric=_A_METRIC, progress=flag)
def path_job(
    solver: GeodesicSolver,
    metric: RiemannianMetric,
    points: PointsLike,
    folder: str | os.PathLike[str],
    *,
    n_jobs: int | None = None,
    client: distributed.Client | None = None,
    progress: bool = False,
) -> PathDistances:
    r"""Find paths between all pairs of a set of points, or resume an earlier run.

    The numbers are those of `rh.solvers.path_distances`. An interrupted or killed job continues
    when it is called again with the same arguments; finished paths are kept, and one of them is
    solved again and compared. If the solver refuses a pair, all blocks of sixteen pairs without
    such a pair are solved and kept before the error is raised.

    Parameters
    ----------
    solver : GeodesicSolver
        Finds the paths, such as `BasisPath`.
    metric : RiemannianMetric
    points : array or sequence, shape (n, \*shape)
    folder, n_jobs, client, progress
        As for `pairwise_job`.

    Examples
    --------
    >>> bodies = rh.datasets.load_open_bodies("coarse")
    >>> space = rh.AlignedSurfaces(bodies.template)
    >>> solver = rh.solvers.PoissonPath(n_nodes=5)
    >>> rh.path_job(solver, space.metric, bodies.points[:3], "paths").lengths.shape
    (3, 3)
    """
    thread_count(n_jobs)
    if length_of(points, "points") < 2:
        raise ArgumentError(f"points must be at least two; found {len(points)}")
    points = metric.check_points(points[:], "points")
    n_pairs = len(points) * (len(points) - 1) // 2
    described = _described(metric) | {
        "points": digest(points).hex(),
        "n_points": len(points),
        "solver": describe(solver),
    }
    job = JobFolder(folder)
    with job.locked():
        blocks = list(slices(n_pairs, job.claim(described, {"block": _PAIRS})["block"]))
        job.make_tables(
            {_ROWS: ((n_pairs, N_COLUMNS), np.float64), _DONE: ((len(blocks),), np.bool_)}
        )
        finder = PathFinder(solver, points, n_jobs)
        if job.read(_DONE)[0]:
            again = finder.compute(metric, slice(0, 1))
            if isinstance(again, RiemhumanError):
                raise again
            rows = job.read(_ROWS)[:1, :2]
            _compare(job, "the length of a path", rows, again[:, :2], _ROUNDING_OF_PATHS)
        errors = _compute(job, metric, finder, blocks, client, progress)
        if errors:
            raise type(errors[0])(
                f"{errors[0]}; {job.path} keeps all paths except {len(errors)} of {len(blocks)} "
                f"blocks of up to {_PAIRS} pairs"
            )
        return distances_of_rows(len(points), np.array(job.read(_ROWS)))


def _described(metric: RiemannianMetric) -> JSONRecord:
    version = pkgutil.resolve_name("riemhuman:__version__")
    return {"format": _FORMAT, "version": str(version), "metric": describe(metric)}


def _layout(
    n_points: int, first: Array, features: tuple[Array, ...], memory: int
) -> dict[str, int]:
    """Return the number of points in a block of features and on a side of a tile."""
    n_bytes = first.nbytes + sum(feature.nbytes for feature in features)
    # A tile of side t takes 2 t n_bytes for features and t² pair_bytes for distances.
    pair_bytes = 8 * _COPIES_OF_PAIRS
    tile = int((math.sqrt(n_bytes**2 + pair_bytes * memory) - n_bytes) / pair_bytes)
    if tile < 1:
        raise ArgumentError(
            f"memory must be at least {2 * n_bytes + pair_bytes} bytes for a tile of two points; "
            f"found {memory}"
        )
    large_enough = max(_SMALLEST_TILE, math.ceil(n_points / _TILES_A_ROW))
    block = max(1, min(_BLOCK, memory // (_COPIES * n_bytes)))
    return {"block": block, "tile": min(n_points, tile, large_enough)}


def tiles_of(n_points: int, size: int) -> list[Tile]:
    """Divide the upper triangle of a distance matrix into tiles, row by row."""
    sides = list(slices(n_points, size))
    return [(rows, columns) for i, rows in enumerate(sides) for columns in sides[i:]]


def _by_file(features: tuple[Array, ...], points: Array) -> dict[str, Array]:
    """Return what a job keeps of points, by the name of the file."""
    # Distances too small for the precision of features are computed again from the points.
    names = _feature_files(len(features))
    return dict(zip(names, features, strict=True)) | {_POINTS: points}


def _feature_files(n_features: int) -> list[str]:
    return [f"features_{number}.npy" for number in range(n_features)]


def checked_part(
    metric: RiemannianMetric, points: PointsLike, part: slice[int, int, None], name: str
) -> Array:
    """Return a range of points after checking them."""
    where = f"{name}[{part.start}:{part.stop}]"
    checked = metric.check_points(points[part], where)
    n_points = part.stop - part.start
    if len(checked) != n_points:
        raise ArgumentError(f"{where} must be {n_points} points; found {len(checked)}")
    return checked


@dataclass(frozen=True)
class _PointsOfJob:
    """The points of a job of distances, and what its folder keeps of them."""

    job: JobFolder
    metric: RiemannianMetric
    points: PointsLike
    precision: str
    n_jobs: int | None

    def read(self, number: int, block: slice[int, int, None]) -> Array:
        """Return a block of points, if they are those of an earlier run."""
        points = checked_part(self.metric, self.points, block, "points")
        known = np.array(self.job.read(_DIGESTS)[number])
        if known.any() and known.tobytes() != digest(points):
            raise ArgumentError(
                f"folder must be that of the same job; that in {self.job.path} has other "
                f"points[{block.start}:{block.stop}]"
            )
        return points

    def write(self, number: int, block: slice[int, int, None]) -> None:
        """Write a block of points and their features."""
        points = self.read(number, block)
        try:
            features = self.metric.features(points, self.precision, self.n_jobs)
        except ArgumentError as error:
            raise type(error)(f"points[{block.start}:{block.stop}]: {error}") from error
        for name, rows in _by_file(features, points).items():
            self.job.write(name, (block, rows))
        # The record follows the entries: a kill in between costs only this block.
        self.job.write(_DIGESTS, (number, np.frombuffer(digest(points), np.uint8)))

    def recompute(self, last: int, is_done: bool) -> None:
        """Compute the first and the last known point's features and distance again; compare."""
        job, metric, rounding = self.job, self.metric, _ROUNDING[self.precision]
        ends = [checked_part(metric, self.points, slice(n, n + 1), "points") for n in (0, last)]
        points = np.concatenate(ends)
        if not job.exists(_RESULT):
            features = metric.features(points, self.precision)
            for name, rows in _by_file(features, points).items():
                _compare(job, "a feature", job.read(name)[[0, last]], rows, rounding)
        if is_done:
            table = job.read(_RESULT if job.exists(_RESULT) else _UNFINISHED_RESULT)
            distances = metric.dist_pairwise(points, precision=self.precision)
            # Of near points, a distance is less exact than the features that it comes from.
            _compare(job, "a distance", table[0, last], distances[0, 1], 10.0 * rounding)


Part = TypeVar("Part")
PartContra = TypeVar("PartContra", contravariant=True)


class JobWorker(Worker[PartContra], Protocol[PartContra]):
    """Computes parts of a job, and writes them."""

    def write(self, job: JobFolder, part: PartContra, values: Array, /) -> None: ...


def _compare(
    job: JobFolder,
    what: str,
    stored: Array,
    recomputed: Array,
    rounding: float,
) -> None:
    size = np.abs([stored, recomputed]).max(initial=0.0)
    gap = np.abs(stored - recomputed).max(initial=0.0)
    if not gap <= rounding * size:
        raise ArgumentError(
            f"folder must be that of the same job; that in {job.path} was computed by other "
            f"code: {what} differs by {gap:.3g} when it is recomputed. The metric, or a library "
            "that it uses, has changed; pass another folder"
        )


def _compute(
    job: JobFolder,
    metric: RiemannianMetric,
    worker: JobWorker[Part],
    parts: Sequence[Part],
    client: distributed.Client | None,
    progress: bool,
) -> list[RiemhumanError]:
    """Compute and write the unfinished parts, and return errors of some."""
    todo = np.flatnonzero(~np.array(job.read(_DONE))).tolist()
    errors: list[RiemhumanError] = []
    if not todo:
        return errors
    n_finished = len(parts) - len(todo)
    with tqdm(
        total=len(parts),
        initial=n_finished,
        desc="Parts of the job",
        disable=not progress,
    ) as bar:
        for number, values in compute_parts(metric, worker, [(k, parts[k]) for k in todo], client):
            if isinstance(values, RiemhumanError):
                errors.append(values)
                continue
            worker.write(job, parts[number], values)
            # The record follows the entries: a kill in between costs only this part.
            job.write(_DONE, (number, True))
            bar.update()
    return errors


@dataclass
class TileReader:
    """Computes tiles from the files of a job, in this process or in a worker of a cluster."""

    folder: Path
    names: list[str]
    n_jobs: int | None
    # The rows of the last tile, and their features.
    _last_rows: tuple[slice[int, int, None], tuple[Array, ...]] | None = field(
        default=None, init=False
    )

    @staticmethod
    def write(job: JobFolder, tile: Tile, block: Array) -> None:
        """Write a tile in both triangles of the matrix."""
        rows, columns = tile
        job.write(_UNFINISHED_RESULT, (tile, block), ((columns, rows), block.T))

    def compute(self, metric: RiemannianMetric, tile: Tile) -> Array:
        """Return the distances of a tile, shape (n_rows, n_columns)."""
        rows, columns = tile
        # Tiles come row by row, so that many of them share the features of their rows.
        if self._last_rows is None or self._last_rows[0] != rows:
            self._last_rows = (rows, self._features(rows))
        row_features = self._last_rows[1]
        column_features = row_features if columns == rows else self._features(columns)
        points = self._open(_POINTS)
        squared = squared_dist_rectangle(
            metric, row_features, column_features, points[rows], points[columns], self.n_jobs
        )
        return np.sqrt(squared)

    def _features(self, part: slice[int, int, None]) -> tuple[Array, ...]:
        # Copied, since compiled loops take no memory maps, whose pages need not stay in memory.
        return tuple(np.array(self._open(name)[part], order="C") for name in self.names)

    def _open(self, name: str) -> Array:
        try:
            return load_array(self.folder / name, mode="r")
        except FileError as error:
            raise FileError(
                f"{error}; the folder of a job must be on a file system that all workers share"
            ) from error


@dataclass(frozen=True)
class PathFinder:
    """Finds the paths of some pairs, in this process or on a worker of a cluster."""

    solver: GeodesicSolver
    points: Array
    n_jobs: int | None

    @staticmethod
    def write(job: JobFolder, block: slice[int, int, None], rows: Array) -> None:
        job.write(_ROWS, (block, rows))

    def compute(
        self, metric: RiemannianMetric, block: slice[int, int, None]
    ) -> Array | RiemhumanError:
        """Return a row of numbers for each pair, or an error."""
        pairs = PairsOfPoints(self.points)

        def name_of(number_in_block: int) -> str:
            return pairs.name_of(block.start + number_in_block)

        in_block = [pairs[number] for number in range(block.start, block.stop)]
        try:
            results = solve_pairs(
                self.solver, metric, in_block, n_jobs=self.n_jobs, name_of=name_of
            )
        except RiemhumanError as error:
            return error
        return np.array([row_of_path(metric, result) for result in results])
