"""Means: of five people in one pose, of all bodies, and of thousands read from a file; medians.

pytest tests/benchmarks/test_means.py --benchmark-enable -s

prints wall and processor seconds; of the thousands also how much the resident memory grew, and how
far the mean or median of the sample alone is above that of all.
"""

import resource
import time

import numpy as np
import pytest
from performances import basis, bodies

from riemhuman.geometry import AlignedSurfaces, ElasticMetric
from riemhuman.solvers import BasisMean, StreamingMean, StreamingMedian
from riemhuman.solvers._dispersion import Dispersion
from riemhuman.statistics import GeometricMedian


def test_mean_of_five_people(benchmark):
    resolution = "coarse" if benchmark.disabled else "full"
    points = bodies(resolution).points[0:50:10]
    metric = ElasticMetric(AlignedSurfaces(bodies(resolution).template), 0.0, 0.0, 1.0)
    solver = BasisMean(basis(resolution))
    result = benchmark.pedantic(
        lambda: solver.solve(metric, points), rounds=3, iterations=1, warmup_rounds=1
    )
    dispersion = Dispersion(metric, points)
    print(
        f"\n{resolution}: variance {result.variance:.6g} after {result.n_iterations} iterations; "
        f"of the Euclidean mean {dispersion.value(points.mean(axis=0)):.6g}, "
        f"of the best sample {min(map(dispersion.value, points)):.6g}"
    )
    assert result.converged
    assert result.variance < dispersion.value(points.mean(axis=0))


def timed(call):
    """Return a result with the wall and processor seconds it took."""
    wall, processor = time.perf_counter(), time.process_time()
    result = call()
    return result, time.perf_counter() - wall, time.process_time() - processor


def test_mean_of_all_bodies(benchmark):
    resolution, count = ("coarse", 6) if benchmark.disabled else ("full", 100)
    points = bodies(resolution).points[:count]
    metric = ElasticMetric(AlignedSurfaces(bodies(resolution).template), 1.0, 1.0, 0.1)
    metric.dist_pairwise(points[:2])
    result, wall, processor = timed(lambda: BasisMean().solve(metric, points))
    print(
        f"\n{resolution}: mean of {count} bodies over their differences in {wall:.1f} s, "
        f"{processor:.1f} s of the processor: variance {result.variance:.6g} after "
        f"{result.n_iterations} iterations"
    )
    assert result.converged
    benchmark.pedantic(lambda: None, rounds=1)


def written(folder, count):
    """Write random people in random poses between those of the open bodies; return the array."""
    known, rng = bodies("coarse"), np.random.default_rng(2)
    file = folder / "bodies.npy"
    made = np.lib.format.open_memmap(file, "w+", float, (count, *known.points.shape[1:]))
    for first in range(0, count, 100):
        some = slice(first, min(first + 100, count))
        n = some.stop - some.start
        weights = rng.dirichlet(np.full(4, 0.7), n)
        people = 10 * rng.integers(10, size=(n, 1)) + rng.integers(10, size=(n, 4))
        made[some] = np.einsum("nk,nkvi->nvi", weights, known.points[people])
    made.flush()
    del made
    return np.load(file, mmap_mode="r")


@pytest.mark.parametrize("kind", [StreamingMean, StreamingMedian], ids=["mean", "median"])
def test_center_of_thousands_from_a_file(benchmark, tmp_path, kind):
    count = 40 if benchmark.disabled else 10_000
    points = written(tmp_path, count)
    metric = ElasticMetric(AlignedSurfaces(bodies("coarse").template), 1.0, 1.0, 1.0)
    deformations = basis("coarse")
    metric.dist_pairwise(bodies("coarse").points[:2])
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    solver = kind(deformations, sample_size=min(64, count))
    result, wall, processor = timed(lambda: solver.solve(metric, points))
    grown = (resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before) / 2**10
    excess = result.variances[0] / result.variances[-1] - 1
    print(
        f"\n{kind.__name__} of {count} coarse bodies from a file in {wall:.1f} s, "
        f"{processor:.1f} s of the processor, {grown:.0f} MiB more than before (pages of the file "
        f"included): variance {result.variance:.6g} after {result.n_evaluations} readings; what "
        f"is minimised is {excess:.2%} more at the sample's own"
    )
    assert result.converged
    benchmark.pedantic(lambda: None, rounds=1)


def test_streamed_median_against_weiszfeld(benchmark):
    """How far a streamed median is above one in memory, which searches the same family."""
    count = 8 if benchmark.disabled else 60
    points = bodies("coarse").points[:count]
    space = AlignedSurfaces(bodies("coarse").template)
    space.equip_with_metric(ElasticMetric, a=1.0, lam=1.0, c=1.0)
    solver = StreamingMedian(basis("coarse"), with_differences=False, sample_size=count // 4)
    found = solver.solve(space.metric, points)
    in_memory = BasisMean(basis("coarse"), with_differences=False)

    class SameFamily:
        def solve(self, metric, points, weights=None, initial_point=None):
            return in_memory.solve(metric, points, weights, found.point)

    median = GeometricMedian(space, solver=SameFamily(), tolerance=1e-8)
    benchmark.pedantic(lambda: median.fit(points), rounds=1, iterations=1)
    excess = found.variances[-1] / median.result_.variances[-1] - 1
    print(f"\nthe mean distance of {count} bodies to the streamed median is {excess:.1e} more")
    assert abs(excess) < 1e-5
