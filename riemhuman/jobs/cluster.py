"""Tiles of a job on a Dask cluster."""

from __future__ import annotations

import pkgutil
from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, Any

from numpy import ndarray

from riemhuman.errors import ArgumentTypeError, MissingDependencyError
from riemhuman.geometry.metric import RiemannianMetric
from riemhuman.optional import import_optional

if TYPE_CHECKING:
    from riemhuman.jobs.tiles import Tile, TileReader

# Tiles for each thread of the cluster: one at work and others waiting, so that none runs dry.
_TILES_A_THREAD = 3
# How often a tile is tried again after an error, such as a file system that failed for a moment.
_RETRIES = 3


def tiles_on_cluster(
    client: Any,
    metric: RiemannianMetric,
    reader: TileReader,
    tiles: Sequence[tuple[int, Tile]],
) -> Iterator[tuple[int, ndarray]]:
    """Compute tiles on a cluster, each anew if its worker is lost.

    Parameters
    ----------
    client : distributed.Client
        Client of the cluster.
    metric : RiemannianMetric
        The metric.
    reader : TileReader
        Computes a tile on a worker.
    tiles : sequence of (int, Tile)
        Numbered tiles.

    Yields
    ------
    number : int
        Number of a tile.
    distances : array, shape (n_rows, n_columns)
        Its distances; tiles come in the order they are finished.

    Raises
    ------
    ArgumentTypeError
        If the client is none.
    MissingDependencyError
        If distributed is not installed, or a worker lacks the library.
    """
    distributed = import_optional("distributed", "cluster")
    if not isinstance(client, distributed.Client):
        raise ArgumentTypeError(
            f"client must be a distributed.Client; found {type(client).__name__}"
        )
    _check_workers(client)
    # Sent once, and from the scheduler again to a worker that replaces a lost one.
    sent = client.submit(_same, metric, pure=False)
    waiting = iter(tiles)
    running: dict[Any, int] = {}

    def start_next() -> Any:
        for number, tile in waiting:
            future = client.submit(
                reader.distances, sent, tile, pure=False, retries=_RETRIES, priority=-number
            )
            running[future] = number
            return future
        return None

    n_running = _TILES_A_THREAD * max(1, sum(client.nthreads().values()))
    started = [start_next() for _ in range(min(n_running, len(tiles)))]
    finished = distributed.as_completed(started)
    try:
        for future in finished:
            distances = future.result()
            yield running.pop(future), distances
            future.release()
            following = start_next()
            if following is not None:
                finished.add(following)
    finally:
        client.cancel([*running, sent])


def _same(metric: RiemannianMetric) -> RiemannianMetric:
    return metric


def _check_workers(client: Any) -> None:
    """Refuse workers that cannot import the library."""
    found = client.run(pkgutil.resolve_name, "riemhuman:__version__", on_error="return")
    missing = {address: error for address, error in found.items() if isinstance(error, Exception)}
    if missing:
        address, error = next(iter(missing.items()))
        raise MissingDependencyError(
            f"{len(missing)} of {len(found)} workers cannot import riemhuman, the first at "
            f"{address} ({error}); install the same version on every worker"
        )
