"""Metrics on legal surfaces that rounding does not like: slivers, far, flat, folded, coincident.

Rounding may move a distance by ε times the condition of the surfaces times the scale of the
metric, and by a small factor more. What a metric owes on other surfaces is in `tests/geometry`.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import adversarial_surfaces as exact
import numpy as np
import pytest
from adversarial_surfaces import EPS, Surfaces, draw
from autograd import grad

import riemhuman as rh

# Derivatives are taken by the chain rule from edges: what overflows or divides by 0 is an error.
pytestmark = pytest.mark.filterwarnings("error")

ROUNDING = 4.0
PAIRS = [(0, 1), (0, 2), (1, 2)]


@dataclass(frozen=True, eq=False)
class Subject:
    """A metric on three surfaces; relative errors ε of coordinates move distances by `rounding`."""

    found: Surfaces
    make_metric: Callable[[rh.AlignedSurfaces], rh.RiemannianMetric]
    scale: float
    squared_dist: Callable[[int, int], Any]

    @property
    def metric(self) -> rh.RiemannianMetric:
        return self.make_metric(self.found.space)

    @property
    def rounding(self) -> float:
        return EPS * self.found.condition * self.scale


def elastic(found, a, lam, c):
    return Subject(
        found,
        lambda space: rh.ElasticMetric(space, a, lam, c),
        exact.scale_of_elastic(found, a, lam, c),
        lambda i, j: exact.exact_elastic(found, i, j, a, lam, c),
    )


METRICS = {
    "shape": lambda found, a, lam, c: elastic(found, 1.0, lam, 0.0),
    "pose": lambda found, a, lam, c: elastic(found, 0.0, 0.0, 1.0),
    "mixed": elastic,
}


def check_distances(subject, name):
    """Distances are those of 60 digits, and satisfy the axioms."""
    metric, points = subject.metric, subject.found.points
    distances = []
    for i, j in PAIRS:
        expected = float(subject.squared_dist(i, j) ** 0.5)
        found = metric.dist(points[i], points[j])
        assert abs(found - expected) <= ROUNDING * subject.rounding + 1e-13 * expected
        assert found == metric.dist(points[j], points[i]) >= 0
        distances.append(found)
    assert all(metric.dist(point, point.copy()) == 0 for point in points)
    xy, xz, yz = distances
    assert xz <= xy + yz + 3 * ROUNDING * subject.rounding + 1e-13 * (xy + yz)


def check_gradients(subject, name):
    """Gradients are finite everywhere, and 0 where surfaces coincide."""
    metric, points = subject.metric, subject.found.points
    for i, j in [*PAIRS, (0, 0)]:
        for argument in (0, 1):
            for function in (metric.squared_dist, metric.dist):
                gradient = grad(function, argument)(points[i], points[j].copy())
                assert np.isfinite(gradient).all()
                assert i != j or not gradient.any()
    assert np.isfinite(grad(metric.energy)(points)).all()


CHECKS = [check_distances, check_gradients]


@pytest.mark.everyday
@pytest.mark.parametrize(
    "seeds", [range(1), pytest.param(range(1, 25), marks=pytest.mark.slow)], ids=["one", "others"]
)
@pytest.mark.parametrize("check", CHECKS)
@pytest.mark.parametrize("name", METRICS)
def test_metrics(name, check, seeds):
    for seed in seeds:
        rng = np.random.default_rng([seed, *name.encode(), *check.__name__.encode()])
        found, weights = draw(rng)
        check(METRICS[name](found, *weights), name)


@pytest.mark.parametrize("power", [1, 4, 7, 8, 9, 12])
def test_energies_of_nearly_antipodal_normals_keep_their_digits(power):
    """The compiled energy took the angle from a chord of nearly 2, and lost half of its digits."""
    template = rh.Template([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]])
    metric = rh.ElasticMetric(rh.AlignedSurfaces(template, equip=False), 0.0, 0.0, 1.0)
    angle = np.pi - 10.0**-power
    turn = [[1, 0, 0], [0, np.cos(angle), -np.sin(angle)], [0, np.sin(angle), np.cos(angle)]]
    path = np.stack([template.vertices, template.vertices @ np.transpose(turn)])
    energy, gradient = metric.energy_and_gradient(path)
    np.testing.assert_allclose(energy, 0.5 * angle**2, rtol=1e-14)
    np.testing.assert_allclose(metric.energy(path), 0.5 * angle**2, rtol=1e-14)
    expected = [grad(metric.squared_dist, k)(*path) for k in (0, 1)]
    np.testing.assert_allclose(gradient, expected, rtol=1e-13, atol=1e-14)
