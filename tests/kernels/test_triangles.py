"""First derivatives of surfaces in compiled loops, against NumPy and autograd."""

import autograd.numpy as anp
import numpy as np
import pytest
from cases import open_template, surfaces

from riemhuman.kernels import triangles
from riemhuman.kernels.surface import DEGENERATE
from riemhuman.kernels.threads import of_one_kind
from riemhuman.kernels.triangles import by_vertex

TEMPLATE = open_template()
FACES, FRAMES = TEMPLATE.faces, TEMPLATE.frame_coefficients
OPERATOR = TEMPLATE.differential_operator.toarray()
PATH = surfaces(TEMPLATE, 3, rng=3)
FLAT = 5


def parts(f):
    """Return f_u, f_v, their cross product and its length, each of all triangles."""
    f_u, f_v = anp.reshape(anp.dot(OPERATOR, f), (2, -1, 3))
    crossed = anp.cross(f_u, f_v)
    return f_u, f_v, crossed, anp.sqrt(anp.sum(crossed**2, axis=1))


def test_derivatives_of_one_triangle():
    f, both = by_vertex(PATH), np.empty(6)
    for t in (0, 7):
        triangles.derivatives.py_func(f, 1, FACES[t], FRAMES[t], both)
        f_u, f_v, *_ = parts(PATH[1])
        np.testing.assert_allclose(both, [*f_u[t], *f_v[t]], atol=1e-13)


def test_forms_of_one_triangle(monkeypatch):
    monkeypatch.setattr(triangles, "first_forms", triangles.first_forms.py_func)
    for t in (0, 7):
        f_u, f_v, crossed, areas = (part[t] for part in parts(PATH[0]))
        found = triangles.triangle.py_func(PATH[0], FACES, FRAMES, t)
        expected = [f_u @ f_u, f_u @ f_v, *crossed, areas]
        np.testing.assert_allclose(found, expected, atol=1e-13)


@pytest.mark.parametrize("share", [0.99, 1.01], ids=["below", "above"])
def test_how_thin_a_triangle_may_be(share):
    """Whatever the lengths of its sides: the sine of the angle between them counts."""
    for along, across in ((1e-3, 1e3), (1e3, 1e-3), (30.0, 20.0)):
        height = across * share * np.sqrt(DEGENERATE)
        *_, area = triangles.first_forms.py_func(along, 0.0, 0.0, across, height, 0.0)
        assert area == pytest.approx(along * height if share > 1 else 0.0, rel=1e-12)


@pytest.mark.parametrize("at", [0.0, 0.4, 1.0], ids=str)
def test_triangles_without_area(at):
    path = PATH.copy()
    one, two, three = FACES[FLAT]
    path[1, three] = (1 - at) * path[1, one] + at * path[1, two]
    marked = triangles.nearly_degenerate_triangles(of_one_kind(path), FACES, FRAMES)
    assert marked[1, FLAT]
    np.testing.assert_array_equal(marked, [parts(f)[3] < 1e-12 for f in path])


def test_forms_of_derivatives_as_forms_of_corners():
    rng = np.random.default_rng(6)
    forms = rng.standard_normal((len(FACES), 6, 6))
    forms += np.swapaxes(forms, 1, 2)
    blocks = np.ones((len(FACES), 9, 9))
    triangles.add_blocks(blocks, PATH[0], FACES, forms)
    for t, face in enumerate(FACES):
        q = PATH[0][face]
        edges = np.stack([q[1] - q[0], q[2] - q[0]], axis=1)
        axes, sides = np.linalg.qr(edges, mode="complete")
        signs = np.sign([sides[0, 0], sides[1, 1]])
        axes[:, :2] *= signs
        axes[:, 2] = np.cross(axes[:, 0], axes[:, 1])
        back = np.linalg.inv(signs[:, None] * sides[:2])
        h = np.eye(9).reshape(9, 3, 3)
        rises = np.stack([h[:, 1] - h[:, 0], h[:, 2] - h[:, 0]], axis=2)
        maps = (axes.T @ rises @ back).reshape(9, 6)
        np.testing.assert_allclose(blocks[t] - 1.0, maps @ forms[t] @ maps.T, rtol=1e-9, atol=1e-9)
