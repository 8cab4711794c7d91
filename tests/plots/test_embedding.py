"""Maps of distance matrices."""

import numpy as np
import pytest
from scipy.spatial.distance import pdist, squareform

from riemhuman.errors import ArgumentError, MissingDependencyError
from riemhuman.plots.embedding import embed, stress

POINTS = np.random.default_rng(0).normal(size=(12, 2))
DISTANCES = squareform(pdist(POINTS))


def test_scaling_keeps_the_distances_of_points_in_a_plane():
    found = embed(DISTANCES, "mds")
    np.testing.assert_allclose(squareform(pdist(found)), DISTANCES, atol=1e-10)
    np.testing.assert_allclose(found.mean(axis=0), 0, atol=1e-12)
    assert found[:, 0].std() > found[:, 1].std()
    assert stress(DISTANCES, found) == pytest.approx(0, abs=1e-10)
    assert stress(DISTANCES, 2 * found) == pytest.approx(1)


def test_t_sne_is_seeded_and_keeps_groups_together():
    groups = np.repeat([0, 1, 2], 10)
    noise = np.random.default_rng(1).uniform(0.1, 0.2, (30, 30))
    distances = np.where(groups[:, None] == groups, 0.1, 1.0) + noise + noise.T
    np.fill_diagonal(distances, 0.0)
    found = embed(distances)
    np.testing.assert_array_equal(found, embed(distances))
    apart = squareform(pdist(found))
    np.fill_diagonal(apart, np.inf)
    np.testing.assert_array_equal(groups[apart.argmin(axis=1)], groups)


@pytest.mark.parametrize(
    ("distances", "method", "message"),
    [
        (DISTANCES[:3], "mds", "square matrix of at least 3 items"),
        (DISTANCES[:2, :2], "mds", "square matrix of at least 3 items"),
        (np.triu(DISTANCES), "mds", "symmetric"),
        (-DISTANCES, "mds", "not negative"),
        (DISTANCES, "umap", "method must be one of 't-sne', 'mds'"),
    ],
)
def test_bad_arguments(distances, method, message):
    with pytest.raises(ArgumentError, match=message):
        embed(distances, method)


def test_without_scikit_learn(monkeypatch):
    monkeypatch.setitem(__import__("sys").modules, "sklearn.manifold", None)
    with pytest.raises(MissingDependencyError, match=r"pip install 'riemhuman\[report\]'"):
        embed(DISTANCES)
    assert embed(DISTANCES, "mds").shape == (12, 2)
