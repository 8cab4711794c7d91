"""The open bodies have eyes in their sockets and darker folds; other meshes have neither."""

import numpy as np
import pytest
from build_occlusion import open_shares
from open_bodies import coarse_bodies

import riemhuman as rh
from riemhuman.kernels.rotations import rotation_matrix
from riemhuman.plots import View, ViewedBody, Viewer, render, view_bodies
from riemhuman.plots._looks import eyeball, eyes_of, shade_of, shades, topology_name
from riemhuman.plots.windows import Window

COARSE = coarse_bodies()
FULL = rh.datasets.load_open_model("full")
RESTS = {
    "coarse": (COARSE.template.vertices, COARSE.template.faces),
    "full": (FULL.template.vertices, FULL.faces),
}
IN_PAGE = """
const [body] = document.querySelector('.viewer').viewer.bodies();
const meshes = body.eyes ? body.eyes.meshes : [];
return meshes.map((mesh) => [...mesh.geometry.attributes[arguments[0]].array]);
"""


def face_picture(surface, faces, **settings):
    """Return the face of a body at rest, seen from the front, 200 pixels of 1 mm."""
    middle = float(surface[:, 1].max()) - 0.1
    window = Window((0.0, float(View(0.0, 0.0).rotate(np.array([0.0, middle, 0.0]))[1])), 0.2, 0.2)
    return render(surface, faces, height=200, view=View(0.0, 0.0), window=window, **settings)


@pytest.mark.parametrize("resolution", RESTS)
def test_eyes_look_ahead_between_the_lids(resolution, monkeypatch):
    surface, faces = RESTS[resolution]
    seen = face_picture(surface, faces)[..., :3].astype(int).sum(axis=-1)
    monkeypatch.setattr("riemhuman.plots.rendering.eyes_of", lambda faces: None)
    empty = face_picture(surface, faces)[..., :3].astype(int).sum(axis=-1)
    changed = np.argwhere(np.abs(seen - empty) > 20)
    for side in (-1, 1):
        rows, columns = changed[side * (changed[:, 1] - 100) > 0].T
        assert abs(columns.mean() - 100) == pytest.approx(32, abs=4)  # pupils are 6.4 cm apart
        assert np.ptp(rows) < 20
        assert 10 < np.ptp(columns) < 35
        brighter = (seen - empty)[rows, columns]
        assert (brighter > 100).sum() > 20  # the white of the eye
        assert seen[rows, columns].min() < 330  # the pupil


@pytest.mark.slow
def test_eyes_are_of_the_open_templates_alone():
    for surface, faces in RESTS.values():
        assert eyes_of(faces) is not None
        assert eyes_of(faces[::-1]) is None
        assert '"eyes":' in view_bodies(surface, faces).fragment("a")
        assert '"eyes":' not in view_bodies(surface, faces[::-1]).fragment("a")


def test_eyes_follow_bodies():
    surface, faces = RESTS["coarse"]
    eyes = eyes_of(faces)
    turn = rotation_matrix(np.array([0.3, -1.1, 0.4]))
    moved = 1.2 * surface @ turn.T + [1.0, 2.0, 3.0]
    expected = 1.2 * eyes.points(surface) @ turn.T + [1.0, 2.0, 3.0]
    np.testing.assert_allclose(eyes.points(moved), expected, atol=1e-6)


def test_the_eyes_of_a_coloured_body_have_its_colour():
    surface, faces = RESTS["coarse"]
    colors = np.tile([0.2, 0.4, 0.9], (len(surface), 1))
    picture = face_picture(surface, faces, color=colors)[..., :3].astype(int)
    drawn = picture.sum(axis=-1) > 0
    assert (picture[drawn, 2] > picture[drawn, 0]).all()


@pytest.mark.slow
@pytest.mark.parametrize("values", [None, "heights"])
def test_pages_draw_the_same_eyes(browser, tmp_path, values):
    surface, faces = COARSE.points[3], COARSE.template.faces
    heights = None if values is None else surface[:, 1]
    body = ViewedBody("", surface[None], values=heights)
    Viewer(faces, {"": [body]}).save(tmp_path / "page.html")
    browser.open_viewer(tmp_path / "page.html", 400, 400)
    eyes = eyes_of(faces)
    middle = (surface.min(axis=0) + surface.max(axis=0)) / 2
    shown = np.reshape(browser.run(IN_PAGE, "position"), (-1, 3))
    apart = shown - (eyes.points(surface) - middle)
    assert np.abs(apart - apart.mean(axis=0)).max() < 2e-4  # metres; the page rounds to 0.1 mm
    colors = np.reshape(browser.run(IN_PAGE, "color"), (2, -1, 3))
    if values is None:
        np.testing.assert_allclose(colors[0, :, 0], eyeball()[2], atol=0.5 / 255 + 1e-6)
    else:
        shares = eyeball()[2][:, np.newaxis]
        np.testing.assert_allclose(colors * shares[-1], colors[:, -1:] * shares, atol=1e-2)
    assert browser.console() == []


def test_the_ground_of_a_groove_sees_the_sky_between_its_walls():
    """A groove as deep as wide: of the middle of its ground 1 / √5 of the half-space is open."""
    outline = np.array(
        [[-1, -1], [1, -1], [1, 1], [0.5, 1], [0.5, 0], [0, 0], [-0.5, 0], [-0.5, 1], [-1, 1]]
    )
    lengths = np.linspace(-6, 6, 7)
    vertices = np.array([[x, y, z] for z in lengths for x, y in outline])
    n, faces = len(outline), []
    for k in range(len(lengths) - 1):
        for i in range(n):
            a, b = n * k + i, n * k + (i + 1) % n
            faces += [[a, b, b + n], [a, b + n, a + n]]
    shares = open_shares(vertices, np.array(faces), 256, 700)
    assert shares[n * 3 + 5] == pytest.approx(1 / np.sqrt(5), abs=0.05)


def test_what_is_stored_is_what_is_computed():
    vertices, faces = RESTS["coarse"]
    stored = shades()[topology_name(faces)]
    computed = open_shares(vertices, faces, 64, 500)
    assert np.mean(np.abs(stored - 0.2 - 0.8 * computed)) < 0.05
    assert shade_of(faces[::-1]) is None


def test_pages_hold_the_shade_of_known_templates():
    vertices, faces = RESTS["coarse"]
    assert '"shade":' in view_bodies(vertices, faces).fragment("a")
    assert '"shade":' not in view_bodies(vertices, faces[::-1]).fragment("a")
