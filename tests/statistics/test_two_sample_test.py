"""The permutation test keeps its level, sees differences, and counts as it says."""

from itertools import combinations

import numpy as np
import pytest

from riemhuman.errors import ArgumentError
from riemhuman.statistics import two_sample_test


def distances_of(points):
    return np.linalg.norm(points[:, None] - points[None], axis=-1)


def energy(distances, first):
    """Return the energy statistic by its definition, in loops."""
    ones, twos = np.flatnonzero(first), np.flatnonzero(~first)
    across = np.mean([distances[i, j] for i in ones for j in twos])
    within = [np.mean([distances[i, j] for i in group for j in group]) for group in (ones, twos)]
    return len(ones) * len(twos) / len(first) * (2 * across - sum(within))


def test_statistic_and_exact_p_value_by_definition():
    distances = distances_of(np.random.default_rng(3).standard_normal((8, 2)))
    first = np.arange(8) < 3
    found = two_sample_test(distances, first, units=None)
    statistics = []
    for chosen in combinations(range(8), 3):
        split = np.isin(np.arange(8), chosen)
        statistics.append(energy(distances, split))
    assert found.exact
    assert found.n_permutations == 56
    assert found.statistic == pytest.approx(energy(distances, first))
    np.testing.assert_allclose(np.sort(found.statistics), np.sort(statistics))
    assert found.p_value == np.mean(np.array(statistics) >= energy(distances, first) - 1e-12)


def test_random_splits_follow_the_convention():
    distances = distances_of(np.random.default_rng(4).standard_normal((20, 2)))
    first = np.arange(20) < 12
    found = two_sample_test(distances, first, n_permutations=301, rng=5, units=None)
    assert not found.exact
    assert found.n_permutations == len(found.statistics) == 301
    as_large = np.sum(found.statistics >= found.statistic)
    assert found.p_value == (as_large + 1) / 302
    assert (
        found.p_value
        == two_sample_test(distances, first, n_permutations=301, rng=5, units=None).p_value
    )
    swapped = two_sample_test(distances, ~first, n_permutations=301, units=None)
    assert swapped.statistic == pytest.approx(found.statistic)


def p_values(shift, n_tests=400, units=None):
    rng = np.random.default_rng(6)
    first = np.arange(16) % 2 == 0
    found = []
    for _ in range(n_tests):
        points = rng.standard_normal((16, 2))
        if units is not None:
            points += 3.0 * rng.standard_normal((16, 2))[units]
        points[first] += shift
        result = two_sample_test(
            distances_of(points), first, units=units, n_permutations=99, rng=rng
        )
        found.append(result.p_value)
    return np.array(found)


def test_p_values_are_uniform_where_there_is_no_difference():
    found = p_values(0.0)
    # The share below a level is within four standard errors of it.
    for level in (0.05, 0.1, 0.25, 0.5, 0.75):
        assert abs(np.mean(found <= level) - level) < 4 * np.sqrt(level * (1 - level) / 400)


def test_units_keep_the_level_where_points_depend_on_each_other():
    # Four points a unit; even points are the first group, so units must be all even or all odd.
    units = np.array([0, 4, 0, 4, 0, 4, 0, 4, 1, 5, 1, 5, 1, 5, 1, 5])
    whole = p_values(0.0, 100, units=units)
    # Two units against two: six splits, of which two by two have the same statistic.
    assert np.all(whole >= 2 / 6 - 1e-12)
    np.testing.assert_allclose(whole * 3, np.round(whole * 3), atol=1e-12)


@pytest.mark.parametrize("kind", [int, np.uint8, float, list])
def test_groups_are_booleans_or_zero_and_one(kind):
    distances = distances_of(np.random.default_rng(3).standard_normal((6, 2)))
    first = np.arange(6) < 3
    expected = two_sample_test(distances, first, units=None)
    groups = first.astype(int).tolist() if kind is list else first.astype(kind)
    assert two_sample_test(distances, groups, units=None).p_value == expected.p_value


def test_refusals():
    distances = distances_of(np.random.default_rng(3).standard_normal((6, 2)))
    first = np.arange(6) < 3
    for wrong in (first.astype(int) + 1, ["a", "a", "a", "b", "b", "b"], first + 0.5):
        with pytest.raises(ArgumentError, match="in_first must hold booleans, or 0 and 1"):
            two_sample_test(distances, wrong, units=None)
    with pytest.raises(ArgumentError, match="each group"):
        two_sample_test(distances, np.ones(6, dtype=bool), units=None)
    with pytest.raises(TypeError, match="units"):  # whether people are several points must be said
        two_sample_test(distances, first)
    with pytest.raises(ArgumentError, match="units: 1 has points in both"):
        two_sample_test(distances, first, units=[0, 1, 1, 1, 2, 2])
    mixed = two_sample_test(distances, first, units=["b", ("c",), "b", 1, 1, 2])
    assert mixed.n_permutations == 6  # two units of four
    with pytest.raises(ArgumentError, match="distances must be a square"):
        two_sample_test(distances[:5], first, units=None)
