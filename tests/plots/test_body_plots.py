"""Bodies and film strips as matplotlib pictures, and what triangles add to a distance."""

import numpy as np
import pytest
from cases import sphere_template, surfaces

from riemhuman.errors import ArgumentError, ArgumentTypeError
from riemhuman.geometry import AlignedSurfaces, ElasticMetric
from riemhuman.io import to_trimesh
from riemhuman.plots import contributions, view_bodies
from riemhuman.plots.body_plots import per_area, plot_body, plot_path
from riemhuman.plots.figures import colour_limit
from riemhuman.plots.rendering import vertex_values

TEMPLATE = sphere_template()
PATH = surfaces(TEMPLATE, 5, size=0.1)
SPACE = AlignedSurfaces(TEMPLATE)


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


def test_negative_values_are_seen_on_bodies_and_strips():
    heights = TEMPLATE.vertices[TEMPLATE.faces].mean(axis=1)[:, 1]
    ax = plot_body(TEMPLATE.vertices, TEMPLATE.faces, heights, label="mm", ground=False, height=80)
    picture = ax.images[0].get_array().astype(int)
    middle = picture.shape[1] // 2
    assert picture[10, middle, 0] > picture[10, middle, 2] + 40  # orange above
    assert picture[70, middle, 2] > picture[70, middle, 0] + 40  # blue below
    low, high = ax.figure.axes[1].get_ylim()
    assert -low == high > 0
    assert ax.figure.axes[1].get_ylabel() == "mm"
    # One scale for all surfaces: the first, without negative values, is drawn on it too.
    values = np.stack([np.zeros(len(heights)), heights])
    first, second = plot_path(PATH[:2], TEMPLATE.faces, values, ground=False, height=60).images
    colors = second.get_array().astype(int)
    assert (colors[..., 2] > colors[..., 0] + 40).any()
    assert (colors[..., 0] > colors[..., 2] + 40).any()
    assert not (first.get_array().astype(int)[..., 2] > first.get_array()[..., 0]).any()


def test_a_strip_shows_bodies_in_order_without_overlap():
    ax = plot_path(PATH, TEMPLATE.faces, n_shown=3, height=60)
    extents = np.array([image.get_extent() for image in ax.images])
    assert len(extents) == 3
    assert (extents[1:, 0] >= extents[:-1, 1] - 1e-9).all()
    every = plot_path(PATH, TEMPLATE.faces, height=60).images
    for image, whole in zip(ax.images, every[::2], strict=True):
        np.testing.assert_array_equal(image.get_array(), whole.get_array())


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


def test_meshes_of_other_packages_are_drawn_as_their_arrays():
    meshes = [to_trimesh(surface, TEMPLATE.faces) for surface in PATH[:2]]
    for drawn, expected in (
        (plot_body(meshes[0], height=40), plot_body(PATH[0], TEMPLATE.faces, height=40)),
        (plot_path(meshes, height=40), plot_path(PATH[:2], TEMPLATE.faces, height=40)),
    ):
        for one, other in zip(drawn.images, expected.images, strict=True):
            np.testing.assert_allclose(one.get_array(), other.get_array(), atol=2)
    assert [len(choice) for choice in view_bodies(meshes).choices.values()] == [2]
    with pytest.raises(ArgumentError, match="the same triangles"):
        plot_path([meshes[0], to_trimesh(PATH[1], TEMPLATE.faces[::-1])])
    with pytest.raises(ArgumentTypeError, match="vertices and faces"):
        plot_body(PATH[0])


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: plot_body(PATH[0], TEMPLATE.faces, [1.0]), r"triangle \(80\) or vertex \(42\)"),
        (lambda: plot_body(PATH[0], TEMPLATE.faces, np.zeros((2, 80))), "a single row"),
        (lambda: plot_path(PATH, TEMPLATE.faces, np.zeros(80)), "one row for each of the"),
        (lambda: plot_path(PATH, TEMPLATE.faces, n_shown=1), "n_shown"),
        (
            lambda: plot_path(PATH, TEMPLATE.faces, labels=["one"]),
            "each of the 5 surfaces; found 1",
        ),
        (lambda: per_area([1.0], np.zeros((3, 3)), [[0, 1, 2]]), "triangles without area"),
        (lambda: plot_path(PATH, TEMPLATE.faces, colors=np.full((5, 3), 2)), "between 0 and 1"),
    ],
)
def test_bad_arguments(call, message):
    with pytest.raises(ArgumentError, match=message):
        call()


