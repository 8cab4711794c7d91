"""Figures that read in both themes."""

import io
import xml.etree.ElementTree as ElementTree

import pytest
from matplotlib.image import imread

from riemhuman.plots.figures import drawn, figure_style, new_figure


def small_figure():
    """Return a small figure, with text and a line."""
    with figure_style():
        figure = new_figure(2.0, 1.5)
        ax = figure.subplots()
        ax.plot([0, 1], [1, 0], color="#4e82b4")
        ax.set_title("Title")
        return drawn(figure)


@pytest.mark.parametrize("label", [r"$\frac$", "a $ b", "two\nlines", r"\alpha_1^2", "=1+1"])
def test_labels_are_no_formulas(label):
    with figure_style():
        figure = new_figure(2.0, 1.5)
        ax = figure.subplots()
        ax.set_title(label)
        ax.set_yscale("log")
        svg, _ = drawn(figure)
    ElementTree.fromstring(svg)


def test_ink_follows_the_theme():
    svg, _ = small_figure()
    ElementTree.fromstring(svg)
    head, _, body = svg.partition("</style>")
    assert "prefers-color-scheme:dark" in head
    assert "currentColor" in body
    assert "#1d2025" not in body
    assert "#4e82b4" in body
    assert "#000000" not in body


def test_nothing_lies_behind_the_drawing():
    svg, png = small_figure()
    assert "fill: #ffffff" not in svg
    pixels = imread(io.BytesIO(png))
    assert pixels.shape[:2] == (225, 300)
    assert pixels[0, 0].tolist() == [1, 1, 1, 1]


def test_the_same_figure_is_the_same_file():
    assert small_figure() == small_figure()


def test_the_style_of_the_session_is_left_alone():
    import matplotlib

    before = dict(matplotlib.rcParams)
    with figure_style():
        assert matplotlib.rcParams["text.color"] != before["text.color"]
    assert dict(matplotlib.rcParams) == before
