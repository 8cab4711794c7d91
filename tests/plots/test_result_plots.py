"""Energies and retrieval results as matplotlib pictures."""

import numpy as np
import pytest

import riemhuman as rh
from riemhuman.errors import ArgumentError
from riemhuman.plots.result_plots import plot_energy


def test_energy_is_drawn_as_it_is():
    ax = plot_energy([3.0, 2.0, 1.5], lines={"bound": 1.2})
    np.testing.assert_array_equal(ax.lines[0].get_xydata(), [[0, 3], [1, 2], [2, 1.5]])
    assert ax.lines[1].get_ydata()[0] == 1.2
    assert ax.texts[0].get_text() == "bound"
    several = plot_energy({"a": [1.0], "b": [2.0, 1.0]})
    legend = several.get_legend()
    assert [text.get_text() for text in legend.get_texts()] == ["a", "b"]
    several.figure.draw_without_rendering()
    assert not legend.get_window_extent().overlaps(several.bbox)  # it hides no line


def test_two_classes_have_no_curve_and_no_matrix():
    distances = np.abs(np.subtract.outer(np.arange(4.0), np.arange(4.0)))
    with pytest.raises(ArgumentError, match="at least 3 classes for this plot; found 2"):
        rh.plots.plot_precision_recall({"toy": distances}, ["a", "a", "b", "b"])
    with pytest.raises(ArgumentError, match="at least 3 classes for this plot; found 2"):
        rh.plots.plot_confusion(distances, [0, 0, 1, 1])
