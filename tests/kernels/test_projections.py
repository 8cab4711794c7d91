"""Coordinates bound distances from below: of fields, projected, and of the metrics."""

import numpy as np
import pytest
from cases import SURFACES, name_of, sphere_template, surfaces

from riemhuman.kernels.projections import Projection, field_coordinates


def test_coordinates_have_the_distances_of_fields():
    template = sphere_template()
    first, second = np.random.default_rng(1).standard_normal((2, 5, template.n_faces, 3))
    exact = np.sum((first - second) ** 2, axis=-1) @ template.face_areas
    one, other = (field_coordinates(fields, template.face_areas) for fields in (first, second))
    np.testing.assert_allclose(np.sum((one - other) ** 2, axis=-1), exact, rtol=1e-12)


def test_projections_never_increase_distances():
    rows = np.random.default_rng(2).standard_normal((30, 12)) * np.arange(1.0, 13.0)
    distances = np.linalg.norm(rows[:, None] - rows, axis=-1)
    for n_components in (0, 3, 12):
        projected = Projection.fit(rows[:20], n_components)(rows)
        found = np.linalg.norm(projected[:, None] - projected, axis=-1)
        assert np.all(found <= distances * (1 + 1e-9))
    np.testing.assert_allclose(found, distances, rtol=1e-6)


@pytest.mark.parametrize("case", SURFACES, ids=name_of)
def test_coordinates_bound_the_metric(case):
    metric, template = case.metric, case.space.template
    points = np.concatenate([surfaces(template, 6, rng=3, size=size) for size in (0.01, 0.3, 0.8)])
    coordinates = metric.lower_bound_coordinates(points)
    bound = np.linalg.norm(coordinates[:, None] - coordinates, axis=-1)
    exact = metric.dist_pairwise(points, precision="double")
    assert np.all(bound <= exact * (1 + 1e-9) + 1e-12)
    assert np.all(bound[~np.eye(len(points), dtype=bool)] > 0)
    np.testing.assert_array_equal(coordinates[2], metric.lower_bound_coordinates(points[2]))
