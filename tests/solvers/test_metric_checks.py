"""Property checks pass all metrics of the registry; broken twins fail where they are broken."""

import autograd.numpy as anp
import numpy as np
import pytest
from cases import CASES, HalfPlane, HyperbolicDistance, HyperbolicInnerProduct, name_of

from riemhuman.errors import ArgumentError
from riemhuman.geometry.metric import RiemannianMetric
from riemhuman.geometry.vector_space import FlatMetric, VectorSpace
from riemhuman.solvers.metric_checks import MetricReport, PropertyCheck, check_metric

POINTS = HalfPlane().random_point(4, rng=3)
PLANE_POINTS = np.random.default_rng(4).uniform(-1.0, 1.0, (4, 2))

SYMMETRIC = "the inner product is symmetric"
LINEAR = "the inner product is linear"
POSITIVE = "the inner product is positive"
STACKED = "inner products in a stack are those of each"
COVECTORS = "covectors represent the inner product"
DIAGONAL = "points are at distance 0 from themselves"
FLAT = "squared distances are flat where points meet"
SYMMETRIC_DIST = "distances are symmetric"
TRIANGLE = "no detour is shorter (triangle inequality)"
STACKED_DIST = "distances in a stack are those of each"
LIMIT = "short distances are norms of tangent vectors"
ENERGY = "energy ≥ squared length ≥ squared distance"
GRADIENT = "the gradient of the energy is exact"


@pytest.mark.parametrize("case", CASES.values(), ids=name_of)
def test_metrics_of_the_registry_pass(case):
    report = check_metric(case.metric, case.points, case.tangent_vecs)
    assert report.passed, str(report)
    assert len(report.checks) == (13 if case.metric.has_closed_form_dist else 7)


def plane():
    return VectorSpace((2,), equip=False)


class Skew(FlatMetric):
    def inner_product(self, tangent_vec_a, tangent_vec_b, base_point):
        (a, b), (c, d) = anp.moveaxis(tangent_vec_a, -1, 0), anp.moveaxis(tangent_vec_b, -1, 0)
        return a * c + b * d + 0.3 * (a * d - b * c)


class Cubic(FlatMetric):
    def inner_product(self, tangent_vec_a, tangent_vec_b, base_point):
        return anp.sum(tangent_vec_a**3 * tangent_vec_b**3, axis=-1)


class Lorentzian(FlatMetric):
    def inner_product(self, tangent_vec_a, tangent_vec_b, base_point):
        return anp.sum(tangent_vec_a * tangent_vec_b * anp.array([1.0, -1.0]), axis=-1)


class Blind(FlatMetric):
    def inner_product(self, tangent_vec_a, tangent_vec_b, base_point):
        return 0.0 * anp.sum(tangent_vec_a * tangent_vec_b, axis=-1)


class Summed(FlatMetric):
    def inner_product(self, tangent_vec_a, tangent_vec_b, base_point):
        return anp.sum(tangent_vec_a * tangent_vec_b)


class WrongCovector(FlatMetric):
    def covector(self, tangent_vec, base_point):
        return 1.001 * tangent_vec


class Shifted(FlatMetric):
    def squared_dist(self, point_a, point_b):
        return anp.sum((point_a - point_b) ** 2, axis=-1) + 0.01


class RootSquared(FlatMetric):
    """Right, but its gradient is 0/0 where points meet."""

    def squared_dist(self, point_a, point_b):
        return anp.sqrt(anp.sum((point_a - point_b) ** 2, axis=-1)) ** 2


class OneSided(FlatMetric):
    def squared_dist(self, point_a, point_b):
        ahead = anp.exp(0.1 * (point_a[..., 0] - point_b[..., 0]))
        return ahead * anp.sum((point_a - point_b) ** 2, axis=-1)


class SquaredTwice(FlatMetric):
    def squared_dist(self, point_a, point_b):
        return anp.sum((point_a - point_b) ** 2, axis=-1) ** 2


class AllTogether(FlatMetric):
    def squared_dist(self, point_a, point_b):
        return anp.sum((point_a - point_b) ** 2)


class TooShort(FlatMetric):
    def squared_dist(self, point_a, point_b):
        return 0.9 * anp.sum((point_a - point_b) ** 2, axis=-1)


class EnergyWithoutSegments(FlatMetric):
    def energy(self, path):
        return super().energy(path) / (len(path) - 1)


class WrongGradient(FlatMetric):
    def energy_and_gradient(self, path):
        energy, gradient = super().energy_and_gradient(path)
        return energy, 1.001 * gradient


class NotFinite(FlatMetric):
    def inner_product(self, tangent_vec_a, tangent_vec_b, base_point):
        return anp.sum(tangent_vec_a * tangent_vec_b, axis=-1) / anp.zeros(())


@pytest.mark.parametrize(
    ("twin", "lacking"),
    [
        (Skew, {SYMMETRIC}),
        (Cubic, {LINEAR, COVECTORS, LIMIT}),
        (Lorentzian, {POSITIVE, LIMIT}),
        (Blind, {POSITIVE, LIMIT}),
        (Summed, {STACKED}),
        (WrongCovector, {COVECTORS}),
        (Shifted, {DIAGONAL, LIMIT}),
        (RootSquared, {FLAT}),
        (OneSided, {SYMMETRIC_DIST}),
        (SquaredTwice, {TRIANGLE, LIMIT}),
        (AllTogether, {STACKED_DIST}),
        (TooShort, {LIMIT}),
        (EnergyWithoutSegments, {ENERGY}),
        (WrongGradient, {GRADIENT}),
        (NotFinite, {SYMMETRIC, LINEAR, STACKED, COVECTORS, LIMIT}),
    ],
)
def test_broken_twins_fail_where_they_are_broken(twin, lacking):
    assert check_metric(FlatMetric(plane()), PLANE_POINTS).passed
    found = {check.name for check in check_metric(twin(plane()), PLANE_POINTS).failures}
    assert lacking <= found


