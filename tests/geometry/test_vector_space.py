"""Vector spaces with flat metrics."""

import numpy as np
import pytest

from riemhuman.errors import ArgumentError
from riemhuman.geometry import FlatMetric, VectorSpace


def test_weights_are_checked_and_kept():
    space = VectorSpace((2, 3))
    with pytest.raises(ArgumentError, match=r"weights must have shape \(2\); found \(3,\)"):
        FlatMetric(space, weights=[1.0, 2.0, 3.0])
    with pytest.raises(ArgumentError, match="must be a finite number of at least 0; found -2"):
        FlatMetric(space, weights=[1.0, -2.0])
    weights = np.ones(2)
    metric = FlatMetric(space, weights=weights)
    a, b = np.zeros((2, 3)), np.ones((2, 3))
    before = metric.squared_dist(a, b)
    weights[:] = 7.0
    assert metric.squared_dist(a, b) == before


def test_weights_of_vectors_and_of_fields_of_matrices():
    weights = [2.0, 0.5, 3.0]
    for shape in ((3,), (3, 2, 2)):
        metric = FlatMetric(VectorSpace(shape), weights=weights)
        a, b = np.random.default_rng(1).standard_normal((2, *shape))
        expected = sum(w * np.sum((a[k] - b[k]) ** 2) for k, w in enumerate(weights))
        np.testing.assert_allclose(metric.squared_dist(a, b), expected, rtol=1e-14)
        found = metric.cdist(a[None], np.stack([a, b]), precision="double")
        np.testing.assert_allclose(found, [[0.0, np.sqrt(expected)]], rtol=1e-14)
        coordinates = metric.lower_bound_coordinates(np.stack([a, b]))
        np.testing.assert_allclose(np.linalg.norm(np.subtract(*coordinates)), found[0, 1])
