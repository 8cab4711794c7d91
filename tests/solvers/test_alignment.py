"""What a metric does not see of its points, their headings and places, no solver's result shows.

The registry of cases declares which metrics ignore that one of two surfaces rotates.
"""

import bodies_in_motion as bodies
import numpy as np
import pytest
from cases import name_of, surface_cases
from scipy.spatial.transform import Rotation

from riemhuman.geometry import AlignedSurfaces, ElasticMetric
from riemhuman.solvers import (
    BasisMean,
    BasisPath,
    PathStraightening,
    PoissonPath,
    PoleLadder,
)
from riemhuman.surfaces import DeformationBasis, procrustes

BLIND = [case for case in surface_cases("dist") if "rotation" in case.invariant_under]

# Angles in degrees, and axes.
TURNS = [
    (0.0, (0.0, 1.0, 0.0)),
    (60.0, (0.0, 1.0, 0.0)),
    (180.0, (0.3, -0.8, 0.5)),
]
SHIFT = np.array([2.0, -1.0, 0.3])


def turned(body, degrees, axis):
    """Return a surface turned about an axis, and elsewhere if it is turned at all."""
    axis = np.array(axis) / np.linalg.norm(axis)
    rotation = Rotation.from_rotvec(np.radians(degrees) * axis).as_matrix()
    return body @ rotation.T + (SHIFT if degrees else 0.0)


def shape_metric():
    space = AlignedSurfaces(bodies.space().template, equip=False)
    return space.equip_with_metric(ElasticMetric, a=1.0, lam=1.0, c=0.0).metric


def mean_members():
    names = ("resting", "arm raised", "knee raised", "elbow bent")
    return np.stack([bodies.body(name) for name in names])


def headed(points, seed):
    """Return surfaces each of which is turned about an axis of its own and elsewhere."""
    rng = np.random.default_rng(seed)
    draws = [(rng.uniform(0.0, 180.0), rng.normal(size=3)) for _ in points]
    return np.stack([turned(f, *draw) for f, draw in zip(points, draws, strict=True)])


def check_energies(metric, solver, start, end, rtol=1e-3):
    """Check that paths lead to the end however it is turned, all with the same energy."""
    energies = []
    for turn in TURNS:
        other = turned(end, *turn)
        result = solver.solve(metric, start, other)
        np.testing.assert_array_equal(result.path[[0, -1]], [start, other])
        assert metric.energy(result.path) == pytest.approx(result.energy, rel=1e-9)
        energies.append(result.energy)
    np.testing.assert_allclose(energies, energies[0], rtol=rtol)


@pytest.mark.everyday("basis-shape sphere", "all-stretch open", "poisson-area triangle, smoothed")
@pytest.mark.parametrize("case", BLIND, ids=name_of)
@pytest.mark.parametrize("name", ["basis", "all", "poisson"])
def test_energies_do_not_depend_on_headings(case, name):
    template = case.space.template
    if name == "basis":
        solver = BasisPath(DeformationBasis.from_laplacian(template, n_components=3), n_nodes=5)
    else:
        solver = {"all": PathStraightening, "poisson": PoissonPath}[name](n_nodes=5)
    # Over all coordinates a search ends where half of its steps gain 0.2 %.
    check_energies(case.metric, solver, *case.points[:2], rtol=4e-3 if name == "all" else 1e-3)


def test_energies_over_any_basis_do_not_depend_on_the_heading_of_both_ends():
    """A basis learnt from motions holds other deformations once it is turned."""
    metric, solver = shape_metric(), BasisPath(bodies.basis(), n_nodes=5)
    ends = bodies.body("resting"), bodies.body("elbow bent")
    expected = solver.solve(metric, *ends).energy
    for degrees, axis in ((40.0, (0.0, 1.0, 0.0)), (150.0, (1.0, 0.4, -0.2))):
        start, end = (turned(body, degrees, axis) for body in ends)
        result = solver.solve(metric, start, turned(end, 70.0, (0.3, 0.2, 1.0)))
        assert result.energy == pytest.approx(expected, rel=1e-4)


