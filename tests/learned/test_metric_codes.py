"""Codes fitted to the user's own bodies, whose distances are nearly those of a metric."""

import numpy as np
import pytest
from scipy.spatial import cKDTree
from scipy.spatial.distance import cdist, pdist
from scipy.stats import spearmanr
from sklearn.base import clone

import riemhuman as rh
from riemhuman.errors import ArgumentError, NotDefinedError
from riemhuman.learned import MetricCodes

# The least rank correlation of distances among bodies left out of the fit.
METRICS = {
    "shape": (lambda space: rh.ElasticMetric(space, a=1.0, lam=1e-4, c=0.0), 0.85),
    "pose": (lambda space: rh.ElasticMetric(space, a=0.0, lam=0.0, c=1.0), 0.96),
    "rotations": (rh.RotationMetric, 0.9),
}


@pytest.fixture(scope="module")
def known():
    return rh.datasets.load_open_bodies("coarse", "natural")


@pytest.mark.parametrize("name", METRICS)
def test_bodies_left_out_are_in_the_order_of_the_metric(known, name):
    """Forty of sixty bodies fit the codes, the others judge them."""
    make, least = METRICS[name]
    metric = make(rh.AlignedSurfaces(known.template))
    sixty = np.random.default_rng(0).permutation(100)[:60]
    codes = MetricCodes(metric).fit(known.points[sixty[:40]])
    others = known.points[sixty[40:]]
    wanted = metric.dist_pairwise(others)[np.triu_indices(20, 1)]
    found = pdist(codes.transform(others))
    assert spearmanr(found, wanted).statistic > least
    assert np.abs(found - wanted).mean() < 0.12 * wanted.mean()


def test_people_and_exact_neighbours_by_codes(known):
    shape = METRICS["shape"][0](rh.AlignedSurfaces(known.template))
    codes = MetricCodes(shape).fit(known.points[::2])
    queries, points = known.points[1::2], known.points[::2]
    gaps = cdist(codes.transform(queries), codes.transform(points))
    assert np.mean(known.subject[::2][gaps.argmin(axis=1)] == known.subject[1::2]) > 0.95
    neighbors = rh.NearestNeighbors(shape, n_neighbors=3).fit(points)
    candidates = cKDTree(codes.transform(points)).query(codes.transform(queries), 8)[1]
    found = neighbors.kneighbors(queries, candidates=candidates)
    np.testing.assert_array_equal(found, neighbors.kneighbors(queries))


def test_conventions_and_refusals(known):
    space = rh.AlignedSurfaces(known.template)
    codes = MetricCodes(METRICS["pose"][0](space), n_codes=50, n_components=8)
    found = codes.fit(known.points[:9]).transform(known.points[:4])
    assert found.shape == (4, 50)
    again = clone(codes).fit(known.points[:9]).transform(known.points[:4])
    np.testing.assert_array_equal(found, again)
    assert codes.transform(known.points[:0]).shape == (0, 50)
    with pytest.raises(ArgumentError, match="must be fitted first"):
        clone(codes).transform(known.points)
    with pytest.raises(ArgumentError, match="at least three bodies; found 2"):
        clone(codes).fit(known.points[:2])
    with pytest.raises(ArgumentError, match="all are the same"):
        codes.fit(known.points[[0, 0, 0]])
    np.testing.assert_array_equal(codes.transform(known.points[:4]), found)
    with pytest.raises(NotDefinedError, match="SobolevMetric does not define lower_bound"):
        MetricCodes(rh.SobolevMetric(space)).fit(known.points)
