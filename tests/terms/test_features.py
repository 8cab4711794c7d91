"""What terms keep of each surface, against the definitions."""

import numpy as np
import pytest
from cases import open_template, surfaces
from packed_fields import field_features

from riemhuman.errors import DegenerateSurfaceError
from riemhuman.geometry import FlatMetric, VectorSpace
from riemhuman.kernels import surface, threads
from riemhuman.terms import ConeTerm, EbinTerm, NormalTerm, RootNormalTerm
from riemhuman.terms._drivers import SumOfTerms

TEMPLATE = open_template()
PRECISIONS = {"single": np.float32, "double": np.float64}
# Rounding errors of the features, and of the arithmetic that leads to them.
TOLERANCES = {"single": 1.2e-7, "double": 1e-13}


@pytest.mark.parametrize("precision", PRECISIONS)
def test_normals_of_surfaces(precision):
    points, n_faces = surfaces(TEMPLATE, 3, rng=21), TEMPLATE.n_faces
    normals = surface.unit_normals(
        *surface.partial_derivatives(points, TEMPLATE.differential_operator)
    )
    found, rounding = SumOfTerms([NormalTerm()], TEMPLATE).features(points, precision)
    assert found.dtype == PRECISIONS[precision]
    assert found.shape[-1] % threads.LANES == 0
    assert found.shape[-1] - n_faces < threads.LANES
    np.testing.assert_array_equal(found[..., n_faces:], 0.0)
    expected = np.swapaxes(normals, 1, 2)
    np.testing.assert_allclose(found[..., :n_faces], expected, atol=TOLERANCES[precision])
    again, rounding_again = field_features(NormalTerm(), (normals,), TEMPLATE.face_areas, precision)
    np.testing.assert_allclose(found, again, atol=TOLERANCES[precision])
    np.testing.assert_allclose(rounding, rounding_again, rtol=1e-4)
    assert rounding.any() == (precision == "single")


BY_STRETCH_AND_BY_TURN = ConeTerm(1.0, 1e4, 1.0, 1e-4), ConeTerm(1.0, 1e-4, 1.0, 1e4)


@pytest.mark.parametrize(
    "term", [*BY_STRETCH_AND_BY_TURN, NormalTerm(), RootNormalTerm()], ids=repr
)
def test_rounding_is_little_more_than_the_distance_to_what_is_kept(term):
    driver, points = SumOfTerms([term], TEMPLATE), surfaces(TEMPLATE, 3, rng=5)
    exact, single = (driver.features(points, precision) for precision in ("double", "single"))
    kept = tuple(array.astype(np.float64) for array in single)
    distances = np.sqrt(np.diag(driver.squared_distances(exact, kept)))
    rounding = driver.rounding(single)
    assert np.all(distances <= (1.0 + 1e-6) * rounding)
    assert np.all(rounding <= 2.0 * distances)


def test_the_driver_joins_the_features_of_terms_that_take_the_surfaces():
    terms, points = [EbinTerm(lam=0.3), NormalTerm(), RootNormalTerm()], surfaces(TEMPLATE, 3)
    driver = SumOfTerms(terms, TEMPLATE)
    found = driver.features(points, "single")
    assert len(found) == driver.n_arrays
    expected = [SumOfTerms([term], TEMPLATE).features(points, "single") for term in terms]
    for array, other in zip(found, sum(expected, ()), strict=True):
        np.testing.assert_array_equal(array, other)
    points[1, TEMPLATE.faces[4]] = points[1, TEMPLATE.faces[4, 0]]
    with pytest.raises(DegenerateSurfaceError, match=r"triangle \d of item \(1,\), the first of"):
        driver.features(points, "single")


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
    vectors = np.array([[0.95e15], [-1.05e15]])
    _, rounding = VectorSpace((1,)).metric.features(vectors, "single")
    assert np.isinf(rounding).tolist() == [False, True]


def test_what_is_too_small_for_single_precision_counts_as_rounding():
    tiny = np.full((1, 10), 1e-30)
    metric = FlatMetric(VectorSpace((10,)), np.full(10, 1e-30))
    features, rounding = metric.features(tiny, "single")
    exact = np.sqrt(np.sum(1e-30 * tiny**2))
    kept = np.linalg.norm(features.astype(np.float64))
    assert exact - kept <= rounding[0] < 1e-15
