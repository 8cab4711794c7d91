"""Every public object shows itself in a line: the call that constructs it."""

import numpy as np

import riemhuman as rh
from riemhuman.representation import constructor_text, join_names


class Recipe:
    def __init__(self, amount, name=None, how=None, secret=3):
        self.amount, self.name, self._how = amount, name, how


def test_calls_are_shown_without_what_is_as_by_default():
    assert constructor_text(Recipe(2.0)) == "Recipe(amount=2.0)"
    assert constructor_text(Recipe(np.zeros(2), "soup", len)) == (
        "Recipe(amount=array([0., 0.]), name='soup', how=len)"
    )
    assert constructor_text(Recipe(1, "soup"), leave_out=("amount",)) == "Recipe(name='soup')"


def test_long_values_are_cut():
    assert constructor_text(Recipe("x" * 1000)) == f"Recipe(amount='{'x' * 76}...)"
    assert "\n" not in constructor_text(Recipe(np.zeros((9, 9))))


def test_a_descriptor_of_ones_own_shows_itself():
    class Height(rh.descriptors.Descriptor):
        def __init__(self, axis=1):
            self.axis = axis

        def describe(self, vertices, faces):
            return np.ptp(vertices[:, self.axis], axis=0)

    assert repr(Height()) == "Height(axis=1)"


def test_a_list_of_names_stays_short_however_many_and_long_they_are():
    assert join_names(["a" * 100, "b", "c"], 2) == "a" * 77 + "..., b and 1 more"
    assert join_names(["a", "b"], 2) == "a, b"
