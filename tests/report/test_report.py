"""Choices of bodies for a report, and the tasks that its labels allow."""

import numpy as np
import pytest

from riemhuman.report._report import Task, choose_pair, group_within

SUBJECT = np.repeat([0, 1, 2], 3)


POSE = np.tile([0, 1, 2], 3)


DISTANCES = np.abs(np.subtract.outer(np.arange(9.0) ** 2, np.arange(9.0) ** 2))


def test_pairs_by_what_they_share_and_their_distance():
    suits = np.equal.outer(SUBJECT, SUBJECT) & ~np.equal.outer(POSE, POSE)
    # Items i and j are |i² − j²| apart: 0 and 1 are nearest, 6 and 8 farthest within a person.
    assert choose_pair(DISTANCES, suits, 0.0) == (0, 1)
    assert choose_pair(DISTANCES, suits, 1.0) == (6, 8)
    assert choose_pair(DISTANCES, np.eye(9, dtype=bool), 0.5) is None


def test_groups_hold_one_of_each():
    np.testing.assert_array_equal(group_within(POSE, SUBJECT, 5), [0, 3, 6])
    np.testing.assert_array_equal(group_within(POSE, SUBJECT, 2), [0, 6])
    uneven = np.array([0, 1, 1, 1, 0])
    np.testing.assert_array_equal(group_within(uneven, np.array([0, 0, 1, 1, 1]), 5), [0, 4])


@pytest.mark.parametrize(
    ("labels", "is_retrieval"),
    [([0, 1, 2], False), ([0, 0, 1, 2], False), ([0, 0, 0], False), ([0, 0, 1, 1], True)],
)
def test_retrieval_needs_two_classes_of_two(labels, is_retrieval):
    task = Task("shape", "person", "", "", np.array(labels), ())
    assert task.is_retrieval == is_retrieval
