"""Nearest neighbours: the same as by all distances, for fewer of them."""

from types import SimpleNamespace

import numpy as np
import pytest
from cases import KINDS, name_of, sphere_template, surfaces

from riemhuman.checks import memory
from riemhuman.errors import ArgumentError, FileError, OutOfMemoryError
from riemhuman.geometry import AlignedSurfaces, ElasticMetric, SRNFMetric
from riemhuman.retrieval import NearestNeighbors
from riemhuman.retrieval import neighbors as neighbors_module

N_GROUPS, N_IN_GROUP = 12, 10


def groups(template, rng=0, spread=0.02):
    """Return surfaces that have neighbours: groups of small changes of a few."""
    centers = surfaces(template, N_GROUPS, rng)
    noise = np.random.default_rng(rng).standard_normal((N_IN_GROUP, N_GROUPS, *centers.shape[1:]))
    return (centers + spread * template.vertices.std() * noise).reshape(-1, *centers.shape[1:])


def by_all_distances(metric, queries, points, k):
    """Return the k nearest by sorting all distances, the query itself left out of its own set."""
    distances = metric.cdist(points if queries is None else queries, points, precision="double")
    if queries is None:
        np.fill_diagonal(distances, np.inf)
    order = np.argsort(distances, axis=1, kind="stable")[:, :k]
    return np.take_along_axis(distances, order, axis=1), order


def assert_same(found, expected):
    np.testing.assert_array_equal(found[1], expected[1])
    np.testing.assert_array_equal(found[0], expected[0])


def metrics():
    space = AlignedSurfaces(sphere_template(), equip=False)
    return {
        "pose": ElasticMetric(space, 0.0, 0.0, 1.0),
        "shape": ElasticMetric(space, 1.0, 1e-4, 0.0),
        "both": ElasticMetric(space, 1.0, 0.1, 0.1),
        "srnf": SRNFMetric(space),
    }


METRICS = metrics()
POSE = METRICS["pose"]


@pytest.mark.parametrize(
    ("name", "algorithm"), [("pose", "index"), ("shape", "index"), ("both", "auto")]
)
def test_same_as_by_all_distances(name, algorithm):
    metric = METRICS[name]
    points, queries = groups(sphere_template()), groups(sphere_template(), rng=1)[:7]
    # Queries that are points of the set, some nearly.
    queries[:3] = points[:3]
    queries[1] *= 1 + 1e-12
    neighbors = NearestNeighbors(metric, 4, algorithm=algorithm).fit(points)
    assert neighbors.n_samples_fit_ == len(points)
    assert_same(neighbors.kneighbors(), by_all_distances(metric, None, points, 4))
    assert_same(neighbors.kneighbors(queries), by_all_distances(metric, queries, points, 4))
    assert_same(neighbors.kneighbors(queries, 1), by_all_distances(metric, queries, points, 1))


def test_features_on_disk_change_no_result(tmp_path, monkeypatch):
    points = groups(sphere_template())
    metric = METRICS["both"]
    expected = by_all_distances(metric, None, points, 4)
    # Room for coordinates, but not for features.
    monkeypatch.setattr(memory, "available_memory", lambda: 8.0 * 256 * len(points))
    with pytest.raises(OutOfMemoryError, match="pass a folder for their features"):
        NearestNeighbors(metric, 4, algorithm="index").fit(points)
    neighbors = NearestNeighbors(metric, 4, algorithm="index", folder=tmp_path).fit(points)
    assert_same(neighbors.kneighbors(), expected)
    assert not list(tmp_path.iterdir())
    monkeypatch.setattr(neighbors_module, "disk_usage", lambda _: SimpleNamespace(free=1000))
    with pytest.raises(FileError, match="are needed"):
        NearestNeighbors(metric, folder=tmp_path).fit(points)


@pytest.mark.parametrize("case", [case for case in KINDS if "dist" in case.can], ids=name_of)
def test_every_metric_with_a_distance(case):
    points = case.points
    neighbors = NearestNeighbors(case.metric).fit(points)
    expected = by_all_distances(case.metric, None, points, len(points) - 1)
    assert_same(neighbors.kneighbors(n_neighbors=len(points) - 1), expected)


@pytest.mark.parametrize("name", ["pose", "srnf"])
def test_duplicates_come_in_the_order_of_their_indices(name):
    metric = METRICS[name]
    points = groups(sphere_template())[:20]
    points = np.concatenate([points[:6], points[:6], points[:6], points])
    neighbors = NearestNeighbors(metric, n_neighbors=5).fit(points)
    found = neighbors.kneighbors()
    assert_same(found, by_all_distances(metric, None, points, 5))
    np.testing.assert_array_equal(found[1][7, :3], [1, 13, 19])
    np.testing.assert_array_equal(found[0][7, :3], 0.0)
    everything = neighbors.kneighbors(points[:4], n_neighbors=len(points))
    assert_same(everything, by_all_distances(metric, points[:4], points, len(points)))


def test_points_with_neighbors_are_compared_with_few():
    points = np.concatenate([groups(sphere_template(), rng) for rng in range(4)])
    neighbors = NearestNeighbors(METRICS["both"], 3, algorithm="index").fit(points)
    neighbors.kneighbors()
    assert neighbors.exact_share_ < 0.05


