"""Paths of several solvers beside each other."""

from dataclasses import replace
from types import SimpleNamespace

import bodies_in_motion
import numpy as np
import pytest
from cases import CASES

from riemhuman.errors import ArgumentError, ArgumentTypeError
from riemhuman.geometry import ElasticMetric, SRNFMetric
from riemhuman.solvers.interpolated_paths import ModelParameters, ModelPath, PoissonPath
from riemhuman.solvers.path_comparison import (
    change_along_path,
    compare_metrics,
    compare_paths,
)
from riemhuman.solvers.path_search import BasisPath
from riemhuman.solvers.paths import LinearPath

N_TIMES = 6


@pytest.fixture(scope="module")
def rows():
    """Return the straight path and that of the model, of an elbow that bends by 120°."""
    space, model = bodies_in_motion.space(), bodies_in_motion.model()
    metrics = {"elastic": ElasticMetric(space, 1.0, 1.0, 1.0), "srnf": SRNFMetric(space)}
    start, end = bodies_in_motion.body("resting"), bodies_in_motion.body("elbow bent")
    betas = np.random.default_rng(3).normal(size=(5, model.n_betas))[0]
    poses = bodies_in_motion.pose(), bodies_in_motion.pose(left_elbow=(0, -120, 0))
    first, last = (ModelParameters(betas, pose, np.zeros(3)) for pose in poses)

    def parameters(surface):
        return first if np.allclose(surface, start) else last

    model_path = ModelPath(model, N_TIMES, parameters=parameters)
    solvers = {"linear": (LinearPath(N_TIMES), "srnf"), "model": (model_path, "elastic")}
    reference = model_path.solve(metrics["elastic"], start, end).path
    return compare_paths(metrics, start, end, solvers, reference)


def by_name(rows):
    return {row.name: row for row in rows}


def test_deviation_is_from_the_reference(rows):
    measures = by_name(rows)
    assert measures["model"].mean_deviation == measures["model"].max_deviation == 0
    linear = measures["linear"]
    # The chord of the hand's arc: it passes some 20 cm inside.
    assert 100 < linear.max_deviation < 300
    assert linear.mean_deviation < 0.5 * linear.max_deviation


def test_rows_for_tables(rows):
    assert [(row.name, row.metric) for row in rows] == [("linear", "srnf"), ("model", "elastic")]
    for row in rows:
        assert row.result.path.shape[0] == N_TIMES
        assert row.seconds > 0
        np.testing.assert_allclose(row.energies[row.metric], row.result.energy, rtol=1e-9)
    table = [row.as_row() for row in rows]
    assert all(list(line) == list(table[0]) for line in table)
    assert all(
        isinstance(value, (str, int, float, bool)) for line in table for value in line.values()
    )
    assert table[0]["energy_srnf"] == rows[0].energies["srnf"]
    assert table[0]["area_change_quantile_99"] == rows[0].area_change.quantile_99


@pytest.fixture(scope="module")
def setting():
    """Return metrics, known paths of an elbow that bends, and a search."""
    space = bodies_in_motion.space()
    metrics = {"elastic": ElasticMetric(space, 1.0, 1.0, 0.0), "srnf": SRNFMetric(space)}
    ends = bodies_in_motion.body("resting"), bodies_in_motion.body("elbow bent")
    search = BasisPath(bodies_in_motion.basis(), N_TIMES)
    solvers = {
        "linear": (LinearPath(N_TIMES), "elastic"),
        "rotating": (PoissonPath(N_TIMES), "elastic"),
    }
    return metrics, search, compare_paths(metrics, *ends, solvers)


