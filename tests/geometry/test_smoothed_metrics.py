"""Metrics of smoothed areas and of diffused rotations."""

import numpy as np
import pytest
from cases import TEMPLATES, deformations, open_template, sphere_template, surfaces
from open_bodies import coarse_bodies
from scipy.spatial.distance import pdist, squareform
from scipy.spatial.transform import Rotation

from riemhuman.errors import DegenerateSurfaceError
from riemhuman.geometry import (
    AlignedSurfaces,
    AreaMetric,
    RotationMetric,
)
from riemhuman.surfaces import Template


def triangle_areas(vertices, faces):
    one, two, three = (vertices[corners] for corners in faces.T)
    return 0.5 * np.linalg.norm(np.cross(two - one, three - one), axis=1)


def smoothed_log_areas(template, f, time):
    """Return the field by its definition, with dense matrices and cotangents of angles."""
    vertices, faces, n = template.vertices, template.faces, template.n_vertices
    at_rest, areas = triangle_areas(vertices, faces), triangle_areas(f, faces)
    before, after, stiffness = np.zeros(n), np.zeros(n), np.zeros((n, n))
    for face, rest, area in zip(faces, at_rest, areas, strict=True):
        before[face] += rest / 3
        after[face] += area / 3
        for k in range(3):
            i, j, opposite = face[k], face[(k + 1) % 3], face[(k + 2) % 3]
            u, v = vertices[i] - vertices[opposite], vertices[j] - vertices[opposite]
            half = 0.5 * np.dot(u, v) / np.linalg.norm(np.cross(u, v))
            stiffness[[i, j], [i, j]] += half
            stiffness[[i, j], [j, i]] -= half
    mass = np.diag(before)
    return np.linalg.solve(mass + time * stiffness, mass @ np.log(after / before)), before


@pytest.mark.parametrize("time", [0.0, 0.02, 3.0])
@pytest.mark.parametrize("name", TEMPLATES)
def test_fields_and_distances_by_their_definition(name, time):
    template = TEMPLATES[name]()
    metric = AreaMetric(AlignedSurfaces(template), time)
    f1, f2 = surfaces(template, 2)
    (x1, masses), (x2, _) = (smoothed_log_areas(template, f, time) for f in (f1, f2))
    np.testing.assert_allclose(metric.log_areas(f1), x1, rtol=1e-9, atol=1e-12)
    assert metric.squared_dist(f1, f2) == pytest.approx(np.sum(masses * (x1 - x2) ** 2), rel=1e-9)


@pytest.mark.parametrize(
    ("metric_class", "share", "time"),
    [(AreaMetric, 1 / 36, 0.05), (RotationMetric, 1 / 720, 0.0025)],
)
def test_default_times_follow_the_size_of_the_template(metric_class, share, time):
    template = coarse_bodies().template
    metric = metric_class(AlignedSurfaces(template))
    assert metric.time == pytest.approx(time, rel=0.05)
    assert metric.time == pytest.approx(share * template.face_areas.sum())
    in_millimetres = Template(1000 * template.vertices, template.faces)
    of_millimetres = metric_class(AlignedSurfaces(in_millimetres))
    assert of_millimetres.time == pytest.approx(1e6 * metric.time)
    f1, f2 = coarse_bodies().points[[0, 30]]
    found = of_millimetres.dist(1000 * f1, 1000 * f2)
    assert found == pytest.approx(1000 * metric.dist(f1, f2), rel=1e-9)


def test_parts_and_vertices_of_no_triangle():
    """Heat stays in its part, and a vertex that no triangle uses has no effect."""
    one, other = sphere_template(), open_template()
    shift = one.n_vertices + 1
    both = Template(
        np.vstack([one.vertices, [[9.0, 9.0, 9.0]], other.vertices]),
        np.vstack([one.faces, other.faces + shift]),
    )
    pairs = surfaces(one, 2), surfaces(other, 2)
    lonely = np.array([[0.0, 0.0, 0.0]]), np.array([[5.0, 1.0, 2.0]])
    together = [np.vstack(pieces) for pieces in zip(pairs[0], lonely, pairs[1], strict=True)]
    metric = AreaMetric(AlignedSurfaces(both), time=0.1)
    parts = [
        AreaMetric(AlignedSurfaces(template), time=0.1).squared_dist(*pair)
        for template, pair in zip((one, other), pairs, strict=True)
    ]
    assert metric.squared_dist(*together) == pytest.approx(sum(parts), rel=1e-12)
    assert np.all(np.isfinite(metric.energy_and_gradient(np.stack(together))[1]))


def test_seams_change_nothing():
    """Vertices doubled where an exporter cut the mesh: heat flows across the cut."""
    template = sphere_template()
    upper = template.vertices[template.faces].mean(axis=1)[:, 1] > 0.0
    twins = np.intersect1d(template.faces[upper], template.faces[~upper])
    faces = template.faces.copy()
    of_twin = np.arange(template.n_vertices)
    of_twin[twins] = template.n_vertices + np.arange(len(twins))
    faces[upper] = of_twin[faces[upper]]
    cut = Template(np.vstack([template.vertices, template.vertices[twins]]), faces)
    f = surfaces(template, 2)
    torn = np.concatenate([f, f[:, twins]], axis=1)
    whole, apart = (AreaMetric(AlignedSurfaces(domain), time=0.1) for domain in (template, cut))
    assert apart.dist(*torn) == pytest.approx(whole.dist(*f), rel=1e-12)
    np.testing.assert_allclose(apart.dist_pairwise(torn), whole.dist_pairwise(f), rtol=1e-6)
    fields = apart.log_areas(torn)
    np.testing.assert_allclose(fields[:, : template.n_vertices], whole.log_areas(f), atol=1e-12)
    np.testing.assert_array_equal(fields[:, template.n_vertices :], fields[:, twins])