def test_parts_are_the_distances_of_the_two_fields():
    one, other = surfaces(SPACE.template, 2, rng=2)
    metric = ElasticMetric(SPACE, 2.0, 0.5, 3.0)
    parts = contributions(metric, one, other)
    assert parts.metric.shape == parts.normal.shape == (SPACE.template.n_faces,)
    assert parts.total.sum() == pytest.approx(metric.squared_dist(one, other), rel=1e-12)
    ebin = ElasticMetric(SPACE, 2.0, 0.5, 0.0).squared_dist(one, other)
    normals = ElasticMetric(SPACE, 0.0, 0.0, 3.0).squared_dist(one, other)
    np.testing.assert_allclose([parts.metric.sum(), parts.normal.sum()], [ebin, normals])
    together = contributions(metric, np.stack([one, other]), other)
    np.testing.assert_array_equal(together.total[0], parts.total)
    assert not together.total[1].any()


def test_a_moved_vertex_shows_in_its_triangles_alone():
    one = SPACE.template.vertices
    other = one.copy()
    other[7] *= 1.2
    total = contributions(ElasticMetric(SPACE, 1.0, 1.0, 1.0), one, other).total
    np.testing.assert_array_equal(total > 0, (SPACE.template.faces == 7).any(axis=1))


def test_surfaces_of_a_strip_stand_unless_they_jump():
    def lowest_rows(ax):
        """Return the last row of each picture in which a surface is drawn, not only its shadow."""
        pictures = [image.get_array() for image in ax.images]
        return [np.flatnonzero((picture[..., 3] == 255).any(axis=1))[-1] for picture in pictures]

    jump = PATH[:3] + np.array([0.0, 0.5, 1.0])[:, None, None] * [0.0, 1.0, 0.0]
    standing = lowest_rows(plot_path(jump, TEMPLATE.faces, height=120))
    assert np.ptp(standing) <= 3
    jumping = lowest_rows(plot_path(jump, TEMPLATE.faces, one_floor=True, height=120))
    assert jumping[0] > jumping[1] + 10 > jumping[2] + 20


def test_surfaces_of_a_strip_have_names_and_a_bar():
    values = np.linspace(-1.0, 2.0, len(TEMPLATE.faces))
    options = {"labels": ["one", "two", "three"], "label": "mm", "height": 40}
    ax = plot_path(PATH[:3], TEMPLATE.faces, [values] * 3, n_shown=2, **options)
    assert [text.get_text() for text in ax.texts] == ["one", "three"]
    for text, image in zip(ax.texts, ax.images, strict=True):
        left, right, *_ = image.get_extent()
        assert left < text.get_position()[0] < right
    assert ax.figure.axes[-1].get_ylabel() == "mm"


def test_values_of_triangles_are_drawn_as_smoothly_as_in_pages():
    """As page and film, figures blend values over triangles; unknown ones do not spread."""
    n_vertices = len(TEMPLATE.vertices)
    faces = TEMPLATE.faces
    values = np.where(np.arange(len(faces)) % 2, 1.0, np.nan)
    smooth = vertex_values(values, faces, n_vertices)
    touched = np.isin(np.arange(n_vertices), faces[1::2])
    np.testing.assert_array_equal(smooth[touched], 1.0)
    assert np.isnan(smooth[~touched]).all()
    heights = TEMPLATE.vertices[:, 1]
    by_face, by_vertex = (
        plot_body(TEMPLATE.vertices, faces, shown, ground=False, height=60).images[0].get_array()
        for shown in (vertex_values(heights[faces].mean(axis=1), faces, n_vertices), heights)
    )
    assert np.abs(by_face.astype(int) - by_vertex.astype(int)).mean() < 6
