"""What compiled loops keep of each point, against the definitions."""

import numpy as np
import pytest
from cases import open_template, sphere_template, surfaces, triangle_template

from riemhuman.kernels import compiled_features as kernel
from riemhuman.kernels import ebin, surface

TEMPLATES = {"sphere": sphere_template(), "open": open_template()}
each_template = pytest.mark.parametrize("template", TEMPLATES.values(), ids=TEMPLATES)
PRECISIONS = {"single": np.float32, "double": np.float64}
each_precision = pytest.mark.parametrize("precision", PRECISIONS)
# Rounding errors of the features, and of the arithmetic that leads to them.
TOLERANCES = {"single": 1.2e-7, "double": 1e-13}


def some_surfaces(template):
    """Return surfaces, of which one has triangles without area."""
    points = surfaces(template, 3, rng=21)
    one, two, three = template.faces[4]
    points[1, three] = 0.25 * points[1, one] + 0.75 * points[1, two]
    points[1, template.faces[9]] = points[1, template.faces[9, 0]]
    return points


def definitions(template, points):
    """Return f_u and f_v of surfaces, and which triangles have no area."""
    derivatives = surface.partial_derivatives(points, template.differential_operator)
    return *derivatives, surface.is_degenerate(*derivatives)


def arguments(template, precision):
    return template.faces, template.frame_coefficients, template.face_areas, precision


def split(features, length):
    """Return features and the zeros that fill up their rows, or fail."""
    assert features.shape[-1] % kernel.LANES == 0
    assert features.shape[-1] - length < kernel.LANES
    np.testing.assert_array_equal(features[..., length:], 0.0)
    return features[..., :length]


@each_template
@each_precision
def test_metric_fields_of_surfaces(template, precision):
    points = some_surfaces(template)
    faces, frames, areas, _ = arguments(template, precision)
    found, rounding = kernel.surface_metric_field_features(
        points, faces, frames, areas, 0.3, precision
    )
    f_u, f_v, degenerate = definitions(template, points)
    x, y, s = ebin.coordinates_of_derivatives(f_u, f_v)
    x, y = np.where(degenerate, 0.0, x), np.where(degenerate, 1.0, y)
    radii = np.sqrt(areas) * np.where(degenerate, 0.0, s)
    assert found.dtype == PRECISIONS[precision]
    assert found.shape[:2] == (3, 4)
    expected = np.stack([x, y, 1 / (np.sqrt(2) * y), radii], axis=1)
    np.testing.assert_allclose(
        split(found, template.n_faces), expected, rtol=TOLERANCES[precision], atol=1e-12
    )
    again, rounding_again = kernel.metric_field_features(
        x, y, radii / np.sqrt(areas), areas, 0.3, precision
    )
    np.testing.assert_allclose(found, again, rtol=TOLERANCES[precision], atol=1e-12)
    np.testing.assert_allclose(rounding, rounding_again, rtol=1e-4)
    assert rounding.any() == (precision == "single")


@each_template
@each_precision
def test_normals_of_surfaces(template, precision):
    points = some_surfaces(template)
    found, rounding, degenerate = kernel.surface_normal_features(
        points, *arguments(template, precision)
    )
    f_u, f_v, expected_degenerate = definitions(template, points)
    np.testing.assert_array_equal(degenerate, expected_degenerate)
    assert degenerate.sum(axis=1).tolist()[::2] == [0, 0]
    assert degenerate[1, 4]
    assert degenerate[1, 9]
    with np.errstate(invalid="ignore"):
        normals = surface.unit_normals(f_u, f_v)
    normals = np.where(degenerate[..., None], 0.0, normals)
    assert found.dtype == PRECISIONS[precision]
    np.testing.assert_allclose(
        split(found, template.n_faces),
        np.swapaxes(normals, 1, 2),
        atol=TOLERANCES[precision],
    )
    again, rounding_again = kernel.normal_features(normals, template.face_areas, precision)
    np.testing.assert_allclose(found, again, atol=TOLERANCES[precision])
    np.testing.assert_allclose(rounding, rounding_again, rtol=1e-4)
    assert rounding.any() == (precision == "single")


