"""Interactive views: what they hold, and that they need nothing else."""

import base64
import json
import re
import zlib
from html import unescape
from pathlib import Path

import numpy as np
import pytest
from cases import sphere_template, surfaces

import riemhuman as rh
from riemhuman.errors import ArgumentError, FileError, FileFormatError
from riemhuman.plots import ViewedBody, Viewer, view_bodies, view_path
from riemhuman.plots.viewer import page_scripts

TEMPLATE = sphere_template()
KIND = "application/vnd.riemhuman.viewer+html"  # of outputs in notebooks
PATH = surfaces(TEMPLATE, 4)


def payload_of(viewer):
    found = re.search(r'data-part="data">(.*?)</script>', viewer.fragment("one"), re.DOTALL)
    return json.loads(found[1])


def inflated(text, dtype):
    return np.frombuffer(zlib.decompress(base64.b64decode(text)), dtype)


def unpacked(text, dtype, width):
    """Return rows of whole numbers as the script of the page restores them."""
    size = np.dtype(dtype).itemsize
    planes = inflated(text, np.uint8).reshape(size, -1).astype(dtype)
    differences = sum(plane << dtype(8 * byte) for byte, plane in enumerate(planes))
    return np.cumsum(differences.reshape(-1, width), axis=0, dtype=dtype)


def test_a_path_travels_whole():
    data = payload_of(view_path({"first": PATH, "second": PATH[::-1]}, TEMPLATE.faces, seconds=7))
    assert data["seconds"] == 7
    assert data["n_vertices"] == TEMPLATE.n_vertices
    np.testing.assert_array_equal(unpacked(data["faces"], np.uint32, 3), TEMPLATE.faces)
    assert [choice["name"] for choice in data["choices"]] == ["first", "second"]
    for choice, path in zip(data["choices"], (PATH, PATH[::-1]), strict=True):
        (body,) = choice["bodies"]
        assert body["n_frames"] == 4
        packed = unpacked(body["frames"], np.uint16, PATH[0].size).reshape(PATH.shape)
        found = np.array(body["low"]) + np.array(body["step"]) * packed
        assert max(body["step"]) <= 1e-4  # metres
        assert np.abs(found - path).max() <= 0.5001 * max(body["step"])


def test_recordings_say_their_rate_and_other_paths_do_not():
    recorded = payload_of(view_path(PATH, TEMPLATE.faces, frames_per_second=30))
    assert recorded["frames_per_second"] == 30
    assert "frames_per_second" not in payload_of(view_path(PATH, TEMPLATE.faces, seconds=3))
    with pytest.raises(ArgumentError, match="either seconds or frames_per_second"):
        view_path(PATH, TEMPLATE.faces, seconds=3, frames_per_second=30)
    with pytest.raises(ArgumentError, match="frames_per_second"):
        view_path(PATH, TEMPLATE.faces, frames_per_second=0)


def test_values_become_colours_of_vertices():
    values = np.zeros(TEMPLATE.n_faces)
    values[(TEMPLATE.faces == 5).any(axis=1)] = 1.0
    viewer = Viewer(TEMPLATE.faces, {"": [ViewedBody("one", PATH[:1], values=values)]})
    (choice,) = payload_of(viewer)["choices"]
    colors = inflated(choice["bodies"][0]["colors"], np.uint8).reshape(-1, 3)
    assert len(colors) == TEMPLATE.n_vertices
    assert colors[5].tolist() == [0x8C, 0x1D, 0x3F]
    far = np.ones(TEMPLATE.n_vertices, bool)
    far[TEMPLATE.faces[(TEMPLATE.faces == 5).any(axis=1)]] = False
    assert (colors[far] == [0xD4, 0xC8, 0xBB]).all()


def test_values_may_be_those_of_vertices():
    heights = PATH[0, :, 1] - PATH[0, :, 1].min()
    viewer = Viewer(TEMPLATE.faces, {"": [ViewedBody("one", PATH[:1], values=heights)]})
    body = payload_of(viewer)["choices"][0]["bodies"][0]
    np.testing.assert_allclose(inflated(body["values"], "<f4"), heights, rtol=1e-6)
    colors = inflated(body["colors"], np.uint8).reshape(-1, 3)
    assert colors[heights.argmin()].tolist() == [0xD4, 0xC8, 0xBB]
    assert colors[heights.argmax()].tolist() == [0x8C, 0x1D, 0x3F]
    with pytest.raises(ArgumentError, match="per triangle .* or vertex"):
        Viewer(TEMPLATE.faces, {"": [ViewedBody("one", PATH[:1], values=heights[1:])]})


def test_parts_are_those_given_or_of_the_open_model():
    assert "parts" not in payload_of(view_bodies(PATH[0], TEMPLATE.faces))
    halves = {"left": np.arange(10), "right": np.arange(10, TEMPLATE.n_faces - 1)}
    one = {"": [ViewedBody("one", PATH[:1])]}
    parts = payload_of(Viewer(TEMPLATE.faces, one, parts=halves))["parts"]
    assert parts["names"] == ["left", "right"]
    numbers = inflated(parts["numbers"], np.uint8)
    assert numbers.tolist() == [0] * 10 + [1] * (TEMPLATE.n_faces - 11) + [255]
    with pytest.raises(ArgumentError, match="part 'left' must hold triangles from 0"):
        Viewer(TEMPLATE.faces, one, parts={"left": [TEMPLATE.n_faces]}).page()
    bodies = rh.datasets.load_open_bodies("coarse")
    parts = payload_of(view_bodies(bodies[0], bodies.template.faces))["parts"]
    assert {"head", "left arm", "right leg"} <= set(parts["names"])


