"""Geodesics over a basis against the paper's recipe, on the open bodies.

    pytest tests/benchmarks/test_geodesics.py --benchmark-enable -s

prints, for twenty seeded pairs under three metrics, the energy and the wall time of the default
solver and of the recipe, then the medians and the worst. The recipe is L-BFGS-B in the coefficients
from the straight path, with the same compiled energy, for 2,000 iterations: where SciPy's line
search gives up before, it starts again from where it was, as long as that gains 0.01 %. It takes
half an hour; with `-k turn0` every pair comes under one metric, which takes a third of that. With
`-k straightening` it prints the seconds of paths straightened in all coordinates, for the same
pairs; with `-k gaps` what results say of their distance to the minimum; with
`-k many` the time of a table of distances by the lengths of paths.
"""

import resource
import time
from dataclasses import replace

import numpy as np
import pytest
from performances import basis, bodies, clocked, timed
from scipy import optimize

from riemhuman.datasets import load_open_bodies
from riemhuman.geometry import AlignedSurfaces, ElasticMetric
from riemhuman.solvers import BasisPath, PathStraightening, SegmentEnergy, path_distances

WEIGHTS = [(1.0, 1.0, 0.0), (0.0, 0.0, 1.0), (1.0, 0.1, 0.1)]
KINDS = ["pose", "pose", "build", "both"]
# What the bent elbow and the raised knee are called among the poses of the open bodies.
REQUIRED = [("t_like", "bent_elbows"), ("t_like", "leg_raised")]
MOST_ITERATIONS = 2000


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
    start_point, end_point = bodies("full").points[[start, end]]
    metric = ElasticMetric(AlignedSurfaces(bodies("full").template), *weights)
    deformations = basis("full")
    # Compiles, loads, keeps what can be kept.
    BasisPath(deformations).solve(metric, start_point, end_point)

    watched = []
    for _ in range(3):
        energy = WatchedEnergy()
        solver = BasisPath(deformations, energy=energy)
        watched.append(
            (*timed(solver, metric, start_point, end_point, benchmark=benchmark), energy)
        )
    ours = watched[0][0]
    energy, n_iterations, n_starts, seconds = recipe(metric, deformations, start_point, end_point)
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


def searched(metric, deformations, path, max_iter):
    """Return the energy, path and iterations of one search, and the ratio of energies it gained.

    It is algorithm 1 of the paper as printed: L-BFGS-B in the coefficients of a basis.
    """
    shape = len(path) - 2, len(deformations)

    def path_of(coefficients):
        moved = path.copy()
        moved[1:-1] += deformations.combine(coefficients.reshape(shape))
        return moved

    def objective(coefficients):
        value, gradient = SegmentEnergy().value_and_gradient(metric, path_of(coefficients))
        return value, (gradient[1:-1].reshape(shape[0], -1) @ deformations.flat.T).ravel()

    begin = np.zeros(shape[0] * shape[1])
    options = {"ftol": 0.0, "gtol": 0.0, "maxiter": max_iter, "maxfun": 10 * max_iter}
    found = optimize.minimize(objective, begin, jac=True, method="L-BFGS-B", options=options)
    return float(found.fun), path_of(found.x), found.nit, float(found.fun) / objective(begin)[0]


def recipe(metric, deformations, start, end):
    """Return the energy of the paper's recipe, its iterations, starts, and seconds."""
    path, done, n_starts, seconds = np.linspace(start, end, 11), 0, 0, 0.0
    while done < MOST_ITERATIONS:
        (energy, path, n_iterations, gain), duration, _ = clocked(
            lambda: searched(metric, deformations, path, MOST_ITERATIONS - done)  # noqa: B023
        )
        done, n_starts, seconds = done + n_iterations, n_starts + 1, seconds + duration
        if gain > 0.9999:
            break
    return energy, done, n_starts, seconds


@pytest.fixture(scope="module")
def straightened():
    """Collect what paths in all coordinates cost, and print medians."""
    rows = []
    yield rows
    if not rows:
        return
    seconds, gains = np.array(rows).T
    print(
        f"\n{len(rows)} paths in all coordinates: median {np.median(seconds):.2f} s of processor "
        f"time, worst {seconds.max():.2f} s; energies over the basis path's at most "
        f"{gains.max():.4f}"
    )


