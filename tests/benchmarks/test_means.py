"""Karcher mean of five people in one pose.

pytest tests/benchmarks/test_means.py --benchmark-enable -s
"""

from performances import basis, bodies

from riemhuman.geometry.aligned_surfaces import AlignedSurfaces
from riemhuman.geometry.elastic_metric import ElasticMetric
from riemhuman.solvers import BasisMean
from riemhuman.solvers.dispersion import Dispersion


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
