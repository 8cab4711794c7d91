"""Which bodies the experiments take."""

import numpy as np

from riemhuman.report._experiments import group_within, pair_across, pair_within

SUBJECT = np.repeat([0, 1, 2], 3)
POSE = np.tile([0, 1, 2], 3)
DISTANCES = np.abs(np.subtract.outer(np.arange(9.0) ** 2, np.arange(9.0) ** 2))


def test_pairs_within_a_class_by_distance():
    # Of the first person: 0-1 is 1 apart, 1-2 is 3, 0-2 is 4.
    assert [pair_within(DISTANCES, SUBJECT, POSE, s) for s in (0.0, 0.5, 1.0)] == [
        (0, 1),
        (1, 2),
        (0, 2),
    ]
    assert pair_within(DISTANCES, POSE, SUBJECT, 1.0) == (0, 6)


def test_pairs_across_classes():
    assert pair_across(DISTANCES, SUBJECT, POSE, 0.0) == (0, 4)
    assert pair_across(DISTANCES, SUBJECT, POSE, 1.0) == (0, 8)


def test_nothing_to_choose():
    alone = np.arange(9)
    assert pair_within(DISTANCES, alone, POSE, 0.5) is None
    assert pair_within(DISTANCES, 0 * alone, 0 * alone, 0.5) is None
    assert pair_across(DISTANCES, 0 * alone, POSE, 0.5) is None


def test_groups_hold_one_of_each():
    np.testing.assert_array_equal(group_within(POSE, SUBJECT, 5), [0, 3, 6])
    np.testing.assert_array_equal(group_within(POSE, SUBJECT, 2), [0, 6])
    uneven = np.array([0, 1, 1, 1, 0])
    np.testing.assert_array_equal(group_within(uneven, np.array([0, 0, 1, 1, 1]), 5), [0, 4])
