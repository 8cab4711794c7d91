"""Logarithms over all vertices between poses of people, and the exponentials of these.

    pytest tests/benchmarks/test_logarithms.py --benchmark-enable -s

prints, for natural bodies of people on whom no setting was compared, coarse and at full resolution,
the seconds on the clock and of the processor that a logarithm takes, the steps that it needs, and
how far its exponential ends from the other body.
"""

import numpy as np
from performances import clocked

from riemhuman.datasets import load_open_bodies
from riemhuman.geometry import AlignedSurfaces, ElasticMetric
from riemhuman.solvers import DiscreteLogarithm

OTHER_PEOPLE = 81
PAIRS = [("a_stance", "squat"), ("lunge", "hands_on_hips"), ("hand_on_ear", "arms_forward")]


def test_exponential_of_the_logarithm(benchmark):
    for resolution in ("coarse", "full"):
        bodies = load_open_bodies(resolution, variant="natural", people=OTHER_PEOPLE)
        metric = ElasticMetric(AlignedSurfaces(bodies.template), 1.0, 1.0, 0.1)
        names = list(bodies.pose_names)
        for person, pair in enumerate(PAIRS):
            start, end = (bodies.points[10 * person + names.index(pose)] for pose in pair)
            solver = DiscreteLogarithm()
            log, wall, processor = clocked(
                lambda: solver.solve(metric, end, start),  # noqa: B023
                benchmark=benchmark,
            )
            exp = solver.inverse(log).solve(metric, log.tangent_vec, start)
            gap = 1000.0 * np.abs(exp.end - end).max()
            print(
                f"\n{resolution}, {pair[0]} to {pair[1]}: {len(log.path) - 1} steps in "
                f"{wall:.1f} s ({processor:.1f} s of the processor); converged is {log.converged}, "
                f"the exponential ends {gap:.4f} mm off at most"
            )
            assert log.converged == (gap <= 0.1)
