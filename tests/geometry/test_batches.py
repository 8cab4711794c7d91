"""What a method says of several points is what it says of each, over the whole registry."""

import numpy as np
import pytest
from cases import CASES, name_of, surface_cases

every_case = pytest.mark.parametrize("case", CASES.values(), ids=name_of)


def check(found, one_by_one):
    expected = np.array(list(one_by_one))
    assert found.shape == expected.shape
    np.testing.assert_allclose(found, expected, rtol=1e-9, atol=1e-11 * np.abs(expected).max())


def calls(case):
    """Return methods with points and tangent vectors, four of each."""
    metric, x, v = case.metric, case.points, case.tangent_vecs
    found = [
        (metric.inner_product, (v, v[::-1], x)),
        (metric.squared_norm, (v, x)),
        (metric.norm, (v, x)),
        (metric.covector, (v, x)),
    ]
    if "dist" in case.can:
        found += [(metric.squared_dist, (x, x[::-1])), (metric.dist, (x, x[::-1]))]
    if "exp" in case.can:
        found += [(metric.exp, (0.1 * v, x)), (metric.log, (x, x[::-1]))]
    if metric.has_target_metric:
        found += [(metric.map, (x,)), (metric.differential, (v, x))]
    if metric.has_lower_bound_coordinates:
        found.append((metric.lower_bound_coordinates, (x,)))
    return found


@pytest.mark.sampled(3)
@every_case
def test_several_points(case):
    for method, arrays in calls(case):
        check(method(*arrays), (method(*items) for items in zip(*arrays, strict=True)))
        grid = method(*(np.stack([array, array]) for array in arrays))
        check(grid[1], (method(*items) for items in zip(*arrays, strict=True)))


@every_case
def test_one_base_point_for_several_vectors_and_the_reverse(case):
    metric, x, v = case.metric, case.points, case.tangent_vecs
    at_one = np.stack([case.space.to_tangent(vector, x[0]) for vector in v])
    check(metric.covector(at_one, x[0]), (metric.covector(vector, x[0]) for vector in at_one))
    if case in surface_cases():
        # Any deformation is tangent everywhere.
        check(metric.covector(v[0], x), (metric.covector(v[0], point) for point in x))
        check(metric.inner_product(v[0], v, x[0]), (metric.inner_product(v[0], w, x[0]) for w in v))


@every_case
def test_several_paths(case):
    metric, paths = case.metric, np.stack([case.points, case.points[::-1]])
    check(metric.energy(paths), (metric.energy(path) for path in paths))
    check(metric.length(paths), (metric.length(path) for path in paths))


@every_case
def test_averages_over_base_points(case):
    metric, x, v = case.metric, case.points[:2], case.tangent_vecs[:2]
    v = np.stack([case.space.to_tangent(vector, x[0]) for vector in v])
    grams = [metric.gram_matrix(v, point) for point in x]
    check(metric.gram_matrix(v, x), np.mean(grams, axis=0))
    if metric.has_metric_matrix:
        matrices = [metric.metric_matrix(point).toarray() for point in x]
        check(metric.metric_matrix(x).toarray(), np.mean(matrices, axis=0))
