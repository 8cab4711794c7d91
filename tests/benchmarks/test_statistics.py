"""Principal components of people who are left out, and of a thousand people.

pytest tests/benchmarks/test_statistics.py --benchmark-enable -s

`-k left_out` prints how well components of nine people describe the tenth, for natural bodies and,
where the variable RIEMHUMAN_FAUST names the folder of MPI FAUST, for its registrations.
"""

import os

import numpy as np
import pytest
from performances import bodies, clocked

from riemhuman.datasets import load_faust, load_open_bodies
from riemhuman.geometry import AlignedSurfaces, ElasticMetric
from riemhuman.solvers import TangentPCA
from riemhuman.surfaces import (
    generalized_procrustes,
    procrustes,
)

FAUST = os.environ.get("RIEMHUMAN_FAUST")
OTHER_PEOPLE = 31  # on whom no setting was compared


def equipped(a, lam, c, resolution="coarse"):
    space = AlignedSurfaces(bodies(resolution).template, equip=False)
    return space.equip_with_metric(ElasticMetric, a=a, lam=lam, c=c)


def euclidean(points):
    """Return mean, principal directions as rows and scores of the vertices."""
    mean = points.mean(axis=0)
    rows = (points - mean).reshape(len(points), -1)
    left, sizes, directions = np.linalg.svd(rows, full_matrices=False)
    return mean, directions, left * sizes


@pytest.mark.parametrize("name", ["natural", "FAUST"])
def test_components_describe_people_left_out(benchmark, name):
    """Ten people in their first pose: each described by all components of the other nine."""
    if name == "FAUST" and FAUST is None:
        pytest.skip("RIEMHUMAN_FAUST names no folder of MPI FAUST")
    if name == "FAUST":
        data = load_faust(FAUST)
    else:
        data = load_open_bodies("coarse", variant="natural", people=OTHER_PEOPLE)
    people = data.points[data.pose == data.pose.min()]
    space = AlignedSurfaces(data.template, equip=False)
    space.equip_with_metric(ElasticMetric, a=1.0, lam=1.0, c=1.0)

    def errors_of_people():
        errors = []
        for k in range(len(people)):
            known, average = generalized_procrustes(np.delete(people, k, axis=0))
            left_out = procrustes(people[k], to=average)
            pca = TangentPCA(space, n_components=len(known) - 1).fit(known)
            mean, directions, _ = euclidean(known)
            scores = directions[: len(known) - 1] @ (left_out - mean).ravel()
            described = (
                pca.inverse_transform(pca.transform(left_out[None]))[0],
                mean + (scores @ directions[: len(known) - 1]).reshape(mean.shape),
            )
            for surface in described:
                gaps = np.linalg.norm(procrustes(surface, to=left_out) - left_out, axis=1)
                errors += [1000.0 * gaps.mean(), float(space.metric.dist(surface, left_out))]
        return np.mean(np.reshape(errors, (len(people), 4)), axis=0)

    ours, our_distance, flat, flat_distance = benchmark.pedantic(errors_of_people, rounds=1)
    print(
        f"\n{name}, one of {len(people)} people left out: TangentPCA {ours:.1f} mm and "
        f"{our_distance:.3f} by the metric (1, 1, 1), components of vertices {flat:.1f} mm and "
        f"{flat_distance:.3f}"
    )
    assert our_distance < flat_distance


def test_components_of_a_thousand_people(benchmark):
    known = bodies("coarse")
    n_people = 1000
    betas = np.zeros((n_people, known.model.n_betas))
    betas[:, :8] = np.random.default_rng(5).standard_normal((n_people, 8))
    points, space = known.model(betas), equipped(1.0, 1.0, 1.0)
    TangentPCA(space, n_components=2).fit(points[:5])
    pca, _, seconds = clocked(
        lambda: TangentPCA(space, n_components=10).fit(points), benchmark=benchmark
    )
    print(
        f"\n{n_people} coarse bodies: mean and ten components in {seconds:.1f} s of the "
        f"processor; the first eight explain "
        f"{100 * pca.explained_variance_ratio_[:8].sum():.2f} %"
    )
    assert pca.explained_variance_ratio_[:8].sum() > 0.95