@pytest.mark.parametrize("name", ["pose", "shape"])
def test_bounds_are_used_where_they_save_work(name):
    """Few points, and points that bounds do not separate, are compared with all others."""
    points = np.concatenate([groups(sphere_template(), rng) for rng in range(9)])
    neighbors = NearestNeighbors(METRICS[name], 3).fit(points[:999])
    neighbors.kneighbors(points[:2])
    assert neighbors.exact_share_ == 1.0
    neighbors.fit(points)
    expected = by_all_distances(METRICS[name], points[:9], points, 3)
    assert_same(neighbors.kneighbors(points[:9]), expected)
    assert (neighbors.exact_share_ < 0.5) == (name == "pose")


def test_wrong_calls():
    points = groups(sphere_template())[:8]
    neighbors = NearestNeighbors(POSE)
    with pytest.raises(ArgumentError, match="call fit first"):
        neighbors.kneighbors(points)
    with pytest.raises(ArgumentError, match="X must hold at least one point"):
        neighbors.fit(points[:0])
    neighbors.fit(points)
    for call in (neighbors.kneighbors, neighbors.fit):
        with pytest.raises(ArgumentError, match="X"):
            call(points[0])
    for k in (0, 8, -1):
        with pytest.raises(ArgumentError, match=f"at most 7, .* found {k}"):
            neighbors.kneighbors(n_neighbors=k)
    with pytest.raises(ArgumentError, match="at most 8, .* found 9"):
        neighbors.kneighbors(points, n_neighbors=9)
    assert neighbors.kneighbors(points[:0])[0].shape == (0, 5)


@pytest.mark.parametrize("n_jobs", [None, 2])
def test_candidates_change_the_work_and_not_the_answer(n_jobs):
    points, queries = groups(sphere_template()), groups(sphere_template(), rng=1)[:7]
    expected = by_all_distances(POSE, queries, points, 4)
    neighbors = NearestNeighbors(POSE, 4, algorithm="index", n_jobs=n_jobs).fit(points)
    rng = np.random.default_rng(0)
    for candidates in (expected[1], rng.integers(len(points), size=(7, 3)), np.zeros((7, 0), int)):
        assert_same(neighbors.kneighbors(queries, candidates=candidates), expected)
    neighbors.kneighbors(queries, candidates=np.tile(np.arange(len(points)), (7, 1)))
    assert neighbors.exact_share_ == 1.0
    with pytest.raises(ArgumentError, match="candidates must hold whole numbers from 0"):
        neighbors.kneighbors(queries, candidates=np.full((7, 1), len(points)))
    with pytest.raises(ArgumentError, match="candidates must have shape"):
        neighbors.kneighbors(queries, candidates=np.zeros((6, 1), int))
    itself = np.zeros((len(points), 1), dtype=int)
    everyone = by_all_distances(POSE, None, points, 4)
    assert_same(neighbors.kneighbors(candidates=itself), everyone)


# Where blocks end, where distances nearly tie, and where bounds round.

CLOSE = surfaces(sphere_template(), 24, rng=5)
CLOSE[[3, 17, 19]] = CLOSE[[23, 16, 0]] * (1 + 1e-9)
FURTHER = surfaces(sphere_template(), 66, rng=7)
NEAR_CLOSE = np.concatenate([surfaces(sphere_template(), 4, rng=6), CLOSE[[5, 22]] * (1 + 1e-9)])


@pytest.mark.parametrize(
    ("name", "n_points", "algorithm"),
    [("shape", 24, "brute"), ("srnf", 24, "index"), ("shape", 90, "index"), ("srnf", 90, "brute")],
)
def test_blocks(name, n_points, algorithm):
    """Of 64 queries, which look at 8 points first, and at 32 at a time."""
    metric, points = METRICS[name], np.concatenate([CLOSE, FURTHER])[:n_points]
    neighbors = NearestNeighbors(metric, 4, algorithm=algorithm).fit(points)
    assert_same(neighbors.kneighbors(), by_all_distances(metric, None, points, 4))
    assert_same(neighbors.kneighbors(NEAR_CLOSE), by_all_distances(metric, NEAR_CLOSE, points, 4))
    everyone = neighbors.kneighbors(NEAR_CLOSE, n_points)
    assert_same(everyone, by_all_distances(metric, NEAR_CLOSE, points, n_points))


@pytest.mark.parametrize("name", ["shape", "srnf"])
def test_bounds_that_a_far_point_makes_inexact(name):
    space = AlignedSurfaces(sphere_template(), equip=False, scale=None)
    metric = SRNFMetric(space) if name == "srnf" else ElasticMetric(space, 1.0, 1e-4, 0.0)
    spread = 1e-4 * (surfaces(sphere_template(), 60, rng=7) - CLOSE[0])
    points = np.concatenate([CLOSE[0] + spread, 1e5 * CLOSE[1:2]])
    neighbors = NearestNeighbors(metric, 3, algorithm="index").fit(points)
    assert_same(neighbors.kneighbors(), by_all_distances(metric, None, points, 3))
