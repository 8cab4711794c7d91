"""Sobolev metrics against exact values on spheres and tori, identities, scalings and refusals."""

import numpy as np
import pytest
from cases import deformations, open_template, sphere_template, surfaces, triangle_template
from known_surfaces import sphere, torus

from riemhuman.errors import ArgumentError
from riemhuman.geometry import AlignedSurfaces, ElasticMetric, SobolevMetric, SRNFMetric
from riemhuman.kernels.surface import cotangent_laplacian
from riemhuman.solvers import (
    BasisPath,
    DiscreteExponential,
    DiscreteLogarithm,
    PathStraightening,
)
from riemhuman.surfaces import DeformationBasis, Template

NAMES = ("a0", "a1", "b1", "c1", "d1", "a2")
ALL = {"a0": 0.3, "a1": 0.7, "b1": 0.4, "c1": 1.1, "d1": 0.5, "a2": 0.02}


def only(space, **weights):
    """Return a metric with these weights and no others."""
    return SobolevMetric(space, **dict.fromkeys(NAMES, 0.0) | weights)


def part(name, h, f, template):
    """Return what one weight costs, as a difference, for no metric need have it alone."""
    space = AlignedSurfaces(template, equip=False)
    both = dict.fromkeys(NAMES, 1.0)
    return only(space, **both | {name: 2.0}).squared_norm(h, f) - only(space, **both).squared_norm(
        h, f
    )


# Values.


@pytest.mark.parametrize("template", [sphere_template(2), open_template(), triangle_template()])
def test_equal_weights_are_the_dirichlet_energy(template):
    """a1 = b1 = c1 = d1 = 1: G(h, k) = hᵀ(L ⊗ I)k with the cotangent Laplacian L of the surface."""
    f = surfaces(template, 1, rng=3)[0]
    h, k = deformations(template, 2, rng=4)
    laplacian = cotangent_laplacian(f, template.faces)
    metric = only(AlignedSurfaces(template), a1=1.0, b1=1.0, c1=1.0, d1=1.0)
    expected = np.sum(h * (laplacian @ k))
    scale = metric.norm(h, f) * metric.norm(k, f)
    assert abs(metric.inner_product(h, k, f) - expected) <= 1e-12 * scale
    assert abs(h.ravel() @ (metric.metric_matrix(f) @ k.ravel()) - expected) <= 1e-12 * scale


def test_laplacian_on_spheres():
    """h = z e_x has Δh = −2h/r²: ∫|Δh|² = (4/r⁴)(4πr⁴/3), of second order in the edge length."""
    errors = []
    for subdivisions in (3, 4, 5):
        template = Template(*sphere(subdivisions, radius=0.7))
        h = np.zeros_like(template.vertices)
        h[:, 0] = template.vertices[:, 2]
        metric = only(AlignedSurfaces(template), a2=1.0)
        errors.append(metric.squared_norm(h, template.vertices) / (16 * np.pi / 3) - 1)
    np.testing.assert_allclose(errors, [-4.4e-3, -1.1e-3, -2.8e-4], rtol=0.02)


def torus_values(template, h):
    """Return the costs of a deformation of a torus by all six weights."""
    space, ones = AlignedSurfaces(template, equip=False), dict.fromkeys(NAMES, 1.0)
    doubled = [only(space, **ones | {name: 2.0}) for name in NAMES]
    all_parts = only(space, **ones).squared_norm(h, template.vertices)
    return np.array([metric.squared_norm(h, template.vertices) for metric in doubled]) - all_parts


def exact_torus_values(major=1.0, minor=0.4):
    """Return the same for h = cos(u) e_y, by quadrature from smooth formulas."""
    n = 400
    u, v = np.meshgrid(*(2 * np.pi * (np.arange(n) + 0.5) / n,) * 2, indexing="ij")
    reach = major + minor * np.cos(v)
    # h = φ e_y with φ = cos u: dh = e_y dφ, |dφ| = |sin u|/reach along the first direction.
    slope = -np.sin(u) / reach
    second, normal = np.cos(v), np.sin(v)  # e_y in the frame: e₁·e_y = 0
    # M₂₁ = slope · cos v, M₃₁ = slope · sin v, the others 0.
    laplacian = -np.cos(u) / reach**2
    parts = [
        np.cos(u) ** 2,
        0.5 * (slope * second) ** 2,
        0.0 * slope,
        (slope * normal) ** 2,
        0.5 * (slope * second) ** 2,
        laplacian**2,
    ]
    areas = minor * reach * (2 * np.pi / n) ** 2
    return np.array([np.sum(one * areas) for one in parts])


def test_all_parts_on_tori():
    exact = exact_torus_values()
    errors = []
    for n in (12, 24, 48):
        template, u, _ = torus(n, 2 * n, 1.0, 0.4)
        h = np.zeros_like(template.vertices)
        h[:, 1] = np.cos(u)
        errors.append(np.abs(torus_values(template, h) - exact) / exact.max())
    errors = np.array(errors)
    assert np.all(errors[-1] < 2e-3)
    seen = errors[0] > 1e-5
    assert seen.sum() >= 5
    assert np.all(np.log2(errors[1] / errors[2])[seen] > 1.8)