@pytest.mark.parametrize("weights", WEIGHTS, ids=str)
def test_straightening(benchmark, straightened, weights):
    metric = ElasticMetric(AlignedSurfaces(bodies("full").template), *weights)
    for start, end, _ in pairs():
        ends = bodies("full").points[[start, end]]
        result, _, processor = clocked(
            lambda: PathStraightening().solve(metric, *ends),  # noqa: B023
            benchmark=benchmark,
        )
        over_basis, _ = timed(BasisPath(basis("full")), metric, *ends)
        assert result.converged
        assert result.lower_bound <= result.energy < over_basis.energy
        straightened.append((processor, result.energy / over_basis.energy))
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 2**20
    print(f"peak of memory {peak:.2f} GiB, of all that has run in this process")


def registered(variant):
    """Return coarse bodies: open ones, natural ones, or natural ones with noise of 1.5 mm."""
    if variant == "open":
        return bodies("coarse").points
    points = load_open_bodies("coarse", variant="natural").points
    noise = np.random.default_rng(6).normal(0.0, 0.0015, points.shape)
    return points + noise if variant == "noisy" else points


@pytest.mark.parametrize("variant", ["open", "natural", "noisy"])
@pytest.mark.parametrize("weights", WEIGHTS, ids=str)
def test_gaps(benchmark, weights, variant):
    """What results say of their distance to the minimum, against running on; and ends swapped."""
    metric = ElasticMetric(AlignedSurfaces(bodies("coarse").template), *weights)
    points, some = registered(variant), pairs()[::2]
    for name, solver, further, most in (
        ("over a basis", BasisPath(basis("coarse"), remove_drift=False), 1e-10, 0.1),
        ("in all coordinates", PathStraightening(remove_drift=False), 1e-6, np.inf),
    ):
        rows = []
        for start, end, _ in some:
            ends = points[[start, end]]
            result = solver.solve(metric, *ends)
            tight = replace(solver, tolerance=further)
            least, _ = timed(tight, metric, *ends, result.path, benchmark=benchmark)
            back = solver.solve(metric, *ends[::-1])
            above = 100 * (result.energy / least.energy - 1)
            rows.append((above, result.gap, 100 * abs(result.energy / back.energy - 1)))
        shown, stated, swapped = np.array(rows).T
        gained = shown > 0.0
        low, middle, high = np.nanpercentile(stated[gained] / shown[gained], [0, 50, 100])
        print(
            f"\n{variant:7} {weights!s:16} {name}: {np.median(shown):.3f} % above the minimum in "
            f"the median, {shown.max():.3f} % at most; gaps stated are {low:.2f} to {high:.2f} of "
            f"that, {middle:.2f} in the median; the way back differs by {swapped.max():.4f} % at "
            "most"
        )
        assert shown.max() < most


def test_many_geodesics(benchmark):
    """A table by path length of coarse bodies, and how far the closed form is from it."""
    n_bodies = 46
    metric = ElasticMetric(AlignedSurfaces(bodies("coarse").template), 1.0, 1.0, 0.1)
    points, solver = bodies("coarse").points[::2][:n_bodies], BasisPath(basis("coarse"))
    solver.solve(metric, *points[:2])
    found, *seconds = clocked(
        lambda: path_distances(solver, metric, points, n_jobs=2), benchmark=benchmark
    )
    n_pairs = n_bodies * (n_bodies - 1) // 2
    a_thousand = [1000 * duration / n_pairs for duration in seconds]
    print(
        f"\n{n_pairs} geodesics of coarse bodies on two threads: {a_thousand[0]:.0f} s a thousand, "
        f"{a_thousand[1]:.0f} s of processor time; lengths exceed distances in closed form by "
        f"{np.median(found.excess):.2f} % in the median, {found.excess.max():.2f} % at most; "
        f"{found.message}"
    )
    assert np.all(found.excess > -1e-6)
