"""The tree of joints, for trees whose numbering follows nothing."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from riemhuman.bodies.skinning import joint_parents, parents_first
from riemhuman.errors import ArgumentError


@st.composite
def trees(draw):
    """Return the parents of a random tree whose joints are shuffled."""
    n_joints = draw(st.integers(1, 12))
    parents = [-1] + [draw(st.integers(0, joint - 1)) for joint in range(1, n_joints)]
    order = np.array(draw(st.permutations(range(n_joints))))
    shuffled = np.empty(n_joints, dtype=np.int64)
    shuffled[order] = [order[parent] if parent >= 0 else -1 for parent in parents]
    return shuffled


@given(trees())
def test_parents_come_before_children(parents):
    order = parents_first(parents)
    assert sorted(order) == list(range(len(parents)))
    place = {joint: number for number, joint in enumerate(order)}
    assert all(place[parent] < place[joint] for joint, parent in enumerate(parents) if parent >= 0)


@given(trees(), st.sampled_from([-1, 2**32 - 1]), st.integers(0, 100))
def test_tables_in_any_numbering(parents, root, shift):
    numbers = shift + 3 * np.arange(len(parents))
    table = [[numbers[parent] if parent >= 0 else root for parent in parents], numbers]
    np.testing.assert_array_equal(joint_parents(table, len(parents)), parents)


def test_cycles_are_named():
    with pytest.raises(ArgumentError, match=r"has a cycle: joints \[1, 3\] never reach the root"):
        parents_first(np.array([-1, 3, 0, 1]))
