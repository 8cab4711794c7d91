"""Nearest neighbours of 10,000 bodies: how few pairs are compared, and what that saves.

    pytest tests/benchmarks/test_neighbors.py --benchmark-enable -s

prints, for the metrics of poses and of shapes and for sets of growing size, the share of the pairs
that are compared, the processor time to index and to search, and that of all distances in single
precision, measured on some of them. Neighbours of some queries are checked against all distances
in double precision.
"""

import time

import numpy as np
import pytest
from people_in_motion import PeopleInMotion
from performances import clocked, growth

from riemhuman.geometry import AlignedSurfaces, ElasticMetric
from riemhuman.retrieval import NearestNeighbors

METRICS = {"pose": (0.0, 0.0, 1.0), "shape": (1.0, 1e-4, 0.0)}
# The 200 people of the largest set are all far from each other under the metric of shapes.
N_COMPONENTS = {"pose": 128, "shape": 512}


def seconds_of_all_pairs(metric, points, n_queries=64):
    """Return the time of all distances in single precision, most of it extrapolated."""
    begin = time.process_time()
    features = metric.features(points, "single")
    made = time.process_time()
    metric.bulk.squared_distances(tuple(array[:n_queries] for array in features), features)
    compared = time.process_time()
    return made - begin + (compared - made) * len(points) / n_queries / 2


@pytest.mark.parametrize("name", METRICS)
def test_neighbors_of_people_in_motion(benchmark, name):
    sizes = [1_250, 2_500, 5_000, 10_000]
    bodies = PeopleInMotion(sizes[-1])
    metric = ElasticMetric(AlignedSurfaces(bodies.model.template), *METRICS[name])
    NearestNeighbors(metric).fit(bodies[:20]).kneighbors()  # compiles
    points = bodies[:]
    compared = []
    for n_bodies in sizes:
        neighbors = NearestNeighbors(metric, n_components=N_COMPONENTS[name])
        *_, fit_seconds = clocked(
            lambda: neighbors.fit(points[:n_bodies]),  # noqa: B023
            benchmark=benchmark,
        )
        (distances, indices), _, seconds = clocked(neighbors.kneighbors)
        compared.append(neighbors.exact_share_ * n_bodies)
        all_pairs = seconds_of_all_pairs(metric, points[:n_bodies])
        print(
            f"\n{name}, 5 neighbours of each of {n_bodies} coarse bodies: "
            f"{100 * neighbors.exact_share_:.2f} % of pairs compared, {compared[-1]:.0f} a query; "
            f"{fit_seconds:.1f} s to index, {seconds:.1f} s to search; all pairs "
            f"{all_pairs:.0f} s, {all_pairs / (fit_seconds + seconds):.1f} times as long",
            end="",
        )
    queries = np.random.default_rng(0).choice(len(points), 24, replace=False)
    exact = metric.cdist(points[queries], points, precision="double", memory=2**31)
    exact[np.arange(len(queries)), queries] = np.inf
    order = np.argsort(exact, axis=1, kind="stable")[:, :5]
    np.testing.assert_array_equal(indices[queries], order)
    np.testing.assert_array_equal(distances[queries], np.take_along_axis(exact, order, axis=1))
    print(f"\nidentical to all distances in double precision for {len(queries)} queries")
    print(f"pairs compared a query grow as n^{growth(sizes, compared):.2f}")
    assert growth(sizes, compared) < 1
