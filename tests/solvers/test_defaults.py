"""Strategies of metrics that were given none."""

import numpy as np
import pytest
from cases import CASES

import riemhuman as rh
from riemhuman.errors import ArgumentTypeError
from riemhuman.geometry.manifold import metric_of


@pytest.mark.parametrize(
    ("Metric", "weights"),
    [
        (rh.ElasticMetric, {"a": 0.0, "lam": 0.0, "c": 1.0}),
        pytest.param(rh.SobolevMetric, {}, marks=pytest.mark.slow),
    ],
)
def test_exp_undoes_log_of_bodies(bodies, Metric, weights):
    space = rh.AlignedSurfaces(bodies.template).equip_with_metric(Metric, **weights)
    start, end = bodies[3], bodies[13]
    velocity = space.metric.log(end, start)
    reached = rh.procrustes(space.metric.exp(velocity, start), end)
    assert np.abs(reached - end).max() < 1e-4


@pytest.mark.slow
@pytest.mark.parametrize(
    ("first", "second"), [(3, 13), pytest.param(12, 88, marks=pytest.mark.slow)]
)
def test_small_lam_takes_shorter_steps(bodies, first, second):
    """With ten steps a path jumps to the other body within one of them; exp was 103 mm off.

    Of two poses of two people, which take eighty steps in place of twenty, it was 589 mm off.
    """
    metric = rh.AlignedSurfaces(bodies.template).metric
    start, end = bodies[first], bodies[second]
    reached = metric.exp(metric.log(end, start), start)
    assert np.abs(rh.procrustes(reached, end) - end).max() < 1e-4


def test_geodesics_of_bodies_run_between_their_ends(bodies):
    metric = rh.AlignedSurfaces(bodies.template).metric
    start, middle, end = metric.geodesic(bodies[3], bodies[13])([0.0, 0.5, 1.0])
    np.testing.assert_array_equal(np.stack([start, end]), np.stack([bodies[3], bodies[13]]))
    assert metric.dist(start, middle) == pytest.approx(metric.dist(middle, end), rel=0.1)


@pytest.mark.slow
def test_all_coordinates_of_small_meshes_and_other_manifolds():
    case = CASES["mixed sphere"]
    metric, (start, end) = case.metric, case.points[:2]
    end = start + 0.1 * (end - start)
    velocity = metric.log(end, start)
    np.testing.assert_allclose(metric.exp(velocity, start), end, atol=1e-4)
    carried = metric.parallel_transport(velocity, start, end_point=end)
    assert metric.norm(carried, end) == pytest.approx(metric.norm(velocity, start), rel=1e-2)
    case = CASES["half-plane, inner product"]
    start, end = np.array([0.0, 1.0]), np.array([0.0, 1.2])
    velocity = case.metric.log(end, start)
    np.testing.assert_allclose(velocity, [0.0, np.log(1.2)], atol=1e-3)
    np.testing.assert_allclose(case.metric.exp(velocity, start), end, atol=1e-6)


def test_a_metric_in_place_of_its_space():
    case = CASES["mixed sphere"]
    assert metric_of(case.metric) is case.metric
    assert metric_of(rh.AlignedSurfaces(case.space.template)).space.template is case.space.template
    with pytest.raises(ArgumentTypeError, match="equipped with a metric.*AlignedSurfaces without"):
        metric_of(rh.AlignedSurfaces(case.space.template, equip=False))
    with pytest.raises(ArgumentTypeError, match="found Template"):
        metric_of(case.space.template)
