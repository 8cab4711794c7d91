"""Colours of classes and values."""

import numpy as np
import pytest

from riemhuman.plots.colors import class_colors, rgb, value_colors


@pytest.mark.parametrize("n_classes", [2, 10, 25])
def test_classes_are_told_apart_on_either_ground(n_classes):
    colors = class_colors(n_classes)
    assert len(np.unique(colors, axis=0)) == n_classes
    light = colors @ [0.2126, 0.7152, 0.0722]
    assert (light > 0.2).all()
    assert (light < 0.75).all()


def test_values_run_from_skin_to_red_and_stop_there():
    colors = value_colors(np.array([0.0, 0.5, 1.0, 7.0]), 1.0)
    np.testing.assert_array_equal(colors[0], rgb("d4c8bb"))
    np.testing.assert_array_equal(colors[2], colors[3])
    assert (np.diff(colors[:, 1]) <= 0).all()  # ever less green
    np.testing.assert_array_equal(value_colors(np.zeros(3)), np.tile(rgb("#d4c8bb"), (3, 1)))