def test_metrics_are_compared_from_one_start(setting):
    """No path of the table has less energy than the one found by the metric itself."""
    (metrics, search, known), initial = setting, "linear"
    path = by_name(known)[initial].result.path
    rows = compare_metrics(metrics, search, known, initial)
    assert [(row.name, row.metric) for row in rows] == [(name, name) for name in metrics]
    for row in rows:
        assert row.starts[0] == initial
        if row.starts == (initial,):
            alone = search.solve(metrics[row.name], path[0], path[-1], initial_path=path)
            np.testing.assert_array_equal(row.result.path, alone.path)
            assert row.result.n_iterations == alone.n_iterations
    for name in metrics:
        energies = {row.name: row.energies[name] for row in [*known, *rows]}
        assert energies[name] <= (1 + 1e-9) * min(energies.values())


def test_a_search_continues_from_a_better_path(setting):
    """From the straight path, with few deformations, it ends above the rotating path."""
    metrics, search, known = setting
    few = BasisPath(search.basis.truncate(1), N_TIMES)
    alone = {"elastic": metrics["elastic"]}
    straight, rotating = (replace(row, energies={"elastic": row.energies["elastic"]})
                          for row in known)  # fmt: skip
    (short,) = compare_metrics(alone, few, [straight], "linear")
    assert short.energies["elastic"] > rotating.energies["elastic"]
    (continued,) = compare_metrics(alone, few, [straight, rotating], "linear")
    assert continued.starts == ("linear", "rotating")
    assert continued.as_row()["starts"] == "linear, then rotating"
    assert continued.energies["elastic"] <= rotating.energies["elastic"]
    assert continued.result.n_iterations >= short.result.n_iterations


def measured(metric, path, reference=None):
    """Return the measures of a path that is already known."""
    known = SimpleNamespace(solve=lambda *_: SimpleNamespace(path=path, energy=0.0))
    (row,) = compare_paths({"one": metric}, path[0], path[-1], {"path": (known, "one")}, reference)
    return row


def test_swelling_is_measured_beyond_the_ends():
    case = CASES["all sphere"]
    surface = case.points[0]
    path = np.stack([surface, 2.0 * surface, 1.25 * surface])
    measures = measured(case.metric, path, path + [0.0, 0.003, 0.004])
    np.testing.assert_allclose(measures.area_change, (2 / 1.25) ** 2 - 1)
    np.testing.assert_allclose(measures.edge_change, 2 / 1.25 - 1)
    np.testing.assert_allclose(measures.volume_change, (2 / 1.25) ** 3 - 1)
    np.testing.assert_allclose([measures.mean_deviation, measures.max_deviation], 5.0)


def test_bad_input():
    case = CASES["all sphere"]
    metrics, ends, path = {"all": case.metric}, case.points[:2], case.points
    for reference, found in ((path[1:], r"\(3"), (path[None], r"\(1, 4")):
        message = rf"reference must have shape \(4, 42, 3\); found {found}"
        with pytest.raises(ArgumentError, match=message):
            measured(case.metric, path, reference)
    flat = CASES["half-plane, distance"]
    with pytest.raises(ArgumentTypeError, match="must be a space of surfaces"):
        measured(flat.metric, flat.points)
    assert compare_paths(metrics, *ends, {}) == []


def test_change_along_path():
    """Doubling and halving count alike."""
    sizes = np.array([[1.0, 1.0, 1.0, 2.0, 3.0], [2.0, 3.0, 0.5, 1.5, 3.0], [2.0, 2.0, 2.0, 1, 3]])
    np.testing.assert_allclose(change_along_path(sizes), [0.0, 0.5, 1.0, 0.0, 0.0])
    np.testing.assert_allclose(change_along_path(sizes[::-1]), change_along_path(sizes))
    np.testing.assert_allclose(change_along_path(7.0 * sizes), change_along_path(sizes))


def test_change_with_sizes_of_zero():
    sizes = np.array([[1.0, 0.0, 0.0, 0.0], [0.0, 0.0, 1.0, 1.0], [1.0, 0.0, 0.0, 1.0]])
    np.testing.assert_array_equal(change_along_path(sizes), [np.inf, 0.0, np.inf, 0.0])
