"""The metric of diffused rotations."""

import numpy as np
import pytest
from cases import deformations, open_template, sphere_template, surfaces
from scipy.linalg import sqrtm
from scipy.spatial.transform import Rotation

from riemhuman.datasets import load_open_bodies
from riemhuman.errors import ArgumentError, DegenerateSurfaceError
from riemhuman.geometry import AlignedSurfaces, ElasticMetric, RotationMetric, SRNFMetric
from riemhuman.kernels.surface import polar_frames
from riemhuman.retrieval import scores
from riemhuman.surfaces import Template

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


def test_rotations_and_first_fundamental_form_determine_the_surface():
    for template in (sphere_template(), open_template()):
        space = AlignedSurfaces(template)
        f = surfaces(template, 1)[0]
        g = space.metric_field(f)
        rotations = RotationMetric(space, time=0.0).rotations(f)
        axes = polar_frames(*space.partial_derivatives(template.vertices))[..., :2]
        df = rotations @ axes @ np.stack([sqrtm(one) for one in g])
        derivatives = np.concatenate([df[..., 0], df[..., 1]])
        found = template.interpolator.surface_of(derivatives, template.vertices)
        shift = found - f
        np.testing.assert_allclose(shift - shift[0], 0.0, atol=1e-12)


def test_the_reflection_in_a_point_is_seen_by_rotations_alone():
    """−f has the same g and n as f: no metric that is pulled back by Φ tells them apart."""
    template = sphere_template()
    space = AlignedSurfaces(template)
    f = surfaces(template, 1)[0]
    for metric in (ElasticMetric(space, 1.0, 1e-4, 1.0), SRNFMetric(space)):
        assert metric.dist(f, -f) == 0
    half_turns = np.pi * np.sqrt(template.face_areas.sum())
    assert RotationMetric(space, time=0.0).dist(f, -f) == pytest.approx(half_turns)
    assert RotationMetric(space).dist(f, -f) > 0.9 * half_turns


def test_default_time_follows_the_size_of_the_template():
    template = sphere_template()
    f1, f2 = surfaces(template, 2)
    metric = RotationMetric(AlignedSurfaces(template))
    larger = Template(1000 * template.vertices, template.faces)  # in millimetres
    in_millimetres = RotationMetric(AlignedSurfaces(larger))
    assert in_millimetres.time == pytest.approx(1e6 * metric.time)
    assert in_millimetres.dist(1000 * f1, 1000 * f2) == pytest.approx(1e3 * metric.dist(f1, f2))
    area = load_open_bodies("coarse").template.face_areas.sum()
    limb = np.sqrt(4 * RotationMetric(AlignedSurfaces(template)).time * area)
    limb /= np.sqrt(template.face_areas.sum())
    assert limb == pytest.approx(0.1, abs=0.002)


def test_wrong_arguments_and_surfaces_without_area():
    template = sphere_template()
    space = AlignedSurfaces(template)
    with pytest.raises(ArgumentError, match="time"):
        RotationMetric(space, time=-1.0)
    metric = RotationMetric(space)
    f, g = surfaces(template, 2)
    flat = f.copy()
    flat[template.faces[7, 1]] = flat[template.faces[7, 0]]
    with pytest.raises(DegenerateSurfaceError, match="every triangle"):
        metric.dist(f, flat)
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


def test_poses_of_people_nothing_was_tuned_on():
    """One person's two similar poses are taken for each other less often than by normals."""
    bodies = load_open_bodies("coarse", "natural", 12)
    space = AlignedSurfaces(bodies.template)
    normals, rotations = (
        scores(metric.dist_pairwise(bodies.points), bodies.pose)
        for metric in (ElasticMetric(space, 0.0, 0.0, 1.0), RotationMetric(space))
    )
    assert rotations.nn >= normals.nn + 5
    assert rotations.first_tier > normals.first_tier
    assert rotations.second_tier > 99


@pytest.mark.parametrize("time", [0.0, None])
def test_compiled_features_are_those_of_the_definition(time):
    bodies = load_open_bodies("coarse")
    metric = RotationMetric(AlignedSurfaces(bodies.template, equip=False), time=time)
    points = bodies.points[:4]
    expected = [[metric.dist(one, other) for other in points] for one in points]
    found = metric.dist_pairwise(points, precision="double")
    np.testing.assert_allclose(found, expected, rtol=1e-12, atol=0)


def test_compiled_features_refuse_triangles_without_area():
    bodies = load_open_bodies("coarse")
    metric = RotationMetric(AlignedSurfaces(bodies.template, equip=False))
    points = bodies.points[:2].copy()
    one, two, _ = bodies.template.faces[7]
    points[1, two] = points[1, one]
    with pytest.raises(DegenerateSurfaceError, match="must have an area"):
        metric.dist_pairwise(points)
