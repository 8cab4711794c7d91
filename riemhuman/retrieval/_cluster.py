"""Computation of the parts of a job, in this process or on a Dask cluster."""

from __future__ import annotations

import pkgutil
from collections.abc import Collection, Hashable, Iterator, Sequence
from concurrent.futures import CancelledError
from contextlib import contextmanager
from copy import copy
from itertools import islice
from types import ModuleType
from typing import TYPE_CHECKING, Protocol, TypeVar

from riemhuman.arrays import Array
from riemhuman.errors import ClusterError, MissingDependencyError, RiemhumanError
from riemhuman.geometry import RiemannianMetric
from riemhuman.io.files import short_message
from riemhuman.optional import import_optional

if TYPE_CHECKING:
    import distributed

# Tiles sent for each thread of the cluster: one at work and others waiting, so that none is idle.
_TILES_A_THREAD = 3
# How often a tile is tried again after an error, such as a file system that failed for a moment.
_RETRIES = 3
# A cluster is lost after this many checks in a row without a worker.
_PATIENCE = 4


Part = TypeVar("Part")
PartContra = TypeVar("PartContra", contravariant=True)


class Worker(Protocol[PartContra]):
    """Computes parts of a job, here or on a machine of a cluster."""

    def compute(self, metric: RiemannianMetric, part: PartContra, /) -> Array | RiemhumanError: ...


def compute_parts(
    metric: RiemannianMetric,
    worker: Worker[Part],
    tiles: Sequence[tuple[int, Part]],
    client: distributed.Client | None = None,
) -> Iterator[tuple[int, Array | RiemhumanError]]:
    """Yield the number and the values of each part of a job, as they are finished."""
    if client is None:
        yield from ((number, worker.compute(metric, tile)) for number, tile in tiles)
        return
    distributed = import_optional("distributed", "cluster")
    if client.status == "closed":
        raise _lost("the client of the cluster is closed")
    with _losses(distributed, client):
        _check_workers(client)
        yield from _in_turn(distributed, client, metric, worker, tiles)


def _in_turn(
    distributed: ModuleType,
    client: distributed.Client,
    metric: RiemannianMetric,
    worker: Worker[Part],
    tiles: Sequence[tuple[int, Part]],
) -> Iterator[tuple[int, Array | RiemhumanError]]:
    # Sent once; the scheduler sends it again to workers that replace lost ones.
    sent = client.submit(copy, metric, pure=False)
    waiting = iter(tiles)
    running: dict[Hashable, int] = {}
    n_running = _TILES_A_THREAD * max(1, sum(client.nthreads().values()))
    try:
        while True:
            for number, tile in islice(waiting, n_running - len(running)):
                future = client.submit(
                    worker.compute, sent, tile, pure=False, retries=_RETRIES, priority=-number
                )
                running[future] = number
            if not running:
                return
            future = first_finished(client, distributed, running)
            values = future.result()
            yield running.pop(future), values
            future.release()
    finally:
        # A closed client has nothing left to cancel.
        if client.status == "running":
            client.cancel([*running, sent])


@contextmanager
def _losses(distributed: ModuleType, client: distributed.Client) -> Iterator[None]:
    """Raise a `ClusterError` for every error that means the loss of the cluster."""
    try:
        yield
    except RiemhumanError:
        raise
    except (CancelledError, distributed.comm.CommClosedError, distributed.KilledWorker) as error:
        raise _lost(f"the cluster is lost ({' '.join(short_message(error).split())})") from error
    except Exception as error:
        # Any part of a closed client may be missing, so errors have any type.
        if client.status != "running":
            raise _lost("the client of the cluster was closed during the work") from error
        raise


def _lost(what: str) -> ClusterError:
    return ClusterError(f"{what}; finished work is kept, and the same call continues it")


def first_finished(
    client: distributed.Client,
    distributed: ModuleType,
    running: Collection[Hashable],
    seconds: float = 15.0,
) -> distributed.Future:
    """Return a finished future, or give up when the cluster has had no worker for a minute.

    It is looked at every so many seconds.
    """
    n_without_workers = 0
    while n_without_workers < _PATIENCE:
        try:
            finished = distributed.wait(
                list(running), timeout=seconds, return_when="FIRST_COMPLETED"
            )
            return next(iter(finished.done))
        except TimeoutError:
            n_without_workers = 0 if client.nthreads() else n_without_workers + 1
    raise _lost(f"the cluster has had no worker for {_PATIENCE * seconds:g} seconds")


def _check_workers(client: distributed.Client) -> None:
    """Refuse workers that cannot import the library; the client would wait for them.

    A worker that is lost meanwhile is the scheduler's affair, which waits for one in its place.
    """
    try:
        answers = client.run(pkgutil.resolve_name, "riemhuman:__version__", on_error="return")
    except (OSError, TimeoutError) as failure:
        raise _lost(f"the cluster cannot be reached ({short_message(failure)})") from failure
    errors = [
        error
        for error in answers.values()
        if isinstance(error, Exception) and not isinstance(error, OSError)
    ]
    if errors:
        raise MissingDependencyError(
            f"{len(errors)} of {len(answers)} workers cannot import riemhuman ({errors[0]}); "
            "install the same version on every worker"
        )
