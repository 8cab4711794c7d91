"""What a path energy with its gradient, a Gram matrix and a geodesic cost, and how that grows.

    pytest tests/benchmarks/test_path_energy.py --benchmark-enable -s

prints times of the compiled loops beside the definitions that autograd differentiates, exponents of
growth fitted to the logarithms, the gain of threads, and the paper's recipe (autograd and L-BFGS in
the coefficients) beside the default solver. Where benchmarks are disabled, the same code runs
briefly at coarse resolution.
"""

import time
from dataclasses import dataclass
from functools import partial

import numpy as np
import pytest
from autograd import value_and_grad
from paper_recipe import paper_path
from performances import basis, bodies, timed

from riemhuman.geometry import AlignedSurfaces, ElasticMetric, RiemannianMetric
from riemhuman.solvers import BasisPath, LinearPath
from riemhuman.surfaces import DeformationBasis
from riemhuman.terms import _sum as sum_of_terms

WEIGHTS = (1.0, 0.1, 0.1)


def metric(resolution, weights=WEIGHTS):
    return ElasticMetric(AlignedSurfaces(bodies(resolution).template), *weights)


def pose_pair(resolution, poses=("t_like", "bent_elbows")):
    names = bodies(resolution).pose_names
    return bodies(resolution).points[[20 + names.index(pose) for pose in poses]]


def path_of(resolution, n_nodes):
    start, end = pose_pair(resolution)
    return LinearPath(n_nodes).solve(metric(resolution), start, end).path


def seconds(function, repetitions):
    """Return the least wall time of several calls: the one least disturbed."""
    times = []
    for _ in range(repetitions):
        begin = time.perf_counter()
        function()
        times.append(time.perf_counter() - begin)
    return min(times)


def exponent(sizes, times):
    return np.polyfit(np.log(sizes), np.log(times), 1)[0]


def definition(elastic, path):
    """Return energy and gradient through autograd, from the definition."""
    return value_and_grad(partial(RiemannianMetric.energy, elastic))(path)


def test_energy_and_gradient(benchmark, monkeypatch):
    resolution, repetitions = ("coarse", 1) if benchmark.disabled else ("full", 20)
    elastic, path = metric(resolution), path_of(resolution, 11)
    elastic.energy_and_gradient(path)
    benchmark.pedantic(lambda: elastic.energy_and_gradient(path), rounds=repetitions)
    ours = seconds(lambda: elastic.energy_and_gradient(path), repetitions)
    theirs = seconds(lambda: definition(elastic, path), min(3, repetitions))
    monkeypatch.setattr(sum_of_terms, "_WORTH_THREADS", np.inf)
    alone = seconds(lambda: elastic.energy_and_gradient(path), repetitions)
    print(
        f"\n{resolution}, 11 surfaces: {1e3 * ours:.1f} ms; definition and autograd "
        f"{1e3 * theirs:.0f} ms, {theirs / ours:.0f} times as long; one thread "
        f"{1e3 * alone:.1f} ms, {alone / ours:.2f} times as long"
    )


def test_growth(benchmark):
    repetitions = 1 if benchmark.disabled else 10
    rows = {}
    sizes, times = [], []
    for resolution in ("coarse", "coarse" if benchmark.disabled else "full"):
        elastic, path = metric(resolution), path_of(resolution, 11)
        elastic.energy_and_gradient(path)
        sizes.append(bodies(resolution).template.n_faces * (1 + 1e-9 * len(sizes)))
        times.append(seconds(lambda: elastic.energy_and_gradient(path), repetitions))  # noqa: B023
    rows["triangles"] = sizes, times
    resolution = "coarse" if benchmark.disabled else "full"
    elastic = metric(resolution)
    lengths = [6, 11, 21, 41]
    paths = [path_of(resolution, n_nodes) for n_nodes in lengths]
    rows["path length"] = (
        [n_nodes - 1 for n_nodes in lengths],
        [seconds(partial(elastic.energy_and_gradient, path), repetitions) for path in paths],
    )
    counts, vectors = [25, 50, 100], basis(resolution).vectors
    f = bodies(resolution).template.vertices
    rows["basis vectors, Gram matrix"] = (
        counts,
        [seconds(partial(elastic.gram_matrix, vectors[:k], f), repetitions) for k in counts],
    )
    benchmark.pedantic(lambda: elastic.gram_matrix(vectors, f), rounds=repetitions)
    for name, (sizes, times) in rows.items():
        values = ", ".join(
            f"{size:.0f}: {1e3 * t:.1f} ms" for size, t in zip(sizes, times, strict=True)
        )
        growth = f"; exponent {exponent(sizes, times):.2f}" if not benchmark.disabled else ""
        print(f"\n{name}: {values}{growth}", end="")
    assert all(t > 0 for _, times in rows.values() for t in times)


@dataclass(frozen=True)
class AutodiffEnergy:
    """The same energy by its definition, with the gradient that autograd gives."""

    def value(self, metric, path):
        return float(RiemannianMetric.energy(metric, path))

    def value_and_gradient(self, metric, path):
        return definition(metric, path)


PAIRS = {
    "pose pair": ("t_like", "leg_raised"),
    "bent elbows": ("t_like", "bent_elbows"),
    "arms up to bent elbows": ("arms_up", "bent_elbows"),
}


@pytest.mark.parametrize("poses", PAIRS.values(), ids=PAIRS)
def test_geodesic(benchmark, poses):
    """Whole geodesics: the first, the next with the same basis and metric, and the recipe."""
    brief = benchmark.disabled
    most = 20 if brief else 2000
    elastic, deformations = metric("coarse"), basis("coarse")
    start, end = pose_pair("coarse", poses)
    solver = BasisPath(deformations)
    solver.solve(elastic, start, end)
    ours, our_seconds = benchmark.pedantic(
        lambda: timed(solver, elastic, start, end), rounds=1, iterations=1
    )
    began = time.perf_counter()
    theirs = paper_path(elastic, deformations, start, end, max_iter=most, energy=AutodiffEnergy())
    their_seconds = time.perf_counter() - began
    print(
        f"\ncoarse: ours {our_seconds:.3f} s, energy {ours.energy:.5g}; recipe with autograd "
        f"{their_seconds:.1f} s, energy {theirs.energy:.5g}, {theirs.n_iterations} iterations; "
        f"{their_seconds / our_seconds:.0f} times as long"
    )
    assert ours.energy <= 1.001 * theirs.energy
    if brief:
        return
    deformations = DeformationBasis(basis("full").vectors)
    elastic, (start, end) = metric("full"), pose_pair("full", poses)
    bodies("full").template.__dict__.pop("interpolator", None)  # factored anew, as in a new process
    solver = BasisPath(deformations)
    _, first_seconds = timed(solver, elastic, start, end)
    result, next_seconds = timed(solver, elastic, end, start)
    a_step = seconds(lambda: definition(elastic, result.path), 3)
    whole = a_step * theirs.n_evaluations
    print(
        f"full: ours {first_seconds:.2f} s, the next {next_seconds:.2f} s; recipe with autograd "
        f"{1e3 * a_step:.0f} ms an evaluation times {theirs.n_evaluations}: {whole:.0f} s, "
        f"{whole / next_seconds:.0f} times as long"
    )
