"""Surfaces over a template and the paper's family of metrics: fields, invariances, refusals."""

import numpy as np
import pytest
from autograd import grad
from cases import (
    SURFACES,
    deformations,
    name_of,
    sphere_template,
    surface_cases,
    surfaces,
)
from scipy.spatial.transform import Rotation

from riemhuman.errors import ArgumentError, DegenerateSurfaceError
from riemhuman.geometry import (
    AlignedSurfaces,
    AreaMetric,
    ElasticMetric,
    GaugeInvariantMetric,
    GeneralElasticMetric,
    RotationMetric,
    SobolevMetric,
    SRNFMetric,
)
from riemhuman.kernels import surface
from riemhuman.kernels.surface import DEGENERATE
from riemhuman.surfaces.template import Template

every_metric = pytest.mark.parametrize("case", SURFACES, ids=name_of)


pytestmark = pytest.mark.usefixtures("strict_floats")


def rotations(rng=0):
    return Rotation.random(2, rng=np.random.default_rng(rng)).as_matrix()


def over(metric, template):
    """Return the metric of the same family and parameters over another template."""
    space = AlignedSurfaces(template)
    if isinstance(metric, ElasticMetric):
        return ElasticMetric(space, metric.a, metric.lam, metric.c)
    if isinstance(metric, GeneralElasticMetric):
        return GeneralElasticMetric(space, metric.a, metric.b, metric.c)
    if isinstance(metric, (AreaMetric, RotationMetric)):
        return type(metric)(space, metric.time)
    return SRNFMetric(space)


# Invariances.


def is_unchanged(metric, before, after):
    scale = metric.dist(*before) + 1e-3
    return abs(metric.dist(*after) - metric.dist(*before)) < 1e-10 * scale


@pytest.mark.parametrize(
    "case", [case for case in surface_cases() if case.name != "edges"], ids=name_of
)
def test_inner_products_do_not_see_rigid_motions(case):
    f, h = case.points[0], case.tangent_vecs[0]
    turn = rotations()[0]
    norm = case.metric.norm(h, f)
    np.testing.assert_allclose(case.metric.norm(h @ turn, f @ turn), norm, rtol=1e-11)
    np.testing.assert_allclose(case.metric.norm(h, f + [1.0, 2.0, 3.0]), norm, rtol=1e-11)
    if "translation" in case.invariant_under:
        np.testing.assert_allclose(case.metric.norm(h + [1.0, 2.0, 3.0], f), norm, rtol=1e-11)
        assert case.metric.norm(np.ones_like(f), f) < 1e-12
    else:
        assert case.metric.norm(np.ones_like(f), f) > 1e-3
    spin = f @ np.array([[0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, 0.0]])
    sees = "rotation" not in case.invariant_under
    assert (case.metric.norm(spin, f) > 1e-3) == sees


@every_metric
def test_rigid_motions_and_mirror_images(case):
    f1, f2 = case.points[:2]
    first, second = rotations()
    mirror = np.diag([-1.0, 1.0, 1.0])
    assert is_unchanged(case.metric, (f1, f2), (f1 @ first, f2 @ first))
    both = is_unchanged(case.metric, (f1, f2), (f1 @ mirror, f2 @ mirror))
    assert both == ("common reflection" in case.invariant_under)
    assert case.metric.is_translation_invariant
    for moved in ((f1 + [0.3, -2.0, 1.0], f2), (f1, f2 + [5.0, 0.1, 0.2])):
        assert is_unchanged(case.metric, (f1, f2), moved)
    seen_alone = "rotation" not in case.invariant_under
    for moved in (
        (f1 @ first, f2),
        (f1, f2 @ first),
        (f1 @ first, f2 @ second),
        (f1 @ mirror, f2),
    ):
        assert is_unchanged(case.metric, (f1, f2), moved) != seen_alone


@every_metric
def test_corners_may_be_turned_and_triangles_flipped(case):
    """Another first corner is another frame; the other orientation turns all normals."""
    template, (f1, f2) = case.space.template, case.points[:2]
    turned = np.stack([np.roll(face, k % 3) for k, face in enumerate(template.faces)])
    for faces in (turned, template.faces[:, ::-1]):
        metric = over(case.metric, Template(template.vertices, faces))
        np.testing.assert_allclose(metric.dist(f1, f2), case.metric.dist(f1, f2), rtol=1e-11)


@every_metric
def test_choice_of_the_template(case):
    """Two templates of the same faces: w √det g is the triangle's own area in both."""
    template, (f1, f2) = case.space.template, case.points[:2]
    stretched = template.vertices * [1.7, 0.6, 1.1] + deformations(template, 1, rng=9, size=0.2)[0]
    other = over(case.metric, Template(stretched, template.faces))
    here, there = case.metric.dist(f1, f2), other.dist(f1, f2)
    if "template" in case.invariant_under:
        np.testing.assert_allclose(there, here, rtol=1e-10)
    else:
        assert abs(there - here) > 1e-3 * here


