"""Sobolev metrics against exact values on spheres and tori, identities, scalings and refusals."""

import numpy as np
import pytest
from cases import (
    CASES,
    HalfPlane,
    HyperbolicDistance,
    deformations,
    open_template,
    sphere_template,
    surfaces,
    triangle_template,
)
from known_surfaces import torus

from riemhuman.errors import (
    ArgumentError,
    ArgumentTypeError,
    ConvergenceWarning,
    DegenerateSurfaceError,
    ReparametrizationInvarianceWarning,
)
from riemhuman.geometry import (
    AlignedSurfaces,
    ElasticMetric,
    GaugeInvariantMetric,
    SobolevMetric,
    SRNFMetric,
    SurfaceMetric,
)
from riemhuman.kernels.surface import cotangent_laplacian
from riemhuman.solvers import (
    DiscreteExponential,
    DiscreteLogarithm,
    PathStraightening,
)
from riemhuman.surfaces import Template
from riemhuman.terms import NormalTerm, _quadratic
from riemhuman.terms._quadratic import corner_averages

NAMES = ("a0", "a1", "b1", "c1", "d1", "a2")
ALL = {"a0": 0.3, "a1": 0.7, "b1": 0.4, "c1": 1.1, "d1": 0.5, "a2": 0.02}


def only(space, **weights):
    """Return a metric with these weights and no others."""
    return SobolevMetric(space, **dict.fromkeys(NAMES, 0.0) | weights)


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
    with pytest.raises(ArgumentError, match="a0 must be above 0, or two of .*found a0 = 0"):
        only(AlignedSurfaces(sphere_template()), **weights)


def test_the_laplacian_alone_needs_a_mesh_without_border():
    only(AlignedSurfaces(sphere_template()), a2=1.0)
    with pytest.raises(ArgumentError, match=r"on a mesh without boundary\) a2"):
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


# Gauge-invariant metrics against exact values on tori and spheres, and what they cannot do.


def test_tangential_fields_cost_nothing_and_change_nothing():
    template = sphere_template(2)
    space = AlignedSurfaces(template)
    metric = GaugeInvariantMetric(ElasticMetric(space, 1.0, 0.1, 0.3))
    f, (h, k) = surfaces(template, 1)[0], deformations(template, 2)
    averages = corner_averages(template.faces, template.n_vertices)
    along = k - _quadratic.project(k, f, template, averages)
    assert metric.norm(along, f) < 1e-14 * metric.norm(k, f)
    np.testing.assert_allclose(metric.norm(h + along, f), metric.norm(h, f), rtol=1e-14)
    assert metric.metric.norm(along, f) > 0.1 * metric.metric.norm(h, f)


def test_a_sobolev_metric_of_first_order_has_a_gauge_invariant_one():
    """With b1 = ½ and c1 = 1 it is that of square-root normals."""
    template = sphere_template()
    space = AlignedSurfaces(template)
    f, h = surfaces(template, 1)[0], deformations(template, 1)[0]
    found = GaugeInvariantMetric(only(space, b1=0.5, c1=1.0)).norm(h, f)
    assert found == pytest.approx(GaugeInvariantMetric(SRNFMetric(space)).norm(h, f), rel=1e-12)


def test_a_warning_says_that_meshes_crumple_over_all_vertices():
    template = sphere_template()
    metric = GaugeInvariantMetric(SRNFMetric(AlignedSurfaces(template, equip=False)))
    start, end = surfaces(template, 2, rng=3, size=0.15)
    with (
        pytest.warns(ReparametrizationInvarianceWarning, match="meshes of a path crump"),
        pytest.warns(ConvergenceWarning, match="after 3 iterations"),
    ):
        PathStraightening(n_nodes=4, max_iter=3).solve(metric, start, end)


# Refusals.


class Bends(NormalTerm):
    """Normals, in a power of the area or in a form of each triangle that has no parts."""

    def __init__(self, area_power, one_by_one):
        super().__init__()
        self.area_power, self._one_by_one = area_power, one_by_one

    def form(self, first):
        form = super().form(first)
        return np.broadcast_to(form, (*first.areas.shape, 6, 6)) if self._one_by_one else form


@pytest.mark.parametrize(("area_power", "one_by_one"), [(0.5, False), (0.0, True), (0.5, True)])
def test_terms_of_their_own_kind_are_refused(area_power, one_by_one):
    space = AlignedSurfaces(sphere_template(), equip=False)
    GaugeInvariantMetric(SurfaceMetric(space, [Bends(0.0, False)]))
    with pytest.raises(ArgumentTypeError, match="first-order metric.*; found SurfaceMetric$"):
        GaugeInvariantMetric(SurfaceMetric(space, [Bends(area_power, one_by_one)]))


@pytest.mark.parametrize(
    ("metric", "found"),
    [
        (CASES["sobolev all sphere"].metric, "SobolevMetric"),
        (CASES["edges"].metric, "PullbackMetric"),
        (HyperbolicDistance(HalfPlane()), "HyperbolicDistance"),
    ],
)
def test_other_metrics_are_refused(metric, found):
    with pytest.raises(ArgumentTypeError, match=f"first-order metric.*; found {found}$"):
        GaugeInvariantMetric(metric)


def test_vertices_whose_normals_cancel_are_refused():
    vertices = [[2, 2, 0], [0, 0, 0], [1, 0, 0], [0, 1, 0.0]]
    template = Template(vertices, [[1, 2, 3], [1, 3, 2]])
    metric = GaugeInvariantMetric(SRNFMetric(AlignedSurfaces(template)))
    f, h = template.vertices, np.ones((4, 3))
    for call in (
        lambda: metric.norm(h, f),
        lambda: metric.norm(h, np.stack([f, f])),
        lambda: metric.metric_matrix(f),
        lambda: metric.energy(np.stack([f, f + h])),
    ):
        with pytest.raises(
            DegenerateSurfaceError, match="vertex 1 cancel, so the vertex has no normal"
        ):
            call()
    assert metric.energy_and_gradient(np.stack([f, f + h]))[0] == np.inf


def test_mixed_orientation_is_refused():
    template = sphere_template()
    faces = template.faces.copy()
    faces[7] = faces[7, ::-1]
    mixed = AlignedSurfaces(Template(template.vertices, faces))
    with pytest.raises(
        ArgumentError, match=r"opposite orientations \(and so do those at 2 other edges"
    ):
        GaugeInvariantMetric(SRNFMetric(mixed))
    strip = np.array([[0, 1, 3], [1, 4, 3], [1, 2, 4], [2, 5, 4], [2, 3, 5], [3, 0, 5]])
    sides = Template(np.random.default_rng(0).uniform(size=(6, 3)), strip)
    with pytest.raises(ArgumentError, match="orient all triangles of the template consistently"):
        GaugeInvariantMetric(SRNFMetric(AlignedSurfaces(sides)))


def test_edges_of_more_than_two_triangles_say_nothing_of_orientation():
    vertices = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1], [0, -1, 0.0]])
    template = Template(vertices, [[0, 1, 2], [0, 1, 3], [0, 1, 4]])
    metric = GaugeInvariantMetric(SRNFMetric(AlignedSurfaces(template)))
    assert metric.norm(deformations(template, 1)[0], vertices) > 0
