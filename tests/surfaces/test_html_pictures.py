"""Pictures for notebooks, read back by another library."""

import base64
import io
import re

import numpy as np
import pytest
from cases import sphere_template

from riemhuman.surfaces.html_pictures import png_bytes, surfaces_html, vertices_html


def test_png_files_hold_the_picture():
    pyplot = pytest.importorskip("matplotlib.pyplot")
    picture = np.random.default_rng(0).integers(0, 256, (5, 7, 4), dtype=np.uint8)
    read = pyplot.imread(io.BytesIO(png_bytes(picture)), format="png")
    np.testing.assert_array_equal(np.round(255 * read).astype(np.uint8), picture)


def by_vertices(surfaces, faces, caption):
    return vertices_html(surfaces, caption)


@pytest.mark.parametrize("drawn", [surfaces_html, by_vertices])
@pytest.mark.parametrize(("n_surfaces", "n_shown"), [(1, 1), (8, 8), (30, 8)])
def test_pictures_show_at_most_eight_surfaces(drawn, n_surfaces, n_shown):
    pyplot = pytest.importorskip("matplotlib.pyplot")
    template = sphere_template(3)
    # Far from each other: each is drawn where it is seen.
    surfaces = [template.vertices + [5.0 * i, 0, 0] for i in range(n_surfaces)]
    html = drawn(surfaces, template.faces, "a <caption>")
    assert "a &lt;caption&gt;" in html
    content = base64.b64decode(re.search(r"base64,([^\"]+)", html)[1])
    picture = pyplot.imread(io.BytesIO(content), format="png")
    columns = (picture[..., 3] > 0).any(axis=0)
    assert np.count_nonzero(np.diff(columns.astype(int)) == 1) == n_shown
