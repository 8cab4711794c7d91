"""The discrete exponential of the discrete logarithm, over all vertices, between poses of people.

    pytest tests/benchmarks/test_logarithms.py --benchmark-enable -s

prints, for natural bodies that raise their arms and squat, coarse and at full resolution, processor
seconds of a logarithm and an exponential of ten steps, or of twenty where a fold of skin snaps, and
how far from the other body the exponential ends, in the mean over vertices. Where benchmarks are
disabled, one coarse pair runs.
"""

import time

import numpy as np

from riemhuman.datasets import load_open_bodies
from riemhuman.geometry.aligned_surfaces import AlignedSurfaces
from riemhuman.geometry.elastic_metric import ElasticMetric
from riemhuman.solvers import DiscreteExponential, DiscreteLogarithm

PERSON = 3


def processor(call):
    """Return a result and the processor seconds it took."""
    begin = time.process_time()
    return call(), time.process_time() - begin


def test_exponential_of_the_logarithm(benchmark):
    full = not benchmark.disabled
    poses = ("arms_up", "squat") if full else ("squat",)
    for resolution in ("coarse", "full") if full else ("coarse",):
        bodies = load_open_bodies(resolution, variant="natural")
        metric = ElasticMetric(AlignedSurfaces(bodies.template), 1.0, 0.1, 0.1)
        names = list(bodies.pose_names)
        own = bodies.points[10 * PERSON : 10 * PERSON + 10]
        start = own[names.index("a_stance")]
        for pose in poses:
            end = own[names.index(pose)]
            log, of_log = processor(lambda: DiscreteLogarithm().solve(metric, end, start))  # noqa: B023
            inverse = DiscreteExponential(n_steps=len(log.path) - 1)
            velocity = log.tangent_vec
            exp, of_exp = processor(lambda: inverse.solve(metric, velocity, start))  # noqa: B023
            gap = 1000.0 * np.linalg.norm(exp.end - end, axis=1).mean()
            print(
                f"\n{resolution} {pose}, {exp.n_steps} steps: logarithm {of_log:.1f} s, "
                f"exponential {of_exp:.1f} s of the processor; it ends {gap:.4f} mm off"
            )
            assert log.converged
            assert exp.converged
            assert gap < 1.0
    benchmark.pedantic(lambda: None, rounds=1)
