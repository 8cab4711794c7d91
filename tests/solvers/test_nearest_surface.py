"""From fields back to surfaces: what came from a surface returns, and means have no slope."""

import numpy as np
import pytest
from autograd import grad
from cases import sphere_template, surfaces

from riemhuman.errors import ArgumentError, ConvergenceWarning
from riemhuman.geometry import AlignedSurfaces, ElasticMetric, SRNFMetric
from riemhuman.solvers import BasisMean
from riemhuman.solvers._dispersion import Dispersion
from riemhuman.statistics import NearestSurface
from riemhuman.surfaces import DeformationBasis

SPACE = AlignedSurfaces(sphere_template(), equip=False)
POINTS = surfaces(sphere_template(), 5, rng=3)


def metric_of(a, lam, c):
    return ElasticMetric(SPACE, a, lam, c)


def test_fields_of_a_surface_give_the_surface():
    metric = metric_of(1.0, 0.5, 0.3)
    found = NearestSurface(tolerance=1e-14).solve(metric, metric.map(POINTS[:1]), POINTS[1])
    assert found.converged
    assert found.variance < 1e-12 * metric.squared_dist(POINTS[0], POINTS[1])
    shift = (POINTS[0] - found.point).mean(axis=0)
    np.testing.assert_allclose(found.point + shift, POINTS[0], atol=1e-5)


def test_mean_has_no_slope_and_agrees_with_the_mean_over_all_deformations():
    metric = metric_of(1.0, 1.0, 1.0)
    weights = np.array([1.0, 2.0, 0.0, 1.0, 0.5])
    found = NearestSurface(tolerance=1e-13).solve(
        metric, metric.map(POINTS), POINTS[0], weights=weights
    )
    dispersion = Dispersion(metric, POINTS, weights)
    assert found.variance == pytest.approx(dispersion.value(found.point), rel=1e-12)
    assert np.all(np.diff(found.variances) < 0)
    _, slope = dispersion.value_and_gradient(found.point)
    _, at_start = dispersion.value_and_gradient(POINTS[0])
    assert np.abs(slope).max() < 1e-5 * np.abs(at_start).max()

    everything = DeformationBasis(np.eye(POINTS[0].size).reshape(-1, *POINTS[0].shape))
    over_basis = BasisMean(everything, with_differences=False, tolerance=1e-12)
    assert found.variance == pytest.approx(
        over_basis.solve(metric, POINTS, weights).variance, rel=1e-6
    )


@pytest.mark.parametrize("abc", [(1.0, 1.0, 0.0), (0.0, 0.0, 1.0)])
def test_companion_keeps_what_the_metric_does_not_see(abc):
    metric = metric_of(*abc)
    unseen = metric_of(1.0 - abc[0], 1.0, 1.0 - abc[2])
    target = metric.map(POINTS[:1])
    found = NearestSurface(tolerance=1e-10).solve(metric, target, POINTS[1])
    before = metric.squared_dist(POINTS[0], POINTS[1])
    assert found.variance < 0.05 * before
    assert unseen.squared_dist(found.point, POINTS[1]) < unseen.squared_dist(POINTS[0], POINTS[1])
    heavy = NearestSurface(companion_weight=10.0)
    held = heavy.solve(metric, target, POINTS[1])
    assert unseen.squared_dist(held.point, POINTS[1]) < unseen.squared_dist(found.point, POINTS[1])
    assert held.variance > found.variance


def test_functional_with_companion_has_no_slope():
    metric, unseen = metric_of(1.0, 1.0, 0.0), metric_of(0.0, 0.0, 1.0)
    target = metric.map(POINTS[:1])[0]
    solver = NearestSurface(companion_weight=0.05, tolerance=1e-13)
    found = solver.solve(metric, target[None], POINTS[1])

    def functional(f):
        seen = metric.target_metric.squared_dist(metric.map(f), target)
        return seen + 0.05 * unseen.squared_dist(f, POINTS[1])

    assert functional(found.point) == pytest.approx(found.variances[-1], rel=1e-12)
    slope = grad(functional)
    assert np.abs(slope(found.point)).max() < 1e-4 * np.abs(slope(POINTS[1])).max()


def test_other_metrics_on_surfaces():
    metric = SRNFMetric(SPACE)
    found = NearestSurface().solve(metric, metric.map(POINTS[:1]), POINTS[1])
    assert found.variance < 1e-3 * metric.squared_dist(POINTS[0], POINTS[1])
    alone = NearestSurface(companion_weight=0.0).solve(
        metric_of(0.0, 0.0, 1.0), metric_of(0.0, 0.0, 1.0).map(POINTS[:1]), POINTS[1]
    )
    assert alone.variance < 1e-3 * metric_of(0.0, 0.0, 1.0).squared_dist(POINTS[0], POINTS[1])


def test_refusals():
    metric = metric_of(1.0, 1.0, 1.0)
    images = metric.map(POINTS)
    with pytest.warns(ConvergenceWarning, match="NearestSurface.*most iterations"):
        NearestSurface(max_iter=1).solve(metric, images, POINTS[0])
    with pytest.raises(ArgumentError, match="companion_weight"):
        NearestSurface(companion_weight=-1.0)
    with pytest.raises(ArgumentError, match="tolerance"):
        NearestSurface(tolerance=0.0)
    with pytest.raises(ArgumentError, match="max_iter"):
        NearestSurface(max_iter=0)
    with pytest.raises(ArgumentError, match="start must have shape"):
        NearestSurface().solve(metric, images, POINTS)
    with pytest.raises(ArgumentError, match="images"):
        NearestSurface().solve(metric, images[:, :-1], POINTS[0])
    with pytest.raises(ArgumentError, match="weights"):
        NearestSurface().solve(metric, images, POINTS[0], weights=[1.0])
