"""All distances within a set of points, computed tile by tile on disk, and resumable."""

from __future__ import annotations

import os
import warnings
from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
from numpy import ndarray

from riemhuman.checks import one_of, whole_number
from riemhuman.errors import (
    ArgumentError,
    ArgumentTypeError,
    DamagedFileWarning,
    DegenerateSurfaceError,
    FileFormatError,
    RiemhumanError,
)
from riemhuman.geometry.metric import RiemannianMetric
from riemhuman.geometry.pairwise import PRECISIONS
from riemhuman.jobs.cluster import tiles_on_cluster
from riemhuman.jobs.tiles import (
    POINTS,
    Tile,
    TileReader,
    feature_file,
    largest_tile,
    memory_of_tile,
    tiles_of,
)
from riemhuman.kernels.threads import thread_count
from riemhuman.kernels.tiles import slices
from riemhuman.progress import ProgressBar
from riemhuman.storage.checksums import are_marks, checksums, mark
from riemhuman.storage.fingerprint import describe, digest
from riemhuman.storage.job_folder import JobFolder

RESULT = "D.npy"
"""Name of the file of distances."""

_UNFINISHED_RESULT = "D.unfinished.npy"
_DIGESTS, _CHECKSUMS, _DONE = "digests.npy", "checksums.npy", "done.npy"
_FORMAT = "riemhuman pairwise job 3"
# How often tiles that do not stay as they were written are computed again.
_ATTEMPTS = 3
# A job is cut into no fewer tiles than make some progress before it is interrupted, and no smaller
# ones than are worth the overhead.
_TILES_A_ROW, _SMALLEST_TILE = 8, 256
# Points whose features are computed at a time.
_BLOCK = 64
# How often the arrays of a point are in memory at once while its features are computed.
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

    The same numbers as `metric.dist_pairwise`, bit for bit, for sets that memory does not hold. A
    job that was interrupted or killed goes on when it is called again with the same arguments;
    what it had finished is kept. When it is complete, the folder holds the distances as `D.npy`,
    and calling it again only opens them.

    Checksums of the features and of every tile show damage to the files of an unfinished job: what
    is damaged is computed again, with a `DamagedFileWarning` that names it.

    Parameters
    ----------
    metric : RiemannianMetric
        The metric. It must keep its parameters in attributes of their names, as the metrics of the
        library do. The job holds their values and the code of the metric, with the constants,
        defaults, closures, globals and base classes that it reaches, and goes on with the same
        alone.
    points : array or sequence, shape (n, \*shape)
        Points: an array, in memory or mapped from a file, or any object with a length whose slices
        are arrays of points, made on the fly perhaps. They are passed over once at every call.
    folder : path_like
        Folder of the job, made if need be. Features of the points are kept there until the job is
        complete.
    precision : {"single", "double"}
        See `RiemannianMetric.dist_pairwise`.
    memory : int
        Bytes of memory that arrays may take at a time, in each worker of a cluster too. It decides
        how a new job is cut into tiles.
    n_jobs : int, optional
        Number of threads for each tile, -1 for one a core; by default one.
    client : distributed.Client, optional
        Client of a Dask cluster that computes the tiles. Its workers must be able to import the
        library, and to read the folder under the same path: it must be on a file system they
        share. They write nothing.
    progress : bool
        Whether to show progress bars.
    key : str, optional
        A name for the metric that stands in the job for its parameters and its code, where these
        cannot be told from others, or change without changing a distance. Whoever gives it sees to
        it that metrics with other distances have other keys.

    Returns
    -------
    memmap, shape (n, n)
        Symmetric, with zero diagonal; read-only.

    Raises
    ------
    ArgumentTypeError
        If an argument is of the wrong type, or the metric depends on what a job cannot tell from
        others, such as an open file, and there is no key for it.
    ArgumentError
        If a point is wrong, an option is not legal, or the folder holds something else: another
        job, one on other points or by another metric, or no job at all.
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

    room = JobFolder(folder)
    with room.locked():
        layout = room.claim(described, layout)
        tiles = list(tiles_of(n_points, layout["tile"]))
        blocks = list(slices(n_points, layout["block"]))
        arrays = dict(zip(map(feature_file, range(len(features))), features, strict=True))
        if precision == "single":
            # Pairs too close for single precision are computed anew, from the points.
            arrays[POINTS] = first
        tables: dict[str, tuple[tuple[int, ...], Any]] = {_DIGESTS: ((len(blocks), 32), np.uint8)}
        complete = room.exists(RESULT)
        if complete:
            tables[RESULT] = ((n_points, n_points), np.float64)
        else:
            for name, array in arrays.items():
                tables[name] = ((n_points, *array.shape[1:]), array.dtype)
            tables[_CHECKSUMS] = ((n_points, len(arrays)), np.uint32)
            tables[_DONE] = ((len(tiles),), np.uint64)
            tables[_UNFINISHED_RESULT] = ((n_points, n_points), np.float64)
        room.make_tables(tables)

        kept = [] if complete else list(arrays)
        for block in ProgressBar(blocks, desc="Points", disable=not progress, unit=" blocks"):
            _keep_features(room, metric, points, block, layout["block"], precision, kept, tiles)
        if not complete:
            reader = TileReader(str(room.path), len(features), n_jobs)
            try:
                _compute_tiles(room, metric, reader, tiles, client, progress)
            except RiemhumanError:
                # What damage makes of features may look like points that are wrong.
                _check_features(room, kept, blocks, tiles)
                raise
            _check_features(room, kept, blocks, tiles)
            room.rename(_UNFINISHED_RESULT, RESULT)
        room.remove(_DONE, _CHECKSUMS, *arrays)
        return room.read(RESULT)


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
    """Return how many points make a block of features, and a side of a tile."""
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
    room: JobFolder,
    metric: RiemannianMetric,
    points: Sequence[Any] | ndarray,
    block: slice,
    size: int,
    precision: str,
    names: list[str],
    tiles: list[Tile],
) -> None:
    """Compute the features of a block of points, or see that points and tables are as before."""
    number = block.start // size
    where = f"points[{block.start}:{block.stop}]"
    some = metric.check_points(points[block], where)
    if len(some) != block.stop - block.start:
        raise ArgumentError(f"{where} must be {block.stop - block.start} points; found {len(some)}")
    found = np.frombuffer(digest(some), np.uint8)
    kept = np.array(room.read(_DIGESTS)[number])
    if not names and not kept.any():
        raise FileFormatError(
            f"{room.path / _DIGESTS} is damaged: it does not tell the points of the complete job"
        )
    if kept.any():
        if not np.array_equal(kept, found):
            raise ArgumentError(
                f"folder must be that of the same job; that in {room.path} has other {where}"
            )
        damaged = _damaged_table(room, names, block)
        if damaged is None:
            return
        warnings.warn(
            f"{room.path / damaged} is damaged: what it holds of {where} is not what was written; "
            "it is computed again, with all that may have been made of it",
            DamagedFileWarning,
            stacklevel=3,
        )
        _forget_tiles(room, tiles, block)
    try:
        features = metric.features(some, precision)
    except DegenerateSurfaceError as error:
        raise DegenerateSurfaceError(f"{where}: {error}") from error
    written = (*features, some) if precision == "single" else features
    for name, array in zip(names, written, strict=True):
        room.write(name, (block, array))
    room.write(_CHECKSUMS, (block, np.stack([checksums(array) for array in written], axis=1)))
    room.write(_DIGESTS, (number, found))


