"""Heat between the triangles of a template."""

import pickle

import numpy as np
import pytest
import trimesh
from cases import TEMPLATES

from riemhuman.surfaces import Template


@pytest.fixture(params=TEMPLATES)
def template(request):
    return TEMPLATES[request.param]()


def test_transpose_is_the_adjoint(template):
    step = template.heat.step(0.02)
    x, y = np.random.default_rng(1).standard_normal((2, template.n_faces, 2))
    assert np.vdot(step @ x, y) == pytest.approx(np.vdot(x, step.T @ y), rel=1e-12)
    np.testing.assert_array_equal(step.T.T @ x, step @ x)


def test_harmonics_of_a_sphere_decay_as_they_should():
    # Spherical harmonics of degree k are eigenfunctions: one implicit step divides them by
    # 1 + k (k + 1) time.
    mesh = trimesh.creation.icosphere(4)
    sphere = Template(np.asarray(mesh.vertices), np.asarray(mesh.faces))
    x, y, z = sphere.vertices[sphere.faces].mean(axis=1).T
    step = sphere.heat.step(0.1)
    for degree, harmonic in ((1, z), (2, x * y), (3, z * (5 * z**2 - 3))):
        decayed = (step @ harmonic[:, None])[:, 0]
        factor = (decayed @ harmonic) / (harmonic @ harmonic)
        assert factor == pytest.approx(1 / (1 + 0.1 * degree * (degree + 1)), rel=0.02)


def test_heat_goes_through_triangles_as_well_as_they_conduct(template):
    heat, time = template.heat, 0.1
    values = np.random.default_rng(3).standard_normal((template.n_faces, 2))
    plain, twice = (heat.step(factor * time) @ values for factor in (1.0, 2.0))
    even = np.ones(template.n_faces)
    np.testing.assert_allclose(heat.step_through(even, time) @ values, plain, atol=1e-12)
    np.testing.assert_allclose(heat.step_through(2.0 * even, time) @ values, twice, atol=1e-12)
    uneven = np.random.default_rng(4).uniform(0.01, 1.0, template.n_faces)
    kept = template.face_areas @ (heat.step_through(uneven, time) @ values)
    np.testing.assert_allclose(kept, template.face_areas @ values, atol=1e-12)


def test_heat_stays_on_its_side_of_triangles_that_hardly_conduct():
    sphere = TEMPLATES["sphere"]()
    height = sphere.vertices[sphere.faces].mean(axis=1)[:, 2]
    warm = (height > 0.0).astype(float)[:, None]
    belt = np.where(np.abs(height) < 0.3, 1e-6, 1.0)
    open_, closed = (sphere.heat.step_through(c, 1.0) @ warm for c in (np.ones_like(belt), belt))
    lower = height < -0.3
    assert open_[lower].min() > 0.1
    assert closed[lower].max() < 1e-4


def test_what_is_known_of_a_time_is_computed_once_and_is_not_pickled(template):
    assert template.heat.step(0.1) is template.heat.step(0.1)
    assert "heat" not in vars(pickle.loads(pickle.dumps(template)))


@pytest.mark.parametrize("between", ["heat", "vertex_heat"])
def test_columns_do_not_depend_on_their_neighbours(template, between):
    flow = getattr(template, between)
    step = flow.step(0.1)
    values = np.random.default_rng(5).standard_normal((len(flow.masses), 19))
    together = step @ values
    order = np.random.default_rng(6).permutation(19)
    np.testing.assert_array_equal(step @ values[:, order], together[:, order])
    for k in (0, 7, 8, 18):
        np.testing.assert_array_equal(step @ values[:, k], together[:, k])
    matrix = np.diag(flow.masses) + 0.1 * flow.laplacian.toarray()
    expected = np.linalg.solve(matrix, flow.masses[:, None] * values)
    np.testing.assert_allclose(together, expected, rtol=1e-9, atol=1e-12)


def test_vertices_conserve_heat_and_constants(template):
    flow = template.vertex_heat
    values = np.random.default_rng(7).standard_normal((template.n_vertices, 2))
    kept = flow.masses @ (flow.step(0.1) @ values)
    np.testing.assert_allclose(kept, flow.masses @ values, atol=1e-12)
    np.testing.assert_allclose(flow.step(0.1) @ np.ones(template.n_vertices), 1.0, rtol=1e-12)
    averages = template.averaging_operator
    np.testing.assert_allclose(averages @ np.ones(template.n_faces), 1.0, rtol=1e-12)
