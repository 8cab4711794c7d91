"""What a path energy with its gradient costs.

    pytest tests/benchmarks/test_path_energy.py --benchmark-enable -s

prints times of the compiled loops beside the definition that autograd differentiates.
"""

from functools import partial

from autograd import value_and_grad
from performances import bodies, clocked, pose_pair

from riemhuman.geometry import AlignedSurfaces, ElasticMetric, RiemannianMetric
from riemhuman.solvers import LinearPath


def metric(resolution):
    return ElasticMetric(AlignedSurfaces(bodies(resolution).template), 1.0, 0.1, 0.1)


def path_of(resolution, n_nodes):
    ends = pose_pair(resolution, ("t_like", "bent_elbows"))
    return LinearPath(n_nodes).solve(metric(resolution), *ends).path


def seconds(call, rounds=10):
    """Return the least wall time of several calls, after one that compiles."""
    call()
    return clocked(call, rounds)[1]


def test_energy_and_gradient(benchmark):
    elastic, path = metric("full"), path_of("full", 11)
    ours = seconds(lambda: elastic.energy_and_gradient(path), 20)
    # Through autograd, from the definition.
    definition = value_and_grad(partial(RiemannianMetric.energy, elastic))
    theirs = seconds(lambda: definition(path), 3)
    print(
        f"\n11 surfaces: {1e3 * ours:.1f} ms; definition and autograd {1e3 * theirs:.0f} ms, "
        f"{theirs / ours:.0f} times as long"
    )
    benchmark.pedantic(lambda: elastic.energy_and_gradient(path), rounds=20)
    assert ours < theirs
