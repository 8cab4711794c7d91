"""Views and windows: what lies to the right, what above, and what is shown."""

import numpy as np
import pytest

from riemhuman.errors import ArgumentError
from riemhuman.plots.windows import View, Window, same_heights, window_around

FRONT = View(0.0, 0.0)


@pytest.mark.parametrize(
    ("view", "right", "up"),
    [
        (FRONT, [1, 0, 0], [0, 1, 0]),
        (View(90.0, 0.0), [0, 0, -1], [0, 1, 0]),
        (View(0.0, 90.0), [1, 0, 0], [0, 0, -1]),
    ],
)
def test_views_rotate_about_the_vertical_and_then_rise(view, right, up):
    np.testing.assert_allclose(view.rotate(np.array(right, float)), [1, 0, 0], atol=1e-12)
    np.testing.assert_allclose(view.rotate(np.array(up, float)), [0, 1, 0], atol=1e-12)


@pytest.mark.parametrize("size", [(1e9, 0.06), (1.0, 0.0)])
def test_pictures_of_too_many_pixels_are_refused(size):
    window = Window((0.0, 0.0), *size)
    assert Window((0.0, 0.0), 0.5, 2.0).pixels(400) == (400, 100)
    with pytest.raises(ArgumentError, match="more than 50,000,000 pixels"):
        window.pixels(400)


def test_windows_side_by_side_show_all_with_one_floor():
    lying = np.array([[0.0, 0.0, 0.0], [2.0, 0.5, 0.0]])
    standing = np.array([[4.0, 0.2, 0.0], [4.5, 1.9, 0.0]])
    windows = [window_around(points, FRONT, margin=0.1) for points in (lying, standing)]
    assert windows[0] == Window((1.0, 0.25), 2.2, 0.7)
    together = same_heights(windows)
    for alone, window in zip(windows, together, strict=True):
        assert (window.centre[0], window.width) == (alone.centre[0], alone.width)
        assert window.centre[1] - window.height / 2 == pytest.approx(-0.1)
        assert window.centre[1] + window.height / 2 == pytest.approx(2.0)