@each_template
@each_precision
def test_square_root_normals_of_surfaces(template, precision):
    points = some_surfaces(template)
    found, rounding = kernel.surface_root_normal_features(points, *arguments(template, precision))
    f_u, f_v, _ = definitions(template, points)
    fields = surface.square_root_normals(f_u, f_v)
    weighted = np.sqrt(template.face_areas)[:, None] * fields
    assert found.dtype == PRECISIONS[precision]
    np.testing.assert_allclose(
        split(found, 3 * template.n_faces),
        weighted.reshape(3, -1),
        rtol=TOLERANCES[precision],
        atol=1e-12,
    )
    areas = np.repeat(template.face_areas, 3)
    again, rounding_again = kernel.vector_features(fields.reshape(3, -1), areas, precision)
    np.testing.assert_allclose(found, again, rtol=TOLERANCES[precision], atol=1e-12)
    np.testing.assert_allclose(rounding, rounding_again, rtol=1e-4)
    assert rounding.any() == (precision == "single")


@pytest.mark.parametrize("axis", range(3))
def test_triangles_pressed_to_an_edge_along_an_axis(axis):
    template = triangle_template()
    edge = np.array([[0.0], [0.7], [0.4]]) * np.eye(3)[axis]
    edge[2, axis - 1] = 1e-9
    points = np.stack([template.vertices[0] + edge, edge])
    faces, frames, areas, precision = arguments(template, "double")
    fields, _ = kernel.surface_metric_field_features(points, faces, frames, areas, 0.3, precision)
    np.testing.assert_array_equal(fields[:, [0, 3]], 0.0)
    normals, _, degenerate = kernel.surface_normal_features(points, faces, frames, areas, precision)
    assert degenerate.tolist() == [[True], [True]]
    np.testing.assert_array_equal(normals, 0.0)
    roots, _ = kernel.surface_root_normal_features(points, faces, frames, areas, precision)
    np.testing.assert_array_equal(roots, 0.0)


def test_range_of_single_precision():
    """Squares of what is kept, and products of squares, stay within its range."""
    limits = np.finfo(np.float32)
    assert limits.max > kernel._LARGEST**2
    assert limits.tiny < kernel._SMALLEST**2
    x, y, s = np.zeros((8, 1)), np.ones((8, 1)), np.ones((8, 1))
    x[0], x[1] = 0.9e15, -1.1e15
    y[2], y[3], y[4], y[5] = 0.9e15, 1.1e15, 1.1e-15, 0.9e-15
    s[6], s[7] = 0.9e15, 1.1e15
    _, rounding = kernel.metric_field_features(x, y, s, np.ones(1), 0.3, "single")
    assert np.isinf(rounding).tolist() == [False, True, False, True, False, True, False, True]
    vectors = np.array([[0.9e15], [-1.1e15], [np.nan]])
    _, rounding = kernel.vector_features(vectors, np.ones(1), "single")
    assert np.isinf(rounding).tolist() == [False, True, True]


def test_rounding_is_at_most_the_way_through_the_apex():
    x, y, s = np.array([[123456789.0]]), np.array([[0.01]]), np.array([[1.7]])
    _, rounding = kernel.metric_field_features(x, y, s, np.array([0.25]), 0.3, "single")
    # 4√λ (s₁ + s₂), times √w.
    assert rounding[0] == pytest.approx(4 * np.sqrt(0.3) * 2 * 1.7 * 0.5, rel=1e-6)


def test_what_is_too_small_for_single_precision_counts_as_rounding():
    tiny = np.full((1, 10), 1e-30)
    features, rounding = kernel.vector_features(tiny, np.full(10, 1e-30), "single")
    exact = np.sqrt(np.sum(1e-30 * tiny**2))
    kept = np.linalg.norm(features.astype(np.float64))
    assert exact - kept <= rounding[0] < 1e-15


def test_arrays_of_one_kind():
    array = np.arange(6.0).reshape(2, 3)
    for given in (array, array[:, ::-1], np.asfortranarray(array), array.T):
        kept = kernel.of_one_kind(given)
        np.testing.assert_array_equal(kept, given)
        assert kept.flags.c_contiguous
        assert not kept.flags.writeable
        assert given.flags.writeable