def _damaged_table(room: JobFolder, names: list[str], block: slice) -> str | None:
    """Return the first table whose rows do not have their checksums."""
    for k, name in enumerate(names):
        if not np.array_equal(checksums(room.read(name)[block]), room.read(_CHECKSUMS)[block, k]):
            return name
    return None


def _check_features(
    room: JobFolder, names: list[str], blocks: list[slice], tiles: list[Tile]
) -> None:
    """Refuse to finish if features have changed while distances were made of them."""
    for block in blocks:
        damaged = _damaged_table(room, names, block)
        if damaged:
            _forget_tiles(room, tiles, block)
            raise FileFormatError(
                f"{room.path / damaged} is damaged: what it holds of "
                f"points[{block.start}:{block.stop}] is no longer what was written; the same call "
                "computes it again, with all that may have been made of it"
            )


def _forget_tiles(room: JobFolder, tiles: list[Tile], block: slice) -> None:
    """Have the tiles computed again that some points are part of."""
    marks = np.array(room.read(_DONE))
    for number, tile in enumerate(tiles):
        for side in (tile.rows, tile.columns):
            if side.start < block.stop and block.start < side.stop:
                marks[number] = 0
    room.write(_DONE, (slice(None), marks))


def _compute_tiles(
    room: JobFolder,
    metric: RiemannianMetric,
    reader: TileReader,
    tiles: list[Tile],
    client: Any | None,
    progress: bool,
) -> None:
    for _ in range(_ATTEMPTS):
        todo = _unfinished(room, tiles)
        if not todo:
            return
        computed: Iterator[tuple[int, ndarray]]
        if client is None:
            computed = ((number, reader.distances(metric, tile)) for number, tile in todo)
        else:
            computed = tiles_on_cluster(client, metric, reader, todo)
        n_pairs = sum(tile.n_pairs for tile in tiles)
        bar = ProgressBar(
            total=n_pairs,
            initial=n_pairs - sum(tile.n_pairs for _, tile in todo),
            desc="Distances",
            disable=not progress,
            unit=" pairs",
        )
        with bar:
            for number, block in computed:
                tile = tiles[number]
                # The record follows the entries: a kill between the two costs this tile, no more.
                room.write(
                    _UNFINISHED_RESULT,
                    ((tile.rows, tile.columns), block),
                    ((tile.columns, tile.rows), block.T),
                )
                room.write(_DONE, (number, mark(block)))
                bar.update(tile.n_pairs)
    if _unfinished(room, tiles):
        raise FileFormatError(
            f"{room.path / _UNFINISHED_RESULT} is damaged, and does not keep what is written to it"
        )


def _unfinished(room: JobFolder, tiles: list[Tile]) -> list[tuple[int, Tile]]:
    """Return the tiles that are not finished, or no longer what was written, with their numbers."""
    marks = np.array(room.read(_DONE))
    if not are_marks(marks):
        raise FileFormatError(f"{room.path / _DONE} is damaged: it marks tiles as neither")
    distances = room.read(_UNFINISHED_RESULT)
    todo = []
    for number, tile in enumerate(tiles):
        if marks[number]:
            mirrored = distances[tile.columns, tile.rows].T
            if {mark(distances[tile.rows, tile.columns]), mark(mirrored)} == {int(marks[number])}:
                continue
            warnings.warn(
                f"{room.path / _UNFINISHED_RESULT} is damaged: tile {number}, distances "
                f"[{tile.rows.start}:{tile.rows.stop}, {tile.columns.start}:{tile.columns.stop}], "
                "is not what was written; it is computed again",
                DamagedFileWarning,
                stacklevel=4,
            )
        todo.append((number, tile))
    return todo
