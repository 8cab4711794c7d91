"""What a method does with a stack is what it does with each: every override of every metric."""

import numpy as np
import pytest
from cases import KINDS, name_of

from riemhuman.errors import ArgumentError

every_case = pytest.mark.parametrize("case", KINDS, ids=name_of)

VECTOR_AND_POINT = ("covector", "squared_norm", "norm", "normalize", "differential")
TWO_POINTS = ("squared_dist", "dist")
PATHS = ("energy", "length")


def calls(case):
    """Return the calls by name that a metric answers, each of arrays with as many points."""
    metric, points = case.metric, case.points
    vectors, others = case.tangent_vecs, np.roll(case.tangent_vecs, 1, axis=0)
    others = case.space.to_tangent(others, points)
    ends = np.roll(points, 1, axis=0)
    found = dict.fromkeys(VECTOR_AND_POINT, (vectors, points))
    found["inner_product"] = (vectors, others, points)
    if metric.has_closed_form_dist:
        found |= dict.fromkeys(TWO_POINTS, (points, ends))
    if "exp" in case.can:
        found |= {"exp": (0.1 * vectors, points), "log": (ends, points)}
        found["parallel_transport"] = (others, points, 0.1 * vectors)
    if not metric.has_target_metric:
        found.pop("differential")
    return found


@pytest.mark.everyday(
    "ebin 0.05 sphere",
    "flat",
    "pose triangle",
    "gauge-invariant srnf open",
    "half-plane, inner product",
)
@every_case
def test_stacks_are_those_of_each(case):
    for name, arrays in calls(case).items():
        method = getattr(case.metric, name)
        one_by_one = np.array([method(*row) for row in zip(*arrays, strict=True)])
        scale = np.abs(one_by_one[np.isfinite(one_by_one)]).max(initial=1e-300)
        # Two leading axes, and a single point or vector with a stack of others.
        shaped = [np.reshape(array, (2, 2, *array.shape[1:])) for array in arrays]
        expected = one_by_one.reshape(2, 2, *one_by_one.shape[1:])
        found = method(*shaped)
        np.testing.assert_allclose(found, expected, rtol=0, atol=1e-9 * scale, err_msg=name)
        mixed = (*arrays[:-1], arrays[-1][0])
        repeated = [np.broadcast_to(array, arrays[0].shape) for array in mixed]
        if name in (*VECTOR_AND_POINT, "inner_product"):
            alone = np.array([method(*row) for row in zip(*repeated, strict=True)])
            np.testing.assert_allclose(
                method(*mixed), alone, rtol=0, atol=1e-9 * scale, err_msg=name
            )


@every_case
def test_empty_stacks_have_empty_results(case):
    for name, arrays in calls(case).items():
        method = getattr(case.metric, name)
        found = method(*(array[:0] for array in arrays))
        assert np.shape(found) == (0, *np.shape(method(*(array[0] for array in arrays)))), name
    none = case.points[:0]
    assert case.metric.dist_pairwise(none).shape == (0, 0)
    assert case.metric.gram_matrix(case.tangent_vecs[:0], case.points[0]).shape == (0, 0)
    assert np.shape(case.metric.energy(np.stack([none, none], axis=1))) == (0,)
    if case.metric.has_target_metric:
        assert case.metric.map(none).shape == (0, *case.metric.target_metric.space.shape)
    if case.metric.has_lower_bound_coordinates:
        assert len(case.metric.lower_bound_coordinates(none)) == 0
    with pytest.raises(ArgumentError, match="base_point must hold at least one"):
        case.metric.gram_matrix(case.tangent_vecs, none)


@every_case
def test_paths_in_a_stack_are_those_of_each(case):
    paths = np.stack([case.points, case.points[::-1]])
    for name in PATHS:
        method = getattr(case.metric, name)
        np.testing.assert_allclose(method(paths), [method(path) for path in paths], rtol=1e-9)
