"""Jobs on a Dask cluster, whose worker is killed on the way."""

import os
import pickle
import signal
import sys

import cloudpickle
import distributed
import numpy as np
import pytest
from cases import sphere_template, surfaces

import riemhuman.retrieval.jobs
from riemhuman.errors import ArgumentError, ClusterError, FileError, MissingDependencyError
from riemhuman.geometry import AlignedSurfaces, ElasticMetric, RiemannianMetric, VectorSpace
from riemhuman.retrieval import pairwise_job
from riemhuman.retrieval._cluster import _check_workers, first_finished
from riemhuman.retrieval.jobs import TileReader

# Workers cannot import the tests: what these send goes by value.
cloudpickle.register_pickle_by_value(sys.modules[__name__])

METRIC = ElasticMetric(AlignedSurfaces(sphere_template(), equip=False), 1.0, 0.1, 0.1)
POINTS = surfaces(sphere_template(), 40, rng=1)
POINTS[5] = POINTS[2] * (1 + 1e-9)
MEMORY = 60_000


@pytest.fixture(scope="module")
def client():
    """Return the client of a cluster of one worker process: each takes seconds to begin."""
    with (
        distributed.LocalCluster(
            n_workers=1, threads_per_worker=1, processes=True, dashboard_address=":0"
        ) as cluster,
        distributed.Client(cluster) as client,
    ):
        yield client


@pytest.fixture(scope="module")
def local(tmp_path_factory):
    """Return the bytes of the result of a local run."""
    folder = tmp_path_factory.mktemp("local")
    pairwise_job(METRIC, POINTS, folder, memory=MEMORY)
    return (folder / "D.npy").read_bytes()


@pytest.mark.slow
def test_a_worker_is_killed_on_the_way(client, local, tmp_path, monkeypatch):
    (pid,) = client.run(os.getpid).values()
    n_tiles = [0]

    def killing(*arguments):
        for number, distances in in_turn(*arguments):
            n_tiles[0] += 1
            if n_tiles[0] == 5:
                os.kill(pid, signal.SIGKILL)
            yield number, distances

    in_turn = riemhuman.retrieval.jobs.compute_parts
    monkeypatch.setattr(riemhuman.retrieval.jobs, "compute_parts", killing)
    pairwise_job(METRIC, POINTS, tmp_path, memory=MEMORY, client=client)
    assert n_tiles[0] > 10
    assert (tmp_path / "D.npy").read_bytes() == local
    assert list(client.run(os.getpid).values()) != [pid]


def test_closed_on_the_way(tmp_path, monkeypatch):
    with distributed.LocalCluster(
        n_workers=1, threads_per_worker=1, processes=False, dashboard_address=":0"
    ) as cluster:
        client = distributed.Client(cluster)

        def closing(*arguments):
            for k, found in enumerate(in_turn(*arguments)):
                if k == 2:
                    client.close()
                yield found

        in_turn = riemhuman.retrieval.jobs.compute_parts
        monkeypatch.setattr(riemhuman.retrieval.jobs, "compute_parts", closing)
        with pytest.raises(ClusterError, match="the same call continues it"):
            pairwise_job(METRIC, POINTS, tmp_path, memory=MEMORY, client=client)
        assert np.load(tmp_path / "done.npy").any()
        monkeypatch.undo()
        with pytest.raises(ClusterError, match="the client of the cluster is closed"):
            pairwise_job(METRIC, POINTS, tmp_path, memory=MEMORY, client=client)
    distances = pairwise_job(METRIC, POINTS, tmp_path, memory=MEMORY)
    np.testing.assert_array_equal(distances, METRIC.dist_pairwise(POINTS))


@pytest.mark.slow
def test_errors_of_a_worker_arrive(client, tmp_path):
    class Faulty(RiemannianMetric):
        def squared_dist(self, point_a, point_b):
            raise ArgumentError("point_a must be better than this")

    space = VectorSpace((2,))
    with pytest.raises(ArgumentError, match="must be better than this"):
        pairwise_job(Faulty(space), np.eye(2), tmp_path, client=client)


class Deserted:
    """What a cluster's client knows once its workers are gone."""

    def nthreads(self):
        return {}


def test_a_cluster_without_workers_is_given_up():
    class Never:
        @staticmethod
        def wait(futures, timeout, return_when):
            raise TimeoutError

    with pytest.raises(ClusterError, match=r"no worker for 0\.2 seconds"):
        first_finished(Deserted(), Never, ["future"], seconds=0.05)


class Restarting:
    """A client one of whose workers is lost while it is asked."""

    status = "running"

    def run(self, *arguments, **options):
        return {"first": "0.1.0", "second": distributed.comm.CommClosedError("reset by peer")}


def test_a_worker_that_is_being_restarted_is_not_refused():
    _check_workers(Restarting())


def hide():
    """Make the library look as if it were not installed."""
    import sys

    hidden = {name: sys.modules.pop(name) for name in list(sys.modules) if "riemhuman" in name}
    sys.hidden, sys.modules["riemhuman"] = hidden, None


def unhide():
    """Take `hide` back."""
    import sys

    sys.modules.update(sys.hidden)


@pytest.mark.slow
def test_a_worker_without_the_library(client, tmp_path):
    client.run(hide)
    try:
        with pytest.raises(MissingDependencyError, match="1 of 1 workers cannot import riemhuman"):
            pairwise_job(METRIC, POINTS, tmp_path, memory=MEMORY, client=client)
    finally:
        client.run(unhide)


def test_a_folder_the_workers_do_not_share(tmp_path):
    reader = TileReader(tmp_path / "elsewhere", ["features_0.npy"], None)
    with pytest.raises(FileError, match="a file system that all workers share") as failure:
        reader.compute(METRIC, (slice(0, 3), slice(3, 6)))
    assert str(pickle.loads(pickle.dumps(failure.value))) == str(failure.value)
