"""Pages and figures of where two bodies differ."""

from dataclasses import replace

import numpy as np
import pytest
import trimesh
from open_bodies import coarse_bodies

import riemhuman as rh
from riemhuman.errors import ArgumentError
from riemhuman.measurements import compare_visits
from riemhuman.plots.difference_views import plot_difference, view_difference
from riemhuman.plots.figures import value_colors

BODIES = coarse_bodies()
FACES = BODIES.template.faces
MEASUREMENTS = rh.measurements.Measurements(BODIES.model, ["waist girth", "stature", "volume"])


@pytest.fixture(scope="module")
def compared():
    """Return two people of different size."""
    return compare_visits(MEASUREMENTS, BODIES[20], BODIES[53])


def test_both_bodies_in_the_standard_pose_with_signed_millimetres(compared):
    viewer = view_difference(compared, measurements=MEASUREMENTS, names=("Ann", "Ben"))
    (first, second), (same, dense) = viewer.choices.values()
    assert [first.label, second.label] == ["Ann", "Ben"]
    assert np.array_equal(first.frames[0], compared.points_before)
    np.testing.assert_allclose(second.values, 1000.0 * compared.displacements)
    assert second.signed
    assert second.value_caption == "+ outside Ann, − inside"
    assert (first.values, same.values) == (None, None)
    assert not dense.signed
    assert dense.values.min() >= 0


def test_changes_are_listed_with_their_noise(compared):
    page = view_difference(compared, measurements=MEASUREMENTS, names=("Ann", "Ben")).page()
    k = compared.names.index("waist girth")
    assert f"±{100 * compared.thresholds[k]:.1f}" in page
    assert f"+{100 * compared.changes[k]:.1f}" in page
    assert compared.is_significant[k]
    assert 'class="changed"' in page


def test_other_surfaces_are_compared_as_they_stand():
    ball = rh.Template(trimesh.creation.icosphere(2))
    larger = 1.1 * ball.vertices + [3.0, 0.0, 0.0]
    viewer = view_difference(ball.vertices, larger, ball.faces)
    (first, second), _ = viewer.choices.values()
    np.testing.assert_allclose(second.values, 100.0, rtol=0.02)
    assert (first.values, viewer.panel) == (None, None)


def test_what_was_not_seen_is_grey(compared):
    unseen = compared.displacements.copy()
    unseen[:100] = np.nan
    some = replace(compared, displacements=unseen)
    viewer = view_difference(some, measurements=MEASUREMENTS)
    assert "The grey 8 % was not seen in both scans" in viewer.description
    colors = value_colors(1000.0 * unseen, 50.0, signed=True)
    assert np.ptp(colors[:100], axis=0).max() == 0
    assert np.ptp(colors[0]) < 0.1


def test_the_figure_has_a_symmetric_bar_in_millimetres(compared):
    figure = plot_difference(compared, measurements=MEASUREMENTS, height=100)
    bar = figure.axes[-1]
    low, high = bar.get_ylim()
    assert low == -high
    # Only the second body is coloured, and both stand on one floor.
    first, second = (image.get_array().astype(int) for image in figure.axes[0].images)
    blue = [(picture[..., 2] > picture[..., 0] + 40).mean() for picture in (first, second)]
    assert blue[0] == 0 < blue[1]
    feet = [np.flatnonzero((p[..., 3] == 255).any(axis=1))[-1] for p in (first, second)]
    assert abs(feet[0] - feet[1]) <= 2


@pytest.mark.slow
@pytest.mark.parametrize(("width", "dark"), [(960, False), (390, True)])
def test_the_page_fits_screens_and_telephones(browser, compared, tmp_path, width, dark):
    view_difference(compared, measurements=MEASUREMENTS).save(tmp_path / "page.html")
    browser.open_viewer(tmp_path / "page.html", width, 780, dark=dark)
    assert browser.run("return document.documentElement.scrollWidth") <= width
    assert browser.console() == []


def test_bad_arguments(compared):
    with pytest.raises(ArgumentError, match="measurements must be passed"):
        view_difference(compared)
    with pytest.raises(ArgumentError, match="point_b must be given"):
        view_difference(BODIES[0], faces=FACES)
