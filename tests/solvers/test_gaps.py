"""How far a geodesic's energy is said to be above its minimum, against running on to there."""

import bodies_in_motion
import numpy as np
import pytest

from riemhuman.geometry import ElasticMetric, NormalFields
from riemhuman.solvers import BasisPath, ClosedFormGeodesic, LinearPath, PathStraightening
from riemhuman.solvers._lbfgs import estimate_gap

WEIGHTS = [(1.0, 1.0, 0.0), (0.0, 0.0, 1.0), (1.0, 0.1, 0.1)]
SEEDS = [2, 5, 7]


def excess(solver, further, metric, start, end):
    """Return the gap that is stated and the one that going on shows, in per cent."""
    found = solver.solve(metric, start, end)
    least = further.solve(metric, start, end, initial_path=found.path).energy
    return found.gap, 100.0 * (found.energy / least - 1.0)


@pytest.mark.parametrize("weights", WEIGHTS)
def test_over_a_basis(weights):
    """By default within a tenth of a per cent, and said within a factor of ten."""
    metric = ElasticMetric(bodies_in_motion.space(), *weights)
    basis = bodies_in_motion.basis()
    gaps = [
        excess(
            BasisPath(basis, n_nodes=7),
            BasisPath(basis, n_nodes=7, tolerance=1e-9),
            metric,
            *bodies_in_motion.swung_arms(seed),
        )
        for seed in SEEDS
    ]
    stated, shown = np.array(gaps).T
    assert np.all(shown < 0.1)
    assert np.all(stated > shown / 3.0)
    assert np.all(stated < 10.0 * shown)


@pytest.mark.parametrize("weights", WEIGHTS)
def test_in_all_vertices(weights):
    """By default within half a per cent, and said within a factor of ten."""
    metric = ElasticMetric(bodies_in_motion.space(), *weights)
    stated, shown = excess(
        PathStraightening(n_nodes=5),
        PathStraightening(n_nodes=5, tolerance=1e-6),
        metric,
        *bodies_in_motion.swung_arms(SEEDS[0]),
    )
    assert shown < 0.5
    assert shown / 5.0 < stated < 10.0 * shown


def test_other_methods_and_other_solvers_say_what_they_know():
    metric = ElasticMetric(bodies_in_motion.space(), 1.0, 1.0, 0.1)
    start, end = bodies_in_motion.swung_arms(2)
    basis = bodies_in_motion.basis().truncate(20)
    assert np.isnan(LinearPath(4).solve(metric, start, end).gap)
    assert BasisPath(basis, n_nodes=2).solve(metric, start, end).gap == 0.0
    assert PathStraightening(n_nodes=4).solve(metric, start, start).gap == 0.0
    fields = NormalFields(metric.space.template)
    closed = ClosedFormGeodesic(4).solve(fields.metric, *fields.random_point(2, rng=0))
    assert closed.gap == 0.0


def test_slow_iterations_tell_by_what_they_gained():
    values = [1.0 + 1.0 / (k + 1) ** 2 for k in range(41)]
    assert estimate_gap(1e-9, values) == values[20] - values[40]
    assert estimate_gap(1.0, values) == 3.0
    assert estimate_gap(1e-3, values[:5]) == 3e-3
    assert np.isnan(estimate_gap(np.nan, values[:5]))


@pytest.mark.parametrize("solver", [BasisPath(bodies_in_motion.basis()), PathStraightening()])
def test_ends_that_the_metric_does_not_tell_apart_have_no_gap(solver):
    metric = ElasticMetric(bodies_in_motion.space(), 1.0, 1.0, 0.0)
    start = bodies_in_motion.body("resting")
    turned = start @ np.array([[0.0, 0.0, 1.0], [0.0, 1.0, 0.0], [-1.0, 0.0, 0.0]])
    assert solver.solve(metric, start, turned).gap == 0.0
