"""Colours of values: the ends of their bar move, and lines of equal value are drawn."""

import base64
import io

import numpy as np
import pytest
from open_bodies import coarse_bodies
from PIL import Image

from riemhuman.plots import ViewedBody, Viewer

BODIES = coarse_bodies()
FACES = BODIES.template.faces
HEIGHTS = BODIES.points[0, :, 1] - BODIES.points[0, :, 1].min()
HANDLES = (
    "return [...document.querySelectorAll('.scale b')].map((e) => e.getAttribute(arguments[0]))"
)
COLORS = """
const [body] = document.querySelector('.viewer').viewer.bodies();
return [...body.geometry.attributes.color.array];
"""


@pytest.fixture
def opened(browser, tmp_path):
    """Return a function that opens a page of bodies with values."""

    def open_page(*values):
        bodies = [ViewedBody("", BODIES.points[:1], values=v, value_label="m") for v in values]
        Viewer(FACES, {"": bodies}).save(tmp_path / "page.html")
        browser.open_viewer(tmp_path / "page.html", 700, 700)

    yield open_page
    assert browser.console() == []


def numbers(browser, name="aria-valuenow"):
    return [float(number) for number in browser.run(HANDLES, name)]


def shot(browser):
    browser.wait_for_picture()
    data = base64.b64decode(browser.devtools("Page.captureScreenshot", format="png")["data"])
    return np.asarray(Image.open(io.BytesIO(data)).convert("RGB")).astype(int)


@pytest.mark.slow
def test_keys_move_the_ends_of_the_bar_and_the_colours_with_them(browser, opened):
    unknown = np.where(np.arange(len(HEIGHTS)) < 100, np.nan, HEIGHTS)
    opened(unknown)
    low, high = numbers(browser)
    assert low == 0
    top = np.nanmax(unknown)
    assert numbers(browser, "aria-valuemax")[1] == pytest.approx(top, rel=1e-6)
    before = np.reshape(browser.run(COLORS), (-1, 3))
    browser.run("document.querySelectorAll('.scale b')[1].focus()")
    browser.press(*["\ue012"] * 20)  # arrow left: 2 % of the bar
    assert numbers(browser)[1] == pytest.approx(high - 0.4 * top, rel=1e-3)
    after = np.reshape(browser.run(COLORS), (-1, 3))
    chest = np.nanargmin(np.abs(unknown - numbers(browser)[1]))
    assert after[chest] == pytest.approx(before[np.nanargmax(unknown)], abs=0.02)
    np.testing.assert_array_equal(after[:100], before[:100])  # unknown ones stay grey
    assert np.ptp(after[:100], axis=0).max() == 0
    browser.press("\ue011")  # Home
    assert numbers(browser) == [0, high]
    assert np.reshape(browser.run(COLORS), (-1, 3)) == pytest.approx(before, abs=0.01)


@pytest.mark.slow
def test_a_bar_with_a_sign_stays_symmetric_and_like_bars_move_together(browser, opened):
    signed = HEIGHTS - 0.9
    opened(signed, signed, HEIGHTS)
    before = numbers(browser)
    assert before[0] == -before[1]
    handle = browser.find(".scale b")
    browser.actions().drag_and_drop_by_offset(handle, 20, 0).perform()
    after = numbers(browser)
    assert after[:2] == after[2:4]
    assert after[0] == -after[1]
    assert after[1] < 0.9 * before[1]
    assert after[4:] == before[4:]


@pytest.mark.slow
def test_lines_of_equal_value_are_drawn_on_demand(browser, opened):
    opened(HEIGHTS)
    plain = shot(browser)
    browser.find(".lines input").click()
    assert browser.find(".lines span").text == "Lines of equal value, every 0.2 m"
    lined = shot(browser)
    darker = (plain - lined).max(axis=-1)[:500] > 40
    # A line every 0.2 m around a body of 1.6 m: in the column of a leg, some rows each.
    columns = darker.sum(axis=0)
    assert 4 <= columns.max() < 60
    assert darker.sum() > 200
    browser.find(".lines input").click()
    assert np.abs(shot(browser) - plain)[:500].max() < 4
