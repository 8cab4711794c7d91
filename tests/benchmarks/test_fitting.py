"""Fit of the body model to registered surfaces, from a neutral start.

pytest tests/benchmarks/test_fitting.py --benchmark-enable -s
"""

import numpy as np
import pytest
from performances import bodies, clocked

_N_BODIES = 100
_N_TIMED = 20


def seeded(model, n_bodies):
    """Return surfaces of random people in random poses, ±0.6 rad about every axis of a joint."""
    rng = np.random.default_rng(2022)
    betas = rng.normal(size=(n_bodies, model.n_betas))
    pose = 0.6 * rng.normal(size=(n_bodies, model.n_joints, 3))
    return model(betas, pose, rng.normal(size=(n_bodies, 3)))


@pytest.mark.parametrize("noise_mm", [0.0, 2.0])
def test_fit(benchmark, noise_mm):
    model = bodies("full").model
    points = seeded(model, _N_BODIES)
    noise = np.random.default_rng(1).normal(size=points.shape)
    points += 1e-3 * noise_mm * noise
    model.fit(points[:1])  # compiles
    _, seconds, _ = clocked(lambda: model.fit(points[:_N_TIMED]), rounds=3, benchmark=benchmark)
    fit = model.fit(points)
    of_noise = 1e3 * np.linalg.norm(1e-3 * noise_mm * noise, axis=-1).mean(axis=-1)
    print(
        f"\n{noise_mm:g} mm of noise: {seconds / _N_TIMED:.3f} s a body, mean "
        f"distance of the worst of {_N_BODIES} bodies {1e3 * fit.mean_distance.max():.3g} mm "
        f"(of the noise itself {of_noise.max():.3g} mm), "
        f"{fit.n_iterations.mean():.1f} steps, {int(fit.converged.sum())} converged"
    )
    assert fit.converged.all()
    assert (1e3 * fit.mean_distance <= of_noise + 0.5).all()
