"""What terms keep of each surface, against the definitions."""

import numpy as np
import pytest
from cases import open_template, sphere_template, surfaces
from packed_fields import field_features

from riemhuman.errors import DegenerateSurfaceError
from riemhuman.kernels import surface, threads
from riemhuman.terms import EbinTerm, NormalTerm, RootNormalTerm, flat
from riemhuman.terms._sum import SumOfTerms, fill_records

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


def features_of(term, template, points, precision):
    """Return features and rounding, of triangles without area too."""
    found = SumOfTerms([term], template)
    found.needs_area = False
    return found.features(points, precision)


def marked(template, points):
    """Return the triangles that the compiled loop finds to have no area."""
    path = threads.of_one_kind(np.swapaxes(points, 0, 1))
    records = np.empty((len(points), 12, template.n_faces))
    fill_records(path, template.faces, template.frame_coefficients, 0, template.n_faces, records)
    return records[:, 9] == 0.0


def split(features, length):
    """Return features and the zeros that fill up their rows, or fail."""
    assert features.shape[-1] % threads.LANES == 0
    assert features.shape[-1] - length < threads.LANES
    np.testing.assert_array_equal(features[..., length:], 0.0)
    return features[..., :length]


@each_template
@each_precision
def test_normals_of_surfaces(template, precision):
    points = some_surfaces(template)
    found, rounding = features_of(NormalTerm(), template, points, precision)
    degenerate = marked(template, points)
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
        split(found, template.n_faces), np.swapaxes(normals, 1, 2), atol=TOLERANCES[precision]
    )
    again, rounding_again = field_features(NormalTerm(), (normals,), template.face_areas, precision)
    np.testing.assert_allclose(found, again, atol=TOLERANCES[precision])
    np.testing.assert_allclose(rounding, rounding_again, rtol=1e-4)
    assert rounding.any() == (precision == "single")


def test_the_driver_joins_the_features_of_terms_that_take_the_surfaces():
    template = TEMPLATES["open"]
    terms, points = [EbinTerm(lam=0.3), NormalTerm(), RootNormalTerm()], some_surfaces(template)
    found = SumOfTerms(terms, template).features(points[::2], "single")
    assert len(found) == SumOfTerms(terms, template).n_arrays
    expected = [features_of(term, template, points[::2], "single") for term in terms]
    for array, other in zip(found, sum(expected, ()), strict=True):
        np.testing.assert_array_equal(array, other)
    with pytest.raises(DegenerateSurfaceError, match=r"triangle 4 of item \(1,\), the first of 5"):
        SumOfTerms(terms, template).features(points, "single")


def test_range_of_single_precision():
    """Squares of what is kept, and products of squares, stay within its range."""
    limits = np.finfo(np.float32)
    assert limits.max > threads.LARGEST**2
    assert limits.tiny < threads.SMALLEST**2
    x, y, s = np.zeros((8, 1)), np.ones((8, 1)), np.ones((8, 1))
    x[0], x[1] = 0.95e15, -1.05e15
    y[2], y[3], y[4], y[5] = 0.95e15, 1.05e15, 1.05e-15, 0.95e-15
    s[6], s[7] = 0.95e15, 1.05e15
    _, rounding = field_features(EbinTerm(lam=0.3), (x, y, s), np.ones(1), "single")
    assert np.isinf(rounding).tolist() == [False, True, False, True, False, True, False, True]
    vectors = np.array([[[0.95e15]], [[-1.05e15]], [[np.nan]]])
    _, rounding = flat.vector_features(vectors, np.ones(1), "single")
    assert np.isinf(rounding).tolist() == [False, True, True]


def test_what_is_too_small_for_single_precision_counts_as_rounding():
    tiny = np.full((1, 10), 1e-30)
    features, rounding = flat.vector_features(tiny[..., None], np.full(10, 1e-30), "single")
    exact = np.sqrt(np.sum(1e-30 * tiny**2))
    kept = np.linalg.norm(features.astype(np.float64))
    assert exact - kept <= rounding[0] < 1e-15
