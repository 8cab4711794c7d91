"""Interactive views: what they hold, and that they need nothing else."""

import base64
import json
import re
from html import unescape

import numpy as np
import pytest
from cases import sphere_template, surfaces

from riemhuman.errors import ArgumentError, FileError
from riemhuman.plots.viewer import view_bodies, view_path
from riemhuman.plots.viewer_data import quantized
from riemhuman.plots.web_files import web_file

TEMPLATE = sphere_template()
PATH = surfaces(TEMPLATE, 4)


def payload_of(viewer):
    found = re.search(r'data-part="data">(.*?)</script>', viewer.fragment("one"), re.DOTALL)
    return json.loads(found[1])


def decoded(text, dtype):
    return np.frombuffer(base64.b64decode(text), dtype)


def test_coordinates_are_kept_to_half_a_step():
    packed, low, step = quantized(PATH)
    assert packed.dtype == np.uint16
    assert np.abs(low + step * packed - PATH).max() <= 0.5001 * step.max()
    assert step.max() < np.ptp(PATH) / 60000


def test_flat_surfaces_are_kept_too():
    packed, low, step = quantized(PATH * [1, 1, 0])
    assert not packed[..., 2].any()
    assert low[2] == 0
    assert np.isfinite(step).all()


def test_a_path_travels_whole():
    data = payload_of(view_path({"first": PATH, "second": PATH[::-1]}, TEMPLATE.faces))
    assert data["n_vertices"] == TEMPLATE.n_vertices
    np.testing.assert_array_equal(decoded(data["faces"], "<u2").reshape(-1, 3), TEMPLATE.faces)
    assert [choice["name"] for choice in data["choices"]] == ["first", "second"]
    for choice, path in zip(data["choices"], (PATH, PATH[::-1]), strict=True):
        (body,) = choice["bodies"]
        assert body["n_frames"] == 4
        packed = decoded(body["frames"], "<u2").reshape(PATH.shape)
        found = np.array(body["low"]) + np.array(body["step"]) * packed
        np.testing.assert_allclose(found, path, atol=1e-4)


def test_paths_side_by_side_are_one_choice():
    viewer = view_path({"a": PATH, "b": PATH}, TEMPLATE.faces, side_by_side=True, title="Both")
    (choice,) = payload_of(viewer)["choices"]
    assert [body["label"] for body in choice["bodies"]] == ["a", "b"]
    assert "<fieldset hidden>" in viewer.fragment("one")


def test_values_become_colours_of_vertices():
    values = np.zeros(TEMPLATE.n_faces)
    values[(TEMPLATE.faces == 5).any(axis=1)] = 1.0
    viewer = view_bodies(PATH[:2], TEMPLATE.faces, ["one", "two"], values=[values, 0 * values])
    (choice,) = payload_of(viewer)["choices"]
    colors = decoded(choice["bodies"][0]["colors"], np.uint8).reshape(-1, 3)
    assert len(colors) == TEMPLATE.n_vertices
    assert colors[5].tolist() == [0x8C, 0x1D, 0x3F]
    far = np.ones(TEMPLATE.n_vertices, bool)
    far[TEMPLATE.faces[(TEMPLATE.faces == 5).any(axis=1)]] = False
    assert (colors[far] == [0xD4, 0xC8, 0xBB]).all()


def test_large_bodies_are_thinned():
    large = sphere_template(5)
    data = payload_of(view_bodies(large.vertices, large.faces))
    assert data["n_vertices"] < 7000 < large.n_vertices
    assert decoded(data["faces"], "<u2").max() == data["n_vertices"] - 1


def test_the_page_asks_for_nothing():
    page = view_path(PATH, TEMPLATE.faces, title="A <path> & more").page()
    assert "<title>A &lt;path&gt; &amp; more</title>" in page
    without_scripts = re.sub(r"<script.*?</script>", "", page, flags=re.DOTALL)
    assert not re.findall(r'(?:src|href)="(?!data:)|url\(|@import|https?:', without_scripts)
    own = "".join(web_file(f"viewer{part}.js") for part in ("", "_body", "_gestures"))
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
        (lambda: view_path({}, TEMPLATE.faces), "path is empty"),
        (lambda: view_path(PATH[0], TEMPLATE.faces), "path must have shape"),
        (lambda: view_path({"a": PATH, "b": PATH[:, 1:]}, TEMPLATE.faces), "same vertices"),
        (lambda: view_bodies(PATH, TEMPLATE.faces, ["a"]), "names must .* found 1 for 4 bodies"),
        (lambda: view_bodies(PATH, TEMPLATE.faces + 100), "out of range"),
        (
            lambda: view_bodies(PATH, TEMPLATE.faces, values=np.ones(TEMPLATE.n_faces)),
            "values must .* found 1 for 4 bodies",
        ),
    ],
)
def test_bad_arguments(call, message):
    with pytest.raises(ArgumentError, match=message):
        call()
