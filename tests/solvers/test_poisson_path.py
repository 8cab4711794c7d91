"""Paths that turn every triangle: which way they turn, and what they refuse."""

import numpy as np
import pytest
from cases import sphere_template

from riemhuman.datasets import load_open_bodies
from riemhuman.errors import DegenerateSurfaceError
from riemhuman.geometry.aligned_surfaces import AlignedSurfaces
from riemhuman.geometry.elastic_metric import ElasticMetric
from riemhuman.solvers import LinearPath, PoissonPath, SegmentEnergy
from riemhuman.solvers.poisson_path import best_turns, turned_path


@pytest.fixture(scope="module")
def bodies():
    return load_open_bodies("coarse")


def pose_pair(bodies, start, end):
    names = bodies.pose_names
    return bodies.points[20 + names.index(start)], bodies.points[20 + names.index(end)]


def test_arms_that_turn_by_more_than_half_a_turn(bodies):
    """The shortest turns tear the arms; turning alike costs far less."""
    metric = ElasticMetric(AlignedSurfaces(bodies.template), 1.0, 1.0, 0.0)
    start, end = pose_pair(bodies, "arms_up", "bent_elbows")
    interpolator = bodies.template.interpolator
    turns = interpolator.turns(start, end)
    assert interpolator.is_torn(turns)
    energies = []
    for way in (turns, interpolator.mended(turns)):
        path = np.stack([start] * 7)
        path[-1] = end
        path[1:-1] = interpolator.interpolate(start, end, np.linspace(0, 1, 7)[1:-1], way)
        energies.append(metric.energy(path))
    found = PoissonPath(7).solve(metric, start, end)
    assert found.energy == pytest.approx(min(energies), rel=1e-12)
    assert found.energy < 0.8 * energies[0]


@pytest.mark.parametrize("poses", [("t_like", "bent_elbows"), ("squat", "hands_on_hips")])
def test_less_energy_than_the_straight_path(bodies, poses):
    start, end = pose_pair(bodies, *poses)
    metric = ElasticMetric(AlignedSurfaces(bodies.template), 1.0, 1.0, 0.0)
    turning = PoissonPath().solve(metric, start, end)
    assert turning.energy < 0.7 * LinearPath().solve(metric, start, end).energy
    np.testing.assert_array_equal(turning.path[[0, -1]], [start, end])


def test_the_better_turns_and_the_energy_of_their_middle(bodies):
    metric = ElasticMetric(AlignedSurfaces(bodies.template), 1.0, 1.0, 0.0)
    interpolator = bodies.template.interpolator
    start, end = pose_pair(bodies, "arms_up", "bent_elbows")
    turns, energy = best_turns(metric, SegmentEnergy(), start, end)
    np.testing.assert_array_equal(turns, interpolator.mended(interpolator.turns(start, end)))
    (middle,) = interpolator.interpolate(start, end, np.array([0.5]), turns)
    halves = metric.squared_dist(np.stack([start, middle]), np.stack([middle, end]))
    assert energy == pytest.approx(2.0 * halves.sum(), rel=1e-12)


def test_turned_paths_are_at_equal_times(bodies):
    metric = ElasticMetric(AlignedSurfaces(bodies.template), 1.0, 1.0, 0.0)
    interpolator = bodies.template.interpolator
    start, end = pose_pair(bodies, "squat", "hands_on_hips")
    turns = interpolator.turns(start, end)
    path = turned_path(metric, start, end, 4, turns)
    inner = interpolator.interpolate(start, end, np.array([1 / 3, 2 / 3]), turns)
    np.testing.assert_allclose(path, np.stack([start, *inner, end]), atol=1e-12)


def test_a_triangle_without_area_has_no_rotation():
    template = sphere_template()
    metric = ElasticMetric(AlignedSurfaces(template, equip=False), 1.0, 1.0, 0.0)
    flat = template.vertices.copy()
    flat[template.faces[3]] = flat[template.faces[3, 0]]
    with pytest.raises(DegenerateSurfaceError, match="end"):
        PoissonPath(5).solve(metric, template.vertices, flat)
