"""Geodesics over a basis against the paper's recipe, on the open bodies.

    pytest tests/benchmarks/test_geodesics.py --benchmark-enable -s

prints, for twenty seeded pairs under three metrics, the energy and the wall time of the default
solver and of the recipe, then the medians and the worst. The recipe is L-BFGS-B in the coefficients
from the straight path, with the same compiled energy, for 2,000 iterations: where SciPy's line
search gives up before, it starts again from where it was, as long as that gains 0.01 %. It takes
half an hour; with `-k turn0` every pair comes under one metric, which takes a third of that. Where
benchmarks are disabled, the same code runs briefly at coarse resolution. With `-k straightening` it
prints the energy and the seconds of paths straightened in all coordinates, for the same pairs.
"""

import time

import numpy as np
import pytest
from performances import basis, bodies, timed

from riemhuman.geometry.aligned_surfaces import AlignedSurfaces
from riemhuman.geometry.elastic_metric import ElasticMetric
from riemhuman.solvers import BasisPath, PathStraightening, SegmentEnergy

WEIGHTS = [(1.0, 1.0, 0.0), (0.0, 0.0, 1.0), (1.0, 0.1, 0.1)]
KINDS = ["pose", "pose", "build", "both"]
# What the bent elbow and the raised knee are called among the poses of the open bodies.
REQUIRED = [("t_like", "bent_elbows"), ("t_like", "leg_raised")]
FULL_ITERATIONS, BRIEF_ITERATIONS = 2000, 30
N_BRIEF = 3


def pairs():
    """Return twenty pairs of indices of bodies, each with what differs between them."""
    rng = np.random.default_rng(20)
    names = bodies("coarse").pose_names
    chosen = []
    for k in range(20):
        subject, other_subject = rng.choice(10, 2, replace=False)
        pose, other_pose = rng.choice(10, 2, replace=False)
        kind = KINDS[k % len(KINDS)]
        if k < 6:
            kind = "pose"
            pose, other_pose = (names.index(name) for name in REQUIRED[k // 3])
        start = 10 * subject + pose
        end = {
            "pose": 10 * subject + other_pose,
            "build": 10 * other_subject + pose,
            "both": 10 * other_subject + other_pose,
        }[kind]
        chosen.append((int(start), int(end), kind))
    return chosen


def runs():
    """Return every pair under every metric, each pair once before any comes again."""
    return [
        pytest.param(*pair, WEIGHTS[(k + turn) % 3], id=f"turn{turn}-{k}")
        for turn in range(3)
        for k, pair in enumerate(pairs())
    ]


class WatchedEnergy:
    """The energy of segments, which notes when a path of how much energy is known."""

    def __init__(self):
        self.seen, self.begin = [], time.perf_counter()

    def value(self, metric, path):
        return SegmentEnergy().value(metric, path)

    def value_and_gradient(self, metric, path):
        value, gradient = SegmentEnergy().value_and_gradient(metric, path)
        self.seen.append((time.perf_counter() - self.begin, value))
        return value, gradient

    def seconds_to(self, energy):
        """Return when the first path of at most this energy was known."""
        return next(seconds for seconds, value in self.seen if value <= energy)


@pytest.fixture(scope="module")
def ratios():
    """Collect the ratios of energies and of times of all pairs, and print what they come to."""
    rows = []
    yield rows
    energies, *times = np.array(rows).T
    print(
        f"\n{len(rows)} geodesics: energies of ours over the recipe's median "
        f"{np.median(energies):.4f}, largest {energies.max():.4f}"
    )
    for what, shares in zip(("reaches the recipe's energy", "ends"), times, strict=True):
        print(
            f"ours {what} in 1/{1 / np.median(shares):.0f} of its time in the median, "
            f"1/{1 / shares.max():.0f} at most"
        )


@pytest.mark.parametrize(("start", "end", "kind", "weights"), runs())
def test_against_the_papers_recipe(benchmark, ratios, start, end, kind, weights):
    full = not benchmark.disabled
    resolution = "full" if full else "coarse"
    most = FULL_ITERATIONS if full else BRIEF_ITERATIONS
    start_point, end_point = bodies(resolution).points[[start, end]]
    metric = ElasticMetric(AlignedSurfaces(bodies(resolution).template), *weights)
    deformations = basis(resolution)
    # Compiles, loads, keeps what can be kept.
    BasisPath(deformations).solve(metric, start_point, end_point)

    watched = []

    def solve():
        energy = WatchedEnergy()
        solver = BasisPath(deformations, energy=energy)
        watched.append((*timed(solver, metric, start_point, end_point), energy))

    benchmark.pedantic(solve, rounds=3 if full else 1, iterations=1)
    ours = watched[0][0]
    energy, n_iterations, n_starts, seconds = recipe(
        metric, deformations, start_point, end_point, most
    )
    assert ours.converged
    assert ours.energy <= 1.001 * energy
    reached = float(np.median([watch.seconds_to(1.001 * energy) for *_, watch in watched]))
    ended = float(np.median([duration for _, duration, _ in watched]))
    ratios.append((ours.energy / energy, reached / seconds, ended / seconds))
    print(
        f"\n{start:3d} {end:3d} {kind:5} {weights!s:16} recipe {energy:.5g} in {n_iterations} "
        f"iterations and {n_starts} starts, {seconds:.1f} s; ours reaches it in {reached:.2f} s "
        f"(1/{seconds / reached:.0f}), ends at {ours.energy:.5g} in {ours.n_evaluations} "
        f"evaluations, {ended:.2f} s (1/{seconds / ended:.0f}); "
        f"energies {ours.energy / energy:.4f}"
    )


def recipe(metric, deformations, start, end, most):
    """Return the energy of the paper's recipe, its iterations, starts, and seconds."""
    path, done, n_starts, seconds = None, 0, 0, 0.0
    while done < most:
        options = {"ftol": 0.0, "gtol": 0.0, "maxfun": 10 * most}
        solver = BasisPath(
            deformations,
            method="l-bfgs-b",
            max_iter=most - done,
            options=options,
            remove_drift=False,
        )
        result, time = timed(solver, metric, start, end, path)
        path, n_starts, seconds = result.path, n_starts + 1, seconds + time
        done += result.n_iterations
        if result.energies[-1] > 0.9999 * result.energies[0]:
            break
    return result.energy, done, n_starts, seconds


@pytest.mark.parametrize("weights", WEIGHTS, ids=str)
def test_straightening(benchmark, weights):
    full = not benchmark.disabled
    resolution = "full" if full else "coarse"
    open_bodies, seconds = bodies(resolution), []
    metric = ElasticMetric(AlignedSurfaces(open_bodies.template), *weights)

    def solve_all():
        for start, end, kind in pairs()[: None if full else N_BRIEF]:
            ends = open_bodies.points[[start, end]]
            result, duration = timed(PathStraightening(), metric, *ends)
            over_basis, _ = timed(BasisPath(basis(resolution)), metric, *ends)
            assert result.converged
            assert result.lower_bound <= result.energy < over_basis.energy
            seconds.append(duration)
            print(
                f"\n{start:3d} {end:3d} {kind:5} {weights!s:16} energy {result.energy:.5g}, over "
                f"the basis {over_basis.energy:.5g}, bound {result.lower_bound:.5g}; "
                f"{result.n_iterations} iterations, {duration:.2f} s"
            )

    benchmark.pedantic(solve_all, rounds=1, iterations=1)
    print(f"median {np.median(seconds):.2f} s, worst {max(seconds):.2f} s")
