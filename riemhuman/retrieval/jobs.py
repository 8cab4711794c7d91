"""Resumable jobs: distances and paths of all pairs of points, computed part by part on disk.

A job is a folder. Its manifest holds the class, the parameters and the arrays of the metric and the
solver, and the version of the library. When a job is resumed, a handful of its results are computed
again and compared: if they differ, something that the manifest does not hold has changed, such as a
constant in the code of a metric, and the folder is refused.
"""

from __future__ import annotations

import math
import os
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy import ndarray

from riemhuman.checks import one_of, whole_number
from riemhuman.errors import (
    ArgumentError,
    ArgumentTypeError,
    FileError,
    FileFormatError,
    RiemhumanError,
)
from riemhuman.geometry import RiemannianMetric
from riemhuman.geometry.pairwise import PRECISIONS, squared_dist_rectangle
from riemhuman.geometry.strategies import GeodesicSolver
from riemhuman.io.arrays import load_array
from riemhuman.io.fingerprint import describe, digest, library_version
from riemhuman.io.job_folder import JobFolder
from riemhuman.kernels.threads import slices, thread_count
from riemhuman.progress import ProgressBar
from riemhuman.retrieval._cluster import compute_parts
from riemhuman.solvers.path_comparison import PairsOfPoints, PathDistances
from riemhuman.solvers.paths import solve_pairs

RESULT, PATHS = "D.npy", "paths.npy"
"""Names of the files of distances, and of paths: one for each pair i < j, row by row."""

_UNFINISHED_RESULT, _ROWS, _DONE = "D.unfinished.npy", "rows.npy", "done.npy"
_DIGESTS, _POINTS = "digests.npy", "points.npy"
_FORMAT = "riemhuman job 5"

# Tiles are small enough for an interrupted job to have made progress, and large enough for their
# overhead not to matter.
_TILES_A_ROW, _SMALLEST_TILE = 8, 256

# Points whose features are computed at a time, and copies of a point's arrays in memory meanwhile.
_BLOCK, _COPIES = 64, 32

# Numbers of eight bytes in memory for each pair of a tile while it is computed and mirrored.
_COPIES_OF_PAIRS = 6

# Pairs whose paths are solved and then written at a time, and numbers of each path.
_PAIRS, _N_NUMBERS = 16, 6

# Points or tiles, and paths, that are computed again when a job is resumed, and how much rounding
# changes them, relative to the largest number.
_TRIED, _TRIED_PATHS = 8, 2
_ROUNDING = {"single": 1e-5, "double": 1e-9}
_ROUNDING_OF_PATHS = 1e-4


