"""Geodesics over a basis against the paper's recipe, on the open bodies.

    pytest tests/benchmarks/test_geodesics.py --benchmark-enable -s

prints, for twenty seeded pairs, the energy and the wall time of the default solver and of L-BFGS-B
in the coefficients, started from the straight path, after at most 2,000 iterations. Where
benchmarks are disabled, the same code runs briefly at coarse resolution.
"""

import numpy as np
import pytest
from performances import basis, bodies, timed

from riemhuman.geometry.aligned_surfaces import AlignedSurfaces, ElasticMetric
from riemhuman.solvers import BasisPath

WEIGHTS = [(1.0, 1.0, 0.0), (0.0, 0.0, 1.0), (1.0, 0.1, 0.1)]
KINDS = ["pose", "pose", "build", "both"]
# What the bent elbow and the raised knee are called among the poses of the open bodies.
REQUIRED = [("t_like", "bent_elbows"), ("t_like", "leg_raised")]
FULL_ITERATIONS, BRIEF_ITERATIONS = 2000, 30


def pairs():
    """Return twenty pairs of indices of bodies with the metric's weights and a name."""
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
        chosen.append((int(start), int(end), WEIGHTS[k % 3], kind))
    return chosen


@pytest.mark.parametrize(
    ("start", "end", "weights", "kind"), pairs(), ids=lambda value: str(value).replace(" ", "")
)
def test_against_the_papers_recipe(benchmark, start, end, weights, kind):
    full = not benchmark.disabled
    resolution = "full" if full else "coarse"
    most = FULL_ITERATIONS if full else BRIEF_ITERATIONS
    points = bodies(resolution).points
    metric = ElasticMetric(AlignedSurfaces(bodies(resolution).template), *weights)
    solver = BasisPath(basis(resolution))
    options = {"ftol": 0.0, "gtol": 0.0, "maxfun": 10 * most}
    recipe = BasisPath(basis(resolution), method="l-bfgs-b", max_iterations=most, options=options)
    solver.solve(metric, points[start], points[end])  # compiles, loads, keeps what can be kept

    ours = benchmark.pedantic(
        lambda: timed(solver, metric, points[start], points[end]), rounds=1, iterations=1
    )
    theirs = timed(recipe, metric, points[start], points[end])
    report(start, end, weights, kind, ours, theirs)
    assert ours[0].converged
    assert ours[0].energy <= 1.001 * theirs[0].energy


def report(start, end, weights, kind, ours, theirs):
    """Print one line of the table."""
    (our_result, our_time), (their_result, their_time) = ours, theirs
    print(
        f"\n{start:3d} {end:3d} {kind:5} {weights!s:16} energy {our_result.energy:.5g} "
        f"in {our_result.n_iterations} iterations, {our_time:.2f} s; recipe "
        f"{their_result.energy:.5g} in {their_result.n_iterations}, {their_time:.1f} s; "
        f"energies {our_result.energy / their_result.energy:.4f}, "
        f"times 1/{their_time / our_time:.0f}"
    )
