"""What the metrics of the family cost: energies and geodesics.

    pytest tests/benchmarks/test_metric_family.py --benchmark-enable -s

prints the time of an energy with its gradient and of a geodesic between two poses over 100
deformations at full resolution, by wall clock and by the processor's time of all threads.
"""

import pytest
from performances import basis, bodies, clocked, pose_pair

from riemhuman.geometry import (
    AlignedSurfaces,
    ElasticMetric,
    GaugeInvariantMetric,
    GeneralElasticMetric,
    SobolevMetric,
    SRNFMetric,
)
from riemhuman.solvers import BasisPath, LinearPath

METRICS = {
    "elastic (1, 0.1, 0.1)": lambda space: ElasticMetric(space, 1.0, 0.1, 0.1),
    "general elastic (1, 1, 1)": GeneralElasticMetric,
    "Sobolev, first order": SobolevMetric,
    "Sobolev, d1 and a2": lambda space: SobolevMetric(space, d1=0.5, a2=1e-3),
    "Sobolev, all six": lambda space: SobolevMetric(space, a0=100.0, d1=0.5, a2=1e-3),
    "gauge-invariant SRNF": lambda space: GaugeInvariantMetric(SRNFMetric(space)),
}
PAIRS = [("t_like", "bent_elbows"), ("t_like", "leg_raised")]


@pytest.mark.parametrize("name", METRICS)
def test_energy_and_gradient(benchmark, name):
    metric = METRICS[name](AlignedSurfaces(bodies("full").template, equip=False))
    path = LinearPath(11).solve(metric, *pose_pair("full", PAIRS[0])).path
    (energy, _), wall, processor = clocked(
        lambda: metric.energy_and_gradient(path), 20, benchmark=benchmark
    )
    print(
        f"\n{name}, 11 surfaces: energy {energy:.4g} with gradient in "
        f"{1e3 * wall:.0f} ms, {1e3 * processor:.0f} ms of the processor"
    )
    assert energy > 0


@pytest.mark.parametrize("poses", PAIRS, ids="-".join)
@pytest.mark.parametrize("name", [name for name in METRICS if "gauge" not in name])
def test_geodesic(benchmark, name, poses):
    metric = METRICS[name](AlignedSurfaces(bodies("full").template, equip=False))
    start, end = pose_pair("full", poses)
    solver = BasisPath(basis("full"))
    solver.solve(metric, start, end)  # compiles, loads, keeps what can be kept
    result, wall, processor = clocked(lambda: solver.solve(metric, start, end), benchmark=benchmark)
    print(
        f"\n{name}, {' to '.join(poses)}: {wall:.2f} s, {processor:.2f} s of the "
        f"processor, {result.n_evaluations} evaluations, energy {result.energies[0]:.5g} to "
        f"{result.energy:.5g}"
    )
    assert result.converged