def test_laplacian_is_symmetric_and_zero_on_linear_functions_of_a_plane():
    bumpy = open_template()
    template = Template(bumpy.vertices * [1.0, 1.0, 0.0], bumpy.faces)
    metric = SobolevMetric(AlignedSurfaces(template), a2=1.0)
    f = template.vertices
    linear = f @ np.random.default_rng(5).uniform(-1, 1, (3, 3)) + [1.0, 2.0, 3.0]
    assert part("a2", linear, f, template) < 1e-18
    assert part("a2", deformations(template, 1)[0], f, template) > 1e-3
    matrix = metric.metric_matrix(surfaces(template, 1)[0])
    assert abs(matrix - matrix.T).max() <= 1e-15 * abs(matrix).max()


@pytest.mark.parametrize(("name", "power"), list(zip(NAMES, (4, 2, 2, 2, 2, 0), strict=True)))
def test_scaling_exponents(name, power):
    template = sphere_template()
    f, h = surfaces(template, 1, rng=6)[0], deformations(template, 1, rng=7)[0]
    before, after = part(name, h, f, template), part(name, 2.5 * h, 2.5 * f, template)
    np.testing.assert_allclose(after, 2.5**power * before, rtol=1e-9)


def test_first_order_is_that_of_ebin_and_square_root_normals():
    """a1 = 4a, b1 = 8b, c1 = c: a · Ebin_λ + c · SRNF with λ = (b − c/16)/a."""
    a, b, c = 0.7, 0.4, 1.3
    space = AlignedSurfaces(sphere_template())
    f, h = surfaces(space.template, 1, rng=10)[0], deformations(space.template, 1, rng=11)[0]
    ebin = ElasticMetric(space, a, (b - c / 16) / a, 0.0).squared_norm(h, f)
    expected = ebin + c * SRNFMetric(space).squared_norm(h, f)
    metric = SobolevMetric(space, a1=4 * a, b1=8 * b, c1=c)
    np.testing.assert_allclose(metric.squared_norm(h, f), expected, rtol=1e-12)


# Paths.


def path_problem(**weights):
    template = sphere_template()
    space = AlignedSurfaces(template, equip=False)
    start, end = surfaces(template, 2, rng=15, size=0.2)
    return space, only(space, **weights), start, end


def test_geodesics_over_a_basis_and_over_all_vertices():
    space, metric, start, end = path_problem(**ALL)
    template = space.template
    basis = DeformationBasis.from_laplacian(template, n_components=30)
    over_basis = BasisPath(basis, n_nodes=7).solve(metric, start, end)
    over_all = PathStraightening(n_nodes=7, tolerance=1e-8).solve(metric, start, end)
    straight = metric.energy(np.linspace(start, end, 7))
    assert over_basis.converged
    assert over_all.converged
    assert over_all.energy < over_basis.energy < straight
    assert over_all.n_iterations <= 40
    # A minimum: no direction leads further down.
    _, gradient = metric.energy_and_gradient(over_all.path)
    _, before = metric.energy_and_gradient(np.linspace(start, end, 7))
    assert np.abs(gradient[1:-1]).max() < 0.02 * np.abs(before[1:-1]).max()


def test_exp_and_log_over_all_vertices_agree_on_where_a_surface_is():
    """Translations cost nothing: `exp` and `log` move the centroid evenly, and so alike."""
    template = sphere_template()
    start, end = surfaces(template, 2, rng=15, size=0.1)
    solvers = {
        "exp_solver": DiscreteExponential(n_steps=4),
        "log_solver": DiscreteLogarithm(n_steps=4),
    }
    metric = SobolevMetric(AlignedSurfaces(template, equip=False), d1=0.5, a2=1e-2, **solvers)
    end = end + [0.3, 0.0, 0.0]
    np.testing.assert_allclose(metric.exp(metric.log(end, start), start), end, atol=1e-7)


# Refusals.


@pytest.mark.parametrize(
    "weights", [{}, {"a1": 1.0}, {"b1": 1.0}, {"c1": 1.0}, {"d1": 1.0}, {"c1": 1.0, "d1": 2.0}]
)
def test_degenerate_weights_raise(weights):
    with pytest.raises(ArgumentError, match="a0, or two of .* must be above 0, .*found a0 = 0"):
        only(AlignedSurfaces(sphere_template()), **weights)


def test_the_laplacian_alone_needs_a_mesh_without_border():
    only(AlignedSurfaces(sphere_template()), a2=1.0)
    with pytest.raises(ArgumentError, match="on a mesh without border a2, must be above 0"):
        only(AlignedSurfaces(open_template()), a2=1.0)
    only(AlignedSurfaces(open_template()), a0=1.0, a2=1.0)


def test_second_derivatives_need_a_manifold():
    vertices = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1], [0, -1, 0.0]])
    template = Template(vertices, [[0, 1, 2], [0, 1, 3], [0, 1, 4]])
    space = AlignedSurfaces(template)
    with pytest.raises(ArgumentError, match="3 triangles share the edge between the vertices 0 an"):
        SobolevMetric(space, a2=1.0)
    metric = SobolevMetric(space)
    assert metric.squared_norm(deformations(template, 1)[0], vertices) > 0
