"""Pictures of surfaces: what is covered, what is in front, and which way is left."""

import base64
import io
import re

import numpy as np
import pytest
import trimesh
from cases import sphere_template
from PIL import Image

from riemhuman.errors import ArgumentError
from riemhuman.plots.rendering import render, surfaces_html
from riemhuman.plots.windows import View, Window

FRONT = View(0.0, 0.0)
TRIANGLE = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])


def test_a_sphere_covers_a_disk():
    ball = trimesh.creation.icosphere(4)
    window = Window((0.0, 0.0), 2.4, 2.4)
    for view in (FRONT, View(130.0, 40.0)):
        picture = render(ball.vertices, ball.faces, height=240, view=view, window=window)
        assert picture.shape == (240, 240, 4)
        area = picture[..., 3].sum() / 255 * (2.4 / 240) ** 2
        assert area == pytest.approx(np.pi, rel=5e-3)
        assert picture[0, 0].tolist() == [0, 0, 0, 0]
        assert picture[120, 120, 3] == 255


def test_every_sample_inside_a_triangle_is_covered_once_and_no_other():
    corners = np.array([[0.13, 0.1, 0.0], [0.9, 0.27, 0.4], [0.4, 0.95, -0.3]])
    window = Window((0.5, 0.5), 1.0, 1.0)
    picture = render(corners, [[0, 1, 2]], height=64, view=FRONT, window=window)
    places = (np.arange(128) + 0.5) / 128  # of two samples a pixel
    points = np.stack(np.meshgrid(places, 1 - places), axis=-1)
    one, two, three = corners[:, :2]
    transform = np.linalg.inv(np.stack([two - one, three - one], axis=1))
    u, v = np.moveaxis((points - one) @ transform.T, -1, 0)
    inside = (u >= 0) & (v >= 0) & (u + v <= 1)
    shares = inside.reshape(64, 2, 64, 2).mean(axis=(1, 3))
    np.testing.assert_array_equal(picture[..., 3], np.round(255 * shares))
    assert len(np.unique(picture[shares > 0, :3], axis=0)) == 1  # a flat triangle has one shade


def test_nearer_triangles_hide_farther_ones_wherever_they_cross():
    behind = TRIANGLE + [0, 0, -0.5]
    vertices, faces = np.concatenate([TRIANGLE, behind]), [[0, 1, 2], [3, 4, 5]]
    colors = [[1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]
    for order in ([0, 1], [1, 0]):
        picture = render(
            vertices, np.array(faces)[order], view=FRONT, height=50, color=np.array(colors)[order]
        )
        inside = picture[..., 3] == 255
        assert (picture[inside][:, 0] > 100).all()
        assert (picture[inside][:, 2] < 80).all()  # of the light that any colour mirrors


def test_back_faces_are_not_drawn():
    picture = render(TRIANGLE, [[0, 2, 1]], view=FRONT, height=20)
    assert not picture.any()
    assert render(TRIANGLE, [[0, 2, 1]], view=View(180.0, 0.0), height=20)[..., 3].any()


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"color": [[0.5, 0.5, 0.5]] * 2}, r"color must have shape \(3,\), \(1, 3\) or \(3, 3\)"),
        ({"color": [2.0, 0.0, 0.0]}, "between 0 and 1"),
        ({"height": 0}, "height must be a whole number of at least 1"),
    ],
)
def test_bad_arguments(arguments, message):
    with pytest.raises(ArgumentError, match=message):
        render(TRIANGLE, [[0, 1, 2]], **arguments)


def test_colours_of_vertices_blend_between_them():
    colors = np.array([[0.2, 0.2, 0.2], [0.9, 0.2, 0.2], [0.2, 0.2, 0.2]])
    picture = render(TRIANGLE, [[0, 1, 2]], height=60, view=FRONT, color=colors)
    row = picture[55]
    reds = row[row[:, 3] == 255, 0].astype(int)
    assert (np.diff(reds) >= 0).all()
    assert reds[-1] > reds[0] + 80


@pytest.mark.parametrize(
    ("n_surfaces", "n_shown", "by_triangles"), [(1, 1, True), (8, 8, False), (30, 8, True)]
)
def test_pictures_show_at_most_eight_surfaces(n_surfaces, n_shown, by_triangles):
    template = sphere_template(3)
    # Far from each other: each is drawn where it is seen.
    surfaces = [template.vertices + [5.0 * i, 0, 0] for i in range(n_surfaces)]
    html = surfaces_html(surfaces, template.faces if by_triangles else None, "a <caption>")
    assert "a &lt;caption&gt;" in html
    content = base64.b64decode(re.search(r"base64,([^\"]+)", html)[1])
    picture = np.asarray(Image.open(io.BytesIO(content)))
    columns = (picture[: len(picture) // 2, :, 3] > 0).any(axis=0)  # above the ground
    assert np.count_nonzero(np.diff(columns.astype(int)) == 1) == n_shown
