"""Records of triangles and slopes by them in compiled loops, against NumPy and autograd."""

import autograd.numpy as anp
import numpy as np
import pytest
from autograd import grad
from cases import open_template, surfaces

from riemhuman.kernels.threads import of_one_kind
from riemhuman.kernels.triangles import by_vertex
from riemhuman.terms._sum import add_gradient, fill_records

TEMPLATE = open_template()
FACES, FRAMES = TEMPLATE.faces, TEMPLATE.frame_coefficients
OPERATOR = TEMPLATE.differential_operator.toarray()
PATH = surfaces(TEMPLATE, 3, rng=3)
FIRST, LAST, FLAT = 2, 13, 5


def parts(f):
    """Return f_u, f_v, their cross product and its length, each of all triangles."""
    f_u, f_v = anp.reshape(anp.dot(OPERATOR, f), (2, -1, 3))
    crossed = anp.cross(f_u, f_v)
    return f_u, f_v, crossed, anp.sqrt(anp.sum(crossed**2, axis=1))


def record(f):
    """Return the twelve numbers of every triangle, shape (12, F)."""
    f_u, f_v, crossed, areas = parts(f)
    numbers = (areas[:, None], anp.sum(f_u * f_u, 1)[:, None], anp.sum(f_u * f_v, 1)[:, None])
    return anp.concatenate([f_u, f_v, crossed / areas[:, None], *numbers], axis=1).T


def filled(path):
    records = np.empty((len(path), 12, LAST - FIRST))
    fill_records(of_one_kind(by_vertex(path)), FACES, FRAMES, FIRST, LAST, records)
    return records


def test_records():
    expected = [record(f)[:, FIRST:LAST] for f in PATH]
    np.testing.assert_allclose(filled(PATH), expected, atol=1e-13)


def test_slopes_by_records_become_slopes_by_vertices():
    slopes = np.random.default_rng(4).standard_normal((len(PATH), 12, LAST - FIRST))
    gradient = by_vertex(np.ones_like(PATH))

    def value(f, slope):
        return anp.sum(slope * record(f)[:, FIRST:LAST])

    expected = [grad(value)(f, slope) for f, slope in zip(PATH, slopes, strict=True)]
    add_gradient(filled(PATH), slopes, FACES, FRAMES, FIRST, LAST, gradient)
    np.testing.assert_allclose(by_vertex(gradient) - 1.0, expected, atol=1e-12)


@pytest.mark.parametrize("at", [0.0, 0.4, 1.0], ids=str)
def test_triangles_without_area(at):
    path = PATH.copy()
    one, two, three = FACES[FLAT]
    path[1, three] = (1 - at) * path[1, one] + at * path[1, two]
    records = filled(path)
    assert not records[1, 6:10, FLAT - FIRST].any()
    np.testing.assert_allclose(records[1, 10, FLAT - FIRST], np.sum(parts(path[1])[0][FLAT] ** 2))
    # Alone, such a triangle adds nothing.
    slopes = np.zeros_like(records)
    slopes[1, :, FLAT - FIRST] = 1.0
    gradient = np.zeros_like(by_vertex(path))
    add_gradient(records, slopes, FACES, FRAMES, FIRST, LAST, gradient)
    assert not gradient.any()