def pairwise_job(
    metric: RiemannianMetric,
    points: Sequence[Any] | ndarray,
    folder: str | os.PathLike[str],
    *,
    precision: str = "single",
    memory: int = 2**30,
    n_jobs: int | None = None,
    client: Any | None = None,
    progress: bool = False,
) -> np.memmap:
    r"""Compute all distances within a set of points into a file, or resume an earlier run.

    The distances are those of `metric.dist_pairwise`, bit for bit, for sets that do not fit in
    memory. An interrupted or killed job resumes when it is called again with the same arguments;
    finished tiles are kept. When the job is complete, the folder holds the distances as `D.npy`,
    and another call only opens them. Whenever it resumes or opens, some distances are computed
    again, and the folder is refused if they differ.

    Parameters
    ----------
    metric : RiemannianMetric
        The metric. The job records its class, its parameters and arrays.
    points : array or sequence, shape (n, \*shape)
        Points: an array in memory, a memory map, or any object that has a length and whose slices
        are arrays of points, which it may compute on demand. Every call reads each point once, and
        a few twice.
    folder : path_like
        Folder of the job, made if need be. It holds features of the points until the job is
        complete.
    precision : {"single", "double"}
        See `RiemannianMetric.dist_pairwise`.
    memory : int
        Bytes of memory that arrays may take at a time, also on each worker of a cluster. It
        determines the size of the tiles of a new job.
    n_jobs : int, optional
        Number of threads for each tile, -1 for one per core; by default one.
    client : distributed.Client, optional
        Client of a Dask cluster that computes the tiles. Its workers must be able to import the
        library and to read the folder under the same path, on a file system that they share. They
        write nothing.
    progress : bool
        Whether to show progress bars.

    Returns
    -------
    memmap, shape (n, n)
        Symmetric, with zero diagonal; read-only.

    Raises
    ------
    ArgumentError
        If the folder holds a job on other points or with another metric, or anything but a job.
    FileError
        If another process is at work in the folder, or the disk is too small.
    ClusterError
        If a cluster has had no worker for a minute.

    Examples
    --------
    >>> import riemhuman as rh
    >>> bodies = rh.datasets.load_open_bodies("coarse")
    >>> space = rh.AlignedSurfaces(bodies.template)
    >>> D = rh.pairwise_job(space.metric, bodies.points[:6], "distances")
    >>> D.shape
    (6, 6)
    """
    if not hasattr(points, "__len__") or not hasattr(points, "__getitem__"):
        raise ArgumentTypeError(
            f"points must be an array, or have a length and slices; found {type(points).__name__}"
        )
    n_points = len(points)
    if n_points == 0:
        raise ArgumentError("points must hold at least one point; found none")
    thread_count(n_jobs)
    one_of(precision, "precision", PRECISIONS)
    memory = whole_number(memory, "memory", minimum=1)
    described = {
        "format": _FORMAT,
        "version": library_version(),
        "n_points": n_points,
        "precision": precision,
        "metric": describe(metric),
    }
    first = metric.check_points(points[slice(0, 1)])
    features = metric.features(first, precision)
    job = JobFolder(folder)
    with job.locked():
        layout = job.claim(described, _layout(n_points, first, features, memory))
        tiles = list(tiles_of(n_points, layout["tile"]))
        blocks = list(slices(n_points, layout["block"]))
        arrays = dict(zip(map(feature_file, range(len(features))), features, strict=True))
        if precision == "single":
            # Distances too small for single precision are computed again from the points.
            arrays[_POINTS] = first
        tables: dict[str, tuple[tuple[int, ...], Any]] = {_DIGESTS: ((len(blocks), 32), np.uint8)}
        complete = job.exists(RESULT)
        if complete:
            tables[RESULT] = ((n_points, n_points), np.float64)
        else:
            for name, array in arrays.items():
                tables[name] = ((n_points, *array.shape[1:]), array.dtype)
            tables[_DONE] = ((len(tiles),), np.bool_)
            tables[_UNFINISHED_RESULT] = ((n_points, n_points), np.float64)
        job.make_tables(tables)

        known: ndarray = np.asarray(np.any(job.read(_DIGESTS), axis=1))
        if complete and not known.all():
            raise FileFormatError(f"{job.path / _DIGESTS} is damaged: it lacks digests of points")
        for number in np.flatnonzero(known):
            _read_points(job, metric, points, blocks[number], int(number))
        todo = [] if complete else _unfinished(job)
        finished = set(range(len(tiles))).difference(todo)
        _try_distances(job, metric, points, blocks, tiles, finished, precision, n_jobs)
        bar = ProgressBar(
            np.flatnonzero(~known), desc="Points", disable=not progress, unit=" blocks"
        )
        for number in bar:
            _write_features(job, metric, points, blocks[number], number, precision, n_jobs)
        if not complete:
            reader = TileReader(str(job.path), len(features), n_jobs)
            _compute(job, metric, reader, tiles, todo, _DistanceTable(), client, progress)
            job.rename(_UNFINISHED_RESULT, RESULT)
        job.remove(_DONE, *arrays)
        result: Any = job.read(RESULT)
        return result


