"""Paths that turn every triangle: which way they turn, and what they refuse."""

from types import SimpleNamespace

import bodies_in_motion
import numpy as np
import pytest
from cases import sphere_template

from riemhuman.datasets import load_open_bodies
from riemhuman.errors import DegenerateSurfaceError
from riemhuman.geometry import AlignedSurfaces, ElasticMetric
from riemhuman.solvers import LinearPath, PoissonPath, SegmentEnergy
from riemhuman.solvers.interpolated_paths import rotating_path, rotating_paths


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
    turns = interpolator.rotations(start, end)
    assert interpolator.has_jumps(turns)
    energies = []
    for way in (turns, interpolator.unwrap(turns)):
        path = np.stack([start] * 7)
        path[-1] = end
        path[1:-1] = interpolator.interpolate(start, end, np.linspace(0, 1, 7)[1:-1], way)
        energies.append(metric.energy(path))
    found = PoissonPath(7).solve(metric, start, end)
    assert found.energy <= min(energies) * (1 + 1e-12)
    assert found.energy < 0.8 * energies[0]


@pytest.mark.parametrize("poses", [("t_like", "bent_elbows"), ("squat", "hands_on_hips")])
def test_less_energy_than_the_straight_path(bodies, poses):
    start, end = pose_pair(bodies, *poses)
    metric = ElasticMetric(AlignedSurfaces(bodies.template), 1.0, 1.0, 0.0)
    turning = PoissonPath().solve(metric, start, end)
    assert turning.energy < 0.7 * LinearPath().solve(metric, start, end).energy
    np.testing.assert_array_equal(turning.path[[0, -1]], [start, end])


@pytest.mark.parametrize("seed", [1, 2, 14])
def test_the_best_turned_path_and_its_rivals(seed):
    """Every part of the body turns the way that costs less; rivals turn a whole limb the other."""
    metric = ElasticMetric(bodies_in_motion.space(), 0.0, 0.0, 1.0)
    start, end = bodies_in_motion.swung_arms(seed)
    found = rotating_paths(metric, SegmentEnergy(), start, end, 11)
    energies = [energy for _, energy in found]
    interpolator = metric.space.template.interpolator
    shorter = interpolator.rotations(start, end)
    alike = interpolator.unwrap(shorter)
    for turns in (shorter, alike):
        assert energies[0] <= metric.energy(rotating_path(metric, start, end, 11, turns))
    largest = interpolator.parts(np.linalg.norm(alike - shorter, axis=1) > np.pi)[0]
    assert (len(found) > 1) == (seed == 1)
    assert (len(largest) > 0.04 * len(shorter)) == (seed == 1)
    for path, energy in found:
        np.testing.assert_array_equal(path[[0, -1]], [start, end])
        assert energies[0] <= energy <= 1.1 * energies[0]
        assert energy == pytest.approx(metric.energy(path), rel=1e-12)


def ways_of_parts(areas, energy):
    """Return which parts of these areas turn like their neighbours, on the best path and rivals.

    The energy is a function of whether each part does; the rest of the surface makes up 1000 units
    of area.
    """
    n_parts = len(areas)
    turned = np.zeros((n_parts + 1, 3))
    turned[:n_parts, 0] = 2.0 * np.pi
    interpolator = SimpleNamespace(
        rotations=lambda start, end: np.zeros_like(turned),
        has_jumps=lambda turns: True,
        unwrap=lambda turns: turned,
        parts=lambda mask: [np.array([k]) for k in np.flatnonzero(mask)],
        interpolate=lambda start, end, times, turns: np.stack([turns] * len(times)),
    )
    template = SimpleNamespace(
        interpolator=interpolator, face_areas=np.array([*areas, 1000.0 - sum(areas)])
    )
    space = SimpleNamespace(template=template, check_immersed=lambda point, name: None)
    of_path = SimpleNamespace(value=lambda _, path: energy(path[1, :n_parts, 0] > 0))
    found = rotating_paths(SimpleNamespace(space=space), of_path, turned, turned, 3)
    return [tuple(np.flatnonzero(path[1, :, 0])) for path, _ in found]


def sum_of(*costs):
    return lambda alike: 100.0 + alike @ np.array(costs)


def test_small_parts_turn_together_and_every_limb_by_itself():
    """A limb has a hundredth of the area, and at most eight parts are limbs."""
    # Parts 2 and 3 are too small: what the one would gain by itself, the other loses.
    energy = sum_of(5.0, -20.0, -3.0, 4.0)
    assert ways_of_parts([50.0, 10.0, 9.0, 8.0], energy)[0] == (1,)
    # A ninth part and a tenth are too many.
    costs = [*[-1.0, 1.0] * 4, -3.0, 4.0]
    assert ways_of_parts([20.0] * 10, sum_of(*costs))[0] == (0, 2, 4, 6)
    assert ways_of_parts([20.0] * 8, sum_of(*costs[2:]))[0] == (0, 2, 4, 6)


def test_limbs_that_gain_only_together_turn_together():
    areas = [20.0] * 3
    assert ways_of_parts(areas, lambda alike: 101.0 + any(alike) - 2.0 * all(alike))[0] == (0, 1, 2)
    assert ways_of_parts(areas, lambda alike: 101.0 + any(alike) - all(alike))[0] == ()


def test_rivals_turn_one_limb_the_other_way_for_a_tenth_of_the_energy_at_most():
    ways = ways_of_parts([50.0, 40.0, 30.0, 5.0], sum_of(9.9, 10.1, 1.0, 1.0))
    assert ways == [(), (0,), (2,)]


def test_turned_paths_are_at_equal_times(bodies):
    metric = ElasticMetric(AlignedSurfaces(bodies.template), 1.0, 1.0, 0.0)
    interpolator = bodies.template.interpolator
    start, end = pose_pair(bodies, "squat", "hands_on_hips")
    turns = interpolator.rotations(start, end)
    path = rotating_path(metric, start, end, 4, turns)
    inner = interpolator.interpolate(start, end, np.array([1 / 3, 2 / 3]), turns)
    np.testing.assert_allclose(path, np.stack([start, *inner, end]), atol=1e-12)


def test_a_triangle_without_area_has_no_rotation():
    template = sphere_template()
    metric = ElasticMetric(AlignedSurfaces(template, equip=False), 1.0, 1.0, 0.0)
    flat = template.vertices.copy()
    flat[template.faces[3]] = flat[template.faces[3, 0]]
    with pytest.raises(DegenerateSurfaceError, match="end"):
        PoissonPath(5).solve(metric, template.vertices, flat)
