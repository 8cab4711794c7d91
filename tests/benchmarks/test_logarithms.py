"""The discrete exponential of the discrete logarithm, over all vertices, between poses of people.

    pytest tests/benchmarks/test_logarithms.py --benchmark-enable -s

prints, for natural bodies that raise their arms and squat, coarse and at full resolution, seconds
on the clock and of the processor that a logarithm and an exponential of ten steps take, or of
twenty where a fold of skin snaps, and how far from the other body the exponential ends, in the mean
over vertices. Where benchmarks are disabled, one coarse pair runs.
"""

import time

import numpy as np

from riemhuman.datasets import load_open_bodies
from riemhuman.geometry import AlignedSurfaces, ElasticMetric
from riemhuman.solvers import DiscreteExponential, DiscreteLogarithm

PERSON = 3


def timed(call):
    """Return a result, and what it took in seconds on the clock and of the processor."""
    begin = time.perf_counter(), time.process_time()
    result = call()
    clock, processor = time.perf_counter() - begin[0], time.process_time() - begin[1]
    return result, f"{clock:.1f} s ({processor:.1f} s of the processor)"


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
            log, of_log = timed(lambda: DiscreteLogarithm().solve(metric, end, start))  # noqa: B023
            inverse = DiscreteExponential(n_steps=len(log.path) - 1)
            velocity = log.tangent_vec
            exp, of_exp = timed(lambda: inverse.solve(metric, velocity, start))  # noqa: B023
            gap = 1000.0 * np.linalg.norm(exp.end - end, axis=1).mean()
            print(
                f"\n{resolution} {pose}, {exp.n_steps} steps: logarithm {of_log}, exponential "
                f"{of_exp}; it ends {gap:.4f} mm off"
            )
            assert log.converged
            assert exp.converged
            assert gap < 1.0
    benchmark.pedantic(lambda: None, rounds=1)
