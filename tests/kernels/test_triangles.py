"""How thin triangles may be in compiled loops, and in NumPy."""

import numpy as np
import pytest
from cases import open_template, surfaces

from riemhuman.kernels import surface, triangles
from riemhuman.kernels.threads import of_one_kind

TEMPLATE = open_template()
FLAT = 5


@pytest.mark.parametrize("share", [0.99, 1.01], ids=["below", "above"])
def test_how_thin_a_triangle_may_be(share):
    """Whatever the lengths of its sides: the sine of the angle between them counts."""
    for along, across in ((1e-3, 1e3), (1e3, 1e-3), (30.0, 20.0)):
        height = across * share * np.sqrt(surface.DEGENERATE)
        *_, area = triangles.first_forms.py_func(along, 0.0, 0.0, across, height, 0.0)
        assert area == pytest.approx(along * height if share > 1 else 0.0, rel=1e-12)


@pytest.mark.parametrize("at", [0.0, 0.4, 1.0], ids=str)
def test_triangles_without_area(at):
    path = surfaces(TEMPLATE, 3, rng=3)
    one, two, three = TEMPLATE.faces[FLAT]
    path[1, three] = (1 - at) * path[1, one] + at * path[1, two]
    marked = triangles.nearly_degenerate_triangles(
        of_one_kind(path), TEMPLATE.faces, TEMPLATE.frame_coefficients
    )
    assert marked[1, FLAT]
    derivatives = surface.partial_derivatives(path, TEMPLATE.differential_operator)
    np.testing.assert_array_equal(marked, surface.is_degenerate(*derivatives))
