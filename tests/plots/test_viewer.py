"""Interactive views: what they hold, and that they need nothing else."""

import json
import re
from html import unescape
from pathlib import Path

import numpy as np
import PIL.Image
import pytest
from cases import sphere_template, surfaces
from page_data import data_of, unpacked

import riemhuman as rh
from riemhuman.errors import ArgumentError, FileError, FileFormatError
from riemhuman.plots import ViewedBody, Viewer, figures, view_bodies, view_path
from riemhuman.plots.standing import on_the_ground
from riemhuman.plots.viewed_bodies import body_record
from riemhuman.plots.viewer import page_scripts

TEMPLATE = sphere_template()
KIND = "application/vnd.riemhuman.viewer+html"  # of outputs in notebooks
PATH = surfaces(TEMPLATE, 4)


@pytest.fixture(autouse=True)
def small_pictures(monkeypatch):
    """Draw the pictures of pages faster, with a fifth of their height."""

    def picture(self, bodies, height):
        return draw(self, bodies, height // 5)

    draw = Viewer._picture
    monkeypatch.setattr(Viewer, "_picture", picture)


def test_a_path_travels_whole():
    data = data_of(view_path({"first": PATH, "second": PATH[::-1]}, TEMPLATE.faces, seconds=7))
    assert data["seconds"] == 7
    assert data["n_vertices"] == TEMPLATE.n_vertices
    np.testing.assert_array_equal(unpacked(data["faces"], np.uint32, 3), TEMPLATE.faces)
    assert [choice["name"] for choice in data["choices"]] == ["first", "second"]
    for choice, path in zip(data["choices"], (PATH, PATH[::-1]), strict=True):
        (body,) = choice["bodies"]
        assert body["n_frames"] == 4
        assert body == body_record(ViewedBody("", on_the_ground(path)), TEMPLATE.faces)


def test_recordings_say_their_rate_and_other_paths_do_not():
    recorded = data_of(view_path(PATH, TEMPLATE.faces, frames_per_second=30))
    assert recorded["frames_per_second"] == 30
    assert "frames_per_second" not in data_of(view_path(PATH, TEMPLATE.faces, seconds=3))


def test_parts_are_those_of_the_open_model():
    assert "parts" not in data_of(view_bodies(PATH[0], TEMPLATE.faces))
    bodies = rh.datasets.load_open_bodies("coarse")
    parts = data_of(view_bodies(bodies[0], bodies.template.faces))["parts"]
    assert {"head", "left arm", "right leg"} <= set(parts["names"])


def test_viewers_stored_with_tutorials_have_what_the_scripts_read():
    current = data_of(view_path(PATH, TEMPLATE.faces))
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
    script = page_scripts().split("<script>")[-1]
    assert not re.findall(r"fetch|XMLHttpRequest|import\(|https?:", script)


def test_names_cannot_end_the_script():
    viewer = view_path({"</script><b>": PATH}, TEMPLATE.faces)
    assert "</script><b>" not in viewer.fragment("one")
    assert data_of(viewer)["choices"][0]["name"] == "</script><b>"


def test_the_ending_says_what_is_written(tmp_path):
    viewer = view_bodies(PATH[:2], TEMPLATE.faces)
    viewer.save(tmp_path / "two.html")
    page = (tmp_path / "two.html").read_text(encoding="utf-8")
    assert page == viewer.page()
    shown = viewer._repr_html_()  # in notebooks, a frame
    assert unescape(re.search(r'srcdoc="(.*)"></iframe>', shown, re.DOTALL)[1]) == page
    viewer.save(tmp_path / "two.png")
    assert (tmp_path / "two.png").read_bytes().startswith(b"\x89PNG")
    with pytest.raises(FileError, match=r"absent.*cannot be written"):
        viewer.save(tmp_path / "absent" / "body.html")
    for name in ("a.avi", "a", "a.htmlx"):
        with pytest.raises(FileFormatError, match=r"the ending must be .*\.html.*found"):
            viewer.save(tmp_path / name)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["two.html", "two.png"]


def test_names_and_colors_of_bodies():
    mean = [0.9, 0.7, 0.3]
    (body, _) = view_bodies(PATH[:2], TEMPLATE.faces, colors=[mean, mean]).choices["Bodies"]
    assert body.color == tuple(mean)
    with pytest.raises(ArgumentError, match="colors must have shape"):
        view_bodies(PATH[:2], TEMPLATE.faces, colors=[mean])
    # Whole numbers are names, too.
    numbered = view_bodies(PATH, TEMPLATE.faces, [1, 2, 3, np.int64(4)])
    assert [body.label for body in numbered.choices["Bodies"]] == ["1", "2", "3", "4"]


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: view_path({}, TEMPLATE.faces), "at least one body"),
        (lambda: view_path(PATH[0], TEMPLATE.faces), "path must have shape"),
        (lambda: view_path({"a": PATH, "b": PATH[:, 1:]}, TEMPLATE.faces), "same vertices"),
        (lambda: view_bodies(PATH, TEMPLATE.faces, ["a"]), "each of the 4 bodies; found 1"),
        (lambda: view_bodies(PATH, TEMPLATE.faces + 100), "out of range"),
        (
            lambda: view_path(PATH, TEMPLATE.faces, seconds=3, frames_per_second=30),
            "either seconds or frames_per_second",
        ),
        (lambda: view_path(PATH, TEMPLATE.faces, frames_per_second=0), "frames_per_second"),
        (
            lambda: Viewer(TEMPLATE.faces, {"": [ViewedBody("", PATH[:1], values=np.ones(41))]}),
            "per triangle .* or vertex",
        ),
    ],
)
@pytest.mark.everyday
def test_bad_arguments(call, message):
    with pytest.raises(ArgumentError, match=message):
        call()


def test_long_recordings_are_shown_at_fewer_frames_a_second():
    model = rh.datasets.load_open_model("coarse")
    poses, betas = np.zeros((10_001, model.n_joints, 3)), np.zeros(model.n_betas)
    poses[:, 0, 1] = np.linspace(0.0, 1.0, len(poses))
    motion = rh.datasets.ArrayMotion(("ann", "turn"), 120.0, model, betas, poses, poses[:, 1])
    viewer = view_path(motion, frames_per_second=120)
    (body,) = viewer.choices[""]
    assert (len(body.frames), viewer.frames_per_second) == (2501, 30.0)
    np.testing.assert_array_equal(body.frames.pose_vectors, poses[::4])
    assert "Showing one in 4 frames." in viewer.page()


@pytest.mark.parametrize("has_matplotlib", [True, False])
def test_pictures_write_the_names_of_several_bodies(tmp_path, monkeypatch, has_matplotlib):
    if not has_matplotlib:
        monkeypatch.setattr(figures, "find_spec", lambda _: None)
    pictures = []
    for names in (["", ""], ["Anna", "Gyöngyi"]):
        view_bodies(PATH[:2], TEMPLATE.faces, names).save(tmp_path / "two.png")
        pictures.append(np.asarray(PIL.Image.open(tmp_path / "two.png")))
    without, named = pictures
    np.testing.assert_array_equal(named[: len(without)], without)
    half = named.shape[1] // 2
    below = named[len(without) :, :, 3] > 0
    assert below[:, :half].any()
    assert below[:, half:].sum() > below[:, :half].sum()
