"""Two motions side by side, aligned in time, and moments before and after."""

import numpy as np
import pytest

import riemhuman as rh
from riemhuman.errors import ArgumentError
from riemhuman.motions import Warp
from riemhuman.plots import view_motions, view_path

KNEES, OTHER = rh.datasets.load_open_motions("coarse", sequences="knees")[:2]
LASTS = (len(KNEES) - 1, len(OTHER) - 1)
# The second motion is shown waiting for the first, and hurries then.
WARP = Warp(0.5, np.array([0.0, 60.0, LASTS[0]]), np.array([0.0, 0.0, LASTS[1]]))
STATE = """
const viewer = document.querySelector('.viewer').viewer;
viewer.seek(arguments[0]);
return viewer.bodies().map((body) => body.place);
"""


def test_the_second_motion_is_shown_at_the_corresponding_times():
    viewer = view_motions(KNEES, OTHER, WARP)
    first, second = viewer.choices["aligned"]
    np.testing.assert_allclose(first.times, np.arange(len(KNEES)))
    np.testing.assert_allclose(second.times, WARP(np.arange(len(KNEES))))
    assert first.label != second.label
    assert [body.times for body in viewer.choices["as recorded"]] == [None, None]
    assert viewer.frames_per_second == KNEES.frames_per_second


def test_the_page_says_which_motion_is_the_later_one():
    """Above the dashed line, the second takes more of its time to the same pose."""
    panel = view_motions(KNEES, OTHER, WARP, names=("slow", "quick")).panel.html("")
    assert "Above the dashed line, quick reaches a pose relatively later than slow" in " ".join(
        panel.split()
    )


def test_view_takes_two_motions_and_their_warp():
    viewer = rh.view((KNEES, OTHER, WARP))
    assert list(viewer.choices) == ["aligned", "as recorded"]
    pair = tuple(rh.datasets.load_open_bodies("coarse").points[:2])
    with pytest.raises(rh.RiemhumanError):
        rh.view(pair)  # arrays without triangles, as before


def test_what_does_not_fit_is_refused():
    with pytest.raises(ArgumentError, match="pass faces too"):
        view_motions(KNEES[:], OTHER[:], WARP)
    with pytest.raises(ArgumentError, match="second motion from 0 to 9"):
        view_motions(KNEES, OTHER[:10], WARP)
    slower = rh.datasets.load_open_motions("coarse", "average man", "knees", 30)[0]
    with pytest.raises(ArgumentError, match="same frames per second"):
        view_motions(KNEES, slower, WARP)


@pytest.mark.slow
def test_the_page_draws_the_curve_and_where_it_is(browser, tmp_path):
    rh.view((KNEES, OTHER, WARP)).save(tmp_path / "both.html")
    browser.open_viewer(tmp_path / "both.html", 1000, 700)
    for share in (0.0, 0.3, 0.8):
        places = browser.run(STATE, share)
        assert places[0] == pytest.approx(share * LASTS[0], abs=1e-2)
        assert places[1] == pytest.approx(float(WARP(places[0])), abs=1e-2)
        now = browser.find(".warp .now")
        assert float(now.get_attribute("cx")) == pytest.approx(100 * share, abs=0.1)
        height = 100 - 100 * places[1] / LASTS[1]
        assert float(now.get_attribute("cy")) == pytest.approx(height, abs=0.1)
    browser.actions().click(browser.find(".warp svg")).perform()
    assert 0.3 < browser.run("return document.querySelector('.viewer').viewer.time") < 0.6
    browser.find("input[type=radio][value='1']").click()
    browser.wait_for("return document.querySelector('.viewer').viewer.chosen === 1")
    assert browser.run(STATE, 1.0) == list(LASTS)
    assert browser.console() == []


@pytest.mark.slow
def test_moments_before_and_after_are_drawn_on_demand(browser, tmp_path):
    view_path(KNEES, frames_per_second=60).save(tmp_path / "knees.html")
    browser.open_viewer(tmp_path / "knees.html", 600, 600)
    seen = """
    const viewer = document.querySelector('.viewer').viewer;
    viewer.seek(arguments[0]);
    return viewer.trail.ghosts.map((ghost) => ghost.mesh.visible ? [...ghost.positions] : null);
    """
    assert browser.run(seen, 0.5) == []
    browser.find("[data-part=trail]").click()
    ghosts = browser.run(seen, 0.5)
    assert len(ghosts) == 6
    place = 0.5 * LASTS[0] - 12  # 0.2 s before
    expected = (KNEES[int(np.floor(place))] + KNEES[int(np.ceil(place))]) / 2
    centre = browser.run("return document.querySelector('.viewer').viewer.bodies()[0].centre")
    shown = np.reshape(ghosts[2], (-1, 3)) + centre
    assert np.linalg.norm(shown - expected, axis=-1).mean() < 1e-3
    assert [ghost is None for ghost in browser.run(seen, 0.0)] == [True] * 3 + [False] * 3
    browser.find("[data-part=trail]").click()
    assert browser.run(seen, 0.5) == []
    assert browser.console() == []
