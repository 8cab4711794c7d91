"""The viewer looks as it did: pictures from headless Chromium against stored ones.

After a change that is meant, `STORE_PICTURES=1 pytest tests/plots/test_stored_pictures.py` writes
them anew; look at them before you commit them.
"""

import base64
import io
import os
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

import riemhuman as rh
from riemhuman.plots import ViewedBody, Viewer, view_bodies

FOLDER = Path(__file__).parent / "stored"
SIDE = 320
BODIES = rh.datasets.load_open_bodies("coarse")
FACES = BODIES.template.faces
# Only what WebGL draws: texts differ with the fonts of a machine.
BARE = """
const style = document.createElement('style');
style.textContent = 'h1, .controls, .label, .hint { visibility: hidden; }'
  + '.viewer .stage { position: fixed !important; inset: 0; min-height: 0 !important;'
  + `width: ${arguments[0]}px; height: ${arguments[0]}px; }`;
document.head.append(style);
"""


def body():
    return view_bodies(BODIES[0], FACES), ""


def values():
    heights = BODIES.points[3, :, 1] - BODIES.points[3, :, 1].mean()
    shown = ViewedBody("", BODIES.points[3:4], values=heights, value_label="m")
    return Viewer(FACES, {"": [shown]}), "document.querySelector('.lines input').click();"


def motion():
    knees = rh.datasets.load_open_motions("coarse", sequences="jumping_jacks")[0]
    return rh.view(knees), "document.querySelector('[data-part=trail]').click(); viewer.seek(0.45);"


SCENES = {"body": body, "values": values, "motion": motion}


def photographed(browser, folder, scene, more="", *, dark=False):
    """Return what the browser draws of a scene, shape (SIDE, SIDE, 3)."""
    viewer, script = SCENES[scene]()
    viewer.save(folder / "page.html")
    browser.open(folder / "page.html", 500, SIDE, dark=dark)
    browser.wait_for("return document.querySelector('.viewer').dataset.ready")
    browser.run(BARE, SIDE)
    browser.wait_for(f"return document.querySelector('.stage').clientWidth === {SIDE}")
    browser.run(f"const {{ viewer }} = document.querySelector('.viewer'); {script} {more}")
    browser.wait_for_picture()
    assert browser.run("return document.querySelector('canvas').width") == 2 * SIDE
    shot = browser.devtools(
        "Page.captureScreenshot",
        format="png",
        clip={"x": 0, "y": 0, "width": SIDE, "height": SIDE, "scale": 1},
    )
    picture = Image.open(io.BytesIO(base64.b64decode(shot["data"]))).convert("RGB")
    return np.asarray(picture)


def difference(first, second):
    """Return the mean difference where something is drawn, and the share of other pixels."""
    first, second = first.astype(int), second.astype(int)
    drawn = (np.abs(second - second[0, 0]) > 6).any(axis=-1)
    apart = np.abs(first - second).max(axis=-1)
    return float(apart[drawn].mean()), float((apart > 40).mean())


@pytest.mark.slow
@pytest.mark.parametrize("dark", [False, True], ids=["light", "dark"])
@pytest.mark.parametrize("scene", SCENES)
def test_scenes_look_as_they_did(browser, tmp_path, scene, dark):
    shown = photographed(browser, tmp_path, scene, dark=dark)
    file = FOLDER / f"{scene}_{'dark' if dark else 'light'}.png"
    if os.environ.get("STORE_PICTURES"):
        Image.fromarray(shown).save(file, optimize=True)
    mean, share = difference(shown, np.asarray(Image.open(file).convert("RGB")))
    assert mean < 3
    assert share < 0.01
    assert browser.console() == []


@pytest.mark.slow
def test_what_looks_different_is_noticed(browser, tmp_path):
    stored = np.asarray(Image.open(FOLDER / "body_light.png").convert("RGB"))
    turned = photographed(browser, tmp_path, "body", "viewer.turn(0.12, 0);")
    brighter = photographed(
        browser,
        tmp_path,
        "body",
        "viewer.scene.children.forEach((each) => { each.intensity *= 1.15; }); viewer.draw();",
    )
    for other in (turned, brighter):
        mean, share = difference(other, stored)
        assert mean >= 3 or share >= 0.01