def test_triangles_without_area():
    template = sphere_template()
    metric = AreaMetric(AlignedSurfaces(template), time=0.1)
    f, g = surfaces(template, 2)
    flat = f.copy()
    flat[template.faces[7, 1]] = flat[template.faces[7, 0]]  # two triangles without area
    limit = metric.dist(flat, g)
    assert metric.dist(flat + 1e-7 * (f - flat), g) == pytest.approx(limit, rel=1e-5)
    energy, gradient = metric.energy_and_gradient(np.stack([f, flat, g]))
    assert np.isfinite(energy)
    assert np.all(np.isfinite(gradient))
    around = template.faces[(template.faces == 4).any(axis=1)]
    gone = f.copy()
    gone[np.unique(around)] = f[4]
    first = min(v for v in range(template.n_vertices) if is_gone(template, gone, v))
    with pytest.raises(DegenerateSurfaceError, match=rf"every vertex .* at vertex {first}"):
        metric.dist(f, gone)
    with pytest.raises(DegenerateSurfaceError, match="every vertex"):
        metric.dist_pairwise(np.stack([f, gone, g]))
    assert metric.energy_and_gradient(np.stack([f, gone, g]))[0] == np.inf


def is_gone(template, f, vertex):
    around = template.faces[(template.faces == vertex).any(axis=1)]
    return triangle_areas(f, around).max() == 0.0


def test_fields_are_vectors_in_a_flat_space():
    bodies = coarse_bodies()
    points = bodies.points[::9]
    metric = AreaMetric(AlignedSurfaces(bodies.template))
    distances = metric.dist_pairwise(points, precision="double")
    coordinates = metric.lower_bound_coordinates(points)
    np.testing.assert_allclose(squareform(pdist(coordinates)), distances, rtol=1e-9, atol=1e-12)
    np.testing.assert_allclose(metric.dist_pairwise(points), distances, rtol=1e-5, atol=1e-12)
    (features, _) = metric.features(points, "single")
    assert features.dtype == np.float32
    assert features[0].size < 1.02 * bodies.template.n_vertices  # of SRNF there are 3 F
    fields, (x, y) = metric.target_metric, metric.map(points[:2])
    velocity = fields.log(y, x)
    np.testing.assert_allclose(fields.exp(velocity, x), y, atol=1e-12)
    assert fields.norm(velocity) == pytest.approx(distances[0, 1])


# The metric of diffused rotations.

TURN = Rotation.from_rotvec([0.3, -0.8, 0.4]).as_matrix()


@pytest.mark.parametrize("time", [0.0, 0.01, None])
def test_whole_bodies_that_turn(time):
    template = sphere_template()
    metric = RotationMetric(AlignedSurfaces(template), time)
    np.testing.assert_allclose(
        metric.rotations(template.vertices), np.eye(3) + np.zeros((80, 3, 3)), atol=1e-12
    )
    f = surfaces(template, 1)[0]
    expected = TURN @ metric.rotations(f)
    np.testing.assert_allclose(metric.rotations(f @ TURN.T + 3.0), expected, atol=1e-12)
    angle = np.linalg.norm([0.3, -0.8, 0.4])
    assert metric.dist(f, f @ TURN.T) == pytest.approx(angle * np.sqrt(template.face_areas.sum()))


def test_surfaces_without_area():
    template = sphere_template()
    space = AlignedSurfaces(template)
    metric = RotationMetric(space)
    f, g = surfaces(template, 2)
    flat = f.copy()
    flat[template.faces[7, 1]] = flat[template.faces[7, 0]]
    for call in (
        lambda: metric.dist(f, flat),
        lambda: metric.dist_pairwise(np.stack([f, flat])),
    ):
        with pytest.raises(DegenerateSurfaceError, match="every triangle"):
            call()
    energy, gradient = metric.energy_and_gradient(np.stack([f, flat, g]))
    assert energy == np.inf
    assert gradient.shape == (3, *f.shape)


@pytest.mark.parametrize("time", [0.0, None])
def test_gram_matrix_holds_inner_products(time):
    template = sphere_template()
    metric = RotationMetric(AlignedSurfaces(template), time)
    points, vectors = surfaces(template, 2), deformations(template, 9)  # more than one chunk
    gram = metric.gram_matrix(vectors, points)
    np.testing.assert_allclose(gram, gram.T)
    for j, k in ((0, 0), (2, 5), (8, 1), (8, 8)):
        expected = np.mean(metric.inner_product(vectors[j], vectors[k], points))
        assert gram[j, k] == pytest.approx(expected, rel=1e-9)
