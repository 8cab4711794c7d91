"""The ground below bodies in pictures."""

import numpy as np
import pytest
import trimesh

import riemhuman as rh
from riemhuman.plots.rendering import render
from riemhuman.plots.windows import View, Window


def test_surfaces_stand_on_a_ground_with_their_shadow():
    """Grid and shadow are below the feet, and what is above is drawn as without them."""
    bodies = rh.datasets.load_open_bodies("coarse")
    view = View(azimuth=20.0, elevation=12.0)
    settings = {"height": 300, "view": view}
    on_ground = render(bodies[1], bodies.template.faces, ground=True, **settings)
    assert on_ground.shape[1] > render(bodies[1], bodies.template.faces, **settings).shape[1]
    window = Window((0.0, 0.0), 2.6, 2.6)
    body = bodies[1] - (bodies[1].min(axis=0) + bodies[1].max(axis=0)) / 2
    pictures = [
        render(body, bodies.template.faces, window=window, ground=ground, **settings).astype(int)
        for ground in (False, True)
    ]
    bare, grounded = pictures
    is_body = bare[..., 3] == 255
    np.testing.assert_array_equal(bare[is_body], grounded[is_body])
    added = grounded[..., 3] - bare[..., 3]
    lowest_row = np.flatnonzero(is_body.any(axis=1))[-1]
    assert added[: lowest_row - 60].max() == 0
    assert (added[lowest_row - 40 :] > 10).sum() > 500
    # The shadow is darkest below the feet, where it hides the grid.
    row, column = np.unravel_index(np.where(is_body, 0, added).argmax(), added.shape)
    near = np.abs(np.argwhere(is_body) - [row, column]).max(axis=1).min()
    assert near < 12
    assert added[row, column] > 100


@pytest.mark.parametrize("view", [View(20.0, 12.0), View(-70.0, -30.0), View(0.0, 90.0)])
def test_the_ground_does_not_depend_on_the_window(view):
    """Windows that show a part of it, or nothing, show what a larger one shows there."""
    box = trimesh.creation.box((0.4, 1.6, 0.3))
    surface, faces = np.asarray(box.vertices), np.asarray(box.faces)

    def shown(centre, size):
        window = Window(centre, 0.01 * size, 0.01 * size)
        return render(surface, faces, height=size, view=view, window=window, ground=True)

    whole = shown((0.0, 0.0), 400)
    assert (whole[..., 3] > 0).any()
    # Rounding moves a few pixels into the next cell of the shadow.
    for column, row in ((0.0, 0.0), (-0.9, -0.6), (0.5, 0.1), (-1.4, 1.4)):
        part = shown((column, row), 120)
        first = np.round(100 * np.array([2.0 - row - 0.6, 2.0 + column - 0.6])).astype(int)
        expected = whole[first[0] : first[0] + 120, first[1] : first[1] + 120]
        assert (np.abs(part.astype(int) - expected) > 1).mean() < 0.005


def test_from_the_side_there_is_no_ground():
    box = trimesh.creation.box((0.4, 1.6, 0.3))
    settings = {"height": 100, "view": View(30.0, 0.0), "window": Window((0.0, 0.0), 2.0, 2.0)}
    pictures = [render(box.vertices, box.faces, ground=ground, **settings) for ground in (0, 1)]
    np.testing.assert_array_equal(*pictures)
