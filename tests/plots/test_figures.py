"""Figures that read in both themes."""

import xml.etree.ElementTree as ElementTree

import numpy as np
import pytest

from riemhuman.plots.figures import (
    figure_files,
    figure_style,
    new_figure,
    rgb,
    save_figure,
    scale_ends,
    value_colors,
)


def test_ink_follows_the_theme_and_labels_are_no_formulas():
    with figure_style():
        figure = new_figure(2.0, 1.5)
        ax = figure.subplots()
        ax.plot([0, 1], [1, 0], color="#4e82b4")
        for label in (r"$\frac$", "a $ b", "two\nlines", r"\alpha_1^2", "=1+1"):
            figure.text(0.5, 0.5, label)
        ax.set_yscale("log")
        svg, _ = figure_files(figure)
    ElementTree.fromstring(svg)
    head, _, body = svg.partition("</style>")
    assert "prefers-color-scheme:dark" in head
    assert "currentColor" in body
    assert "#1d2025" not in body
    assert "#4e82b4" in body
    assert "#000000" not in body


def test_values_run_from_skin_to_red_and_stop_there():
    colors = value_colors(np.array([0.0, 0.5, 1.0, 7.0]), 1.0)
    np.testing.assert_array_equal(colors[0], rgb("d4c8bb"))
    np.testing.assert_array_equal(colors[2], colors[3])
    assert (np.diff(colors[:, 1]) <= 0).all()  # ever less green
    np.testing.assert_array_equal(value_colors(np.zeros(3)), np.tile(rgb("#d4c8bb"), (3, 1)))


def test_negative_values_keep_their_sign():
    values = np.array([-7.0, -1.0, -0.5, 0.0, 0.5, 1.0])
    colors = value_colors(values, 1.0)
    np.testing.assert_array_equal(colors[0], colors[1])
    np.testing.assert_array_equal(colors[3], rgb("d4c8bb"))
    np.testing.assert_allclose(colors[3:], value_colors(values[3:], 1.0), rtol=1e-12)
    assert (colors[:3, 2] > colors[:3, 0]).all()  # blue
    assert (colors[4:, 0] > colors[4:, 2]).all()  # orange
    assert scale_ends(values, 1.0) == (-1.0, 1.0)
    assert scale_ends(values[3:], 1.0) == (0.0, 1.0)
    assert scale_ends(np.array([-1e-17, 1.0]), 1.0) == (0.0, 1.0)  # a sum that should be zero
    assert scale_ends(-np.ones(9)) == (-1.0, 1.0)
    # A part without negative values may belong to a whole that has some.
    np.testing.assert_array_equal(value_colors(np.array([-0.5]), 1.0, signed=True)[0], colors[2])


def test_names_in_scripts_that_the_font_lacks(tmp_path):
    from matplotlib import font_manager

    def characters(name):
        font = font_manager.get_font(font_manager.findfont(name))
        return {chr(code) for code in font.get_charmap()}

    elsewhere = min(filter(str.isalpha, characters("STIXGeneral") - characters("DejaVu Sans")))
    title = new_figure(3, 2).subplots().set_title(f"Zoë {elsewhere}")
    save_figure(title.figure, tmp_path / "a.pdf")
    assert len(title.get_fontfamily()) > 1
    title.set_text("\ua9c1")
    if not any("Javanese" in entry.name for entry in font_manager.fontManager.ttflist):
        with pytest.warns(UserWarning, match="no installed font has the characters \ua9c1"):
            save_figure(title.figure, tmp_path / "a.png")
    assert (tmp_path / "a.png").exists()
    # Letters are TrueType: journals refuse fonts of type 3.
    content = (tmp_path / "a.pdf").read_bytes()
    assert b"CIDFontType2" in content
    assert b"/Type3" not in content
