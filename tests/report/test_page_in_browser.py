"""The page in a browser: no complaint, no request, and controls that work."""

import pytest
from headless_browser import Browser, is_available

pytestmark = pytest.mark.skipif(not is_available(), reason="Chromium and its driver are not here")


def viewer(browser, name):
    """Scroll to a viewer and wait until it is there."""
    browser.run(f"document.getElementById('{name}').scrollIntoView()")
    browser.wait_for(f"return document.getElementById('{name}').dataset.ready")


def state(browser, name, key):
    return browser.run(f"return document.getElementById('{name}').dataset.{key}")


def pixels(browser, name):
    """Return a digest of what a viewer draws."""
    return browser.run(
        f"const v = document.getElementById('{name}'); const c = v.querySelector('canvas');"
        "const copy = document.createElement('canvas'); copy.width = 60; copy.height = 60;"
        "v.querySelector('[data-action=reset]').click();"  # draws in this very frame
        "copy.getContext('2d').drawImage(c, 0, 0, 60, 60); return copy.toDataURL()"
    )


@pytest.mark.parametrize("width", [390, 1440])
def test_it_opens_and_fits(report_page, width):
    with Browser(width, 900, dark=width == 390) as browser:
        browser.open(report_page)
        for name in ("differences-view", "geodesics-view", "comparison-view", "mean-view"):
            viewer(browser, name)
        assert browser.console() == []
        assert browser.requests() == [report_page.resolve().as_uri()]
        assert browser.run("return document.documentElement.scrollWidth") <= width
        ground = browser.run("return getComputedStyle(document.body).backgroundColor")
        assert ground == ("rgb(20, 22, 26)" if width == 390 else "rgb(253, 253, 251)")


def test_controls(report_page):
    name = "geodesics-view"
    with Browser(1000, 800) as browser:
        browser.open(report_page)
        viewer(browser, name)
        assert state(browser, name, "choice") == "shape (1, 1, 0)"
        start = pixels(browser, name)
        slider = f"document.getElementById('{name}-time')"
        browser.run(f"{slider}.value = 100; {slider}.dispatchEvent(new Event('input'))")
        assert state(browser, name, "time") == "0.500"
        half_way = pixels(browser, name)
        assert half_way != start
        browser.run(f"document.querySelectorAll('#{name} input[type=radio]')[1].click()")
        assert state(browser, name, "choice") == "pose (0, 0, 1)"
        assert state(browser, name, "time") == "0.500"
        assert pixels(browser, name) != half_way

        browser.run(f"{slider}.focus()")
        browser.press("\ue014")  # right arrow
        assert float(state(browser, name, "time")) > 0.5
        browser.run(f"document.querySelector('#{name} canvas').focus()")
        browser.press("\ue014")
        by_keys = float(state(browser, name, "yaw"))
        browser.drag(f"#{name} canvas", 120, 0)
        assert float(state(browser, name, "yaw")) == pytest.approx(by_keys + 1.0, abs=0.1)

        browser.run(f"document.querySelector('#{name} [data-part=play]').click()")
        browser.wait_for(f"return document.getElementById('{name}').dataset.time === '1.000'")
        browser.wait_for(
            f"return document.querySelector('#{name} [data-part=play]').textContent === 'Play'"
        )
        assert browser.console() == []
