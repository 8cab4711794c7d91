"""Pages and figures of scans over bodies."""

import dataclasses

import numpy as np
import pytest
from open_bodies import coarse_bodies

import riemhuman as rh
from riemhuman.kernels.surface import vertex_normals
from riemhuman.plots import scan_views
from riemhuman.readable_units import gap_unit
from riemhuman.registration import lay_over_body, simulated_scan
from riemhuman.surfaces.measures import share_of_surface

BODIES = coarse_bodies()
FACES = BODIES.template.faces
BODY = BODIES[57]
# Sets a control of the panel and lets the page know.
SET = """
const [name, value] = arguments;
const input = document.querySelector(`[data-scan=${name}]`);
if (input.type === 'checkbox') input.checked = value; else input.value = value;
input.dispatchEvent(new Event('input'));
"""


@pytest.fixture(scope="module")
def over():
    scan = simulated_scan(BODY, FACES, rng=3, n_points=3000, missing=0.12, rotate=False)
    return lay_over_body(scan.points, BODY, FACES)


def test_local_means_leave_out_noise_and_what_is_not_seen():
    offset = BODY + 0.004 * vertex_normals(BODY, FACES)
    rng = np.random.default_rng(1)
    scan = simulated_scan(offset, FACES, rng=1, n_points=10_000, noise=0.0, rotate=False)
    points = lay_over_body(scan.points, BODY, FACES)
    noisy = dataclasses.replace(
        points, distances=points.distances + 0.002 * rng.standard_normal(len(points.distances))
    )
    means = scan_views.local_means(noisy)
    assert np.isfinite(means).mean() > 0.9
    assert np.nanmedian(means) == pytest.approx(0.004, abs=0.0007)
    errors = means - scan_views.local_means(points)
    assert 0 < np.nanstd(errors) < 0.5 * 0.002
    heights, middle = BODY[:, 1], np.median(BODY[:, 1])
    upper = noisy.chosen(noisy.scan_points[:, 1] > middle)
    assert np.isnan(scan_views.local_means(upper)[heights < middle - 0.05]).all()


def test_shares_are_of_the_surface(over):
    """Hands have many small triangles."""
    share = share_of_surface(BODY, FACES, over.seen)
    text = rh.plots.view_scan(over.scan_points, BODY, FACES).description
    assert f"shows {100 * share:.0f} % of the body's surface" in text


def test_the_scale_fits_the_median_of_several_scans():
    unit = gap_unit("cm")
    gaps = [np.full(9, metres) for metres in (0.0009, 0.001, 1.0)]
    assert scan_views.colour_end(gaps[:1], unit) == 3
    assert scan_views.colour_end(gaps, unit) == 3
    assert scan_views.colour_end([], unit) == 1


def test_a_figure_in_inches_shows_the_same_distances(over):
    bars, titles = {}, {}
    for system in ("cm", "in"):
        figure = rh.plots.plot_scan(over, height=100, system=system)
        titles[system] = float(figure.axes[2].get_title().split()[2])
        bars[system] = figure.axes[3].get_ylabel()
    assert {system: bar.split()[-1] for system, bar in bars.items()} == {"cm": "mm", "in": "in"}
    assert titles["in"] == pytest.approx(titles["cm"] / 25.4, abs=0.0025)


@pytest.mark.slow
def test_a_scan_is_seen_through_and_cut(browser, over, tmp_path):
    page = tmp_path / "over.html"
    rh.plots.view_scan(over.scan_points, BODY, FACES).save(page)
    browser.open_viewer(page, 1000, 700)
    panel = "document.querySelector('.viewer').viewer.panel"
    browser.actions().move_to_element(browser.find("canvas")).perform()
    assert browser.run(f"return {panel}.body.mesh.material.transparent") is False
    browser.run(SET, "body", 35)
    browser.run(SET, "scan", 100)
    browser.actions().move_by_offset(1, 1).perform()
    said = browser.run("return document.querySelector('[data-part=hint]').textContent")
    assert "side the body" in said
    assert browser.run("return document.querySelector('[data-scan=placing]').hidden")
    browser.run(SET, "cut", "above")
    browser.run(SET, "place", 0)
    assert not browser.run("return document.querySelector('[data-scan=placing]').hidden")
    # All is cut away, so that the pointer is on nothing.
    browser.actions().move_by_offset(2, 2).perform()
    assert browser.run("return document.querySelector('[data-part=hint]').hidden")
    assert browser.console() == []
