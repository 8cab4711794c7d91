"""Gauge-invariant metrics against exact values on tori and spheres, and what they cannot do."""

import numpy as np
import pytest
from cases import (
    CASES,
    HalfPlane,
    HyperbolicDistance,
    deformations,
    sphere_template,
    surfaces,
)
from known_surfaces import sphere, torus

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
from riemhuman.solvers import BasisPath, PathStraightening
from riemhuman.surfaces import DeformationBasis, Template
from riemhuman.terms import NormalTerm, _quadratic
from riemhuman.terms._quadratic import corner_averages

MAJOR, MINOR = 1.0, 0.4


def normal_part(u, v):
    return 1.0 + 0.5 * np.cos(u) + 0.3 * np.sin(v)


def normals(u, v):
    return np.stack([np.cos(v) * np.sin(u), np.sin(v), np.cos(v) * np.cos(u)], axis=-1)


def exact_values():
    """Return ∫2φ²(κ₁ − κ₂)², ∫4φ²(κ₁ + κ₂)² and ∫|∇φ|² on the torus, by quadrature."""
    n = 200
    u, v = np.meshgrid(*(2 * np.pi * (np.arange(n) + 0.5) / n,) * 2, indexing="ij")
    reach = MAJOR + MINOR * np.cos(v)
    one, other, phi = 1.0 / MINOR, np.cos(v) / reach, normal_part(u, v)
    slope = (0.5 * np.sin(u) / reach) ** 2 + (0.3 * np.cos(v) / MINOR) ** 2
    parts = (2 * phi**2 * (one - other) ** 2, 4 * phi**2 * (one + other) ** 2, slope)
    areas = MINOR * reach * (2 * np.pi / n) ** 2
    return np.array([np.sum(part * areas) for part in parts])


def values(n, tangential):
    """Return the same of a triangulated torus, for deformations with a tangential part."""
    template, u, v = torus(n, 2 * n, MAJOR, MINOR)
    h = normal_part(u, v)[:, None] * normals(u, v)
    h += tangential * np.sin(3 * v)[:, None] * np.stack([np.cos(u), 0 * u, -np.sin(u)], axis=-1)
    space = AlignedSurfaces(template, equip=False)

    def squared(a, b, c):
        metric = GaugeInvariantMetric(SobolevMetric(space, a1=4 * a, b1=8 * b, c1=c))
        return metric.squared_norm(h, template.vertices)

    whole = squared(1.0, 1.0, 1.0)
    parts = squared(2.0, 1.0, 1.0), squared(1.0, 2.0, 1.0), squared(1.0, 1.0, 2.0)
    return np.array(parts) - whole


def test_closed_formula_on_tori():
    exact = exact_values()
    errors = np.array([values(n, tangential=0.5) / exact - 1 for n in (12, 24, 48)])
    assert np.all(np.abs(errors[-1]) < 0.01)
    assert np.all(np.log2(np.abs(errors[1] / errors[2])) > 1.8)


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


def test_growing_spheres():
    """E = 16 λ · 4π (r₁ − r₀)², at any number of times."""
    template, lam = Template(*sphere(4)), 0.3
    metric = GaugeInvariantMetric(ElasticMetric(AlignedSurfaces(template), 1.0, lam, 0.0))
    for n_times in (2, 5):
        path = template.vertices * np.linspace(0.8, 1.3, n_times)[:, None, None]
        expected = 16 * lam * 4 * np.pi * 0.5**2
        np.testing.assert_allclose(metric.energy(path), expected, rtol=3e-3)


def registered_anew(subdivisions, turn, n_times=33):
    """Return a path of ellipsoids, the parameters of which turn by an angle in unit time."""
    template, path = Template(*sphere(subdivisions)), []
    for t in np.linspace(0.0, 1.0, n_times):
        angle = turn * np.sin(np.pi * t)
        turned = template.vertices @ np.array(
            [
                [np.cos(angle), np.sin(angle), 0.0],
                [-np.sin(angle), np.cos(angle), 0.0],
                [0.0, 0.0, 1.0],
            ]
        )
        path.append(turned * [1.0 + 0.5 * t, 1.0 - 0.2 * t, 1.0 + 0.3 * t])
    return template, np.array(path)


def test_energy_when_every_time_is_registered_anew():
    changes = []
    for subdivisions, n_times in ((2, 17), (3, 33), (4, 65)):
        energies = []
        for turn in (0.0, 0.4):
            template, path = registered_anew(subdivisions, turn, n_times)
            space = AlignedSurfaces(template, equip=False)
            base = SobolevMetric(space, a1=2.0, b1=1.0, c1=0.7)
            energies.append(GaugeInvariantMetric(base).energy(path))
            if turn:
                assert base.energy(path) > 1.3 * energies[0]
        changes.append(abs(energies[1] / energies[0] - 1))
    assert changes[-1] < 0.01
    assert changes[0] > 1.9 * changes[1] > 1.9**2 * changes[2]


def test_meshes_crumple_over_all_vertices_and_a_warning_says_so():
    template = sphere_template()
    metric = GaugeInvariantMetric(SRNFMetric(AlignedSurfaces(template, equip=False)))
    start, end = surfaces(template, 2, rng=3, size=0.15)
    solver = PathStraightening(n_nodes=4, max_iter=30)
    with (
        pytest.warns(ReparametrizationInvarianceWarning, match="meshes of a path crump"),
        pytest.warns(ConvergenceWarning, match="after 30 iterations"),
    ):
        crumpled = solver.solve(metric, start, end)
    basis = DeformationBasis.from_laplacian(template, n_components=20)
    smooth = BasisPath(basis, n_nodes=4).solve(metric, start, end)
    assert crumpled.energy < 0.8 * smooth.energy
    assert metric.metric.energy(crumpled.path) > 2 * metric.metric.energy(smooth.path)


def test_gram_matrix_is_semidefinite():
    template = sphere_template()
    metric = GaugeInvariantMetric(SRNFMetric(AlignedSurfaces(template)))
    f = surfaces(template, 1)[0]
    values = np.linalg.eigvalsh(metric.metric_matrix(f).toarray())
    assert np.sum(values < 1e-12 * values[-1]) == 2 * template.n_vertices
    assert values[0] > -1e-12 * values[-1]


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
        (CASES["gauge-invariant srnf open"].metric, "GaugeInvariantMetric"),
        (CASES["edges"].metric, "PullbackMetric"),
        (HyperbolicDistance(HalfPlane()), "HyperbolicDistance"),
        ("pose", "str"),
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
        with pytest.raises(DegenerateSurfaceError, match="vertex 1 cancel, so that it has none"):
            call()
    assert metric.energy_and_gradient(np.stack([f, f + h]))[0] == np.inf


def test_mixed_orientation_is_refused():
    template = sphere_template()
    faces = template.faces.copy()
    faces[7] = faces[7, ::-1]
    mixed = AlignedSurfaces(Template(template.vertices, faces))
    with pytest.raises(ArgumentError, match=r"turn opposite sides up \(and those at 2 other edges"):
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
