"""Bodies and film strips as matplotlib pictures."""

import subprocess
import sys

import numpy as np
import pytest
from cases import sphere_template, surfaces

from riemhuman.errors import ArgumentError
from riemhuman.plots._colors import colour_limit
from riemhuman.plots.body_plots import plot_body, plot_path

TEMPLATE = sphere_template()
PATH = surfaces(TEMPLATE, 5, size=0.1)


def test_a_body_fills_its_axes():
    ax = plot_body(TEMPLATE.vertices, TEMPLATE.faces, height=100)
    (image,) = ax.images
    picture = image.get_array()
    assert picture.shape[0] == 100
    assert picture.shape[2] == 4
    left, right, low, high = image.get_extent()
    # In metres: as high as the sphere, which is seen a little from above, with its margins.
    assert (high - low) == pytest.approx(1.86, abs=0.03)
    assert (right - left) / (high - low) == pytest.approx(picture.shape[1] / 100, abs=0.01)


def test_values_colour_triangles_and_have_a_scale():
    values = np.zeros(TEMPLATE.n_faces)
    values[TEMPLATE.vertices[TEMPLATE.faces].mean(axis=1)[:, 1] > 0] = 1.0
    ax = plot_body(TEMPLATE.vertices, TEMPLATE.faces, values, label="per area", height=80)
    picture = ax.images[0].get_array()
    top, bottom = picture[20, picture.shape[1] // 2], picture[60, picture.shape[1] // 2]
    assert int(top[0]) - int(top[2]) > 40 + int(bottom[0]) - int(bottom[2])  # redder
    bar = ax.figure.axes[1]
    assert bar.get_ylabel() == "per area"
    assert bar.get_ylim() == (0.0, 1.0)


def test_a_strip_shows_bodies_in_order_without_overlap():
    ax = plot_path(PATH, TEMPLATE.faces, n_shown=3, height=60)
    extents = np.array([image.get_extent() for image in ax.images])
    assert len(extents) == 3
    assert (extents[1:, 0] >= extents[:-1, 1] - 1e-9).all()
    ends = [image.get_array() for image in ax.images]
    all_of_them = [image.get_array() for image in plot_path(PATH, TEMPLATE.faces, height=60).images]
    np.testing.assert_array_equal(ends[0], all_of_them[0])
    np.testing.assert_array_equal(ends[1], all_of_them[2])
    np.testing.assert_array_equal(ends[2], all_of_them[4])


def test_a_strip_may_be_spaced_and_coloured():
    colors = np.eye(3)[[0, 1, 2, 0, 1]]
    ax = plot_path(PATH, TEMPLATE.faces, spacing=0.5, colors=colors, height=40)
    extents = np.array([image.get_extent() for image in ax.images])
    np.testing.assert_allclose(np.diff(extents[:, :2].mean(axis=1)), 0.5)
    for image, color in zip(ax.images, colors, strict=True):
        picture = image.get_array()
        seen = picture[picture[..., 3] == 255][:, :3].mean(axis=0)
        assert seen.argmax() == color.argmax()


def test_one_triangle_does_not_rule_the_scale():
    values = np.ones(1000)
    values[0] = 1e6
    assert colour_limit(values) == 1.0
    assert colour_limit(np.zeros(5)) == 0.0
    assert colour_limit(np.array([0.0] * 999 + [2.0])) == 2.0


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: plot_body(PATH[0], TEMPLATE.faces, [1.0]), r"values must have shape \(80\)"),
        (lambda: plot_path(PATH[0], TEMPLATE.faces), "path must have shape"),
        (lambda: plot_path(PATH, TEMPLATE.faces, n_shown=1), "n_shown"),
        (lambda: plot_path(PATH, TEMPLATE.faces, spacing=0), "spacing"),
        (lambda: plot_path(PATH, TEMPLATE.faces, colors=np.full((5, 3), 2)), "between 0 and 1"),
        (lambda: plot_path(PATH, TEMPLATE.faces, np.ones((5, 3))), "values must have shape"),
    ],
)
def test_bad_arguments(call, message):
    with pytest.raises(ArgumentError, match=message):
        call()


def test_the_room_loads_without_matplotlib_or_display():
    code = "import sys, riemhuman.plots; print('matplotlib' in sys.modules)"
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True, env={"PATH": ""}
    )
    assert done.stdout == "False\n"
