"""Codes whose distances are nearly those of a metric."""

import numpy as np
import pytest
from scipy.spatial import cKDTree
from scipy.spatial.distance import pdist
from scipy.stats import spearmanr

from riemhuman.errors import ArgumentError, ArgumentTypeError
from riemhuman.geometry import AlignedSurfaces, ElasticMetric
from riemhuman.learned import MetricCodes
from riemhuman.learned.build_weights import N_CODES, WEIGHTS
from riemhuman.learned.evaluate import UnseenBodies
from riemhuman.retrieval import NearestNeighbors


@pytest.fixture(scope="module")
def bodies():
    return UnseenBodies("plain")


def metric_of(bodies, which):
    a, lam, c = WEIGHTS[which]
    return ElasticMetric(AlignedSurfaces(bodies.model.template), a=a, lam=lam, c=c)


@pytest.mark.parametrize(
    ("which", "error", "correlation"), [("pose", 0.1, 0.95), ("shape", 0.2, 0.5)]
)
def test_distances_of_codes_are_nearly_those_of_the_metric(bodies, which, error, correlation):
    codes = MetricCodes.load_pretrained(which=which)
    metric = metric_of(bodies, which)
    assert codes.metric_ == repr(metric)
    found = codes.transform(bodies.points)
    assert found.shape == (100, N_CODES[which])
    pairs = np.triu_indices(100, 1)
    wanted = metric.dist_pairwise(bodies.points)[pairs]
    assert np.mean(np.abs(pdist(found) - wanted) / wanted) < error
    assert spearmanr(pdist(found), wanted).statistic > correlation


def test_candidates_by_codes_and_exact_neighbours(bodies):
    codes = MetricCodes.load_pretrained(which="pose")
    points, queries = bodies.points[20:], bodies.points[:20]
    metric = metric_of(bodies, "pose")
    neighbors = NearestNeighbors(metric, n_neighbors=3).fit(points)
    expected = neighbors.kneighbors(queries)
    tree = cKDTree(codes.transform(points))
    candidates = tree.query(codes.transform(queries), 8)[1]
    found = neighbors.kneighbors(queries, candidates=candidates)
    np.testing.assert_array_equal(found, expected)
    recall = np.mean([np.isin(e, c).mean() for e, c in zip(expected[1], candidates, strict=True)])
    assert recall > 0.9


def test_needs_a_metric_to_train_on(bodies):
    with pytest.raises(ArgumentTypeError, match="metric must be a RiemannianMetric"):
        MetricCodes().fit(bodies.points)
    with pytest.raises(ArgumentError, match="which must be"):
        MetricCodes.load_pretrained()
