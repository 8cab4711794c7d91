"""Tables of distances are the same wherever they are cut: blocks are shrunk, all cuts crossed."""

import numpy as np
import pytest
from cases import sphere_template, surfaces

from riemhuman.geometry import AlignedSurfaces, ElasticMetric, SRNFMetric, pairwise
from riemhuman.kernels import threads

TEMPLATE = sphere_template()
SPACE = AlignedSurfaces(TEMPLATE, equip=False)
METRICS = {
    "shape": ElasticMetric(SPACE, 1.0, 1e-4, 0.0),
    "pose": ElasticMetric(SPACE, 0.0, 0.0, 1.0),
    "both": ElasticMetric(SPACE, 1.0, 0.1, 0.1),
    "srnf": SRNFMetric(SPACE),
}
N_POINTS = 21
POINTS = surfaces(TEMPLATE, N_POINTS, rng=1)
# Pairs too close for single precision, near each other and far apart.
for one, other in ((0, 20), (3, 4), (7, 19), (8, 19), (11, 2), (13, 12)):
    POINTS[one] = POINTS[other] * (1 + 1e-9 * (one + 1))
OTHERS = np.concatenate([surfaces(TEMPLATE, 9, rng=2), POINTS[[5, 0, 16]] * (1 + 1e-9)])


@pytest.fixture(scope="module", params=METRICS)
def known(request):
    """Return a metric with its distances, one pair at a time, in double precision."""
    metric = METRICS[request.param]
    within = np.array([[metric.dist(a, b) if a is not b else 0.0 for b in POINTS] for a in POINTS])
    between = np.array([[metric.dist(a, b) for b in OTHERS] for a in POINTS])
    return metric, within, between


def assert_right(metric, within, between, **options):
    for precision, tolerance in (("single", 2e-5), ("double", 1e-7)):
        found = metric.dist_pairwise(POINTS, precision=precision, **options)
        np.testing.assert_allclose(found, within, rtol=tolerance, atol=1e-15)
        np.testing.assert_array_equal(found, metric.dist_pairwise(POINTS, precision=precision))
        found = metric.cdist(POINTS, OTHERS, precision=precision, **options)
        np.testing.assert_allclose(found, between, rtol=tolerance, atol=1e-15)
        found = metric.cdist(OTHERS, POINTS, precision=precision, **options)
        np.testing.assert_allclose(found.T, between, rtol=tolerance, atol=1e-15)


@pytest.mark.sampled(5)
@pytest.mark.parametrize("block", [2, 5, 20])
def test_blocks_of_rows_and_columns(known, block, monkeypatch):
    monkeypatch.setattr(pairwise, "_BLOCK", block)
    assert_right(*known)
    assert_right(*known, memory=1)
    assert_right(*known, memory=80_000)


@pytest.mark.parametrize("metric", METRICS.values(), ids=METRICS)
@pytest.mark.parametrize("n_jobs", [1, 2])
def test_more_tiles_than_rows(metric, n_jobs, monkeypatch):
    """Tiles of compiled loops are as small as they get, and there are dozens of them."""
    points = surfaces(TEMPLATE, 83, rng=3)
    expected = metric.dist_pairwise(points, precision="double")
    monkeypatch.setattr(threads, "_TILE_WORK", 1)
    for precision, tolerance in (("single", 2e-5), ("double", 0)):
        found = metric.dist_pairwise(points, n_jobs, precision=precision)
        np.testing.assert_allclose(found, expected, rtol=tolerance)
        between = metric.cdist(points[:70], points[3:], n_jobs, precision=precision)
        np.testing.assert_allclose(between, expected[:70, 3:], rtol=tolerance)
