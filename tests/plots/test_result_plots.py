"""Maps, energies and retrieval results as matplotlib pictures."""

import re
from importlib.resources import files

import numpy as np
import pytest

from riemhuman.errors import ArgumentError
from riemhuman.plots.maps import plot_embedding
from riemhuman.plots.result_plots import plot_confusion, plot_energy, plot_sweep

LABELS = np.repeat([0, 1, 2], 4)
POSITIONS = np.random.default_rng(0).normal(size=(12, 2)) + 8 * np.eye(3)[LABELS][:, :2]
DISTANCES = np.linalg.norm(POSITIONS[:, None] - POSITIONS, axis=-1)


def test_maps_show_every_item_in_the_colour_of_its_class():
    ax = plot_embedding(POSITIONS, LABELS, ["one", "two", "three"])
    groups = POSITIONS.reshape(3, 4, 2)  # four items a class, in order
    for group, dots in zip(groups, ax.collections, strict=True):
        np.testing.assert_array_equal(dots.get_offsets(), group)
    assert len({tuple(dots.get_facecolor()[0]) for dots in ax.collections}) == 3
    assert [text.get_text() for text in ax.get_legend().get_texts()] == ["one", "two", "three"]


def test_maps_have_a_body_for_every_class(nine_bodies):
    labels = np.unique(nine_bodies.pose, return_inverse=True)[1]
    ax = plot_embedding(
        POSITIONS[:9], labels, list("abc"), points=nine_bodies.points,
        faces=nine_bodies.template.faces,
    )  # fmt: skip
    boxes = [artist for artist in ax.artists if hasattr(artist, "offsetbox")]
    assert len(boxes) == 3
    x, y = ax.get_xlim(), ax.get_ylim()
    for box in boxes:
        assert x[0] < box.xy[0] < x[1]
        assert y[0] < box.xy[1] < y[1]
    assert [text.get_text() for text in ax.texts] == ["a", "b", "c"]


def test_energy_is_drawn_as_it_is():
    ax = plot_energy([3.0, 2.0, 1.5], lines={"bound": 1.2})
    np.testing.assert_array_equal(ax.lines[0].get_xydata(), [[0, 3], [1, 2], [2, 1.5]])
    assert ax.lines[1].get_ydata()[0] == 1.2
    assert ax.texts[0].get_text() == "bound"
    several = plot_energy({"a": [1.0], "b": [2.0, 1.0]})
    assert [text.get_text() for text in several.get_legend().get_texts()] == ["a", "b"]


def contrast(one, other):
    """Return the contrast of two colours, as the Web Content Accessibility Guidelines define it."""
    linear = [
        np.where(
            np.array(c) <= 0.04045, np.array(c) / 12.92, ((np.array(c) + 0.055) / 1.055) ** 2.4
        )
        for c in (one, other)
    ]
    low, high = sorted(float(c[:3] @ [0.2126, 0.7152, 0.0722]) for c in linear)
    return (high + 0.05) / (low + 0.05)


def test_what_is_written_in_cells_reads_on_every_shade():
    to_rgba = pytest.importorskip("matplotlib.colors").to_rgba
    ax = plot_sweep(np.linspace(0, 100, 12).reshape(3, 4), [1, 2, 3], list("abcd"))
    (image,) = ax.images
    for text in ax.texts:
        column, row = text.get_position()
        shade = image.cmap(image.norm(image.get_array()[row, column]))
        assert shade[3] == 1  # whatever the ground is
        assert contrast(to_rgba(text.get_color()), shade) >= 4.5


def test_what_is_written_on_the_page_reads_on_its_ground():
    to_rgba = pytest.importorskip("matplotlib.colors").to_rgba
    style = (files("riemhuman.report") / "web" / "page.css").read_text(encoding="utf-8")
    light, dark, printed = re.findall(r":root \{([^}]*--ground[^}]*)\}", style)
    for theme in (light, dark, printed):
        color = dict(re.findall(r"--(\w+): (#[0-9a-f]+);", theme))
        for written in ("ink", "quiet", "accent"):
            assert contrast(to_rgba(color[written]), to_rgba(color["ground"])) >= 4.5


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: plot_embedding(POSITIONS, LABELS[1:]), "labels must have shape"),
        (lambda: plot_embedding(POSITIONS[:, :1], LABELS), "positions must have shape"),
        (lambda: plot_embedding(POSITIONS, LABELS, points=POSITIONS), "must be given together"),
        (lambda: plot_sweep(np.ones((2, 2)), [1.0], ["0"]), "scores must have shape"),
        (lambda: plot_confusion(DISTANCES, LABELS[1:]), "11 labels found; .* 12 items"),
        (lambda: plot_energy([[1.0]]), "energies must have shape"),
    ],
)
def test_bad_arguments(call, message):
    with pytest.raises(ArgumentError, match=message):
        call()
