"""Means of one person's poses and of thousands of bodies from a file; medians of these.

pytest tests/benchmarks/test_means.py --benchmark-enable -s

prints wall and processor seconds; of the thousands also how much the resident memory grew, and how
far the mean or median of the sample alone is above that of all.
"""

import resource

import numpy as np
import pytest
from performances import basis, bodies, clocked

from riemhuman.datasets import load_open_bodies
from riemhuman.geometry import AlignedSurfaces, ElasticMetric
from riemhuman.solvers import BasisMean, FrechetMean, GeometricMedian
from riemhuman.solvers._dispersion import Dispersion
from riemhuman.surfaces import DeformationBasis
from riemhuman.surfaces.measures import triangle_areas

OTHER_PEOPLE = 81  # on whom no setting was compared


def test_mean_of_poses(benchmark):
    """The default mean of one natural person's ten poses, beside that over their differences."""
    data = load_open_bodies("full", variant="natural", people=OTHER_PEOPLE)
    for person in (2, 7):
        points = data.points[10 * person : 10 * person + 10]
        space = AlignedSurfaces(data.template)
        for weights in ((1.0, 1.0, 0.1), (0.0, 0.0, 1.0)):
            metric = ElasticMetric(space, *weights)
            metric.dist_pairwise(points[:2])
            differences = DeformationBasis(points[1:] - points[0], orthonormalize=True)
            over_span = BasisMean(differences, tolerance=1e-6).solve(metric, points)
            result, wall, processor = clocked(
                lambda: BasisMean().solve(metric, points),  # noqa: B023
                benchmark=benchmark,
            )
            areas = [triangle_areas(f, data.template.faces).sum() for f in (*points, result.point)]
            print(
                f"\n{weights}, person {person}: variance {result.variance:.4f} after "
                f"{result.n_iterations} iterations in {wall:.1f} s ({processor:.1f} s of the "
                f"processor), over the differences {over_span.variance:.4f}, of the vertex average "
                f"{Dispersion(metric, points).value(points.mean(axis=0)):.4f}; area "
                f"{areas[-1]:.3f} m², of the members {min(areas[:-1]):.3f} to {max(areas[:-1]):.3f}"
            )
            assert result.converged
            assert result.variance < over_span.variance


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


@pytest.mark.parametrize("kind", [FrechetMean, GeometricMedian])
def test_center_of_thousands_from_a_file(benchmark, tmp_path, kind):
    count = 10_000
    points = written(tmp_path, count)
    space = AlignedSurfaces(bodies("coarse").template)
    space.equip_with_metric(ElasticMetric, a=1.0, lam=1.0, c=1.0)
    space.metric.dist_pairwise(bodies("coarse").points[:2])
    batches = [points[first : first + 256] for first in range(0, count, 256)]
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    solver = BasisMean(basis("coarse"), tolerance=1e-7, sample_size=64)
    result, wall, processor = clocked(
        lambda: kind(space, solver).fit(batches).result_, benchmark=benchmark
    )
    grown = (resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before) / 2**10
    excess = result.variances[0] / result.variances[-1] - 1
    print(
        f"\n{kind.__name__} of {count} coarse bodies from a file in {wall:.1f} s, "
        f"{processor:.1f} s of the processor, {grown:.0f} MiB more than before (pages of the file "
        f"included): variance {result.variance:.6g} after {result.n_evaluations} readings; what "
        f"is minimised is {excess:.2%} more at the sample's own"
    )
    assert result.converged
