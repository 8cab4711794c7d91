"""Pages with panels look as they did: pictures of whole pages are compared with stored ones.

Stored pictures are small, so that fonts of other machines hardly count. After a change that is
meant to be seen, look at the new ones: `python tests/plots/test_stored_pages.py`.
"""

import base64
import io
import sys
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

import riemhuman as rh
from riemhuman.measurements import Measurements, compare_visits
from riemhuman.registration import lay_over_body, simulated_scan

STORED = Path(__file__).parent / "stored_pages"
WINDOWS = {"wide": (960, 640, False), "narrow": (390, 780, True)}  # the narrow one is dark
SHRUNK = 4
# Mean difference of channels, of 255, and of the share of pixels that differ by more than a fifth.
MEAN, SHARE = 4.0, 0.02


def bodies():
    return rh.datasets.load_open_bodies("coarse")


def scan_page():
    body, faces = bodies()[57], bodies().template.faces
    scan = simulated_scan(body, faces, rng=3, n_points=6000, missing=0.12)
    return rh.plots.view_scan(lay_over_body(scan.points, body, faces).scan_points, body, faces)


def measured_page():
    some = bodies()
    return rh.plots.view_measurements(Measurements(some.model), some[20], pose="as is")


def difference_page():
    some = bodies()
    measurements = Measurements(some.model, ["stature", "chest girth", "waist girth", "volume"])
    compared = compare_visits(measurements, some[70], some[80])
    return rh.plots.view_difference(compared, measurements=measurements, names=("Ann", "Ben"))


def map_page():
    some = bodies()[:40:4]
    angles = 2 * np.pi * np.arange(10) / 10
    places = np.stack([np.cos(angles), np.sin(angles)], axis=1)
    return rh.plots.view_map(
        places, some.subject, some.subject_names, points=some.points, faces=some.template.faces
    )


PAGES = {
    "scan": scan_page,
    "measured": measured_page,
    "difference": difference_page,
    "map": map_page,
}
CASES = [(name, window) for name in PAGES for window in WINDOWS]


@pytest.fixture(scope="module")
def saved(tmp_path_factory):
    """Return a function that gives the file of a page, written once."""
    folder = tmp_path_factory.mktemp("pages")

    def file_of(name):
        file = folder / f"{name}.html"
        if not file.exists():
            PAGES[name]().save(file)
        return file

    return file_of


def picture_of(browser, page, window):
    """Return a page as it is seen in a window, small."""
    width, height, dark = WINDOWS[window]
    browser.open_viewer(page, width, height, dark=dark)
    browser.wait_for_picture()
    data = browser.devtools("Page.captureScreenshot")["data"]
    whole = Image.open(io.BytesIO(base64.b64decode(data))).convert("RGB")
    return whole.resize((whole.width // SHRUNK, whole.height // SHRUNK), Image.Resampling.BOX)


@pytest.mark.slow
@pytest.mark.parametrize(("name", "window"), CASES, ids=["-".join(case) for case in CASES])
def test_a_page_looks_as_it_did(browser, saved, name, window):
    picture = picture_of(browser, saved(name), window)
    stored = Image.open(STORED / f"{name}-{window}.png").convert("RGB")
    assert picture.size == stored.size
    gaps = np.abs(np.asarray(picture, dtype=float) - np.asarray(stored, dtype=float))
    assert gaps.mean() < MEAN
    assert (gaps.max(axis=2) > 255 / 5).mean() < SHARE
    assert browser.console() == []


def store(folder):
    """Write the pictures of all pages."""
    from headless_browser import opened_browser

    with opened_browser() as browser:
        for name, window in CASES:
            page = folder / f"{name}.html"
            if not page.exists():
                PAGES[name]().save(page)
            picture_of(browser, page, window).save(STORED / f"{name}-{window}.png", optimize=True)


if __name__ == "__main__":
    import tempfile

    sys.path.insert(0, str(Path(__file__).parents[1] / "support"))
    with tempfile.TemporaryDirectory() as place:
        store(Path(place))
