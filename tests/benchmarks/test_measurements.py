"""Speed of measurements.

pytest tests/benchmarks/test_measurements.py --benchmark-enable -s
"""

import numpy as np
from performances import bodies, clocked

from riemhuman.measurements import Measurements, model_from_measurements


def test_measure(benchmark):
    """All measurements of coarse bodies, and of one full body with derivatives by the vertices."""
    model = bodies("coarse").model
    own = Measurements(model)
    points = model(np.random.default_rng(0).normal(size=(10_000, model.n_betas)))
    own.measure(points[:2])  # compiled
    measured, seconds, _ = clocked(lambda: own.measure(points, missing="nan"), benchmark=benchmark)
    print(f"\n{len(points)} coarse bodies: {seconds:.1f} s")
    assert np.isnan(measured.values).mean() < 0.001
    own = Measurements(bodies("full").model)
    body = bodies("full").points[0]
    _, seconds, _ = clocked(lambda: own.measure(body, gradient=True), rounds=2)
    print(f"a full body with derivatives: {seconds:.2f} s")


def test_inverse(benchmark):
    """A body from three measurements."""
    wanted = {"stature": 1.7, "waist girth": 0.8, "hip girth": 1.0}
    person, seconds, _ = clocked(
        lambda: model_from_measurements(wanted, resolution="coarse"), 2, benchmark=benchmark
    )
    print(f"\na body from three measurements: {seconds:.2f} s")
    assert max(map(abs, person.misses.values())) < 0.002
