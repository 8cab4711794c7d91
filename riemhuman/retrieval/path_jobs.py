"""Paths between all pairs of a set of points, computed block by block on disk and resumable."""

from __future__ import annotations

import os
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy import ndarray

from riemhuman.errors import (
    ArgumentError,
    DamagedFileWarning,
    FileFormatError,
    RiemhumanError,
    warn,
)
from riemhuman.geometry import RiemannianMetric
from riemhuman.geometry.strategies import GeodesicSolver
from riemhuman.io.fingerprint import describe, digest
from riemhuman.io.job_folder import JobFolder, are_marks, mark
from riemhuman.kernels.threads import thread_count
from riemhuman.kernels.tiles import slices
from riemhuman.progress import ProgressBar
from riemhuman.retrieval.cluster import computed_tiles
from riemhuman.solvers.path_comparison import PairsOfPoints, PathDistances
from riemhuman.solvers.paths import solve_pairs

PATHS = "paths.npy"
"""Name of the file of paths, if they are kept: one for each pair i < j, row by row."""

_ROWS, _DONE = "rows.npy", "done.npy"
_FORMAT = "riemhuman pairwise job of paths 1"
# Pairs that are solved and then written at a time.
_BLOCK = 16
_N_NUMBERS = 6


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

    The numbers are those of `riemhuman.solvers.path_comparison`. An interrupted or killed job
    resumes when it is called again with the same arguments; finished paths are kept. Where the
    solver refuses a pair, all blocks of sixteen pairs without such a pair are solved and kept
    before the error is raised.

    Parameters
    ----------
    solver : GeodesicSolver
        Finds the paths, such as `BasisPath`. The job records its parameters, a callback included,
        and its code, and resumes only with the same.
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
    >>> found = rh.retrieval.path_job(solver, space.metric, bodies.points[:3], "paths")
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
        "points": digest(points).hex(),
        "n_points": len(points),
        "paths": keep_paths,
        "metric": describe(metric),
        "solver": describe(solver),
    }
    job = JobFolder(folder)
    with job.locked():
        size = job.claim(described, {"block": _BLOCK})["block"]
        blocks = list(slices(n_pairs, size))
        tables: dict[str, tuple[tuple[int, ...], Any]] = {
            _ROWS: ((n_pairs, _N_NUMBERS), np.float64),
            _DONE: ((len(blocks),), np.uint64),
        }
        if keep_paths:
            n_nodes = solver.solve(metric, *points[:2]).path.shape[0]
            tables[PATHS] = ((n_pairs, n_nodes, *points.shape[1:]), np.float64)
        job.make_tables(tables)
        todo = [(number, blocks[number]) for number in _unfinished(job, blocks, keep_paths)]
        reader = _PathFinder(solver, points, keep_paths, n_jobs)
        bar = ProgressBar(
            total=n_pairs,
            initial=n_pairs - sum(block.stop - block.start for _, block in todo),
            desc="Geodesics",
            disable=not progress,
            unit=" paths",
        )
        failures: list[RiemhumanError] = []
        found: Any
        with bar:
            for number, found in computed_tiles(metric, reader, todo, client):
                block = blocks[number]
                if isinstance(found, RiemhumanError):
                    failures.append(found)
                    continue
                if keep_paths:
                    shape = tables[PATHS][0][1:]
                    paths = found[:, _N_NUMBERS:].reshape(-1, *shape)
                    job.write(PATHS, (block, paths))
                job.write(_ROWS, (block, found[:, :_N_NUMBERS]))
                # The record follows the entries: a kill in between costs only these pairs.
                job.write(_DONE, (number, mark(found)))
                bar.update(block.stop - block.start)
        if failures:
            raise type(failures[0])(
                f"{failures[0]}; paths are kept in {job.path} but for {len(failures)} of "
                f"{len(blocks)} blocks of up to {size} pairs"
            )
        return PathDistances.from_rows(len(points), np.array(job.read(_ROWS)))


@dataclass(frozen=True)
class _PathFinder:
    """Finds the paths of some pairs, in this process or on a worker of a cluster."""

    solver: GeodesicSolver
    points: ndarray
    keep_paths: bool
    n_jobs: int | None

    def distances(self, metric: RiemannianMetric, tile: slice) -> Any:
        """Return a row for each pair: its numbers, and then its path if it is kept; or an error."""
        pairs = PairsOfPoints(self.points)[tile]
        try:
            results = solve_pairs(self.solver, metric, pairs, n_jobs=self.n_jobs)
        except RiemhumanError as error:
            return self._named(error, metric, tile)
        rows = []
        for result in results:
            path = result.path.ravel() if self.keep_paths else np.empty(0)
            rows.append(np.concatenate([PathDistances.row_of(metric, result), path]))
        return np.array(rows)

    def _named(
        self, error: RiemhumanError, metric: RiemannianMetric, tile: slice
    ) -> RiemhumanError:
        """Return an error of some pairs with the numbers of the two points that it is about."""
        rows, columns = np.triu_indices(len(self.points), 1)
        for i, j in zip(rows[tile], columns[tile], strict=True):
            try:
                solve_pairs(self.solver, metric, [self.points[[i, j]]])
            except RiemhumanError as own:
                said = str(own).removeprefix("pairs[0]: ")
                return type(own)(f"points[{i}] and points[{j}]: {said}")
        return error


def _unfinished(job: JobFolder, blocks: list[slice], keep_paths: bool) -> Iterator[int]:
    """Yield the numbers of the blocks that are unfinished or damaged."""
    marks = np.array(job.read(_DONE))
    if not are_marks(marks):
        raise FileFormatError(f"{job.path / _DONE} is damaged: it does not hold marks of pairs")
    for number, block in enumerate(blocks):
        if marks[number]:
            found = np.array(job.read(_ROWS)[block])
            if keep_paths:
                paths = np.array(job.read(PATHS)[block]).reshape(len(found), -1)
                found = np.concatenate([found, paths], axis=1)
            if mark(found) == int(marks[number]):
                continue
            warn(
                f"a table in {job.path} is damaged: its data for pairs {block.start} to "
                f"{block.stop - 1} are not what was written; they are solved again",
                DamagedFileWarning,
            )
        yield number
