"""Maps of distance matrices."""

import sys

import numpy as np
import pytest
from scipy.spatial.distance import pdist, squareform

import riemhuman as rh
from riemhuman.errors import ArgumentError, MissingDependencyError
from riemhuman.plots.figures import new_figure
from riemhuman.plots.maps import (
    describe_stress,
    embed,
    neighbours_kept,
    plot_embedding,
    stress,
)

POINTS = np.random.default_rng(0).normal(size=(12, 2))
DISTANCES = squareform(pdist(POINTS))


def test_scaling_keeps_the_distances_of_points_in_a_plane():
    found = embed(DISTANCES, method="mds")
    np.testing.assert_allclose(squareform(pdist(found)), DISTANCES, atol=1e-10)
    np.testing.assert_allclose(found.mean(axis=0), 0, atol=1e-12)
    assert found[:, 0].std() > found[:, 1].std()
    assert stress(DISTANCES, found) == pytest.approx(0, abs=1e-10)
    assert stress(DISTANCES, 2 * found) == pytest.approx(1)


def test_scaling_minimizes_the_stress():
    """Five dimensions in a plane: classical scaling, a projection, makes all distances shorter."""
    points = np.random.default_rng(3).normal(size=(30, 5))
    distances = squareform(pdist(points))
    found = embed(distances, method="mds")
    lowest = stress(distances, found)
    _, _, axes = np.linalg.svd(points - points.mean(axis=0))
    assert lowest < 0.7 * stress(distances, points @ axes[:2].T)
    rng = np.random.default_rng(0)
    for _ in range(20):
        moved = found + 0.03 * rng.normal(size=found.shape)
        assert stress(distances, moved) > lowest


def test_scaling_of_items_in_one_place_and_of_equal_distances():
    twice = np.repeat(np.repeat(DISTANCES, 2, axis=0), 2, axis=1)
    assert stress(twice, embed(twice, method="mds")) == pytest.approx(0, abs=1e-6)
    # A square is the best map of four items that are all equally far from each other.
    equal = 1 - np.eye(4)
    square = 0.8536 * np.array([[0, 0], [0, 1], [1, 0], [1, 1]])
    assert stress(equal, embed(equal, method="mds")) < 1.02 * stress(equal, square)
    nothing = np.zeros((4, 4))
    assert stress(nothing, embed(nothing, method="mds")) == 0.0
    assert stress(nothing, POINTS[:4]) == np.inf
    assert describe_stress(0.0) == "distances are kept"


def test_neighbours_kept():
    assert neighbours_kept(DISTANCES, POINTS) == (1.0, 5, 5 / 11)
    assert neighbours_kept(1 - np.eye(12), POINTS)[0] == pytest.approx(5 / 11)
    # On a line, a swap of the first and the last item leaves the neighbours of some.
    line = np.abs(np.subtract.outer(np.arange(7.0) ** 1.1, np.arange(7.0) ** 1.1))
    kept, count, _ = neighbours_kept(line, np.stack([[6, 1, 2, 3, 4, 5, 0], np.zeros(7)], axis=1))
    assert count == 3
    assert 0.3 < kept < 0.8


def test_t_sne_is_seeded_and_keeps_groups_together():
    groups = np.repeat([0, 1, 2], 10)
    noise = np.random.default_rng(1).uniform(0.1, 0.2, (30, 30))
    distances = np.where(groups[:, None] == groups, 0.1, 1.0) + noise + noise.T
    np.fill_diagonal(distances, 0.0)
    found = embed(distances)
    np.testing.assert_array_equal(found, embed(distances))
    apart = squareform(pdist(found))
    np.fill_diagonal(apart, np.inf)
    np.testing.assert_array_equal(groups[apart.argmin(axis=1)], groups)


