"""All distances within a set of points, computed tile by tile on disk and resumable."""

from __future__ import annotations

import os
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy import ndarray

from riemhuman.checks import one_of, whole_number
from riemhuman.errors import (
    ArgumentError,
    ArgumentTypeError,
    DamagedFileWarning,
    FileFormatError,
    RiemhumanError,
    warn,
)
from riemhuman.geometry import RiemannianMetric
from riemhuman.geometry.pairwise import PRECISIONS
from riemhuman.io.fingerprint import describe, digest
from riemhuman.io.job_folder import JobFolder, are_marks, checksums, mark
from riemhuman.kernels.threads import thread_count
from riemhuman.kernels.tiles import slices
from riemhuman.progress import ProgressBar
from riemhuman.retrieval.cluster import computed_tiles
from riemhuman.retrieval.job_tiles import (
    POINTS,
    Tile,
    TileReader,
    feature_file,
    largest_tile,
    memory_of_tile,
    tiles_of,
)

RESULT = "D.npy"
"""Name of the file of distances."""

_UNFINISHED_RESULT = "D.unfinished.npy"
_DIGESTS, _CHECKSUMS, _DONE = "digests.npy", "checksums.npy", "done.npy"
_FORMAT = "riemhuman pairwise job 3"
# How often tiles that are damaged after they were written are computed again.
_ATTEMPTS = 3
# Tiles are small enough for an interrupted job to have made progress, and large enough for their
# overhead not to matter.
_TILES_A_ROW, _SMALLEST_TILE = 8, 256
# Points whose features are computed at a time.
_BLOCK = 64
# Copies of a point's arrays that are in memory at once while its features are computed.
_COPIES = 32


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
    key: str | None = None,
) -> np.memmap:
    r"""Compute all distances within a set of points into a file, or resume an earlier run.

    The distances are those of `metric.dist_pairwise`, bit for bit, for sets that do not fit in
    memory. An interrupted or killed job resumes when it is called again with the same arguments;
    finished tiles are kept. When the job is complete, the folder holds the distances as `D.npy`,
    and another call only opens them.

    Checksums of the features and of every tile reveal damage to the files of an unfinished job:
    damaged parts are computed again, with a `DamagedFileWarning` that names them.

    Parameters
    ----------
    metric : RiemannianMetric
        The metric. It must keep its parameters in attributes of their names, as the metrics of the
        library do. The job records their values and the code of the metric, with the constants,
        defaults, closures, globals and base classes that the code reaches, and resumes only with
        the same.
    points : array or sequence, shape (n, \*shape)
        Points: an array in memory, a memory map, or any object that has a length and whose slices
        are arrays of points, which it may compute on demand. Every call reads each point once.
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
    key : str, optional
        A name for the metric, which the job records in place of its parameters and code, for a
        metric that cannot be recorded or that changes without changing distances. The caller must
        give metrics with different distances different keys.

    Returns
    -------
    memmap, shape (n, n)
        Symmetric, with zero diagonal; read-only.

    Raises
    ------
    ArgumentTypeError
        If an argument has the wrong type, or the metric holds something that cannot be recorded,
        such as an open file, and no key is given.
    ArgumentError
        If a point or an option is not valid, or the folder holds a job on other points or with
        another metric, or anything but a job.
    FileError
        If another process is at work in the folder, it cannot be written, or the disk is too small.
    FileFormatError
        If a file of the job is damaged.
    ClusterError
        If a cluster has had no worker for a minute.
    MissingDependencyError
        If a client is given and distributed is not installed, or a worker lacks the library.

    Examples
    --------
    >>> import riemhuman as rh
    >>> bodies = rh.datasets.load_open_bodies("coarse")
    >>> space = rh.AlignedSurfaces(bodies.template)
    >>> D = rh.pairwise_job(space.metric, bodies.points[:6], "distances")
    >>> D.shape
    (6, 6)
    """
    n_points = _count(points)
    thread_count(n_jobs)
    one_of(precision, "precision", PRECISIONS)
    memory = whole_number(memory, "memory", minimum=1)
    described = {
        "format": _FORMAT,
        "n_points": n_points,
        "precision": precision,
        "metric": describe(metric) if key is None else {"key": _checked_key(key)},
    }
    first = metric.check_points(points[slice(0, 1)])
    features = metric.features(first, precision)
    layout = _layout(n_points, first, features, memory)

    job = JobFolder(folder)
    with job.locked():
        layout = job.claim(described, layout)
        tiles = list(tiles_of(n_points, layout["tile"]))
        blocks = list(slices(n_points, layout["block"]))
        arrays = dict(zip(map(feature_file, range(len(features))), features, strict=True))
        if precision == "single":
            # Distances too small for single precision are computed again from the points.
            arrays[POINTS] = first
        tables: dict[str, tuple[tuple[int, ...], Any]] = {_DIGESTS: ((len(blocks), 32), np.uint8)}
        complete = job.exists(RESULT)
        if complete:
            tables[RESULT] = ((n_points, n_points), np.float64)
        else:
            for name, array in arrays.items():
                tables[name] = ((n_points, *array.shape[1:]), array.dtype)
            tables[_CHECKSUMS] = ((n_points, len(arrays)), np.uint32)
            tables[_DONE] = ((len(tiles),), np.uint64)
            tables[_UNFINISHED_RESULT] = ((n_points, n_points), np.float64)
        job.make_tables(tables)

        kept = [] if complete else list(arrays)
        for block in ProgressBar(blocks, desc="Points", disable=not progress, unit=" blocks"):
            _keep_features(
                job, metric, points, block, layout["block"], precision, kept, tiles, n_jobs
            )
        if not complete:
            reader = TileReader(str(job.path), len(features), n_jobs)
            try:
                _compute_tiles(job, metric, reader, tiles, client, progress)
            except RiemhumanError:
                # Damaged features may look like points that are not valid.
                _check_features(job, kept, blocks, tiles)
                raise
            _check_features(job, kept, blocks, tiles)
            job.rename(_UNFINISHED_RESULT, RESULT)
        job.remove(_DONE, _CHECKSUMS, *arrays)
        return job.read(RESULT)