def test_negative_values_keep_their_sign():
    values = np.where((TEMPLATE.faces == 5).any(axis=1), -2.0, 1.0)
    bodies = [ViewedBody("one", PATH[:1], values=v) for v in (values, np.abs(values))]
    signed, plain = payload_of(Viewer(TEMPLATE.faces, {"": bodies}))["choices"][0]["bodies"]
    assert (signed["signed"], plain["signed"]) == (True, False)
    assert signed["scale"][-4:] == plain["scale"]
    red, _, blue = inflated(signed["colors"], np.uint8).reshape(-1, 3)[5].tolist()
    assert blue > red + 60
    red, _, blue = inflated(plain["colors"], np.uint8).reshape(-1, 3)[5].tolist()
    assert red > blue + 60


def test_viewers_stored_with_tutorials_have_what_the_scripts_read():
    current = payload_of(view_path(PATH, TEMPLATE.faces))
    stored = []
    for path in (Path(__file__).parents[2] / "tutorials").glob("*.ipynb"):
        cells = json.loads(path.read_text(encoding="utf-8"))["cells"]
        shown = [output.get("data", {}) for cell in cells for output in cell.get("outputs", [])]
        stored += ["".join(data[KIND]) for data in shown if KIND in data]
    assert len(stored) >= 3
    for fragment in stored:
        data = json.loads(re.search(r'data-part="data">(.*?)</script>', fragment, re.DOTALL)[1])
        assert data.keys() >= current.keys()
        assert data["choices"][0].keys() == current["choices"][0].keys()


def test_the_page_asks_for_nothing():
    page = view_path(PATH, TEMPLATE.faces, title="A <path> & more").page()
    assert "<title>A &lt;path&gt; &amp; more</title>" in page
    without_scripts = re.sub(r"<script.*?</script>", "", page, flags=re.DOTALL)
    assert not re.findall(r'(?:src|href)="(?!data:)|url\(|@import|https?:', without_scripts)
    own = page_scripts().split("<script>")[-1]
    assert not re.findall(r"fetch|XMLHttpRequest|import\(|https?:", own)
    identifiers = re.findall(r'\bid="([^"]+)"', without_scripts)
    assert len(identifiers) == len(set(identifiers)) > 1


def test_names_cannot_end_the_script():
    viewer = view_path({"</script><b>": PATH}, TEMPLATE.faces)
    assert "</script><b>" not in viewer.fragment("one")
    assert payload_of(viewer)["choices"][0]["name"] == "</script><b>"


def test_notebooks_show_the_page_in_a_frame():
    viewer = view_bodies(PATH[0], TEMPLATE.faces)
    shown = viewer._repr_html_()
    assert shown.startswith("<iframe")
    assert unescape(re.search(r'srcdoc="(.*)"></iframe>', shown, re.DOTALL)[1]) == viewer.page()


def test_saved_whole(tmp_path):
    viewer = view_bodies(PATH[0], TEMPLATE.faces)
    viewer.save(tmp_path / "body.html")
    assert (tmp_path / "body.html").read_text(encoding="utf-8") == viewer.page()
    with pytest.raises(FileError, match=r"absent.*cannot be written"):
        viewer.save(tmp_path / "absent" / "body.html")


def test_the_ending_says_what_is_written(tmp_path):
    viewer = view_bodies(PATH[:2], TEMPLATE.faces)
    viewer.save(tmp_path / "two.png")
    assert (tmp_path / "two.png").read_bytes().startswith(b"\x89PNG")
    for name in ("a.avi", "a.webm", "a", "a.htmlx"):
        with pytest.raises(FileFormatError, match=r"the ending must be .*\.html.*found"):
            viewer.save(tmp_path / name)
    assert [path.name for path in tmp_path.iterdir()] == ["two.png"]


def test_pictures_have_an_ending_that_says_so_and_a_name_for_each_body(tmp_path):
    for name, names, message in (
        ("x.jpg", "abcd", r"path must end in .png or .html; found .*x\.jpg"),
        ("x.png", "abc", "found 3 for 4 bodies"),
        ("x.html", "abcde", "found 5 for 4 bodies"),
    ):
        with pytest.raises(ArgumentError, match=message):
            rh.plots.save_picture(tmp_path / name, PATH, TEMPLATE.faces, list(names))
    assert not list(tmp_path.iterdir())


def test_pages_stay_small():
    assert len(page_scripts()) < 650_000
    bodies = rh.datasets.load_open_bodies("coarse")
    page = view_bodies(bodies.points[0], bodies.template.faces).page()
    assert len(page) - len(page_scripts()) < 250_000


def test_the_library_is_the_one_described():
    import hashlib
    from importlib.resources import files

    folder = files("riemhuman.plots") / "web"
    digest = hashlib.sha256((folder / "three.min.js").read_bytes()).hexdigest()
    assert digest in (folder / "README.md").read_text(encoding="utf-8")
    assert "MIT" in (folder / "three.LICENSE").read_text(encoding="utf-8")


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: view_path({}, TEMPLATE.faces), "at least one body"),
        (lambda: view_path(PATH[0], TEMPLATE.faces), "path must have shape"),
        (lambda: view_path({"a": PATH, "b": PATH[:, 1:]}, TEMPLATE.faces), "same vertices"),
        (lambda: view_bodies(PATH, TEMPLATE.faces, ["a"]), "names must .* found 1 for 4 bodies"),
        (lambda: view_bodies(PATH, TEMPLATE.faces + 100), "out of range"),
    ],
)
def test_bad_arguments(call, message):
    with pytest.raises(ArgumentError, match=message):
        call()
