"""The page of a report in a browser: no complaint, no request, viewers that start, and print."""

import pytest

from riemhuman.plots.maps import _NAME_POINTS


@pytest.mark.slow
def test_it_opens_and_fits_a_screen_and_a_telephone(browser, drawn_report_page):
    pixels_a_point = (
        "return [...document.querySelectorAll(arguments[0])]"
        ".map((picture) => picture.clientWidth / Number(picture.getAttribute('width')))"
    )
    for width in (1440, 390):
        browser.open(drawn_report_page, width, 900, dark=width == 390)
        for name in ("differences-view", "geodesics-view", "comparison-view", "mean-view"):
            browser.run(f"document.getElementById('{name}').scrollIntoView()")
            browser.wait_for(f"return document.getElementById('{name}').dataset.ready")
        assert browser.console() == []
        assert browser.requests() == [drawn_report_page.resolve().as_uri()]
        assert browser.run("return document.documentElement.scrollWidth") <= width
        ground = browser.run("return getComputedStyle(document.body).backgroundColor")
        assert ground == ("rgb(20, 22, 26)" if width == 390 else "rgb(253, 253, 251)")
    # Names on maps, and the smallest text of other figures, are legible on a telephone.
    maps = browser.run(pixels_a_point, "#maps img")
    assert len(maps) == 4
    assert _NAME_POINTS * min(maps) >= 10
    others = browser.run(pixels_a_point, "#retrieval img, .scroll img")
    assert len(others) > 6
    small = 8 / 1.2  # points
    assert small * min(others) >= 9


@pytest.mark.slow
def test_the_wheel_scrolls_the_page_until_the_bodies_have_the_focus(browser, drawn_report_page):
    browser.open(drawn_report_page, 1000, 700)
    browser.run("document.getElementById('mean-view').scrollIntoView({block: 'center'})")
    browser.wait_for("return document.getElementById('mean-view').dataset.ready")
    canvas = browser.find("#mean-view canvas")
    where = "return window.scrollY"
    zoom = "return Number(document.getElementById('mean-view').dataset.zoom)"
    before = browser.run(where)
    browser.wheel(canvas, 0, 0, 100)
    browser.wait_for(f"return window.scrollY > {before} + 50")
    assert browser.run(zoom) == 1
    canvas.click()
    before = browser.run(where)
    browser.wheel(canvas, 0, 0, -100)
    browser.wait_for(f"{zoom} > 1.1")
    assert browser.run(where) == before


@pytest.mark.slow
def test_a_button_unfolds_a_long_table(browser, drawn_report_page):
    browser.open(drawn_report_page, 1000, 700)
    shown = (
        "return [...document.querySelector('.long tbody').rows]"
        ".filter((row) => row.offsetHeight > 0).length"
    )
    rows = browser.run("return document.querySelector('.long tbody').rows.length")
    assert browser.run(shown) == 8
    button = browser.find(".long button")
    button.click()
    assert browser.run(shown) == rows > 15
    assert button.get_attribute("aria-expanded") == "true"
    button.click()
    assert browser.run(shown) == 8