def test_a_path_turns_evenly():
    """About its centroid, by the angle of its ends, and moves evenly."""
    metric, (start, end) = shape_metric(), bodies.swung_arms(1)
    solver = BasisPath(bodies.basis(), n_nodes=5)
    still = solver.solve(metric, start, end).path
    other = turned(end, 120.0, (0.2, 1.0, 0.0))
    for number, point in enumerate(solver.solve(metric, start, other).path):
        aligned = procrustes(point, to=still[number])
        np.testing.assert_allclose(aligned, still[number], atol=2e-3)
        linear, *_ = np.linalg.lstsq(
            still[number] - still[number].mean(axis=0), point - point.mean(axis=0), rcond=None
        )
        angle = np.degrees(np.linalg.norm(Rotation.from_matrix(linear).as_rotvec()))
        assert angle == pytest.approx(30.0 * number, abs=1.0)


def test_callbacks_and_starts_of_turned_ends():
    """Both are paths between the ends as they are given."""
    metric, (start, end) = shape_metric(), bodies.swung_arms(1)
    end, seen = turned(end, 150.0, (0.0, 1.0, 0.1)), []
    solver = BasisPath(bodies.basis(), 5, callback=lambda number, energy, path: seen.append(path))
    result = solver.solve(metric, start, end)
    for path in seen:
        np.testing.assert_array_equal(path[[0, -1]], [start, end])
    assert metric.energy(seen[-1]) == pytest.approx(result.energy, rel=1e-9)
    again = solver.solve(metric, start, end, initial_path=result.path)
    assert again.energies[0] == pytest.approx(result.energy, rel=1e-9)


def test_rotations_that_count_stay():
    """Under a metric that sees them, ends are not aligned."""
    metric = ElasticMetric(bodies.space(), 1.0, 1.0, 0.1)
    start, end = bodies.body("resting"), turned(bodies.body("elbow bent"), 30.0, (0, 1, 0))
    result = BasisPath(bodies.basis(), 5).solve(metric, start, end)
    assert result.energy >= metric.squared_dist(start, end)
    assert metric.squared_dist(start, end) > 1.1 * metric.squared_dist(
        start, bodies.body("elbow bent")
    )


@pytest.mark.parametrize(
    ("in_batches", "settings"), [(False, {}), (True, {"with_differences": False})]
)
def test_means_of_bodies(in_batches, settings):
    """Also over a basis of motions, whose directions are those of the template."""
    metric, points, seen = shape_metric(), mean_members(), []
    expected = BasisMean(bodies.basis(), **settings).solve(metric, points)
    solver = BasisMean(
        bodies.basis(), **settings, callback=lambda number, variance, point: seen.append(point)
    )
    members = headed(points, 1)
    found = solver.solve(metric, [members[:2], members[2:]] if in_batches else members)
    assert found.variance == pytest.approx(expected.variance, rel=1e-3)
    assert metric.dist(found.point, expected.point) <= 0.01 * np.sqrt(expected.variance)
    np.testing.assert_allclose(seen[-1], found.point, atol=1e-9)
    # It stands as the first of the members.
    assert np.median(np.linalg.norm(found.point - members[0], axis=1)) < 0.1


@pytest.mark.slow
def test_transport_turns_vectors_with_the_end():
    metric, basis = shape_metric(), bodies.basis()
    start, end = bodies.body("resting"), bodies.body("arm raised")
    ladder = PoleLadder(basis=basis, geodesic_solver=BasisPath(basis, n_nodes=4))
    vector = bodies.body("other build") - start
    expected = ladder.solve(metric, vector, start, end_point=end)
    for degrees, axis in TURNS[1:]:
        other = turned(end, degrees, axis)
        found = ladder.solve(metric, vector, start, end_point=other)
        np.testing.assert_array_equal(found.path[[0, -1]], [start, other])
        turned_vector = turned(expected.tangent_vec, degrees, axis) - SHIFT
        difference = metric.norm(found.tangent_vec - turned_vector, other)
        assert difference <= 0.01 * metric.norm(expected.tangent_vec, end)