# Degenerate surfaces.


def flattened(template, f, face=7):
    flat = f.copy()
    flat[template.faces[face, 1]] = flat[template.faces[face, 0]]
    return flat


def test_surfaces_with_degenerate_triangles_are_legal_without_normals():
    template = sphere_template()
    space = AlignedSurfaces(template)
    f, g = surfaces(template, 2)
    flat = flattened(template, f)
    assert not space.belongs(flat)
    np.testing.assert_array_equal(space.belongs(np.stack([f, flat, g])), [True, False, True])
    for metric, lam in (
        (ElasticMetric(space, 1.0, 1e-4, 0.0), 1e-4),
        (ElasticMetric(space, 1.0, 0.3, 0.0), 0.3),
        (SRNFMetric(space), 1 / 16),
    ):
        limit = metric.dist(flat, g)
        assert metric.dist(flat, flat) == 0
        target = metric.target_metric
        assert target.dist(metric.map(flat), metric.map(g)) == pytest.approx(limit, rel=1e-10)
        for step in (1e-3, 1e-5, 1e-7):
            gap = abs(metric.dist(flat + step * (f - flat), g) - limit)
            assert gap < 20 * np.sqrt(lam * step)
        for argument in (0, 1):
            for pair in ((flat, g), (g, flat), (flat, flat)):
                assert np.all(np.isfinite(grad(metric.squared_dist, argument)(*pair)))
                assert np.all(np.isfinite(grad(metric.dist, argument)(*pair)))
        t = np.linspace(0, 1, 5)[:, None, None]
        assert metric.length((1 - t) * flat + t * g) >= limit
        matrix = metric.dist_pairwise(np.stack([f, flat, g]), precision="double")
        np.testing.assert_allclose(matrix[1, 2], limit, rtol=1e-13)


def test_degenerate_triangles_are_refused_by_index():
    template = sphere_template()
    space = AlignedSurfaces(template)
    f = surfaces(template, 1)[0]
    flat = flattened(template, f)
    normals = ElasticMetric(space, 1.0, 1.0, 1.0)
    first = next(k for k, face in enumerate(template.faces) if {*template.faces[7, :2]} <= {*face})
    message = rf"triangle.* must have an area.*triangle {first}.*, the first of 2 such triangles"
    for call in (
        lambda: normals.dist(flat, f),
        lambda: space.to_fields(flat),
        lambda: space.check_immersed(flat),
    ):
        with pytest.raises(DegenerateSurfaceError, match=message):
            call()
    with pytest.raises(DegenerateSurfaceError, match=rf"triangle {first} of item \(2,\)"):
        normals.dist_pairwise(np.stack([f, f, flat]))
    np.testing.assert_array_equal(space.check_immersed(f), f)


# Metrics given by their inner product alone, and one with a distance.
ENERGIES = {
    "elastic": lambda space: ElasticMetric(space, 1.0, 1.0, 1.0),
    "sobolev": lambda space: SobolevMetric(space, a0=0.3, a1=0.7, b1=0.4, c1=1.1, d1=0.5, a2=0.02),
    "sobolev, a0": lambda space: SobolevMetric(space, 1.0, 0.0, 0.0, 0.0),
    "sobolev, a2": lambda space: SobolevMetric(space, 0.0, 0.0, 0.0, 0.0, a2=1.0),
    "gauge-invariant": lambda space: GaugeInvariantMetric(SRNFMetric(space)),
}
every_energy = pytest.mark.parametrize("metric_over", ENERGIES.values(), ids=ENERGIES)


@every_energy
def test_energies_need_triangles_with_area(metric_over):
    template = sphere_template()
    metric, f = metric_over(AlignedSurfaces(template)), surfaces(template, 1)[0]
    flat = flattened(template, f)
    still = np.stack([flat, flat])
    for call in (
        lambda: metric.norm(f, flat),
        lambda: metric.metric_matrix(flat),
        lambda: metric.energy(still),
        lambda: grad(metric.energy)(still),
    ):
        with pytest.raises(DegenerateSurfaceError, match="triangle .* must have an area"):
            call()
    energy, gradient = metric.energy_and_gradient(still)
    assert energy == np.inf
    assert np.all(np.isfinite(gradient))


