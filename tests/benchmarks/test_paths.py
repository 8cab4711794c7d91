"""Geodesics between poses of one person against the body model's own motion.

    pytest tests/benchmarks/test_paths.py --benchmark-enable -s

prints two tables, as the report does: for twenty seeded pairs of poses, searches under the SRNF
metric and under (1, 1, 0) from one start, with one basis, tolerance and number of surfaces. In the
first table the start rotates every triangle, in the second it is the straight path. Rows are means
over the pairs: energies under both metrics, the mean vertex deviation from the model's own motion,
and the mean change of triangle areas beyond the end points. A search that ends above another path
of its table continues from that path; "continued" counts on how many pairs.
"""

import warnings

import numpy as np
import pytest
from performances import basis, bodies, clocked

from riemhuman.errors import ConvergenceWarning
from riemhuman.geometry import AlignedSurfaces, ElasticMetric, SRNFMetric
from riemhuman.solvers import BasisPath, LinearPath, PoissonPath, compare_metrics, compare_paths

REQUIRED = [("t_like", "bent_elbows"), ("t_like", "leg_raised"), ("arms_up", "bent_elbows")]
TABLES = {"rotating": ("linear", "rotating"), "linear": ("linear",)}


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


def pairs_of_poses():
    """Return a subject and two poses, twenty times."""
    names, rng = bodies("full").pose_names, np.random.default_rng(1)
    pairs = []
    for k in range(20):
        subject = int(rng.integers(10))
        poses = [int(i) for i in rng.choice(10, 2, replace=False)]
        if k < len(REQUIRED):
            poses = [names.index(name) for name in REQUIRED[k]]
        pairs.append((subject, *poses))
    return pairs


def printed_means(tables):
    """Print the means over all pairs, and return the measures of each pair by name of the path."""
    measures = {}
    for rows in zip(*tables, strict=True):
        name = rows[0].name
        measures[name] = values = np.array(
            [
                (
                    row.energies["srnf"],
                    row.energies["elastic"],
                    row.mean_deviation,
                    row.area_change.mean,
                )
                for row in rows
            ]
        )
        srnf, elastic, deviation, area = values.mean(axis=0)
        n_continued = sum(len(row.starts) > 1 for row in rows)
        print(
            f"{name:>8} {srnf:7.3f}   {elastic:9.3f}  {deviation:6.1f}   {100 * area:9.1f} %   "
            f"{n_continued:9d}"
        )
    return measures


@pytest.mark.parametrize("start", TABLES)
def test_paths_against_the_models_motion(benchmark, start):
    space = AlignedSurfaces(bodies("full").template)
    metrics = {"srnf": SRNFMetric(space), "elastic": ElasticMetric(space, 1.0, 1.0, 0.0)}
    known_solvers = {
        "linear": (LinearPath(), "elastic"),
        "rotating": (PoissonPath(), "elastic"),
    }
    search = BasisPath(basis("full"))

    def tables_of_pairs():
        tables = []
        for subject, *poses in pairs_of_poses():
            expected_path = motion(subject, *poses)
            solvers = {name: known_solvers[name] for name in TABLES[start]}
            known = compare_paths(
                metrics, expected_path[0], expected_path[-1], solvers, expected_path
            )
            tables.append([*known, *compare_metrics(metrics, search, known, start, expected_path)])
        return tables

    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ConvergenceWarning)
        tables, _, _ = clocked(tables_of_pairs, benchmark=benchmark)

    print(
        f"\n{len(tables)} pairs, start: {start}, {len(search.basis)} deformations, "
        f"{search.n_nodes} surfaces, tolerance {search.tolerance:g}\n"
        "            SRNF   (1, 1, 0)      mm   areas, mean   continued"
    )
    measures = printed_means(tables)
    ratios = measures["elastic"] / measures["linear"]
    gain = 1.0 - measures["elastic"][:, 1] / measures[start][:, 1]
    print(
        f"(1, 1, 0) against the straight path: deviation {np.median(ratios[:, 2]):.2f} in the "
        f"median, {ratios[:, 2].max():.2f} at most; change of areas {np.median(ratios[:, 3]):.3f} "
        f"and {ratios[:, 3].max():.3f}; the search lowers the energy of its start by "
        f"{100 * np.median(gain):.1f} % in the median, {100 * gain.max():.1f} % at most"
    )
    for rows in tables:
        for name in metrics:
            energies = {row.name: row.energies[name] for row in rows}
            assert energies[name] <= (1 + 1e-9) * min(energies.values())
    if start == "rotating":
        assert np.all(np.median(ratios[:, 2:], axis=0) < 0.5)
        assert np.all(ratios[:, 2:] <= 1.0)