def path_job(
    solver: GeodesicSolver,
    metric: RiemannianMetric,
    points: Sequence[Any] | ndarray,
    folder: str | os.PathLike[str],
    *,
    keep_paths: bool = False,
    n_jobs: int | None = None,
    client: Any | None = None,
    progress: bool = False,
) -> PathDistances:
    r"""Find paths between all pairs of a set of points, or resume an earlier run.

    The numbers are those of `rh.solvers.path_distances`. An interrupted or killed job resumes when
    it is called again with the same arguments; finished paths are kept, and two of them are solved
    again and compared. Where the solver refuses a pair, all blocks of sixteen pairs without such a
    pair are solved and kept before the error is raised.

    Parameters
    ----------
    solver : GeodesicSolver
        Finds the paths, such as `BasisPath`. The job records its class, its parameters and arrays.
    metric : RiemannianMetric
        The metric, recorded likewise.
    points : array or sequence, shape (n, \*shape)
        Points.
    folder : path_like
        Folder of the job, made if need be.
    keep_paths : bool
        Whether to keep the paths too, in `paths.npy`, shape (n (n − 1)/2, n_nodes, \*shape).
    n_jobs : int, optional
        Number of threads in each process, -1 for one per core; by default one.
    client : distributed.Client, optional
        Client of a Dask cluster whose workers find the paths; they must be able to import the
        library.
    progress : bool
        Whether to show a progress bar.

    Returns
    -------
    PathDistances

    Raises
    ------
    RiemhumanError
        As for `pairwise_job`, where the solver is part of the job like the metric; and if the
        solver refuses a pair, which the error names.

    Examples
    --------
    >>> import riemhuman as rh
    >>> bodies = rh.datasets.load_open_bodies("coarse")
    >>> space = rh.AlignedSurfaces(bodies.template)
    >>> solver = rh.solvers.PoissonPath(n_nodes=5)
    >>> found = rh.path_job(solver, space.metric, bodies.points[:3], "paths")
    >>> found.lengths.shape
    (3, 3)
    """
    thread_count(n_jobs)
    points = metric.check_points(points[:], "points")
    if len(points) < 2:
        raise ArgumentError(f"points must be at least two; found {len(points)}")
    n_pairs = len(points) * (len(points) - 1) // 2
    described = {
        "format": _FORMAT,
        "version": library_version(),
        "points": digest(points).hex(),
        "n_points": len(points),
        "paths": keep_paths,
        "metric": describe(metric),
        "solver": describe(solver),
    }
    job = JobFolder(folder)
    with job.locked():
        blocks = list(slices(n_pairs, job.claim(described, {"block": _PAIRS})["block"]))
        tables: dict[str, tuple[tuple[int, ...], Any]] = {
            _ROWS: ((n_pairs, _N_NUMBERS), np.float64),
            _DONE: ((len(blocks),), np.bool_),
        }
        if keep_paths:
            n_nodes = solver.solve(metric, *points[:2]).path.shape[0]
            tables[PATHS] = ((n_pairs, n_nodes, *points.shape[1:]), np.float64)
        job.make_tables(tables)
        finder = PathFinder(solver, points, keep_paths, n_jobs)
        todo = _unfinished(job)
        _try_paths(job, metric, finder, blocks, sorted(set(range(len(blocks))).difference(todo)))
        errors = _compute(
            job, metric, finder, blocks, todo, _PathTable(keep_paths), client, progress
        )
        if errors:
            raise type(errors[0])(
                f"{errors[0]}; paths are kept in {job.path} but for {len(errors)} of "
                f"{len(blocks)} blocks of up to {_PAIRS} pairs"
            )
        return PathDistances.from_rows(len(points), np.array(job.read(_ROWS)))


