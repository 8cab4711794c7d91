"""Path energies, paths without a search, what all path solvers share, and many paths at once."""

import bodies_in_motion
import numpy as np
import pytest
from cases import CASES, name_of
from oracles import taylor_slope

from riemhuman.errors import ArgumentError, ConvergenceWarning, NotDefinedError
from riemhuman.geometry import ElasticMetric, VectorSpace
from riemhuman.solvers import (
    BasisPath,
    ClosedFormGeodesic,
    FiniteDifferenceEnergy,
    Interrupted,
    LinearPath,
    PoissonPath,
    SegmentEnergy,
    path_distances,
)
from riemhuman.solvers.path_comparison import PairsOfPoints, distances_of_rows
from riemhuman.solvers.paths import check_initial_path, check_path_from, linear_path

SEGMENT, DIFFERENCE = SegmentEnergy(), FiniteDifferenceEnergy()


def test_finite_differences_are_those_at_midpoints():
    """As metrics take them that have no distance in closed form."""
    case = CASES["half-plane, inner product"]
    steps = np.diff(case.points, axis=0)
    middle = 0.5 * (case.points[1:] + case.points[:-1])
    expected = 3.0 * np.sum(np.sum(steps**2, axis=1) / middle[:, 1] ** 2)
    for energy in (DIFFERENCE, SEGMENT):
        assert energy.value(case.metric, case.points) == pytest.approx(expected, rel=1e-12)


def check_gradient(energy, case):
    def value(points):
        return energy.value(case.metric, case.space.projection(points))

    found, gradient = energy.value_and_gradient(case.metric, case.points)
    np.testing.assert_allclose(found, energy.value(case.metric, case.points), rtol=1e-12)
    assert gradient.shape == case.points.shape
    direction = case.space.to_tangent(case.tangent_vecs, case.points)
    assert taylor_slope(value, case.points, direction, gradient) >= 1.9


@pytest.mark.parametrize(
    "case", [case for case in CASES.values() if case.metric.has_inner_product], ids=name_of
)
def test_gradients_of_finite_difference_energy(case):
    check_gradient(DIFFERENCE, case)


@pytest.mark.parametrize("energy", [SEGMENT, DIFFERENCE], ids=["segment", "difference"])
def test_bad_paths_are_refused(energy):
    case = CASES["all triangle"]
    for path, found in (
        (case.points[0], r"found \(3, 3\)"),
        (np.full_like(case.points, np.nan), "36 NaN"),
    ):
        with pytest.raises(ArgumentError, match=found):
            energy.value(case.metric, path)
        with pytest.raises(ArgumentError, match=found):
            energy.value_and_gradient(case.metric, path)


@pytest.mark.parametrize("case", CASES.values(), ids=name_of)
def test_linear_path(case):
    start, end = case.points[:2]
    result = LinearPath(n_nodes=5).solve(case.metric, start, end)
    assert result.path.shape == (5, *case.space.shape)
    np.testing.assert_array_equal(result.path[[0, -1]], case.points[:2])
    assert np.all(case.space.belongs(result.path))
    middle = case.space.projection(0.5 * (start + end))
    np.testing.assert_allclose(result.path[2], middle, atol=1e-14)
    assert result.energy == case.metric.energy(result.path)
    np.testing.assert_array_equal(result.energies, [result.energy])
    assert (result.n_iterations, result.n_evaluations, result.converged) == (0, 1, True)


def test_no_closed_form_is_said():
    case = CASES["all triangle"]
    with pytest.raises(NotDefinedError, match="no closed-form geodesics; use BasisPath or Path"):
        ClosedFormGeodesic().solve(case.metric, *case.points[:2])


@pytest.fixture(scope="module")
def metric():
    return ElasticMetric(bodies_in_motion.space(), 1.0, 1.0, 0.1)


@pytest.fixture(scope="module")
def points():
    names = ("resting", "arm raised", "elbow bent")
    return np.stack([bodies_in_motion.body(name) for name in names])


def test_same_paths_as_one_by_one(metric, points):
    basis = bodies_in_motion.basis().truncate(20)
    pairs = PairsOfPoints(points)
    for solver in (BasisPath(basis, n_nodes=4), PoissonPath(4), LinearPath(4)):
        expected = [solver.solve(metric, start, end) for start, end in pairs]
        assert len(expected) == 3
        found = solver.solve_many(metric, pairs, n_jobs=2)
        for result, alone in zip(found, expected, strict=True):
            np.testing.assert_array_equal(result.path, alone.path)
            assert (result.energy, result.gap) == pytest.approx(
                (alone.energy, alone.gap), nan_ok=True
            )


