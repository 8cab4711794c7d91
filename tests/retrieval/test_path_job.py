"""Paths on disk are those in memory, whatever stops the job on the way."""

import distributed
import numpy as np
import pytest
from cases import sphere_template, surfaces

import riemhuman.retrieval.path_jobs
from riemhuman.errors import ArgumentError, DamagedFileWarning
from riemhuman.geometry import AlignedSurfaces, ElasticMetric
from riemhuman.retrieval import path_job
from riemhuman.solvers import PathStraightening, PoissonPath, path_distances

METRIC = ElasticMetric(AlignedSurfaces(sphere_template(), equip=False), 1.0, 0.1, 0.1)
POINTS = surfaces(sphere_template(), 5, rng=1)
SOLVER = PathStraightening(n_nodes=4)


@pytest.fixture(autouse=True)
def small_blocks(monkeypatch):
    monkeypatch.setattr(riemhuman.retrieval.path_jobs, "_BLOCK", 3)


@pytest.fixture(scope="module")
def expected():
    return path_distances(SOLVER, METRIC, POINTS)


def assert_same(found, expected):
    for name in ("lengths", "bounds", "gaps"):
        np.testing.assert_array_equal(getattr(found, name), getattr(expected, name))
    assert found.outcome == expected.outcome


def test_same_as_in_memory_with_the_paths(expected, tmp_path):
    assert_same(path_job(SOLVER, METRIC, POINTS, tmp_path, keep_paths=True, n_jobs=2), expected)
    paths = np.load(tmp_path / "paths.npy")
    assert paths.shape == (10, 4, *POINTS.shape[1:])
    np.testing.assert_array_equal(paths[5], SOLVER.solve(METRIC, POINTS[1], POINTS[3]).path)


def test_goes_on_where_it_was_stopped(expected, tmp_path, monkeypatch):
    finder = riemhuman.retrieval.path_jobs._PathFinder
    find, asked = finder.distances, []

    def stopped(self, metric, block):
        if len(asked) == 2:
            raise KeyboardInterrupt
        asked.append(block)
        return find(self, metric, block)

    monkeypatch.setattr(finder, "distances", stopped)
    with pytest.raises(KeyboardInterrupt):
        path_job(SOLVER, METRIC, POINTS, tmp_path)
    monkeypatch.setattr(finder, "distances", lambda *call: (asked.append(call[-1]), find(*call))[1])
    assert_same(path_job(SOLVER, METRIC, POINTS, tmp_path), expected)
    assert [block.start for block in asked] == [0, 3, 6, 9]


def test_damage_is_found_and_solved_again(expected, tmp_path):
    path_job(SOLVER, METRIC, POINTS, tmp_path)
    rows = np.load(tmp_path / "rows.npy", mmap_mode="r+")
    rows[4, 0] *= 2.0
    rows.flush()
    with pytest.warns(DamagedFileWarning, match="pairs 3 to 5"):
        found = path_job(SOLVER, METRIC, POINTS, tmp_path)
    assert_same(found, expected)


def test_a_pair_that_is_refused_loses_no_other_block(tmp_path):
    points = POINTS.copy()
    first, second, _ = METRIC.space.template.faces[0]
    points[4, first] = points[4, second]
    with pytest.raises(ArgumentError, match=r"^points\[0\] and points\[4\]: .*but for 3 of 4"):
        path_job(PoissonPath(4), METRIC, points, tmp_path, n_jobs=2)
    lengths = np.load(tmp_path / "rows.npy")[:, 0]
    expected = path_distances(PoissonPath(4), METRIC, points[:4]).lengths
    np.testing.assert_array_equal(lengths[:3], expected[0, 1:])
    # Pairs of the last point are in all blocks but the first.
    np.testing.assert_array_equal(lengths[3:], 0.0)


def test_another_job_is_refused(tmp_path):
    path_job(PoissonPath(4), METRIC, POINTS, tmp_path)
    for solver, metric, points, what in (
        (PoissonPath(5), METRIC, POINTS, "solver"),
        (PoissonPath(4), ElasticMetric(METRIC.space, 1.0, 0.2, 0.1), POINTS, "metric"),
        (PoissonPath(4), METRIC, POINTS + 1e-9, "points"),
    ):
        with pytest.raises(ArgumentError, match=what):
            path_job(solver, metric, points, tmp_path)
    with pytest.raises(ArgumentError, match="two"):
        path_job(PoissonPath(4), METRIC, POINTS[:1], tmp_path / "other")


def test_on_a_cluster(expected, tmp_path):
    with (
        distributed.LocalCluster(
            n_workers=1, threads_per_worker=1, dashboard_address=":0"
        ) as cluster,
        distributed.Client(cluster) as client,
    ):
        assert_same(path_job(SOLVER, METRIC, POINTS, tmp_path, client=client), expected)
