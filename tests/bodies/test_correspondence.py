"""Maps from the points of another mesh to a model: three spellings of one matrix."""

import numpy as np
import pytest
from scipy import sparse

from riemhuman.bodies import correspondence_matrix
from riemhuman.datasets import load_open_model


@pytest.fixture(scope="module")
def model():
    return load_open_model("coarse")


def test_every_vertex_by_default(model):
    matrix = correspondence_matrix(model, None)
    np.testing.assert_array_equal(matrix @ model(), model())


@pytest.mark.parametrize("numbers", [[3, 7], [5, 5, 0, 1201], (9,), np.array([1, 0], np.uint16)])
def test_vertices(model, numbers):
    matrix = correspondence_matrix(model, numbers)
    np.testing.assert_array_equal(matrix @ model(), model()[np.asarray(numbers)])


def test_triangles(model):
    rng = np.random.default_rng(0)
    triangles = rng.integers(model.template.n_faces, size=40)
    coordinates = rng.dirichlet([1, 1, 1], size=40)
    expected = [
        sum(c * model()[v] for c, v in zip(some, model.faces[t], strict=True))
        for t, some in zip(triangles, coordinates, strict=True)
    ]
    pair = (triangles, coordinates)
    np.testing.assert_allclose(correspondence_matrix(model, pair) @ model(), expected, atol=1e-15)
    corners = correspondence_matrix(model, (triangles, np.eye(3)[rng.integers(3, size=40)]))
    assert corners.sum() == 40


@pytest.mark.parametrize("layout", ["csr", "csc", "coo", "dok"])
def test_matrices(model, layout):
    rows, columns = [0, 0, 1, 1], [4, 9, 2, 2]
    matrix = sparse.coo_array(([0.25, 0.75, 0.5, 0.5], (rows, columns)), shape=(2, 1202))
    found = correspondence_matrix(model, matrix.asformat(layout)) @ model()
    expected = [0.25 * model()[4] + 0.75 * model()[9], model()[2]]
    np.testing.assert_allclose(found, expected, atol=1e-15)
