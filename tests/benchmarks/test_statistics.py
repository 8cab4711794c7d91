"""Principal components and metrics learned from labels on the open bodies.

pytest tests/benchmarks/test_statistics.py --benchmark-enable -s

`-k left_out` prints how well components of nine people describe the tenth, for natural bodies and,
where the variable RIEMHUMAN_FAUST names the folder of MPI FAUST, for its registrations.
"""

import os
from functools import cache
from warnings import catch_warnings, simplefilter

import numpy as np
import pytest
from performances import bodies, clocked

from riemhuman.datasets import load_faust, load_open_bodies
from riemhuman.errors import MixedPosesWarning
from riemhuman.geometry import AlignedSurfaces, ElasticMetric
from riemhuman.retrieval import scores
from riemhuman.solvers import TangentPCA
from riemhuman.solvers.path_comparison import Distortion, summarize
from riemhuman.statistics import LearnedMetric
from riemhuman.surfaces import (
    edge_lengths,
    generalized_procrustes,
    procrustes,
    triangle_areas,
)

SETS = {"ten people in one pose": slice(0, 100, 10), "ten poses of one person": slice(0, 10)}
FAUST = os.environ.get("RIEMHUMAN_FAUST")
OTHER_PEOPLE = 31  # on whom no setting was compared
each_set = pytest.mark.parametrize("name", SETS)


def equipped(a, lam, c, resolution="coarse"):
    space = AlignedSurfaces(bodies(resolution).template, equip=False)
    return space.equip_with_metric(ElasticMetric, a=a, lam=lam, c=c)


@cache
def aligned(name):
    """Return the bodies of a set, moved onto each other as Euclidean components need it."""
    return generalized_procrustes(bodies("coarse").points[SETS[name]])[0]


def euclidean(points):
    """Return mean, principal directions as rows and scores of the vertices."""
    mean = points.mean(axis=0)
    rows = (points - mean).reshape(len(points), -1)
    left, sizes, directions = np.linalg.svd(rows, full_matrices=False)
    return mean, directions, left * sizes


def changes(points, reference):
    """Return how much areas of triangles and lengths of edges differ from those of a reference."""
    template = bodies("coarse").template
    found = []
    for measure, elements in ((triangle_areas, template.faces), (edge_lengths, template.edges)):
        ratio = measure(points, elements) / measure(reference, elements)
        weights = measure(reference, elements).ravel()
        found.append(summarize(np.maximum(ratio, 1.0 / ratio).ravel() - 1.0, weights))
    return found


def row(kind, squared, areas, edges):
    def cells(change: Distortion):
        return " ".join(f"{100 * value:7.1f}" for value in (change.mean, change.quantile_99))

    return f"  {kind:9s} {squared:8.4f}   {cells(areas)}   {cells(edges)}"


@each_set
def test_components_against_euclidean_ones(benchmark, name):
    points = aligned(name)
    space = equipped(1.0, 1.0, 1.0)
    with catch_warnings():
        simplefilter("ignore", MixedPosesWarning)
        pca = benchmark.pedantic(TangentPCA(space).fit, (points,), rounds=1)
    found = pca.transform(points)
    mean, directions, flat = euclidean(points)
    print(f"\n{name}: explained {np.round(100 * pca.explained_variance_ratio_, 1)} %")
    print("  rank      d² mean   area change %     edge change %   (mean, 99 %)")
    for k in range(10):
        ours = pca.inverse_transform(found[:, :k])
        theirs = mean + (flat[:, :k] @ directions[:k]).reshape(ours.shape)
        measured = [changes(other, points) for other in (ours, theirs)]
        squared = [space.metric.squared_dist(other, points).mean() for other in (ours, theirs)]
        print(row(f"{k} ours", squared[0], *measured[0]))
        print(row("  flat", squared[1], *measured[1]))
        if k < 9:
            assert squared[0] < squared[1]
            assert measured[0][0].mean < measured[1][0].mean


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


@pytest.mark.parametrize("what", ["subject", "pose"])
def test_metric_learned_from_labels(benchmark, what):
    """Retrieval of people to whom the metric was not fitted, on the natural bodies."""
    known = load_open_bodies("full", "natural")
    labels = getattr(known, what)
    space = AlignedSurfaces(known.template, equip=False)
    a, c = (1.0, 0.0) if what == "subject" else (0.0, 1.0)
    learned = LearnedMetric(ElasticMetric(space, a=a, lam=a, c=c))
    arguments = known.points, labels, known.subject
    distances = benchmark.pedantic(learned.held_out_distances, arguments, rounds=1)
    found = scores(distances, labels)
    print(f"\n{what}: {found}")
    assert found.nn >= 98.0


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
