"""The same bits: from many threads at once, from fresh processes, however the work is cut."""

import json
import os
import subprocess
import sys
import threading
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
import pytest
import threadpoolctl
from cases import sphere_template, surfaces

from riemhuman.geometry import AlignedSurfaces, ElasticMetric, SRNFMetric
from riemhuman.solvers import BasisPath
from riemhuman.surfaces import DeformationBasis, Template

ROOT = Path(__file__).parents[2]
N_THREADS = 8


def fresh(kind):
    """Return a metric on a template, neither of which has computed anything yet."""
    made = sphere_template()
    space = AlignedSurfaces(Template(made.vertices, made.faces))
    if kind == "srnf":
        return SRNFMetric(space)
    weights = {"pose": (0.0, 0.0, 1.0), "both": (1.0, 1.0, 0.1)}[kind]
    return ElasticMetric(space, *weights)


POINTS = surfaces(sphere_template(), 12, rng=4, size=0.05)


def distance(metric, k):
    return metric.dist(POINTS[k], POINTS[(k + 1) % 12])


def energy_and_gradient(metric, k):
    energy, gradient = metric.energy_and_gradient(POINTS[[k, k - 1, k - 2]])
    return np.append(energy, gradient)


def geodesic(metric, k):
    basis = DeformationBasis.from_laplacian(metric.space.template, 4)
    return BasisPath(basis, n_nodes=3).solve(metric, POINTS[k], POINTS[k - 1]).path


CALLS = (distance, energy_and_gradient, geodesic)


@pytest.mark.everyday("distance-srnf", "geodesic-both")
@pytest.mark.parametrize("kind", ["both", "srnf"])
@pytest.mark.parametrize("call", CALLS)
def test_many_threads_see_the_bits_of_one(call, kind):
    alone = [np.asarray(call(fresh(kind), k)).tobytes() for k in range(12)]
    for _ in range(3):
        metric = fresh(kind)
        together = threading.Barrier(N_THREADS)

        def task(k, metric=metric, together=together):
            # All come upon an object that has kept nothing yet.
            if k < N_THREADS:
                together.wait(timeout=120)
            return np.asarray(call(metric, k)).tobytes()

        with ThreadPoolExecutor(N_THREADS) as pool:
            assert list(pool.map(task, range(12))) == alone


COMPUTE = """
import hashlib, json
import numpy as np
from cases import sphere_template, surfaces
import riemhuman as rh
from riemhuman.datasets import load_open_motions
from riemhuman.solvers import TangentPCA

template = sphere_template()
points = surfaces(template, 6, rng=4, size=0.05)
space = rh.AlignedSurfaces(template)
space.equip_with_metric(rh.ElasticMetric, a=1.0, lam=1.0, c=0.0)
metric = space.metric
basis = rh.DeformationBasis.from_laplacian(template, 6)
motions = load_open_motions("coarse", sequences=["knees"])[:1]
pca = TangentPCA(space, 2).fit(points)
results = {
    "pairs": metric.dist_pairwise(points, 2),
    "pairs, single": metric.dist_pairwise(points, 2, precision="single"),
    "harmonics": basis.vectors,
    "basis": rh.DeformationBasis.from_motions(motions, 5, 10).vectors,
    "geodesic": rh.solvers.BasisPath(basis, n_nodes=4).solve(metric, *points[:2]).path,
    "mean": rh.FrechetMean(space, solver=rh.solvers.BasisMean(basis)).fit(points).estimate_,
    "components": pca.components_,
    "samples": pca.sample(3, 7),
    "random points": space.random_point(2, rng=3),
}
digests = {name: hashlib.sha256(np.ascontiguousarray(a)).hexdigest() for name, a in results.items()}
print(json.dumps(digests))
"""


@pytest.mark.slow
@pytest.mark.parametrize("n_threads", [1, pytest.param(2, marks=pytest.mark.slow)])
def test_fresh_processes_give_the_same_bits(n_threads):
    here = {"__name__": "here"}
    with threadpoolctl.threadpool_limits(n_threads):
        exec(COMPUTE, here)
    environment = os.environ | {
        "PYTHONPATH": os.pathsep.join([str(ROOT / "tests" / "support"), str(ROOT)]),
        "PYTHONHASHSEED": "3",
        "OPENBLAS_NUM_THREADS": str(n_threads),
        "OMP_NUM_THREADS": str(n_threads),
    }
    command = [sys.executable, "-c", COMPUTE]
    done = subprocess.run(command, env=environment, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert len(here["digests"]) == 9
    assert json.loads(done.stdout) == here["digests"]