def test_refusals(monkeypatch):
    for distances, message in (
        (DISTANCES[:2, :2], "at least 3 items"),
        (np.triu(DISTANCES), "symmetric"),
    ):
        with pytest.raises(ArgumentError, match=message):
            embed(distances, method="mds")
    monkeypatch.setitem(sys.modules, "sklearn.manifold", None)
    with pytest.raises(MissingDependencyError, match=r"\[report\]'"):
        embed(DISTANCES)
    assert embed(DISTANCES, method="mds").shape == (12, 2)


LABELS = np.repeat([0, 1, 2], 4)
PLACES = POINTS + 8 * np.eye(3)[LABELS][:, :2]


def test_maps_show_every_item_in_the_colour_of_its_class():
    ax = plot_embedding(PLACES, LABELS, ["one", "two", "three"])
    groups = PLACES.reshape(3, 4, 2)  # four items a class, in order
    for group, dots in zip(groups, ax.collections, strict=True):
        np.testing.assert_array_equal(dots.get_offsets(), group)
    assert len({tuple(dots.get_facecolor()[0]) for dots in ax.collections}) == 3
    assert [text.get_text() for text in ax.get_legend().get_texts()] == ["one", "two", "three"]


def test_bodies_of_classes_hide_no_point_and_no_name(nine_bodies):
    rng = np.random.default_rng(1)
    labels = np.repeat(np.arange(10), 6)
    centres = rng.uniform(0.06, [0.41, 0.37], (10, 2))
    positions = centres[labels] + 0.01 * rng.normal(size=(60, 2))  # as of small distances
    names = [f"person number {label} of the set" for label in range(10)]
    figure = new_figure(4.5, 4.8)
    surfaces = np.repeat(nine_bodies.points[:1], len(positions), axis=0)
    faces = nine_bodies.template.faces
    ax = plot_embedding(
        positions, labels, names, points=surfaces, faces=faces, ax=figure.subplots()
    )
    figure.draw_without_rendering()
    renderer = figure._get_renderer()
    named = [text for text in ax.texts if text.get_text()]
    drawn = [artist for artist in ax.artists if hasattr(artist, "offsetbox")]
    boxes = [one.get_window_extent(renderer) for one in [*named, *drawn]]
    assert len(named) == len(drawn) == 10
    for index, box in enumerate(boxes):
        assert not any(box.overlaps(other) for other in boxes[index + 1 :])
        assert not any(box.contains(*place) for place in ax.transData.transform(positions))
        assert figure.bbox.fully_containsx(box.x0)
        assert figure.bbox.fully_containsx(box.x1)
    assert not [text for text in ax.texts if text.arrow_patch]  # lines would cross names


def test_the_bar_is_as_long_as_it_says_in_both_directions():
    figure = new_figure(4.8, 3.0)
    ax = plot_embedding(PLACES, LABELS, unit="m", ax=figure.subplots())
    figure.draw_without_rendering()
    (bar,) = (line for line in ax.lines if len(line.get_xdata()) == 2)
    (text,) = (text.get_text() for text in ax.texts)
    length, unit = text.split()
    assert unit == "m"
    assert np.ptp(bar.get_xdata()) == pytest.approx(float(length))
    across, along = np.abs(np.diff(ax.transData.transform([[0, 0], [1, 1]]), axis=0)[0])
    assert across == pytest.approx(along, rel=0.02)


def test_a_metric_and_bodies_are_embedded_in_one_call():
    bodies = rh.datasets.load_open_bodies("coarse")[:12]
    metric = rh.SRNFMetric(rh.AlignedSurfaces(bodies.template, equip=False))
    expected = embed(metric.dist_pairwise(bodies.points), method="mds")
    np.testing.assert_array_equal(embed(metric, bodies, method="mds"), expected)
    np.testing.assert_array_equal(embed(metric, bodies.points, method="mds"), expected)
    with pytest.raises(ArgumentError, match=r"pass the bodies to compare: embed\(metric, bodies\)"):
        embed(metric)
    with pytest.raises(ArgumentError, match="leave it out for distances"):
        embed(DISTANCES, bodies)
