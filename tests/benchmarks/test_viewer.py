"""How smoothly pages play without a graphics card, and how large they are.

    pytest tests/benchmarks/test_viewer.py --benchmark-enable -s

prints frames a second, by the counter of the page, in headless Chromium that draws on the
processor, and the size of the page of a minute at 60 frames a second of the full body model.
Other work on the machine lowers the rate.
"""

import time

import numpy as np
import pytest

import riemhuman as rh

SIZE = (1280, 800)
SECONDS = 8


@pytest.fixture(scope="module")
def minute():
    """Return a minute of the full model: jumping jacks with the noise of markers."""
    motion = rh.datasets.load_open_motions("full", sequences="jumping_jacks")[0]
    rng = np.random.default_rng(0)
    frames = np.arange(3600) % len(motion)
    poses = motion.pose_vectors[frames] + 0.002 * rng.normal(size=(3600, motion.model.n_joints, 3))
    places = motion.translations[frames] + 1e-3 * rng.normal(size=(3600, 3))
    return rh.datasets.ArrayMotion(("a", "minute"), 60.0, motion.model, motion.betas, poses, places)


def test_a_minute_of_the_full_model(browser, tmp_path, minute):
    start = time.perf_counter()
    rh.view(minute).save(tmp_path / "minute.html")
    seconds = time.perf_counter() - start
    size = (tmp_path / "minute.html").stat().st_size / 1e6
    browser.open(tmp_path / "minute.html", *SIZE)
    browser.wait_for("return document.querySelector('.viewer').dataset.ready")
    browser.run("document.querySelector('[data-part=play]').click()")
    time.sleep(SECONDS)
    rate = float(browser.run("return document.querySelector('.viewer').dataset.rate"))
    print(f"\n{size:.2f} MB, written in {seconds:.1f} s; {rate:.1f} frames a second at {SIZE}")
    assert size < 6
    assert rate >= 15
    assert browser.console() == []
