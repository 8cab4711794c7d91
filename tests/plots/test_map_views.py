"""Pages of maps: the pointer on a point shows its body."""

import numpy as np
import pytest
from open_bodies import coarse_bodies

import riemhuman as rh
from riemhuman.errors import ArgumentError

BODIES = coarse_bodies()[:30:3]
PLACES = np.random.default_rng(0).normal(size=(10, 2))
NAMES = [f"body {number}" for number in range(10)]


def view(**options):
    return rh.plots.view_map(
        PLACES,
        BODIES.subject,
        BODIES.subject_names,
        points=BODIES.points,
        faces=BODIES.template.faces,
        **{"item_names": NAMES, **options},
    )


def test_the_page_has_a_dot_for_each_body_and_a_name_for_each_class():
    page = view().page()
    assert page.count("data-item=") == 10
    for subject in np.unique(BODIES.subject):
        assert f">{BODIES.subject_names[subject]}</text>" in page
    with pytest.raises(ArgumentError, match="item_names must name each of the 10 bodies; found 2"):
        view(item_names=NAMES[:2])


@pytest.mark.slow
def test_the_pointer_on_a_dot_shows_its_body(browser, tmp_path):
    view().save(tmp_path / "map.html")
    browser.open_viewer(tmp_path / "map.html", 1000, 700)
    browser.actions().move_to_element(browser.find("[data-item='7']")).perform()
    assert browser.run("return document.querySelector('[data-part=map]').dataset.shown") == "7"
    label = browser.run("return document.querySelector('[data-part=labels]').textContent")
    assert label.startswith("body 7 (")
    heights = browser.run(
        "const { positions } = document.querySelector('.viewer').viewer.bodies()[0];"
        "let [low, high] = [Infinity, -Infinity];"
        "for (let i = 1; i < positions.length; i += 3) {"
        "  low = Math.min(low, positions[i]); high = Math.max(high, positions[i]);"
        "} return high - low;"
    )
    assert heights == pytest.approx(np.ptp(BODIES.points[7, :, 1]), abs=1e-3)
    assert browser.console() == []
