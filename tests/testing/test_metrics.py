"""Property checks pass all metrics of the registry; broken twins fail where they are broken."""

import autograd.numpy as anp
import numpy as np
import pytest
from cases import CASES, KINDS, HalfPlane, HyperbolicDistance, name_of

from riemhuman.checks import values_of
from riemhuman.errors import ArgumentError
from riemhuman.geometry import FlatMetric, NormalFieldMetric, RiemannianMetric, VectorSpace
from riemhuman.testing import check_metric

POINTS = HalfPlane().random_point(4, rng=3)
PLANE_POINTS = np.random.default_rng(4).uniform(-1.0, 1.0, (4, 2))

SYMMETRIC = "the inner product is symmetric"
LINEAR = "the inner product is linear"
POSITIVE = "the inner product is positive"
STACKED = "inner products of a stack are those of each pair"
COVECTORS = "covectors represent the inner product"
DIAGONAL = "points are at distance 0 from themselves"
FLAT = "squared distances are flat where points meet"
SYMMETRIC_DIST = "distances are symmetric"
TRIANGLE = "no detour is shorter (triangle inequality)"
STACKED_DIST = "distances of a stack are those of each pair"
LIMIT = "short distances are norms of tangent vectors"
ENERGY = "energy ≥ squared length ≥ squared distance"
GRADIENT = "the gradient of the energy is exact"


@pytest.mark.parametrize(
    "case", [case for case in KINDS if "diffused" not in case.name], ids=name_of
)
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


class OneSided(FlatMetric):
    def squared_dist(self, point_a, point_b):
        ahead = anp.exp(0.1 * (point_a[..., 0] - point_b[..., 0]))
        return ahead * anp.sum((point_a - point_b) ** 2, axis=-1)


class SquaredTwice(FlatMetric):
    def squared_dist(self, point_a, point_b):
        return anp.sum((point_a - point_b) ** 2, axis=-1) ** 2


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


def test_only_what_is_broken_is_named():
    for twin, lacking in ((FlatMetric, set()), (Skew, {SYMMETRIC}), (WrongGradient, {GRADIENT})):
        failures = check_metric(twin(plane()), PLANE_POINTS).failures
        assert {check.name for check in failures} == lacking


def test_what_is_not_finite_fails():
    failures = check_metric(NotFinite(plane()), PLANE_POINTS).failures
    assert {SYMMETRIC, LINEAR, STACKED, COVECTORS, LIMIT} <= {check.name for check in failures}


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"points": POINTS[:2]}, "points must hold three points or more; found 2"),
        ({"tangent_vecs": POINTS[:3]}, "tangent_vecs must hold 4 vectors; found 3"),
    ],
)
def test_bad_arguments(arguments, message):
    metric: RiemannianMetric = HyperbolicDistance(HalfPlane())
    with pytest.raises(ArgumentError, match=message):
        check_metric(metric, **({"points": POINTS} | arguments))


LINE_POINTS = np.array([[0.0, 0.0], [1.0, 0.0], [2.0, 0.0], [3.0, 0.0]])


class Sloped(FlatMetric):
    def squared_dist(self, point_a, point_b):
        return anp.sum((point_a - point_b) ** 2, axis=-1) + 0.1 * (point_b - point_a)[..., 0]


class ApartInStacks(FlatMetric):
    def squared_dist(self, point_a, point_b):
        return anp.sum((point_a - point_b) ** 2, axis=-1) + 0.5 * (anp.ndim(point_a) > 1)


class NoLength(EnergyWithoutSegments):
    def length(self, path):
        return np.zeros(())


@pytest.mark.parametrize(
    ("twin", "name", "expected"),
    [
        # a = (0, 2) and b = a/2: ⟨2a − 3b, b⟩ is 1, of 13, where ⟨a, a⟩ is 64.
        (Cubic, LINEAR, 12.0 / 64.0),
        (WrongCovector, COVECTORS, 0.001 * 0.5),
        (Lorentzian, POSITIVE, 1.0),
        (Blind, POSITIVE, np.inf),
        (Summed, STACKED, np.inf),
        (Shifted, DIAGONAL, 0.1 / np.sqrt(9.01)),
        (Sloped, FLAT, 0.1 / 9.3),
        (OneSided, SYMMETRIC_DIST, 1.0 - np.exp(-0.3)),
        # The longest way, 3² long, is 2 · 1.5² by its middle.
        (SquaredTwice, TRIANGLE, 0.5),
        (ApartInStacks, STACKED_DIST, 0.5 / 9.0),
        (TooShort, LIMIT, 0.1),
        # Of the squared length 9, one third is left.
        (EnergyWithoutSegments, ENERGY, 2.0),
        (NoLength, ENERGY, 2.0),
        (FlatMetric, GRADIENT, 0.0),
    ],
)
def test_errors_by_hand(twin, name, expected):
    """Points in a line, with one tangent vector at all of them."""
    vectors = np.array([[0.0, 2.0]] * 4)
    report = check_metric(twin(plane()), LINE_POINTS, vectors)
    errors = {check.name: check.error for check in report.checks}
    assert errors[name] == pytest.approx(expected, rel=1e-6)


@pytest.mark.parametrize("scale", [1e-6, 1.0, 1e6])
def test_rounding_errors_are_no_remainders(scale):
    """Vectors so short that the energy's remainder is below its rounding errors."""
    vectors = 1e-6 * scale * PLANE_POINTS
    report = check_metric(FlatMetric(plane()), scale * PLANE_POINTS, vectors)
    assert {check.name: check.error for check in report.checks}[GRADIENT] == 0.0


def test_points_of_the_manifold_alone_are_asked_for():
    seen = []

    class Watched(NormalFieldMetric):
        def squared_dist(self, point_a, point_b):
            seen.extend([values_of(point_a), values_of(point_b)])
            return super().squared_dist(point_a, point_b)

    points = CASES["normals sphere"].points
    metric = Watched(CASES["normals sphere"].space)
    assert check_metric(metric, points).passed
    assert len(seen) > 100
    assert all(np.all(metric.space.belongs(point)) for point in seen)
