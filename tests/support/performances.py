"""The open bodies, a basis of the open motions, and stopwatches, for benchmarks."""

import time
import warnings
from functools import cache

import numpy as np

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


def pose_pair(resolution, poses):
    """Return the third person in two poses."""
    names = bodies(resolution).pose_names
    return bodies(resolution).points[[20 + names.index(pose) for pose in poses]]


def clocked(call, rounds=1, benchmark=None):
    """Return a result, and the least wall and processor seconds of several calls.

    The first calls that a test clocks with the fixture `benchmark` are those that pytest-benchmark
    reports.
    """
    walls, processors = [], []

    def timed_call():
        wall, processor = time.perf_counter(), time.process_time()
        result = call()
        walls.append(time.perf_counter() - wall)
        processors.append(time.process_time() - processor)
        return result

    if benchmark is not None and not benchmark.extra_info:
        benchmark.extra_info["rounds"] = rounds
        result = benchmark.pedantic(timed_call, rounds=rounds, iterations=1)
    else:
        for _ in range(rounds):
            result = timed_call()
    return result, min(walls), min(processors)


def shortest(*calls, rounds=5):
    """Return the least wall seconds of each call, the calls taking turns."""
    walls = [[clocked(call)[1] for call in calls] for _ in range(rounds)]
    return np.min(walls, axis=0)


def timed(solver, metric, *arguments, benchmark=None):
    """Return a solver's result and its wall time in seconds."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ConvergenceWarning)
        result, seconds, _ = clocked(lambda: solver.solve(metric, *arguments), 1, benchmark)
    return result, seconds


def growth(sizes, times):
    """Return the exponent with which times grow."""
    return np.polyfit(np.log(sizes), np.log(times), 1)[0]