def _count(points: Any) -> int:
    if not hasattr(points, "__len__") or not hasattr(points, "__getitem__"):
        raise ArgumentTypeError(
            f"points must be an array, or have a length and slices; found {type(points).__name__}"
        )
    if len(points) == 0:
        raise ArgumentError("points must hold at least one point; found none")
    return len(points)


def _checked_key(key: Any) -> str:
    if not isinstance(key, str) or not key:
        raise ArgumentTypeError(f"key must be a string that names the metric; found {key!r:.100}")
    return key


def _layout(
    n_points: int, first: ndarray, features: tuple[ndarray, ...], memory: int
) -> dict[str, int]:
    """Return the number of points in a block of features and on a side of a tile."""
    n_bytes = first.nbytes + sum(feature.nbytes for feature in features)
    tile = largest_tile(n_bytes, memory)
    if tile < 1:
        raise ArgumentError(
            f"memory must be at least {memory_of_tile(n_bytes, 1)} bytes for a tile of two "
            f"points; found {memory}"
        )
    wanted = max(_SMALLEST_TILE, -(-n_points // _TILES_A_ROW))
    block = max(1, min(_BLOCK, memory // (_COPIES * n_bytes)))
    return {"block": block, "tile": min(n_points, tile, wanted)}


def _keep_features(
    job: JobFolder,
    metric: RiemannianMetric,
    points: Sequence[Any] | ndarray,
    block: slice,
    size: int,
    precision: str,
    names: list[str],
    tiles: list[Tile],
    n_jobs: int | None,
) -> None:
    """Compute the features of a block of points, or check that points and tables are unchanged."""
    number = block.start // size
    where = f"points[{block.start}:{block.stop}]"
    some = metric.check_points(points[block], where)
    if len(some) != block.stop - block.start:
        raise ArgumentError(f"{where} must be {block.stop - block.start} points; found {len(some)}")
    found = np.frombuffer(digest(some), np.uint8)
    kept = np.array(job.read(_DIGESTS)[number])
    if not names and not kept.any():
        raise FileFormatError(
            f"{job.path / _DIGESTS} is damaged: it lacks digests of the points of a complete job"
        )
    if kept.any():
        if not np.array_equal(kept, found):
            raise ArgumentError(
                f"folder must be that of the same job; that in {job.path} has other {where}"
            )
        damaged = _damaged_table(job, names, block)
        if damaged is None:
            return
        warn(
            f"{job.path / damaged} is damaged: its data for {where} are not what was written; they "
            "are computed again, with everything that depends on them",
            DamagedFileWarning,
        )
        _forget_tiles(job, tiles, block)
    try:
        features = metric.features(some, precision, n_jobs)
    except ArgumentError as error:
        raise type(error)(f"{where}: {error}") from error
    written = (*features, some) if precision == "single" else features
    for name, array in zip(names, written, strict=True):
        job.write(name, (block, array))
    job.write(_CHECKSUMS, (block, np.stack([checksums(array) for array in written], axis=1)))
    job.write(_DIGESTS, (number, found))


def _damaged_table(job: JobFolder, names: list[str], block: slice) -> str | None:
    """Return the first table with rows that do not match their checksums."""
    for k, name in enumerate(names):
        if not np.array_equal(checksums(job.read(name)[block]), job.read(_CHECKSUMS)[block, k]):
            return name
    return None


def _check_features(
    job: JobFolder, names: list[str], blocks: list[slice], tiles: list[Tile]
) -> None:
    """Refuse to finish if features have changed while distances were computed from them."""
    for block in blocks:
        damaged = _damaged_table(job, names, block)
        if damaged:
            _forget_tiles(job, tiles, block)
            raise FileFormatError(
                f"{job.path / damaged} is damaged: its data for "
                f"points[{block.start}:{block.stop}] are no longer what was written; the same call "
                "computes them again, with everything that depends on them"
            )


def _forget_tiles(job: JobFolder, tiles: list[Tile], block: slice) -> None:
    """Mark the tiles that contain points of a block as unfinished."""
    marks = np.array(job.read(_DONE))
    for number, tile in enumerate(tiles):
        for side in (tile.rows, tile.columns):
            if side.start < block.stop and block.start < side.stop:
                marks[number] = 0
    job.write(_DONE, (slice(None), marks))


def _compute_tiles(
    job: JobFolder,
    metric: RiemannianMetric,
    reader: TileReader,
    tiles: list[Tile],
    client: Any | None,
    progress: bool,
) -> None:
    for _ in range(_ATTEMPTS):
        todo = _unfinished(job, tiles)
        if not todo:
            return
        n_pairs = sum(tile.n_pairs for tile in tiles)
        bar = ProgressBar(
            total=n_pairs,
            initial=n_pairs - sum(tile.n_pairs for _, tile in todo),
            desc="Distances",
            disable=not progress,
            unit=" pairs",
        )
        with bar:
            for number, block in computed_tiles(metric, reader, todo, client):
                tile = tiles[number]
                # The record follows the entries: a kill in between costs only this tile.
                job.write(
                    _UNFINISHED_RESULT,
                    ((tile.rows, tile.columns), block),
                    ((tile.columns, tile.rows), block.T),
                )
                job.write(_DONE, (number, mark(block)))
                bar.update(tile.n_pairs)
    if _unfinished(job, tiles):
        raise FileFormatError(
            f"{job.path / _UNFINISHED_RESULT} is damaged and does not keep what is written to it"
        )


def _unfinished(job: JobFolder, tiles: list[Tile]) -> list[tuple[int, Tile]]:
    """Return the tiles that are unfinished or damaged, with their numbers."""
    marks = np.array(job.read(_DONE))
    if not are_marks(marks):
        raise FileFormatError(f"{job.path / _DONE} is damaged: it does not hold marks of tiles")
    distances = job.read(_UNFINISHED_RESULT)
    todo = []
    for number, tile in enumerate(tiles):
        if marks[number]:
            mirrored = distances[tile.columns, tile.rows].T
            if {mark(distances[tile.rows, tile.columns]), mark(mirrored)} == {int(marks[number])}:
                continue
            warn(
                f"{job.path / _UNFINISHED_RESULT} is damaged: tile {number}, distances "
                f"[{tile.rows.start}:{tile.rows.stop}, {tile.columns.start}:{tile.columns.stop}], "
                "is not what was written; it is computed again",
                DamagedFileWarning,
            )
        todo.append((number, tile))
    return todo
