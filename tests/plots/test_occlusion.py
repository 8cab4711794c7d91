"""Folds of bodies are darker than what all light reaches."""

import numpy as np
import pytest
from build_occlusion import open_shares

import riemhuman as rh
from riemhuman.plots import view_bodies
from riemhuman.plots._occlusion import _stored, shade_of, topology_name

MODEL = rh.datasets.load_open_model("coarse")


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
    stored = _stored()[topology_name(MODEL.faces)]
    computed = open_shares(MODEL.template.vertices, MODEL.faces, 64, 500)
    assert np.mean(np.abs(stored - 0.2 - 0.8 * computed)) < 0.05
    assert shade_of(MODEL.faces[::-1]) is None


def test_pages_hold_the_shade_of_known_templates():
    assert '"shade":' in view_bodies(MODEL.template.vertices, MODEL.faces).fragment("a")
    reversed_faces = MODEL.faces[::-1]
    assert '"shade":' not in view_bodies(MODEL.template.vertices, reversed_faces).fragment("a")
