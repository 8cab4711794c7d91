"""Speed and repeatability of measurements.

pytest tests/benchmarks/test_measurements.py --benchmark-enable -s
"""

import numpy as np
from performances import bodies

from riemhuman.measurements import Measurements, in_standard_pose, model_from_measurements

_N_BODIES = 10_000
_N_POSED = 10


def test_measure(benchmark):
    """All measurements of coarse bodies, in one pass."""
    model = bodies("coarse").model
    own = Measurements(model)
    n_bodies = 100 if benchmark.disabled else _N_BODIES
    betas = np.random.default_rng(0).normal(size=(n_bodies, model.n_betas))
    points = model(betas)
    own.measure(points[:2])  # compiled
    measured = benchmark.pedantic(
        lambda: own.measure(points, missing="nan"), rounds=1, iterations=1
    )
    if not benchmark.disabled:
        print(f"\n{n_bodies} coarse bodies: {benchmark.stats.stats.min:.1f} s")
    assert measured.values.shape == (n_bodies, len(own.names))
    assert np.isnan(measured.values).mean() < 0.001


def test_gradient(benchmark):
    """All measurements of one body with their derivatives by the vertices."""
    resolution = "coarse" if benchmark.disabled else "full"
    data = bodies(resolution)
    own = Measurements(data.model)
    measured = benchmark.pedantic(
        lambda: own.measure(data.points[0], gradient=True), rounds=1, warmup_rounds=1
    )
    assert np.isfinite(measured.gradient).all()


def test_standard_pose(benchmark):
    """Bodies in ten poses brought to the standard pose."""
    resolution = "coarse" if benchmark.disabled else "full"
    data = bodies(resolution)
    own = Measurements(data.model)
    points = data.points[: 2 if benchmark.disabled else _N_POSED]
    straight = benchmark.pedantic(
        lambda: in_standard_pose(own.definitions, points), rounds=1, iterations=1
    )
    if not benchmark.disabled:
        print(f"\n{resolution}: {benchmark.stats.stats.min / len(points):.2f} s a body")
    assert straight.shape == points.shape


def test_inverse(benchmark):
    """A body from three measurements."""
    wanted = {"stature": 1.7, "waist girth": 0.8, "hip girth": 1.0}
    person = benchmark.pedantic(
        lambda: model_from_measurements(wanted, resolution="coarse"), rounds=1, warmup_rounds=1
    )
    assert max(map(abs, person.misses.values())) < 0.002