def _layout(
    n_points: int, first: ndarray, features: tuple[ndarray, ...], memory: int
) -> dict[str, int]:
    """Return the number of points in a block of features and on a side of a tile."""
    n_bytes = first.nbytes + sum(feature.nbytes for feature in features)
    # A tile of side t takes 2 t n_bytes for features and 8 copies t² for distances.
    square = 8 * _COPIES_OF_PAIRS
    tile = int((math.sqrt(n_bytes**2 + square * memory) - n_bytes) / square)
    if tile < 1:
        raise ArgumentError(
            f"memory must be at least {2 * n_bytes + square} bytes for a tile of two points; "
            f"found {memory}"
        )
    wanted = max(_SMALLEST_TILE, -(-n_points // _TILES_A_ROW))
    block = max(1, min(_BLOCK, memory // (_COPIES * n_bytes)))
    return {"block": block, "tile": min(n_points, tile, wanted)}


def _read_points(
    job: JobFolder, metric: RiemannianMetric, points: Any, block: slice, number: int
) -> ndarray:
    """Return a block of points, if they are those of an earlier run."""
    where = f"points[{block.start}:{block.stop}]"
    some = metric.check_points(points[block], where)
    if len(some) != block.stop - block.start:
        raise ArgumentError(f"{where} must be {block.stop - block.start} points; found {len(some)}")
    kept = np.array(job.read(_DIGESTS)[number])
    if kept.any() and kept.tobytes() != digest(some):
        raise ArgumentError(
            f"folder must be that of the same job; that in {job.path} has other {where}"
        )
    return some


def _write_features(
    job: JobFolder,
    metric: RiemannianMetric,
    points: Any,
    block: slice,
    number: int,
    precision: str,
    n_jobs: int | None,
) -> None:
    some = _read_points(job, metric, points, block, number)
    try:
        features = metric.features(some, precision, n_jobs)
    except ArgumentError as error:
        raise type(error)(f"points[{block.start}:{block.stop}]: {error}") from error
    for k, feature in enumerate(features):
        job.write(feature_file(k), (block, feature))
    if precision == "single":
        job.write(_POINTS, (block, some))
    # The record follows the entries: a kill in between costs only this block.
    job.write(_DIGESTS, (number, np.frombuffer(digest(some), np.uint8)))


def _try_distances(
    job: JobFolder,
    metric: RiemannianMetric,
    points: Any,
    blocks: list[slice],
    tiles: list[Tile],
    finished: set[int],
    precision: str,
    n_jobs: int | None,
) -> None:
    """Compute some features and distances again, and raise an error if they differ."""
    known = np.flatnonzero(np.any(job.read(_DIGESTS), axis=1))
    if not len(known):
        return
    complete = job.exists(RESULT)
    numbers = {blocks[k].start for k in _spread(known)} | {blocks[known[-1]].stop - 1}
    # A corner of each of some tiles; their blocks are known, as features are written first.
    pairs = [(tiles[k].rows.start, tiles[k].columns.stop - 1) for k in _spread(sorted(finished))]
    if complete:
        pairs = [(i, j) for i in numbers for j in numbers]
    order = sorted(numbers.union(*pairs))
    some = np.concatenate([metric.check_points(points[slice(n, n + 1)]) for n in order])
    features = metric.features(some, precision)
    rounding = _ROUNDING[precision]
    if not complete:
        for k, again in enumerate(features):
            table = job.read(feature_file(k))
            for number, feature in zip(order, again, strict=True):
                _compare(job, f"features of points[{number}]", table[number], feature, rounding)
    squared = squared_dist_rectangle(metric, features, features, some, some, n_jobs)
    place = {number: k for k, number in enumerate(order)}
    distances = job.read(RESULT if complete else _UNFINISHED_RESULT)
    largest = float(np.sqrt(squared.max(initial=0.0)))
    for i, j in pairs:
        what = f"the distance of points[{i}] and points[{j}]"
        again = np.sqrt(squared[place[i], place[j]])
        _compare(job, what, distances[i, j], again, rounding, largest)


def _spread(items: Sequence[Any] | ndarray) -> list[Any]:
    """Return a handful of items, evenly spaced."""
    places = np.linspace(0, len(items) - 1, min(_TRIED, len(items))).astype(int)
    return [items[place] for place in np.unique(places)]


def _try_paths(
    job: JobFolder,
    metric: RiemannianMetric,
    finder: PathFinder,
    blocks: list[slice],
    finished: list[int],
) -> None:
    """Solve some paths again, and raise an error if their lengths differ."""
    if not finished:
        return
    rows = job.read(_ROWS)
    for k in np.unique(np.linspace(0, len(finished) - 1, _TRIED_PATHS).astype(int)):
        pair = blocks[finished[k]].start
        again = finder.compute(metric, slice(pair, pair + 1))
        if isinstance(again, RiemhumanError):
            raise again
        what = f"the length of path {pair}"
        _compare(job, what, rows[pair, :2], again[0, :2], _ROUNDING_OF_PATHS)


def _compare(
    job: JobFolder, what: str, kept: Any, again: Any, rounding: float, largest: float = 0.0
) -> None:
    kept, again = np.asarray(kept, dtype=np.float64), np.asarray(again, dtype=np.float64)
    size = max(largest, float(np.abs(kept).max(initial=0.0)), float(np.abs(again).max(initial=0.0)))
    gap = np.abs(kept - again).max(initial=0.0)
    if gap > rounding * size or np.isnan(gap):
        raise ArgumentError(
            f"folder must be that of the same job; that in {job.path} was computed by other code: "
            f"{what} differs by {gap:.3g} when it is computed again. The metric, or a library that "
            "it uses, has changed; give another folder"
        )


def _compute(
    job: JobFolder,
    metric: RiemannianMetric,
    worker: Any,
    parts: list[Any],
    todo: list[int],
    table: _DistanceTable | _PathTable,
    client: Any | None,
    progress: bool,
) -> list[RiemhumanError]:
    """Compute and write parts, and return errors of some."""
    if not todo:
        return []
    n_pairs = sum(table.n_pairs(part) for part in parts)
    n_left = sum(table.n_pairs(parts[number]) for number in todo)
    errors: list[RiemhumanError] = []
    settings = {"desc": table.title, "disable": not progress, "unit": table.unit}
    with ProgressBar(total=n_pairs, initial=n_pairs - n_left, **settings) as bar:
        values: Any
        for number, values in compute_parts(
            metric, worker, [(number, parts[number]) for number in todo], client
        ):
            if isinstance(values, RiemhumanError):
                errors.append(values)
                continue
            table.write(job, parts[number], values)
            # The record follows the entries: a kill in between costs only this part.
            job.write(_DONE, (number, True))
            bar.update(table.n_pairs(parts[number]))
    return errors


def _unfinished(job: JobFolder) -> list[int]:
    """Return the numbers of the parts that are unfinished."""
    numbers: list[int] = np.flatnonzero(~np.array(job.read(_DONE))).tolist()
    return numbers


@dataclass(frozen=True)
class Tile:
    """A rectangle of the upper triangle of a distance matrix, or a square on its diagonal."""

    rows: slice
    columns: slice


def tiles_of(n_points: int, size: int) -> Iterator[Tile]:
    """Divide the upper triangle of a distance matrix into tiles, row by row."""
    sides = list(slices(n_points, size))
    for i, rows in enumerate(sides):
        for columns in sides[i:]:
            yield Tile(rows, columns)


def feature_file(number: int) -> str:
    """Return the name of the file of the k-th features."""
    return f"features_{number}.npy"


class _DistanceTable:
    """Tiles of distances, kept in both triangles of one matrix."""

    title, unit = "Distances", " pairs"

    @staticmethod
    def n_pairs(tile: Tile) -> int:
        n_rows, n_columns = (side.stop - side.start for side in (tile.rows, tile.columns))
        return n_rows * (n_rows - 1) // 2 if tile.rows == tile.columns else n_rows * n_columns

    @staticmethod
    def write(job: JobFolder, tile: Tile, block: ndarray) -> None:
        upper, lower = (tile.rows, tile.columns), (tile.columns, tile.rows)
        job.write(_UNFINISHED_RESULT, (upper, block), (lower, block.T))


@dataclass(frozen=True)
class _PathTable:
    """Blocks of paths, kept as a row of numbers for each pair, and perhaps its path."""

    keep_paths: bool
    title, unit = "Geodesics", " paths"

    @staticmethod
    def n_pairs(block: slice) -> int:
        return block.stop - block.start

    def write(self, job: JobFolder, block: slice, values: ndarray) -> None:
        if self.keep_paths:
            shape = job.read(PATHS).shape[1:]
            job.write(PATHS, (block, values[:, _N_NUMBERS:].reshape(-1, *shape)))
        job.write(_ROWS, (block, values[:, :_N_NUMBERS]))


@dataclass
class TileReader:
    """Computes tiles from the files of a job, in this process or in a worker of a cluster."""

    folder: str
    n_features: int
    n_jobs: int | None
    _rows: tuple[slice, tuple[ndarray, ...]] | None = field(
        default=None, init=False, repr=False, compare=False
    )

    def compute(self, metric: RiemannianMetric, tile: Tile) -> ndarray:
        """Return the distances of a tile, shape (n_rows, n_columns)."""
        # Tiles come row by row, so that many of them share the features of their rows.
        if self._rows is None or self._rows[0] != tile.rows:
            self._rows = (tile.rows, self._features(tile.rows))
        rows = self._rows[1]
        columns = rows if tile.columns == tile.rows else self._features(tile.columns)
        has_points = (Path(self.folder) / _POINTS).exists()
        points = self._open(_POINTS) if has_points else np.empty(0)
        squared = squared_dist_rectangle(
            metric, rows, columns, points[tile.rows], points[tile.columns], self.n_jobs
        )
        return np.sqrt(squared)

    def _features(self, part: slice) -> tuple[ndarray, ...]:
        # Copied, since compiled loops take no memory maps, whose pages need not stay in memory.
        names = map(feature_file, range(self.n_features))
        return tuple(np.array(self._open(name)[part], order="C") for name in names)

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


@dataclass(frozen=True)
class PathFinder:
    """Finds the paths of some pairs, in this process or on a worker of a cluster."""

    solver: GeodesicSolver
    points: ndarray
    keep_paths: bool
    n_jobs: int | None

    def compute(self, metric: RiemannianMetric, block: slice) -> Any:
        """Return a row for each pair: its numbers, and then its path if it is kept; or an error."""
        pairs = PairsOfPoints(self.points)[block]
        try:
            results = solve_pairs(self.solver, metric, pairs, n_jobs=self.n_jobs)
        except RiemhumanError as error:
            return self._name_points(error, metric, block)
        rows = []
        for result in results:
            path = result.path.ravel() if self.keep_paths else np.empty(0)
            rows.append(np.concatenate([PathDistances.row_of(metric, result), path]))
        return np.array(rows)

    def _name_points(
        self, error: RiemhumanError, metric: RiemannianMetric, block: slice
    ) -> RiemhumanError:
        """Return an error of some pairs with the numbers of the two points that it is about."""
        rows, columns = np.triu_indices(len(self.points), 1)
        for i, j in zip(rows[block], columns[block], strict=True):
            try:
                solve_pairs(self.solver, metric, [self.points[[i, j]]])
            except RiemhumanError as own:
                said = str(own).removeprefix("pairs[0]: ")
                return type(own)(f"points[{i}] and points[{j}]: {said}")
        return error
