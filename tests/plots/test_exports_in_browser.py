"""What leaves the page: pictures, surfaces and links."""

import base64
import io
import json

import numpy as np
import pytest
import trimesh
from open_bodies import coarse_bodies
from PIL import Image

from riemhuman.plots import ViewedBody, Viewer, view_path

BODIES = coarse_bodies()
FACES = BODIES.template.faces
CAUGHT = """
const [action, done] = arguments;
URL.createObjectURL = (blob) => {
  const reader = new FileReader();
  reader.onload = () => done([blob.type, reader.result.split(",")[1]]);
  reader.readAsDataURL(blob);
  return "about:blank#";
};
HTMLAnchorElement.prototype.click = () => {};
document.querySelector(`[data-export=${action}]`).click();
"""
STATE = """
const viewer = document.querySelector('.viewer').viewer;
const { yaw, pitch, zoom, panX, panY, time, chosen } = viewer;
return [yaw, pitch, zoom, panX, panY, time, chosen];
"""


@pytest.fixture
def opened(browser, tmp_path):
    """Return a function that opens the page of a viewer."""

    def open_page(viewer):
        viewer.save(tmp_path / "page.html")
        browser.open_viewer(tmp_path / "page.html", 700, 700)

    yield open_page
    assert browser.console() == []


@pytest.mark.slow
def test_pictures_and_surfaces_leave_with_their_names_and_colours(browser, opened):
    values = np.linspace(-1, 1, len(FACES))
    bodies = [
        ViewedBody("Anna", BODIES.points[:1]),
        ViewedBody("Ben", BODIES.points[3:4], values=values, value_label="mm"),
    ]
    opened(Viewer(FACES, {"": bodies}, title="Anna & Ben"))

    def exported(action):
        kind, text = browser.driver.execute_async_script(CAUGHT, action)
        return kind, base64.b64decode(text)

    kind, data = exported("png")
    assert kind == "image/png"
    picture = np.asarray(Image.open(io.BytesIO(data)))
    stage = browser.find(".stage").size
    assert picture.shape == (2 * stage["height"], 2 * stage["width"], 4)
    assert picture[0, 0, 3] == 0
    assert (picture[..., 3] == 255).mean() > 0.05
    label = browser.run(
        "const r = document.querySelector('.label').getBoundingClientRect();"
        "const s = document.querySelector('.stage').getBoundingClientRect();"
        "return [r.left - s.left, r.top - s.top, r.right - s.left, r.bottom - s.top]"
    )
    left, top, right, bottom = (round(2 * value) for value in label)
    assert picture[top:bottom, left:right, 3].max() > 200

    kind, data = exported("glb")
    assert kind == "model/gltf-binary"
    scene = trimesh.load(io.BytesIO(data), file_type="glb", process=False)
    for name, surface in (("Anna", BODIES.points[0]), ("Ben", BODIES.points[3])):
        mesh = scene.geometry[scene.graph[name][1]]
        assert np.array_equal(mesh.faces, FACES)
        shift = (surface.min(axis=0) + surface.max(axis=0)) / 2
        assert np.abs(mesh.vertices - (surface - shift)).max() < 1e-3
        lowest = mesh.vertices[:, 1].min() + scene.graph[name][0][1, 3]
        assert lowest == pytest.approx(0, abs=1e-3)
    (size,) = np.frombuffer(data[12:16], "<u4")
    contents = json.loads(data[20 : 20 + size])
    _, ben = (mesh["primitives"][0]["attributes"] for mesh in contents["meshes"])
    accessor = contents["accessors"][ben["COLOR_0"]]
    start = 28 + size + contents["bufferViews"][accessor["bufferView"]]["byteOffset"]
    colors = np.frombuffer(data, "<f4", 3 * accessor["count"], start).reshape(-1, 3)
    assert len(colors) == len(BODIES.points[0])
    assert len(np.unique(colors, axis=0)) > 50
    assert 0 <= colors.min() <= colors.max() <= 1


@pytest.mark.slow
def test_a_link_restores_what_is_seen(browser, opened, tmp_path):
    start, end = BODIES.points[[0, 3]]
    path = start + np.linspace(0, 1, 5)[:, None, None] * (end - start)
    opened(view_path({"there": path, "back": path[::-1]}, FACES))
    browser.run(
        "const v = document.querySelector('.viewer').viewer; v.turn(0.7, 0.2);"
        "v.magnify(2); v.move(30, -20); v.seek(0.4);"
        "document.querySelector('input[type=radio][value=\"1\"]').click();"
    )
    browser.wait_for("return document.querySelector('.viewer').viewer.chosen === 1")
    before = browser.run(STATE)
    browser.run("document.querySelector('[data-export=link]').click()")
    browser.wait_for("return location.hash.length > 1")
    address = browser.driver.current_url
    browser.driver.get("about:blank")
    browser.driver.get(address)
    browser.wait_for("return document.querySelector('.viewer').dataset.ready")
    assert browser.run(STATE) == pytest.approx(before, abs=1e-3)
    # What is not a view is ignored, as is a vertex that there is not.
    for wrong in ("1,x", "0,0,1,0,0,0,0,-1", f"0,0,1,0,0,0,0,{len(BODIES.points[0])}"):
        browser.driver.get("about:blank")
        browser.driver.get(address.split("=")[0] + f"={wrong}")
        browser.wait_for("return document.querySelector('.viewer').dataset.ready")
        assert browser.run(STATE)[-1] == 0
        pivot = "document.querySelector('.viewer').viewer.bodies()[0].pivot"
        assert browser.run(f"return {pivot}") is None