def test_wrong_pairs_are_named(metric, points):
    with pytest.raises(ArgumentError, match=r"pairs\[1\] must be two points"):
        LinearPath(3).solve_many(metric, [points[:2], points[:1]])
    flat = points[:2].copy()
    flat[1] *= [1.0, 0.0, 0.0]
    with pytest.raises(ArgumentError, match=r"pairs\[1\]: .*area"):
        PoissonPath(3).solve_many(metric, [points[:2], flat], n_jobs=2)


def test_points_of_a_table_are_named(metric, points):
    flat = points[:3].copy()
    flat[2] *= [1.0, 0.0, 0.0]
    with pytest.raises(ArgumentError, match=r"^points\[0\] and points\[2\]: .*area"):
        path_distances(PoissonPath(3), metric, flat)


def test_paths_may_start_and_end_off_by_rounding():
    metric, path = VectorSpace((2,)).metric, linear_path(np.ones(2), np.zeros(2), 3)
    check_initial_path(metric, path[0] + 1e-12, path[-1] - 1e-12, 3, path)
    check_path_from(metric, path, path[0] + 1e-12)
    with pytest.raises(ArgumentError, match="by up to 1e-07"):
        check_initial_path(metric, path[0] + 1e-7, path[-1], 3, path)
    with pytest.raises(ArgumentError, match="by up to 1e-07"):
        check_initial_path(metric, path[0], path[-1] - 1e-7, 3, path)
    with pytest.raises(ArgumentError, match="it is off by 1e-07"):
        check_path_from(metric, path, path[0] + 1e-7)


def test_what_has_not_converged_is_said_once(metric, points):
    solver = BasisPath(bodies_in_motion.basis().truncate(20), n_nodes=4, max_iter=1, tolerance=1e-9)
    pairs = [points[[0, 1]], points[[0, 0]], points[[0, 2]]]
    with pytest.warns(ConvergenceWarning, match="2 of 3 pairs") as caught:
        found = solver.solve_many(metric, pairs)
    assert len(caught) == 1
    assert [result.converged for result in found] == [False, True, False]


class InterruptedPath(LinearPath):
    """A solver stopped from the keyboard."""

    def solve(self, metric, start, end):
        raise Interrupted(super().solve(metric, start, end))


def test_the_keyboard_stops_all(metric, points):
    with pytest.raises(KeyboardInterrupt):
        InterruptedPath(3).solve_many(metric, PairsOfPoints(points), n_jobs=2)


@pytest.mark.parametrize("name", ["mixed sphere", "normals sphere", "half-plane, distance"])
def test_no_path_is_shorter_than_the_bound(name):
    """The closed form is a distance, and paths through other points are no shorter."""
    case = CASES[name]
    found = path_distances(LinearPath(4), case.metric, case.points)
    assert found.lengths.shape == (len(case.points),) * 2
    np.testing.assert_array_equal(found.lengths, found.lengths.T)
    np.testing.assert_allclose(found.bounds, case.metric.dist_pairwise(case.points), rtol=1e-6)
    assert np.all(found.lengths >= found.bounds * (1 - 1e-9) - 1e-12)


def test_table_of_lengths(metric, points):
    solver = BasisPath(bodies_in_motion.basis(), n_nodes=5)
    found = path_distances(solver, metric, points)
    result = solver.solve(metric, points[0], points[2])
    assert found.lengths[0, 2] == pytest.approx(metric.length(result.path))
    assert found.gaps[2, 0] == pytest.approx(result.gap)
    assert found.excess[1] == pytest.approx(
        100 * (found.lengths[0, 2] / metric.dist(points[0], points[2]) - 1)
    )
    assert found.converged
    assert found.message == "3 of 3 paths converged"


def test_the_table_holds_the_row_of_every_pair_on_both_sides():
    rows = np.arange(18.0).reshape(3, 6)
    rows[:, 5] = 1.0, 0.0, 1.0
    found = distances_of_rows(3, rows)
    for name, column in (("lengths", 0), ("bounds", 1), ("gaps", 2)):
        a, b, c = rows[:, column]
        np.testing.assert_array_equal(getattr(found, name), [[0, a, b], [a, 0, c], [b, c, 0]])
    assert (found.n_iterations, found.n_evaluations) == (3 + 9 + 15, 4 + 10 + 16)
    assert (found.converged, found.message) == (False, "2 of 3 paths converged")
