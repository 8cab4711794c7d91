"""Tiles of a job on a Dask cluster."""

from __future__ import annotations

import pkgutil
from collections.abc import Collection, Iterator, Sequence
from concurrent.futures import CancelledError
from contextlib import contextmanager
from typing import Any, Protocol

from numpy import ndarray

from riemhuman.errors import (
    ArgumentTypeError,
    ClusterError,
    MissingDependencyError,
    RiemhumanError,
)
from riemhuman.geometry.metric import RiemannianMetric
from riemhuman.optional import import_optional
from riemhuman.storage.file_content import brief

# Tiles for each thread of the cluster: one at work and others waiting, so that none runs dry.
_TILES_A_THREAD = 3
# How often a tile is tried again after an error, such as a file system that failed for a moment.
_RETRIES = 3
# How often, and how many seconds apart, a cluster may be found without a worker.
_PATIENCE, _SECONDS = 4, 15


class BlockReader(Protocol):
    """What computes one part of a job."""

    def distances(self, metric: RiemannianMetric, tile: Any) -> ndarray:
        """Return the numbers of one part.

        Parameters
        ----------
        metric : RiemannianMetric
            The metric.
        tile : object
            Which part, such as a `Tile`.

        Returns
        -------
        array
        """


def tiles_on_cluster(
    client: Any,
    metric: RiemannianMetric,
    reader: BlockReader,
    tiles: Sequence[tuple[int, Any]],
) -> Iterator[tuple[int, ndarray]]:
    """Compute tiles on a cluster; tiles of a lost worker are computed again.

    Parameters
    ----------
    client : distributed.Client
        Client of the cluster.
    metric : RiemannianMetric
        The metric.
    reader : BlockReader
        Computes a tile on a worker, a `TileReader` for one.
    tiles : sequence of (int, object)
        Numbered tiles, or whatever else the reader takes.

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
    ClusterError
        If the cluster has had no worker for a minute, its scheduler is lost, or one tile after
        another has ended its worker.
    """
    distributed = import_optional("distributed", "cluster")
    if not isinstance(client, distributed.Client):
        raise ArgumentTypeError(
            f"client must be a distributed.Client; found {type(client).__name__}"
        )
    if client.status == "closed":
        raise _lost("the client of the cluster is closed")
    with _losses(distributed, client):
        _check_workers(client)
        yield from _in_turn(distributed, client, metric, reader, tiles)


def _in_turn(
    distributed: Any,
    client: Any,
    metric: RiemannianMetric,
    reader: BlockReader,
    tiles: Sequence[tuple[int, Any]],
) -> Iterator[tuple[int, ndarray]]:
    # Sent once, and from the scheduler again to a worker that replaces a lost one.
    sent = client.submit(_same, metric, pure=False)
    waiting = iter(tiles)
    running: dict[Any, int] = {}

    def start_next() -> None:
        for number, tile in waiting:
            future = client.submit(
                reader.distances, sent, tile, pure=False, retries=_RETRIES, priority=-number
            )
            running[future] = number
            return

    n_running = _TILES_A_THREAD * max(1, sum(client.nthreads().values()))
    for _ in range(min(n_running, len(tiles))):
        start_next()
    try:
        while running:
            future = _first_finished(client, distributed, running)
            distances = future.result()
            yield running.pop(future), distances
            future.release()
            start_next()
    finally:
        # Of a client that was closed, there is nothing left to cancel.
        if client.status == "running":
            client.cancel([*running, sent])


@contextmanager
def _losses(distributed: Any, client: Any) -> Iterator[None]:
    """Say in one way, and typed, that there is no cluster to go on with."""
    try:
        yield
    except RiemhumanError:
        raise
    except (CancelledError, distributed.comm.CommClosedError, distributed.KilledWorker) as error:
        raise _lost(f"the cluster is lost ({' '.join(brief(error).split())})") from error
    except Exception as error:
        # Of a client that was closed, any part may be missing: errors have any type.
        if client.status != "running":
            said = " ".join(brief(error).split())
            raise _lost(f"the client of the cluster was closed on the way ({said})") from error
        raise


def _lost(what: str) -> ClusterError:
    return ClusterError(f"{what}; what is done is kept, and the same call goes on with it")


def _first_finished(client: Any, distributed: Any, running: Collection[Any]) -> Any:
    """Return a future that is finished, or give up when the cluster has had no worker for long."""
    n_without_workers = 0
    while n_without_workers < _PATIENCE:
        try:
            finished = distributed.wait(
                list(running), timeout=_SECONDS, return_when="FIRST_COMPLETED"
            )
            return next(iter(finished.done))
        except TimeoutError:
            n_without_workers = 0 if client.nthreads() else n_without_workers + 1
    raise _lost(f"the cluster has had no worker for {_PATIENCE * _SECONDS} seconds")


def _same(metric: RiemannianMetric) -> RiemannianMetric:
    return metric


def _check_workers(client: Any) -> None:
    """Refuse workers that cannot import the library."""
    try:
        found = client.run(pkgutil.resolve_name, "riemhuman:__version__", on_error="return")
    except (OSError, TimeoutError) as failure:
        raise _lost(f"the cluster cannot be reached ({brief(failure)})") from failure
    missing = {address: error for address, error in found.items() if isinstance(error, Exception)}
    if missing:
        address, error = next(iter(missing.items()))
        raise MissingDependencyError(
            f"{len(missing)} of {len(found)} workers cannot import riemhuman, the first at "
            f"{address} ({error}); install the same version on every worker"
        )
