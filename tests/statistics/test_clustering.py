"""Clusters on distances: the best there are on small sets, and obvious ones."""

from itertools import combinations

import numpy as np
import pytest

from riemhuman.errors import ArgumentError
from riemhuman.statistics import HierarchicalClustering, KMedoids


def random_distances(n_points, seed, dimension=2):
    points = np.random.default_rng(seed).standard_normal((n_points, dimension))
    return np.linalg.norm(points[:, None] - points[None], axis=-1)


def three_groups():
    """Return distances of points in three far groups, and the groups."""
    rng = np.random.default_rng(1)
    groups = np.repeat([0, 1, 2], [5, 8, 4])
    points = rng.standard_normal((17, 2)) + 30.0 * np.array([[0, 0], [1, 0], [0, 1]])[groups]
    order = rng.permutation(17)
    points, groups = points[order], groups[order]
    return np.linalg.norm(points[:, None] - points[None], axis=-1), groups


def same_partition(one, other):
    return np.array_equal(one[:, None] == one[None], other[:, None] == other[None])


@pytest.mark.parametrize("k", [1, 2, 4])
def test_medoids_are_the_best_of_all(k):
    distances = random_distances(11, seed=k)
    best = min(
        distances[:, list(chosen)].min(axis=1).sum() for chosen in combinations(range(11), k)
    )
    found = KMedoids(k, n_init=8).fit(distances)
    assert found.inertia_ == pytest.approx(best)
    assert found.inertia_ == pytest.approx(distances[:, found.medoid_indices_].min(axis=1).sum())
    assert np.all(np.diff(found.medoid_indices_) > 0)


def test_groups_are_found_and_predicted():
    distances, groups = three_groups()
    found = KMedoids(3).fit(distances)
    assert same_partition(found.labels_, groups)
    np.testing.assert_array_equal(found.predict(distances[3:6]), found.labels_[3:6])
    np.testing.assert_array_equal(KMedoids(3).fit_predict(distances), found.labels_)
    again = KMedoids(3, rng=5).fit(distances)
    np.testing.assert_array_equal(again.medoid_indices_, found.medoid_indices_)


def test_equal_points_keep_their_medoids():
    found = KMedoids(3).fit(np.zeros((5, 5)))
    assert len(np.unique(found.medoid_indices_)) == 3
    np.testing.assert_array_equal(found.labels_[found.medoid_indices_], [0, 1, 2])
    everything = KMedoids(5).fit(random_distances(5, 3))
    assert everything.inertia_ == 0
    np.testing.assert_array_equal(everything.labels_, np.arange(5))


@pytest.mark.parametrize("linkage", ["ward", "average", "complete", "single", "weighted"])
def test_hierarchy(linkage):
    distances, groups = three_groups()
    found = HierarchicalClustering(3, linkage=linkage).fit(distances)
    assert same_partition(found.labels_, groups)
    tree = found.linkage_matrix_
    nearest = distances[~np.eye(17, dtype=bool)].min()
    np.testing.assert_allclose(tree[0, 2], nearest, rtol=1e-12)
    assert np.all(np.diff(tree[:, 2]) >= 0)


def test_refusals():
    distances, _ = three_groups()
    for estimator in (KMedoids(2), HierarchicalClustering(2)):
        with pytest.raises(ArgumentError, match="symmetric.*by 1"):
            estimator.fit(distances + np.eye(17, k=1))
    with pytest.raises(ArgumentError, match="n_clusters=18 exceeds the 17 points"):
        KMedoids(18).fit(distances)
    with pytest.raises(ArgumentError, match="all fitted points"):
        KMedoids(2).fit(distances).predict(distances[:, :1])
    with pytest.raises(ArgumentError, match="17 points; at least 20"):
        HierarchicalClustering(20).fit(distances)


def test_clusters_are_numbered_in_the_order_of_their_first_points():
    points = np.random.default_rng(0).uniform(size=40)
    distances = np.abs(np.subtract.outer(points, points))
    labels = HierarchicalClustering(6).fit(distances).labels_
    numbers, first = np.unique(labels, return_index=True)
    np.testing.assert_array_equal(numbers, np.arange(6))
    assert (np.diff(first) > 0).all()
