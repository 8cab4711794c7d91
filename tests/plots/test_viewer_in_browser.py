"""Every ability of the viewer, by events of a real mouse, keyboard and fingers."""

import base64
import io
import re
import time

import numpy as np
import pytest
from open_bodies import coarse_bodies
from PIL import Image

from riemhuman.datasets import load_open_bodies
from riemhuman.measurements import open_measurements
from riemhuman.plots import View, ViewedBody, Viewer, render, view_bodies, view_path
from riemhuman.plots.windows import Window
from riemhuman.surfaces import nearest_points

BODIES = coarse_bodies()
FACES = BODIES.template.faces
SIZE = (1000, 760)
# Pixels from the middle of the stage to the belly of the first body.
BELLY = """
const { viewer } = document.querySelector('.viewer');
const [body] = viewer.bodies();
const { x, y } = body.holder.position;
return [x, -y - 0.1 * body.height].map((metres) => Math.round(metres / viewer.metresPerPixel()));
"""
WITHOUT_WEBGL = "HTMLCanvasElement.prototype.getContext = () => null"


def viewer_of(name):
    """Return coloured bodies, one body, or paths to choose from."""
    first, values = BODIES.points[:1], np.linspace(0, 2, len(FACES))
    if name == "one":
        return view_bodies(first[0], FACES)
    if name == "bodies":
        coloured = [
            ViewedBody(label, surface[None], values=values, value_label="per m²")
            for label, surface in zip(["Anna", "Ben"], BODIES.points, strict=False)
        ]
        return Viewer(FACES, {"": coloured})
    start, end = BODIES.points[[0, 3]]
    path = start + np.linspace(0, 1, 5)[:, None, None] * (end - start)
    return view_path({"there": path, "back": path[::-1]}, FACES, seconds=1.2)


@pytest.fixture(scope="module")
def page_of(tmp_path_factory):
    """Return a function that returns the file of a page, which it writes once."""
    folder = tmp_path_factory.mktemp("pages")

    def written(name):
        file = folder / f"{name}.html"
        if not file.exists():
            viewer_of(name).save(file)
        return file

    return written


@pytest.fixture
def opened(browser, page_of):
    """Return a function that opens a page and waits for its viewer."""

    def open_page(name, width=SIZE[0], height=SIZE[1]):
        browser.open_viewer(page_of(name), width, height)
        return browser.find("canvas")

    yield open_page
    assert browser.console() == []


def state(browser, key):
    return float(browser.run(f"return document.querySelector('.viewer').dataset.{key}"))


def world(browser, right, below):
    """Return what is at a place, from the middle of the stage, in metres."""
    scale = state(browser, "scale")
    return state(browser, "panX") + right / scale, state(browser, "panY") - below / scale


def boxes(browser, selector):
    """Return left, top, right and bottom of the elements that are seen."""
    return browser.run(
        "return [...document.querySelectorAll(arguments[0])]"
        ".filter((e) => e.checkVisibility({visibilityProperty: true}))"
        ".map((e) => e.getBoundingClientRect())"
        ".map((r) => [r.left, r.top, r.right, r.bottom])",
        selector,
    )


def reset(browser):
    browser.run("document.querySelector('[data-action=reset]').click()")


def test_mouse_turns_moves_and_zooms(browser, opened):
    canvas = opened("bodies")
    yaw = state(browser, "yaw")
    browser.actions().drag_and_drop_by_offset(canvas, 120, 0).perform()
    assert state(browser, "yaw") == pytest.approx(yaw + 1.0, abs=0.02)
    assert state(browser, "panX") == 0
    yaw = state(browser, "yaw")
    for how in ({"shift": True}, {"button": 2}):
        reset(browser)
        scale = state(browser, "scale")
        browser.drag(canvas, 90, -60, **how)
        assert state(browser, "panX") * scale == pytest.approx(-90, abs=1)
        assert state(browser, "panY") * scale == pytest.approx(-60, abs=1)
    reset(browser)
    place = (150, -80)
    before = world(browser, *place)
    browser.wheel(canvas, *place, -300)
    browser.wait_for("return Number(document.querySelector('.viewer').dataset.zoom) > 1.5")
    assert world(browser, *place) == pytest.approx(before, abs=1e-3)
    browser.wheel(canvas, *place, 300)
    browser.wait_for("return Number(document.querySelector('.viewer').dataset.zoom) < 1.01")


def belly(browser):
    return tuple(browser.run(BELLY))


