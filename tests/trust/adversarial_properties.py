"""What every metric owes on adversarial points, as functions of a subject that assert.

A tolerance is `ROUNDING` times what rounding of the points may cost, see `adversarial_metrics`.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import autograd.numpy as anp
import numpy as np
import pytest
from autograd import grad
from oracles import taylor_slope
from trust.adversarial_metrics import FIELDS, METRICS, Subject
from trust.adversarial_surfaces import EPS

import riemhuman as rh

ROUNDING = 4.0
PAIRS = [(0, 1), (0, 2), (1, 2)]


def distances_are_exact(subject: Subject, rng: np.random.Generator) -> None:
    """Against arithmetic with 60 digits."""
    for i, j in PAIRS:
        exact = float(subject.exact(i, j) ** 0.5)
        found = subject.metric.dist(subject.points[i], subject.points[j])
        assert abs(found - exact) <= ROUNDING * subject.rounding + 1e-13 * exact


def axioms(subject: Subject, rng: np.random.Generator) -> None:
    """Symmetry, positivity, the triangle inequality; 0 where points coincide."""
    metric, (x, y, z) = subject.metric, subject.points
    xy, yz, xz = metric.dist(x, y), metric.dist(y, z), metric.dist(x, z)
    assert xy == metric.dist(y, x)
    assert min(xy, yz, xz) >= 0
    for point in subject.points:
        assert metric.dist(point, point) == 0
        assert metric.squared_dist(point, point.copy()) == 0
    # Each of the three may be wrong by the allowance and in its last digits.
    assert xz <= xy + yz + 3 * ROUNDING * subject.rounding + 1e-13 * (xy + yz)


def code_paths_agree(subject: Subject, rng: np.random.Generator) -> None:
    """One by one, batched, all pairs in both precisions and in slices, as paths, as a gradient."""
    metric, points = subject.metric, subject.points
    one_by_one = np.array([[metric.dist(f, g) for g in points] for f in points])
    tight = ROUNDING * subject.rounding + 1e-12 * one_by_one.max()

    def check(found: np.ndarray, expected: np.ndarray = one_by_one, rtol: float = 0.0) -> None:
        np.testing.assert_allclose(found, expected, rtol=rtol, atol=tight)

    check(metric.dist(points[:, None], points[None]))
    check(np.sqrt(metric.squared_dist(points[:, None], points[None])))
    check(metric.dist_pairwise(points, precision="double"))
    single = metric.dist_pairwise(points)
    check(single, rtol=2e-5)
    for options in ({"n_jobs": 2}, {"memory": 1}):
        np.testing.assert_array_equal(metric.dist_pairwise(points, **options), single)
    np.testing.assert_array_equal(metric.cdist(points, points[:2]), single[:, :2])
    for i, j in PAIRS:
        path = points[[i, j]]
        check(metric.length(path), one_by_one[i, j])
        check(np.sqrt(metric.energy(path)), one_by_one[i, j])
        check(np.sqrt(metric.energy(path[None]))[0], one_by_one[i, j])
        energy, gradient = metric.energy_and_gradient(path)
        check(np.sqrt(energy), one_by_one[i, j])
        assert np.isfinite(gradient).all()
        if i == 0:
            # The derivative along a vector of size about 1, whatever the size of a triangle.
            slope = np.sum(gradient[0] * subject.tangent_vecs[0])
            expected = grad(metric.squared_dist)(*path)
            allowance = 8 * ROUNDING * subject.rounding * subject.scale
            expected_slope = np.sum(expected * subject.tangent_vecs[0])
            assert abs(slope - expected_slope) <= allowance + 1e-12 * abs(expected_slope)


def isometries(subject: Subject, rng: np.random.Generator) -> None:
    """Distances under each symmetry that the metric claims."""
    expected = subject.metric.dist(*subject.points[:2])
    for isometry in subject.isometries:
        other, ratio = isometry(subject, rng)
        # Moved and turned coordinates are rounded anew, and up to three times as large.
        tolerance = 8 * ROUNDING * ratio * subject.rounding + 1e-12 * ratio * expected
        assert abs(other.metric.dist(*other.points[:2]) - ratio * expected) <= tolerance, isometry


def inner_products_are_bilinear(subject: Subject, rng: np.random.Generator) -> None:
    """Symmetric, bilinear, positive, with the inequality of Cauchy and Schwarz."""
    metric, x, (v, w) = subject.metric, subject.points[0], subject.tangent_vecs
    product, bound = metric.inner_product(v, w, x), metric.norm(v, x) * metric.norm(w, x)
    assert metric.norm(v, x) > 0
    assert metric.norm(0.0 * v, x) == 0
    tolerance = ROUNDING * EPS * subject.condition * (bound + metric.squared_norm(v, x))
    assert abs(product) <= bound + tolerance
    assert abs(metric.inner_product(w, v, x) - product) <= tolerance
    both = 2.0 * metric.squared_norm(v, x) - 3.0 * product
    assert abs(metric.inner_product(v, 2.0 * v - 3.0 * w, x) - both) <= 4 * tolerance
    assert abs(np.sum(metric.covector(v, x) * w) - product) <= 4 * tolerance
    gram = metric.gram_matrix(subject.tangent_vecs, x)
    np.testing.assert_allclose(gram[0, 1], product, rtol=0, atol=4 * tolerance)
    np.testing.assert_array_equal(gram, gram.T)


def inner_products_are_exact(subject: Subject, rng: np.random.Generator) -> None:
    """Against arithmetic with 60 digits."""
    x, (v, w) = subject.points[0], subject.tangent_vecs
    norms = [float(subject.exact_product(u, u) ** 0.5) for u in (v, w)]
    exact = float(subject.exact_product(v, w))
    tolerance = ROUNDING * EPS * subject.condition * norms[0] * norms[1]
    assert abs(subject.metric.inner_product(v, w, x) - exact) <= tolerance
    norm = subject.metric.norm(v, x)
    assert abs(norm - norms[0]) <= ROUNDING * EPS * subject.condition * norms[0]


def norms_are_limits_of_distances(subject: Subject, rng: np.random.Generator) -> None:
    """Of the distance to a near point, over the step."""
    metric, x, v = subject.metric, subject.points[0], subject.tangent_vecs[0]
    step = 1e-3 * subject.reach
    near = metric.space.projection(x + step * v)
    norm = metric.norm(v, x)
    tolerance = 2 * ROUNDING * subject.rounding / step + 0.02 * norm
    assert abs(metric.dist(x, near) / step - norm) <= tolerance


def energies_bound_distances(subject: Subject, rng: np.random.Generator) -> None:
    """E ≥ L² ≥ d², and no change where a path stands still."""
    metric, points = subject.metric, subject.points
    direct, length = metric.dist(points[0], points[2]), metric.length(points)
    slack = 4 * ROUNDING * subject.rounding + 1e-12 * length
    assert length >= direct - slack
    assert np.sqrt(metric.energy(points)) >= length - slack
    assert metric.energy(points[[0, 0, 0]]) == 0
    assert abs(metric.length(points[[0, 0, 2, 2]]) - direct) <= slack


def gradients_are_finite(subject: Subject, rng: np.random.Generator) -> None:
    """Everywhere, and 0 where points coincide."""
    metric, points = subject.metric, subject.points
    for i, j in [*PAIRS, (0, 0)]:
        for argument in (0, 1):
            for function in (metric.squared_dist, metric.dist):
                gradient = grad(function, argument)(points[i], points[j].copy())
                assert np.isfinite(gradient).all()
                assert i != j or not gradient.any()
    assert np.isfinite(grad(metric.energy)(points)).all()


def gradients_have_the_taylor_slope(subject: Subject, rng: np.random.Generator) -> None:
    """Order 2 of what a gradient leaves."""
    metric, x = subject.metric, subject.points[0]
    direction = subject.reach * subject.tangent_vecs[0]
    # The value is near its own change, or digits go.
    near = metric.space.projection(x + subject.reach * subject.tangent_vecs.sum(axis=0))

    def value(point: np.ndarray) -> np.ndarray:
        return metric.squared_dist(metric.space.projection(point), near)

    def squared_norm(point: np.ndarray) -> np.ndarray:
        # Some inner products do not depend on the base point; autograd warns of that.
        norm = metric.squared_norm(direction, metric.space.projection(point))
        return norm + 0.0 * anp.sum(point)

    for function in (value, squared_norm):
        rounding = 1e-13 + 2 * ROUNDING * subject.rounding / np.sqrt(function(x))
        assert taylor_slope(function, x, direction, grad(function)(x), rounding) >= 1.9, function


def single_precision_is_read_as_what_it_is(subject: Subject, rng: np.random.Generator) -> None:
    """The same number, or the same refusal, as of the same points in double precision."""
    single = subject.points[:2].astype(np.float32)
    try:
        expected = subject.metric.dist(*single.astype(np.float64))
    except rh.RiemhumanError as error:
        with pytest.raises(type(error)):
            subject.metric.dist(*single)
        return
    assert subject.metric.dist(*single) == expected


def geodesics_have_constant_speed(subject: Subject, rng: np.random.Generator) -> None:
    """Exponential, logarithm and geodesic belong together, and to the distance."""
    metric, x, v = subject.metric, subject.points[0], subject.reach * subject.tangent_vecs[0]
    end = metric.exp(v, x)
    velocity = metric.log(end, x)
    tolerance = 4 * ROUNDING * subject.rounding / subject.reach
    distance = metric.dist(x, end)
    assert abs(metric.norm(v, x) - distance) <= tolerance + 1e-12 * distance
    assert abs(metric.norm(velocity, x) - distance) <= tolerance + 1e-12 * distance
    assert metric.dist(metric.exp(velocity, x), end) <= tolerance
    path = metric.geodesic(x, end)(np.linspace(0.0, 1.0, 5))
    assert np.max(metric.dist(path[[0, -1]], np.stack([x, end]))) <= tolerance
    steps = metric.dist(path[:-1], path[1:])
    np.testing.assert_allclose(steps, distance / 4, rtol=1e-11, atol=tolerance)


@dataclass(frozen=True)
class Property:
    """A property, the metrics it holds for, and whether it is asked of smooth subjects alone."""

    check: Callable[[Subject, np.random.Generator], None]
    metrics: tuple[str, ...] = tuple(METRICS)
    smooth: bool = False


PROPERTIES = {
    "exact distance": Property(distances_are_exact),
    "axioms": Property(axioms),
    "code paths": Property(code_paths_agree),
    "isometries": Property(isometries),
    "bilinearity": Property(inner_products_are_bilinear),
    "exact product": Property(inner_products_are_exact),
    "norm as limit": Property(norms_are_limits_of_distances),
    "energy bounds": Property(energies_bound_distances),
    "finite gradient": Property(gradients_are_finite),
    "Taylor slope": Property(gradients_have_the_taylor_slope, smooth=True),
    "float32": Property(single_precision_is_read_as_what_it_is),
    "exp and log": Property(geodesics_have_constant_speed, FIELDS),
}
"""Properties by name."""
CELLS = [(name, metric) for name in PROPERTIES for metric in PROPERTIES[name].metrics]
"""All pairs of a property and a metric it holds for."""
