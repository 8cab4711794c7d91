"""Geodesics between poses of one person against the body model's own motion.

    pytest tests/benchmarks/test_paths.py --benchmark-enable -s

prints, for twenty seeded pairs of poses, the mean vertex deviation from the model's own motion and
the change of triangle areas beyond the end points, of the straight path, of the same basis under
the SRNF metric and of ours with (1, 1, 0).
"""

from types import SimpleNamespace

import numpy as np
from performances import basis, bodies, timed

from riemhuman.geometry import AlignedSurfaces, ElasticMetric, SRNFMetric
from riemhuman.solvers import BasisPath, LinearPath, compare_paths

REQUIRED = [("t_like", "bent_elbows"), ("t_like", "leg_raised"), ("arms_up", "bent_elbows")]


def motion(subject, pose, other_pose):
    """Return the motion of the model between two performances, joint angles linear in time."""
    performances = bodies("full")
    start, end = 10 * subject + pose, 10 * subject + other_pose
    t = np.linspace(0, 1, 11)[:, None]
    turns, places = performances.pose_vectors, performances.translations
    return performances.model(
        betas=performances.betas[start],
        pose=(1 - t[..., None]) * turns[start] + t[..., None] * turns[end],
        trans=(1 - t) * places[start] + t * places[end],
    )


def test_paths_against_the_models_motion(benchmark):
    space = AlignedSurfaces(bodies("full").template)
    metrics = {"elastic": ElasticMetric(space, 1.0, 1.0, 0.0), "srnf": SRNFMetric(space)}
    solvers = {
        "linear": (LinearPath(), "elastic"),
        "srnf": (BasisPath(basis("full"), tolerance=1e-3, initial=LinearPath()), "srnf"),
        "ours": (BasisPath(basis("full")), "elastic"),
    }
    names = bodies("full").pose_names
    rng = np.random.default_rng(1)
    rows = []
    for k in range(20):
        subject = int(rng.integers(10))
        pose, other_pose = (int(i) for i in rng.choice(10, 2, replace=False))
        if k < len(REQUIRED):
            pose, other_pose = (names.index(name) for name in REQUIRED[k])
        own = motion(subject, pose, other_pose)
        row = {}
        for name, (solver, metric) in solvers.items():
            result, seconds = timed(solver, metrics[metric], own[0], own[-1], benchmark=benchmark)
            known = SimpleNamespace(solve=lambda *_, found=result: found)
            (path,) = compare_paths(metrics, own[0], own[-1], {name: (known, metric)}, own)
            row[name] = (path.mean_deviation, path.area_change.mean)
        rows.append(list(row.values()))
        line = "; ".join(f"{name} {mm:5.1f} mm {area:6.3f}" for name, (mm, area) in row.items())
        print(f"\n{names[pose]:>13} {names[other_pose]:13} {line}; {seconds:.2f} s", end="")

    rows = np.array(rows)
    ratios = rows[:, 2] / rows[:, 0]
    medians = np.median(ratios, axis=0)
    print(
        f"\nours against linear: deviation {medians[0]:.2f} in the median, "
        f"{ratios[:, 0].max():.2f} at most; change of areas {medians[1]:.3f} and "
        f"{ratios[:, 1].max():.3f}"
    )
    assert np.all(medians < 0.5)
    assert np.all(ratios <= 1.0)