@pytest.mark.slow
def test_mouse_names_body_and_value_and_frames_a_point(browser, opened):
    canvas = opened("bodies")
    hint_is_shown = "return !document.querySelector('[data-part=hint]').hidden"
    on_the_left_body = belly(browser)
    browser.actions().move_to_element_with_offset(canvas, *on_the_left_body).perform()
    browser.wait_for(hint_is_shown)
    hint = browser.run("return document.querySelector('[data-part=hint]').textContent")
    name, value = hint.rsplit(": ", 1)
    assert name == "Anna"
    number, said = value.split(" ", 1)
    part = re.fullmatch(r"per m² \((.*)\)", said)[1]
    # Values grow with the number of the triangle: the value tells which one it is.
    triangle = round(float(number) / 2 * (len(FACES) - 1))
    assert triangle in open_measurements("coarse").parts[part]
    assert np.ptp(BODIES.points[0, FACES[triangle]], axis=0).max() < 0.2
    assert 0.4 < BODIES.points[0, FACES[triangle], 1].mean() - BODIES.points[0, :, 1].min() < 1.6
    browser.actions().move_to_element_with_offset(canvas, 0, -300).perform()
    browser.wait_for("return document.querySelector('[data-part=hint]').hidden")

    before = state(browser, "zoom")
    browser.double_click(canvas, *on_the_left_body)
    assert state(browser, "zoom") > 3 * before
    assert state(browser, "panX") < 0
    # Turning keeps what was framed in the middle.
    browser.actions().drag_and_drop_by_offset(canvas, 60, 0).perform()
    browser.actions().move_to_element_with_offset(canvas, 1, 0).perform()
    browser.wait_for(hint_is_shown)
    browser.press("\ue011")  # Home
    assert state(browser, "zoom") == before


@pytest.mark.slow
def test_the_light_is_that_of_our_own_pictures(browser, page_of):
    """Compare the body's middle in the page with our renderer's: it stands on no ground there."""
    browser.open_viewer(page_of("one"), 600, 700)
    left, top, right, bottom = (round(x) for x in boxes(browser, "canvas")[0])
    browser.wait_for_picture()
    shot = base64.b64decode(browser.devtools("Page.captureScreenshot", format="png")["data"])
    screen = np.asarray(Image.open(io.BytesIO(shot)).convert("RGB")).astype(int)
    shown = screen[top:bottom, left:right]
    surface = BODIES.points[0]
    middle = View().rotate((surface.min(axis=0) + surface.max(axis=0)) / 2)
    scale = state(browser, "scale")
    height, width = shown.shape[:2]
    place = "return document.querySelector('.viewer').viewer.bodies()[0].holder.position.y"
    lifted = browser.run(place)  # there is more room for the ground than above
    window = Window((middle[0], middle[1] - lifted), width / scale, height / scale)
    drawn = render(surface, FACES, height=height, window=window)
    drawn = drawn[:, :width].astype(int)
    inside = drawn[..., 3] == 255
    apart = np.abs(shown[:, : drawn.shape[1]] - drawn[..., :3]).max(axis=-1)[inside]
    assert inside.sum() > 5000
    assert np.median(apart) < 8
    assert np.mean(apart > 40) < 0.1  # at outlines, which a perspective moves
    assert browser.console() == []


@pytest.mark.slow
def test_fingers_turn_zoom_move_and_frame(browser, opened):
    opened("bodies", 400, 760)
    left_edge, top, right_edge, bottom = boxes(browser, "canvas")[0]
    x, y = (left_edge + right_edge) / 2, (top + bottom) / 2
    before = state(browser, "yaw")
    browser.touch("touchStart", (x, y))
    for moved in (20, 40, 60):
        browser.touch("touchMove", (x + moved, y))
    browser.touch("touchEnd")
    assert state(browser, "yaw") == pytest.approx(before + 0.5, abs=0.2)
    y = top + (bottom - top) * 0.25  # above the colour bar, whose ends can be dragged
    browser.touch("touchStart", (x - 40, y), (x + 40, y))
    browser.touch("touchMove", (x - 60, y), (x + 60, y))
    browser.touch("touchMove", (x - 80, y + 20), (x + 80, y + 20))
    browser.touch("touchEnd")
    browser.wait_for("return Number(document.querySelector('.viewer').dataset.zoom) > 1.9")
    assert state(browser, "zoom") == pytest.approx(2.0, abs=0.05)
    assert state(browser, "panY") > 0
    reset(browser)
    right, below = belly(browser)
    torso = ((left_edge + right_edge) / 2 + right, (top + bottom) / 2 + below)
    now = time.time()
    for seconds in (0.0, 0.2):  # a double tap, however long its events take
        browser.touch("touchStart", torso, at=now + seconds)
        browser.touch("touchEnd", at=now + seconds + 0.05)
    browser.wait_for("return Number(document.querySelector('.viewer').dataset.zoom) > 3")


