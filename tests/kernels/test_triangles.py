"""First derivatives of surfaces in compiled loops, against NumPy and autograd."""

import autograd.numpy as anp
import numpy as np
import pytest
from cases import open_template, surfaces

from riemhuman.kernels import triangles
from riemhuman.kernels.surface import DEGENERATE
from riemhuman.kernels.threads import of_one_kind

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
