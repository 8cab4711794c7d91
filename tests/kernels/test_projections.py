"""Coordinates bound distances from below: fields over patches, and the metrics."""

import numpy as np
import pytest
from cases import TEMPLATES, sphere_template, surfaces

from riemhuman.geometry import AlignedSurfaces, ElasticMetric, SRNFMetric
from riemhuman.kernels.projections import patch_coordinates, triangle_patches

WEIGHTS = [(0.0, 0.0, 1.0), (1.0, 1e-4, 0.0), (1.0, 1.0, 0.0), (2.0, 0.05, 0.3)]


@pytest.mark.parametrize("n_patches", [None, 1, 3, 7, 10_000])
def test_patches_bound_the_distance_of_fields(n_patches):
    template = sphere_template()
    patches = None
    if n_patches is not None:
        patches = triangle_patches(template.vertices, template.faces, n_patches)
    fields = np.random.default_rng(1).standard_normal((2, 5, template.n_faces, 3))
    fields[1, 0] = fields[0, 0]
    exact = np.sum((fields[0] - fields[1]) ** 2, axis=-1) @ template.face_areas
    first, second = patch_coordinates(fields, template.face_areas, patches)
    bound = np.sum((first - second) ** 2, axis=-1)
    assert np.all(bound <= exact * (1 + 1e-12))
    if n_patches is None or n_patches >= template.n_faces:
        np.testing.assert_allclose(bound, exact, rtol=1e-12)


def test_patches_by_hand():
    values = np.array([[1.0], [3.0], [10.0]])
    areas, patches = np.array([1.0, 3.0, 4.0]), np.array([1, 1, 0])
    # The patch of one triangle first; then mean 2.5 and rest sqrt(1 · 1.5² + 3 · 0.5²) = √3.
    expected = [2.0 * 10.0, 0.0, 2.0 * 2.5, np.sqrt(3.0)]
    np.testing.assert_allclose(patch_coordinates(values, areas, patches), expected)


def test_patches_may_have_any_numbers():
    values = np.random.default_rng(4).standard_normal((6, 3))
    areas, patches = np.arange(1.0, 7.0), np.array([0, 1, 0, 2, 2, 1])
    expected = patch_coordinates(values, areas, patches)
    for numbers in (patches + 1, patches + 2, 3 * patches + 4):
        np.testing.assert_array_equal(patch_coordinates(values, areas, numbers), expected)


def test_triangle_patches_are_even_and_in_one_piece():
    template = sphere_template(2)
    patches = triangle_patches(template.vertices, template.faces, 16)
    counts = np.bincount(patches)
    assert len(counts) == 16
    assert counts.max() <= counts.min() + 1
    centers = template.vertices[template.faces].mean(axis=1)
    halves = triangle_patches(template.vertices * [1.0, 3.0, 1.0], template.faces, 2)
    assert centers[halves == 0, 1].max() <= centers[halves == 1, 1].min()
    spread = [np.ptp(centers[patches == patch], axis=0).max() for patch in range(16)]
    assert max(spread) < np.ptp(centers, axis=0).max()


def metrics():
    """Return metrics on surfaces over every template, by name."""
    found = {}
    for name, make_template in TEMPLATES.items():
        space = AlignedSurfaces(make_template(), equip=False)
        for weights in WEIGHTS:
            found[f"{name} {weights}"] = ElasticMetric(space, *weights)
        found[f"{name} srnf"] = SRNFMetric(space)
    return found


@pytest.mark.parametrize("n_patches", [None, 4])
@pytest.mark.parametrize("metric", metrics().values(), ids=metrics().keys())
def test_coordinates_bound_the_metric(metric, n_patches):
    template = metric.space.template
    points = np.concatenate([surfaces(template, 6, rng=3, size=size) for size in (0.01, 0.3, 0.8)])
    coordinates = metric.lower_bound_coordinates(points, n_patches)
    bound = np.linalg.norm(coordinates[:, None] - coordinates, axis=-1)
    exact = metric.dist_pairwise(points, precision="double")
    assert np.all(bound <= exact * (1 + 1e-9) + 1e-12)
    assert np.all(bound[~np.eye(len(points), dtype=bool)] > 0)
    np.testing.assert_array_equal(
        coordinates[2], metric.lower_bound_coordinates(points[2], n_patches)
    )
