"""What the metrics of the family cost: energies, geodesics, matrices, and a term of one's own.

    pytest tests/benchmarks/test_metric_family.py --benchmark-enable -s

prints the time of an energy with its gradient and of a geodesic between two poses over 100
deformations at full resolution, by wall clock and by the processor's time of all threads, and the
time of a distance with a term that a user wrote beside those of the library.
"""

import autograd.numpy as np
import numpy
import pytest
from performances import basis, bodies, clocked, pose_pair, timed

from riemhuman.geometry import (
    AlignedSurfaces,
    ElasticMetric,
    GaugeInvariantMetric,
    GeneralElasticMetric,
    SobolevMetric,
    SRNFMetric,
    SurfaceMetric,
)
from riemhuman.solvers import BasisPath, LinearPath
from riemhuman.surfaces import DeformationBasis
from riemhuman.terms import FlatTerm

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


@pytest.mark.parametrize("people", [(20, 40), (30, 50)], ids=str)
def test_geodesic_along_normals(benchmark, people):
    """Between two people in one pose, over mesh harmonics."""
    data = bodies("full")
    metric = GaugeInvariantMetric(SRNFMetric(AlignedSurfaces(data.template, equip=False)))
    harmonics = DeformationBasis.from_laplacian(data.template, n_components=100)
    solver, ends = BasisPath(harmonics, n_nodes=6), data.points[list(people)]
    result, wall = timed(solver, metric, *ends, benchmark=benchmark)
    straight = metric.energy(np.linspace(*ends, 6))
    print(
        f"\ngauge-invariant SRNF over 100 harmonics: {wall:.1f} s, "
        f"{result.n_evaluations} evaluations, energy {straight:.3g} to {result.energy:.3g}"
    )
    assert result.converged


class LogAreas(FlatTerm):
    """The term of the README."""

    is_rotation_invariant = True
    needs_area = True

    def field(self, first):
        return np.log(first.areas)[..., None]


def test_distances_with_a_term_of_ones_own(benchmark):
    space, points = AlignedSurfaces(bodies("full").template, equip=False), bodies("full").points
    n_pairs = 4950
    own, srnf = SurfaceMetric(space, [LogAreas(0.1)]), SRNFMetric(space)
    times = {}
    for name, metric in (("own term", own), ("SRNF", srnf)):
        features = metric.bulk.features(points, "single")
        metric.bulk.squared_distances(features, features, 1)
        _, times[name], _ = clocked(
            lambda: metric.bulk.squared_distances(features, features, 1),  # noqa: B023
            5,
            benchmark=benchmark,
        )
    _, one, _ = clocked(lambda: own.dist(points[0], points[1]), 3)
    shown = ", ".join(f"{name} {1e6 * t / n_pairs:.1f} µs a pair" for name, t in times.items())
    print(f"\n{n_pairs} pairs: {shown}; by the definition {1e6 * one:.0f} µs")
    numpy.testing.assert_allclose(
        own.dist_pairwise(points[:2])[0, 1], own.dist(points[0], points[1]), rtol=1e-5
    )
