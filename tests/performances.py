"""The open bodies, a basis of the open motions, and a stopwatch, for benchmarks."""

import time
import warnings
from functools import cache

from riemhuman.datasets import load_open_bodies, load_open_motions
from riemhuman.errors import ConvergenceWarning
from riemhuman.surfaces import DeformationBasis


@cache
def bodies(resolution):
    """Return the open bodies."""
    return load_open_bodies(resolution)


@cache
def basis(resolution):
    """Return 100 principal deformations of the open motions."""
    motions = load_open_motions(resolution)
    return DeformationBasis.from_motions(motions, n_components=100)


def timed(solver, metric, *arguments):
    """Return a solver's result and its wall time in seconds."""
    begin = time.perf_counter()
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ConvergenceWarning)
        result = solver.solve(metric, *arguments)
    return result, time.perf_counter() - begin