@pytest.mark.slow
def test_keys_turn_move_zoom_and_frame(browser, opened):
    canvas = opened("bodies")
    browser.press("\ue004")  # Tab: the view is the first thing the keyboard comes to
    assert browser.run("return document.activeElement === arguments[0]", canvas)
    yaw = state(browser, "yaw")
    browser.press("\ue014")
    assert state(browser, "yaw") > yaw
    browser.actions().key_down("\ue008").send_keys("\ue014").key_up("\ue008").perform()
    assert state(browser, "panX") > 0
    browser.press("+")
    assert state(browser, "zoom") > 1
    browser.press("\ue011")
    assert (state(browser, "zoom"), state(browser, "panX"), state(browser, "yaw")) == (1, 0, yaw)


@pytest.mark.slow
def test_paths_play_by_key_slider_speed_and_loop(browser, opened):
    opened("paths")
    browser.find("[data-part=loop]").click()  # it plays until it is paused
    browser.find("canvas").click()
    browser.press(" ")
    browser.wait_for("return Number(document.querySelector('.viewer').dataset.time) > 0.05")
    label = "return document.querySelector('[data-part=play]').textContent"
    assert browser.run(label) == "Pause"
    browser.press(" ")
    assert browser.run(label) == "Play"
    slider = browser.find("input[type=range]")
    browser.run("arguments[0].focus()", slider)
    browser.press("\ue010")  # End
    assert state(browser, "time") == 1
    assert slider.get_attribute("aria-valuetext") == "100 % of the path"
    browser.press("\ue011")
    browser.find("select option[value='2']").click()
    browser.find("[data-part=play]").click()
    browser.wait_for("return Number(document.querySelector('.viewer').dataset.time) > 0.6")
    browser.wait_for("return Number(document.querySelector('.viewer').dataset.time) < 0.4")
    assert browser.run(label) == "Pause"
    browser.find("[data-part=loop]").click()
    browser.wait_for("return document.querySelector('.viewer').dataset.time === '1.000'")
    browser.wait_for(f"{label} === 'Play'")


@pytest.mark.slow
def test_stills_stand_in_where_there_is_no_webgl(browser, page_of):
    added = browser.devtools("Page.addScriptToEvaluateOnNewDocument", source=WITHOUT_WEBGL)
    browser.open(page_of("paths"), *SIZE)
    browser.wait_for("return !document.querySelector('[data-part=message]').hidden")
    shown = "return [...document.querySelectorAll('.still')].map((e) => e.checkVisibility())"
    assert browser.run(shown) == [True, False]
    assert browser.find(".still").size["height"] > 200
    browser.find("input[type=radio][value='1']").click()
    assert browser.run(shown) == [False, True]
    assert not browser.find("[data-part=play]").is_displayed()
    browser.devtools("Page.removeScriptToEvaluateOnNewDocument", **added)


@pytest.mark.slow
def test_the_last_choice_is_shown(browser, opened):
    """Though an earlier one takes longer, because its bodies are built first."""
    opened("paths")
    chosen = browser.run(
        "const { viewer } = document.querySelector('.viewer');"
        "return Promise.all([viewer.choose(1), viewer.choose(0)]).then(() => viewer.chosen)"
    )
    assert chosen == 0
    assert browser.run("return document.querySelector('.viewer').dataset.choice") == "there"


SMOOTH = """
const { viewer } = document.querySelector('.viewer');
const [body] = viewer.bodies();
const { attributes, index } = body.mesh.geometry;
const lists = (arrays) => arrays.map((array) => [...array]);
const triangles = [0, 5, 1234].map((face) => body.smooth.faceOf(16 * face + 7));
return [...lists([body.positions, attributes.position.array, index.array]), triangles];
"""


@pytest.mark.slow
def test_coarse_bodies_are_drawn_nearer_to_the_full_ones(browser, opened):
    opened("one")
    *arrays, triangles = browser.run(SMOOTH)
    own, points = (np.reshape(array, (-1, 3)) for array in arrays[:2])
    fine = np.reshape(arrays[2], (-1, 3))
    np.testing.assert_array_equal(points[: len(own)], own)
    assert (len(fine), triangles) == (16 * len(FACES), [0, 5, 1234])
    middle = (BODIES[0].min(axis=0) + BODIES[0].max(axis=0)) / 2
    full = load_open_bodies("full")[0] - middle
    flat, smooth = (
        nearest_points(full, vertices, faces)[1].mean()
        for vertices, faces in ((own, FACES), (points, fine))
    )
    assert smooth < 0.9 * flat
