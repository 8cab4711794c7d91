"""Neighbours are exact where blocks end, where distances nearly tie, and where bounds round."""

import numpy as np
import pytest
from cases import sphere_template, surfaces
from retrieval.test_neighbors import METRICS, assert_same, by_all_distances

from riemhuman.geometry import AlignedSurfaces, ElasticMetric, SRNFMetric
from riemhuman.retrieval import NearestNeighbors, neighbor_index, neighbor_search
from riemhuman.terms.sum import SumOfTerms

POINTS = surfaces(sphere_template(), 40, rng=5)
POINTS[[3, 17, 29]] = POINTS[[39, 16, 0]] * (1 + 1e-9)
QUERIES = np.concatenate([surfaces(sphere_template(), 6, rng=6), POINTS[[5, 38]] * (1 + 1e-9)])


@pytest.mark.parametrize("metric", METRICS.values(), ids=METRICS)
@pytest.mark.parametrize("size", [1, 3, 7])
def test_blocks(metric, size, monkeypatch):
    for name in ("_BLOCK", "_FIRST", "_BATCH", "_DOUBLE"):
        monkeypatch.setattr(neighbor_search, name, size)
    monkeypatch.setattr(neighbor_index, "_BLOCK", size)
    neighbors = NearestNeighbors(metric, n_neighbors=4, n_pivots=3).fit(POINTS[:30])
    neighbors.partial_fit(POINTS[30:])
    assert_same(neighbors.kneighbors(), by_all_distances(metric, None, POINTS, 4))
    assert_same(neighbors.kneighbors(QUERIES), by_all_distances(metric, QUERIES, POINTS, 4))
    everyone = neighbors.kneighbors(QUERIES, len(POINTS))
    assert_same(everyone, by_all_distances(metric, QUERIES, POINTS, len(POINTS)))


@pytest.mark.parametrize("metric", METRICS.values(), ids=METRICS)
def test_distances_that_nearly_tie(metric):
    """More than a batch of points whose distances single precision does not tell apart."""
    base, direction = POINTS[0], POINTS[1] - POINTS[0]
    steps = 0.2 + 1e-8 * np.random.default_rng(0).permutation(50)
    points = np.concatenate([base + steps[:, None, None] * direction, POINTS])
    neighbors = NearestNeighbors(metric, n_neighbors=5).fit(points)
    queries = np.stack([base, base + 1e-3 * direction])
    assert_same(neighbors.kneighbors(queries), by_all_distances(metric, queries, points, 5))


@pytest.mark.parametrize("name", ["shape", "srnf"])
def test_bounds_that_a_far_point_makes_inexact(name):
    space = AlignedSurfaces(sphere_template(), equip=False, scale=None)
    metric = SRNFMetric(space) if name == "srnf" else ElasticMetric(space, 1.0, 1e-4, 0.0)
    spread = 1e-4 * (surfaces(sphere_template(), 60, rng=7) - POINTS[0])
    points = np.concatenate([POINTS[0] + spread, 1e5 * POINTS[1:2]])
    neighbors = NearestNeighbors(metric, n_neighbors=3).fit(points)
    assert_same(neighbors.kneighbors(), by_all_distances(metric, None, points, 3))


class Blurred(ElasticMetric):
    """A metric whose distances in single precision are off by half of what is allowed for."""

    @property
    def bulk(self):
        return BlurredSum(self.terms, self.space.template)


class BlurredSum(SumOfTerms):
    def squared_distances(self, a, b, n_threads=1):
        """Return squared distances, off by up to 1e-4 of them, as distances by 5e-5."""
        squared = super().squared_distances(a, b, n_threads)
        if a[0].dtype != np.float32:
            return squared
        return squared * (1 + 1e-4 * np.sin(1e9 * squared))


def test_distances_that_are_as_inexact_as_is_allowed_for():
    space = AlignedSurfaces(sphere_template(), equip=False)
    base, direction = POINTS[0], POINTS[1] - POINTS[0]
    steps = 0.2 + 1e-6 * np.random.default_rng(0).permutation(50)
    points = np.concatenate([base + steps[:, None, None] * direction, POINTS])
    neighbors = NearestNeighbors(Blurred(space, 1.0, 0.5, 0.0), n_neighbors=5).fit(points)
    found = neighbors.kneighbors(base[None])
    assert_same(found, by_all_distances(ElasticMetric(space, 1.0, 0.5, 0.0), base[None], points, 5))