@pytest.mark.parametrize(
    "twin", [Skew, Summed, WrongCovector, TooShort, EnergyWithoutSegments, WrongGradient]
)
def test_only_what_is_broken_is_named(twin):
    assert len(check_metric(twin(plane()), PLANE_POINTS).failures) == 1


def test_error_is_by_how_much():
    errors = {
        check.name: check.error for check in check_metric(TooShort(plane()), PLANE_POINTS).checks
    }
    assert 0.05 < errors[LIMIT] <= 0.1 + 1e-9
    errors = {
        check.name: check.error
        for check in check_metric(WrongGradient(plane()), PLANE_POINTS).checks
    }
    assert 0.5 < errors[GRADIENT] < 1.1


class WrongCurvature(HyperbolicDistance):
    """Its two primitives belong to different metrics, at points with y ≠ 1."""

    def inner_product(self, tangent_vec_a, tangent_vec_b, base_point):
        return anp.sum(tangent_vec_a * tangent_vec_b, axis=-1) / base_point[..., 1]


def test_primitives_that_do_not_belong_together():
    report = check_metric(WrongCurvature(HalfPlane()), POINTS)
    assert [check.name for check in report.failures] == [LIMIT]


def test_what_has_no_closed_form_is_not_asked_for():
    names = {
        check.name for check in check_metric(HyperbolicInnerProduct(HalfPlane()), POINTS).checks
    }
    assert {SYMMETRIC, ENERGY, GRADIENT} <= names
    assert not {TRIANGLE, LIMIT} & names


def test_report_is_a_table():
    report = check_metric(WrongCovector(plane()), PLANE_POINTS)
    lines = str(report).splitlines()
    assert lines[0] == "WrongCovector: 12 of 13 properties hold"
    (failed,) = [line for line in lines if line.startswith("FAILS")]
    assert COVECTORS in failed
    assert "> 1e-06" in failed
    assert not report.passed
    assert MetricReport("Nothing", ()).passed


def test_not_a_number_does_not_pass():
    assert not PropertyCheck("any", np.nan, 1.0).holds
    assert PropertyCheck("any", 1.0, 1.0).holds


def test_arguments_stay_as_they_are():
    points, vectors = POINTS.copy(), np.ones_like(POINTS)
    check_metric(HyperbolicDistance(HalfPlane()), points, vectors)
    np.testing.assert_array_equal(points, POINTS)
    np.testing.assert_array_equal(vectors, 1.0)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"points": POINTS[:2]}, "points must hold three points or more; found 2"),
        ({"points": POINTS[:, :1]}, r"points must have shape .*found \(4, 1\)"),
        ({"tangent_vecs": POINTS[:3]}, "tangent_vecs must hold 4 vectors; found 3"),
        ({"tolerance": 0.0}, "tolerance must be a finite number above 0"),
    ],
)
def test_bad_arguments(arguments, message):
    metric: RiemannianMetric = HyperbolicDistance(HalfPlane())
    with pytest.raises(ArgumentError, match=message):
        check_metric(metric, **({"points": POINTS} | arguments))


LINE_POINTS = np.array([[0.0, 0.0], [1.0, 0.0], [2.0, 0.0], [3.0, 0.0]])


@pytest.mark.parametrize(
    ("twin", "name", "expected"),
    [
        (WrongCovector, COVECTORS, 0.001 * 0.5),
        (Lorentzian, POSITIVE, 1.0),
        (Blind, POSITIVE, np.inf),
        (Summed, STACKED, np.inf),
        (Shifted, DIAGONAL, 0.1 / np.sqrt(9.01)),
        (OneSided, SYMMETRIC_DIST, 1.0 - np.exp(-0.3)),
        # The longest way, 3² long, is 2 · 1.5² by its middle.
        (SquaredTwice, TRIANGLE, 0.5),
        (AllTogether, STACKED_DIST, np.inf),
        (TooShort, LIMIT, 0.1),
        # Of the squared length 9, one third is left.
        (EnergyWithoutSegments, ENERGY, 2.0),
    ],
)
def test_errors_by_hand(twin, name, expected):
    """Points in a line, with one tangent vector at all of them."""
    vectors = np.array([[0.0, 2.0]] * 4)
    report = check_metric(twin(plane()), LINE_POINTS, vectors)
    errors = {check.name: check.error for check in report.checks}
    assert errors[name] == pytest.approx(expected, rel=1e-6)


def test_tolerances():
    report = check_metric(FlatMetric(plane()), LINE_POINTS, tolerance=1e-4)
    tolerances = {check.name: check.tolerance for check in report.checks}
    assert tolerances.pop(LIMIT) == pytest.approx(1e-2)
    assert tolerances.pop(GRADIENT) == 0.1
    assert set(tolerances.values()) == {1e-4}
    # The error of TooShort in the norms, 0.1, is the root of this tolerance.
    for tolerance, holds in ((0.0102, True), (0.0098, False)):
        vectors = np.array([[0.0, 2.0]] * 4)
        found = check_metric(TooShort(plane()), LINE_POINTS, vectors, tolerance=tolerance)
        (limit,) = [check for check in found.checks if check.name == LIMIT]
        assert limit.holds == holds
