"""Terms whose fields are compared as vectors: sums over pairs, and roots of normals."""

import autograd.numpy as anp
import numpy as np
import pytest
from autograd import grad
from cases import sphere_template, surfaces

from riemhuman.geometry import AlignedSurfaces, SurfaceMetric
from riemhuman.kernels import surface
from riemhuman.terms import FlatTerm, RootNormalTerm

SPACE = AlignedSurfaces(sphere_template())


def square_root_normals(f_u, f_v):
    return RootNormalTerm().field(surface.follow_up(f_u, f_v))


class Rows(FlatTerm):
    """Fields of five numbers, so that chunks end within a triangle."""

    def field(self, first):
        return anp.concatenate([first.area_vectors, first.areas[..., None], first.f_u[..., :1]], -1)


@pytest.mark.parametrize("n_rows", [1, 3, 4, 5, 9])
def test_tables_of_any_size(n_rows):
    """Four by four pairs are summed at a time; the rows at the edge come more than once."""
    metric, points = SurfaceMetric(SPACE, [Rows(0.3)]), surfaces(SPACE.template, 9, rng=4)
    columns, rows = points, points[:n_rows]
    fields = Rows().field(surface.derivatives(points, SPACE.template.differential_operator))
    gaps = fields[:n_rows, None] - fields[None]
    expected = np.sqrt(0.3 * np.einsum("nmtk,t->nm", gaps**2, SPACE.template.face_areas))
    found = metric.cdist(rows, columns, precision="double")
    np.testing.assert_allclose(found, expected, rtol=1e-12, atol=1e-15)
    within = metric.dist_pairwise(rows, precision="double")
    np.testing.assert_allclose(within, expected[:, :n_rows], rtol=1e-12, atol=1e-15)


def test_roots_of_normals_are_square_roots_of_areas_along_normals():
    f_u, f_v = np.random.default_rng(6).standard_normal((2, 7, 3))
    area_vectors = np.cross(f_u, f_v)
    areas = np.linalg.norm(area_vectors, axis=1)
    expected = area_vectors / np.sqrt(areas)[:, None]
    np.testing.assert_allclose(square_root_normals(f_u, f_v), expected, rtol=1e-12)
    np.testing.assert_allclose(square_root_normals(4.0 * f_u, f_v), 2.0 * expected, rtol=1e-12)


def test_roots_of_normals_of_triangles_without_area_are_zero():
    f_u = np.array([[1.0, 0, 0], [1.0, 0, 0], [0, 0, 0], [1.0, 0, 0], [1e-9, 0, 0]])
    f_v = np.array([[0, 1.0, 0], [2.0, 0, 0], [0, 1.0, 0], [1.0, 1e-9, 0], [0, 1e-9, 0]])
    with np.errstate(divide="raise", over="raise", invalid="raise"):
        roots = square_root_normals(f_u, f_v)
        np.testing.assert_array_equal(roots[1:4], 0.0)
        assert np.all(np.linalg.norm(roots[[0, 4]], axis=1) > 0)
        for argument in (0, 1):
            slope = grad(lambda a, b: np.sum(square_root_normals(a, b)), argument)
            np.testing.assert_array_equal(slope(f_u, f_v)[1:4], 0.0)
            assert np.all(np.isfinite(slope(f_u, f_v)))


class Unweighted(FlatTerm):
    """Its `__init__` knows nothing of the weight."""

    def __init__(self, power):
        self.power = power

    def field(self, first):
        return first.areas[..., None] ** self.power


def test_a_term_that_says_no_weight_has_weight_one():
    metric = SurfaceMetric(SPACE, [Unweighted(0.5)])
    points = surfaces(SPACE.template, 3)
    found = metric.dist_pairwise(points, precision="double")
    np.testing.assert_allclose(found[0, 1], metric.dist(points[0], points[1]), rtol=1e-12)
