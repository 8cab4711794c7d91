"""Many geodesics at once are those that are found one by one; their lengths make a table."""

import bodies_in_motion
import numpy as np
import pytest
from cases import CASES, HalfPlane, HyperbolicDistance

from riemhuman.errors import ArgumentError, ConvergenceWarning
from riemhuman.geometry import ElasticMetric, NormalFields
from riemhuman.solvers import (
    BasisPath,
    ClosedFormGeodesic,
    Interrupted,
    LinearPath,
    PathDistances,
    PathStraightening,
    PoissonPath,
    path_distances,
)
from riemhuman.solvers.path_comparison import PairsOfPoints


@pytest.fixture(scope="module")
def metric():
    return ElasticMetric(bodies_in_motion.space(), 1.0, 1.0, 0.1)


@pytest.fixture(scope="module")
def points():
    names = ("resting", "arm raised", "elbow bent")
    return np.stack([bodies_in_motion.body(name) for name in names])


@pytest.mark.parametrize("n_jobs", [None, 2])
def test_same_paths_as_one_by_one(metric, points, n_jobs):
    basis = bodies_in_motion.basis().truncate(20)
    pairs = PairsOfPoints(points)
    for solver in (BasisPath(basis, n_nodes=4), PoissonPath(4), LinearPath(4)):
        found = solver.solve_many(metric, pairs, n_jobs=n_jobs)
        assert len(found) == 3
        for (start, end), result in zip(pairs, found, strict=True):
            expected = solver.solve(metric, start, end)
            np.testing.assert_array_equal(result.path, expected.path)
            assert (result.energy, result.gap) == pytest.approx(
                (expected.energy, expected.gap), nan_ok=True
            )


def test_every_solver_on_any_manifold():
    plane = HyperbolicDistance(HalfPlane())
    pairs = np.random.default_rng(0).uniform(1.0, 2.0, (4, 2, 2))
    found = PathStraightening(n_nodes=4).solve_many(plane, pairs)
    assert [result.path.shape for result in found] == 4 * [(4, 2)]
    fields = NormalFields(bodies_in_motion.space().template)
    pairs = fields.random_point(4, rng=1).reshape(2, 2, *fields.shape)
    assert len(ClosedFormGeodesic(3).solve_many(fields.metric, pairs)) == 2


def test_wrong_pairs_are_named(metric, points):
    with pytest.raises(ArgumentError, match=r"pairs\[1\] must be two points"):
        LinearPath(3).solve_many(metric, [points[:2], points[:1]])
    flat = points[:2].copy()
    flat[1] *= [1.0, 0.0, 0.0]
    with pytest.raises(ArgumentError, match=r"pairs\[1\]: .*area"):
        PoissonPath(3).solve_many(metric, [points[:2], flat], n_jobs=2)


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


def test_progress(metric, points, capsys):
    LinearPath(3).solve_many(metric, PairsOfPoints(points))
    assert capsys.readouterr().err == ""
    LinearPath(3).solve_many(metric, PairsOfPoints(points), progress=True)
    assert "Geodesics" in capsys.readouterr().err


@pytest.mark.parametrize("name", [name for name, case in CASES.items() if "dist" in case.can])
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
    found = PathDistances.from_rows(3, rows)
    for name, column in (("lengths", 0), ("bounds", 1), ("gaps", 2)):
        a, b, c = rows[:, column]
        np.testing.assert_array_equal(getattr(found, name), [[0, a, b], [a, 0, c], [b, c, 0]])
    assert (found.n_iterations, found.n_evaluations) == (3 + 9 + 15, 4 + 10 + 16)
    assert (found.converged, found.message) == (False, "2 of 3 paths converged")