@every_energy
def test_vertices_of_no_triangle_do_not_count(metric_over):
    template = sphere_template()
    more = Template(np.vstack([template.vertices, [[3.0, 0.0, 0.0]]]), template.faces)
    path, (h, k) = surfaces(template, 3), deformations(template, 2)
    longer, (wide_h, wide_k) = (
        np.concatenate([points, np.full((len(points), 1, 3), 2.0)], axis=1)
        for points in (path, (h, k))
    )
    longer[1, -1] = 2.5
    alone, lonely = (metric_over(AlignedSurfaces(one)) for one in (template, more))
    product = lonely.inner_product(wide_h, wide_k, longer[0])
    assert product == pytest.approx(alone.inner_product(h, k, path[0]), rel=1e-12)
    expected, slope = alone.energy_and_gradient(path)
    energy, gradient = lonely.energy_and_gradient(longer)
    assert energy == pytest.approx(expected, rel=1e-12)
    np.testing.assert_allclose(gradient[:, :-1], slope, rtol=1e-9, atol=1e-12)
    np.testing.assert_array_equal(gradient[:, -1], 0.0)


# Refusals.


def test_weights_are_checked():
    space = AlignedSurfaces(sphere_template())
    with pytest.raises(ArgumentError, match=r"lam must be above 0 if a > 0 \(found lam = 0\)"):
        ElasticMetric(space, 1.0, 0.0, 0.0)
    with pytest.raises(ArgumentError, match="a and c must not both be 0"):
        ElasticMetric(space, 0.0, 1.0, 0.0)


def test_triangles_have_faces_areas_and_normals():
    space = AlignedSurfaces(sphere_template())
    points = space.random_point(3, rng=1)
    corners = points[:, space.faces]
    edges = corners[:, :, 1:] - corners[:, :, :1]
    normals = 0.5 * np.cross(edges[:, :, 0], edges[:, :, 1])
    np.testing.assert_allclose(space.normals(points), normals, rtol=0, atol=1e-16)
    areas = space.face_areas(points)
    np.testing.assert_allclose(areas, np.linalg.norm(normals, axis=-1), rtol=1e-13)
    np.testing.assert_allclose(areas[..., None] * space.normal_field(points), normals, atol=1e-16)
    np.testing.assert_array_equal(space.face_areas(np.zeros(space.shape)), np.zeros(80))
    template = space.template
    np.testing.assert_allclose(space.face_areas(template.vertices), template.face_areas, rtol=1e-13)


def test_what_belongs_has_an_area_for_everybody():
    """Near the bound, others, who round in another order, find some triangles without area."""
    template = Template([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]], [[0, 1, 2]])
    space, rng = AlignedSurfaces(template, equip=False), np.random.default_rng(0)
    shares = np.repeat([0.5, 1.0, 2.5], 50)
    path = np.zeros((len(shares), 3, 3))
    path[:, 1, 0] = 1.0
    path[:, 2, 1] = np.sqrt(shares * DEGENERATE)
    path[:, 2, 0] = np.sqrt(1.0 - path[:, 2, 1] ** 2)
    path = path @ Rotation.random(len(shares), random_state=rng).as_matrix()
    belong = space.belongs(path)
    np.testing.assert_array_equal(belong, shares > 2.0)
    assert not space.belongs(path[0])
    paths = path.reshape(3, 50, 3, 3)
    np.testing.assert_array_equal(space.belongs(paths), belong.reshape(3, 50))
    # At the bound itself, whether there is area is a matter of rounding.
    without = surface.is_degenerate(*space.partial_derivatives(path))[:, 0]
    assert not without[belong].any()
    assert 0 < without[shares == 1.0].sum() < 50


# Meshes of other libraries.


@pytest.mark.parametrize("library", ["trimesh", "meshio"])
def test_meshes_are_taken_for_surfaces(library):
    template = sphere_template()
    space, points = AlignedSurfaces(template), surfaces(template, 3)
    other = Template(points[0], np.roll(template.faces, 1, axis=0))
    if library == "trimesh":
        meshes, wrong = [template.to_trimesh(f) for f in points], other.to_trimesh()
    else:
        meshio = pytest.importorskip("meshio")
        meshes = [meshio.Mesh(f, [("triangle", template.faces)]) for f in points]
        wrong = meshio.Mesh(other.vertices, [("triangle", other.faces)])
    metric = ElasticMetric(space, 1.0, 0.1, 0.1)
    assert metric.dist(meshes[0], meshes[1]) == metric.dist(points[0], points[1])
    expected = metric.dist_pairwise(points)
    np.testing.assert_array_equal(metric.dist_pairwise(meshes), expected)
    assert metric.energy(meshes) == metric.energy(points)
    norm = metric.norm(points[1] - points[0], meshes[0])
    assert norm == metric.norm(points[1] - points[0], points[0])
    np.testing.assert_array_equal(space.normals(meshes[0]), space.normals(points[0]))
    for call in (lambda: metric.dist(points[0], wrong), lambda: metric.cdist(meshes, [wrong])):
        with pytest.raises(ArgumentError, match="of the template .*; register it first: "):
            call()
