"""Two matched scans carry the same colours, which tell left from right and high from low."""

import numpy as np

from riemhuman.plots.match_plots import position_colors


def test_colours_are_those_of_places():
    x, y = np.meshgrid(np.linspace(-0.4, 0.4, 41), np.linspace(0.0, 1.8, 91), indexing="ij")
    places = np.stack([x, y, 0.1 * x], axis=-1).reshape(-1, 3)
    colors = position_colors(np.concatenate([places, places, [[np.nan] * 3]]))
    first, second = np.split(colors[:-1], 2)
    np.testing.assert_array_equal(first, second)
    assert np.ptp(colors[-1]) == 0.0  # grey
    assert colors.min() >= 0.0
    assert colors.max() <= 1.0
    left, right = places[:, 0] > 0.3, places[:, 0] < -0.3
    # Blue and orange differ for people who confuse red with green, too.
    assert np.all(first[right, 2] > first[right, 0] + 0.1)
    assert np.all(first[left, 0] > first[left, 2] + 0.1)
    middle = np.abs(places[:, 0]) < 0.01
    light = first[middle].mean(axis=1)
    assert np.corrcoef(light, places[middle, 1])[0, 1] > 0.5


def test_nothing_seen_is_grey():
    np.testing.assert_array_equal(np.ptp(position_colors(np.full((4, 3), np.nan)), axis=1), 0.0)
