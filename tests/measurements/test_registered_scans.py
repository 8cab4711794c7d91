"""Scans of one person, registered and measured, against the body they were taken of."""

import numpy as np
import pytest
from lengths import sample

from riemhuman.datasets import load_open_bodies
from riemhuman.measurements import Measurements
from riemhuman.registration import ScanRegistration


@pytest.mark.sampled(3, "scans that are trusted")
@pytest.mark.slow
def test_noisy_scans_measure_like_the_body():
    """Loose points with 2 mm of noise, of two performances of a person nothing was tuned on."""
    trimesh = pytest.importorskip("trimesh")
    bodies = load_open_bodies("full", people=4)
    own = Measurements(bodies.model)
    lengths = [unit == "m" for unit in own.units]
    registration = ScanRegistration(bodies.model)
    for number in sample((3, 0), 2):
        mesh = bodies.template.to_trimesh(bodies.points[number])
        points, _ = trimesh.sample.sample_surface(mesh, 20_000, seed=number)
        noise = np.random.default_rng(number).normal(0.0, 0.002, points.shape)
        result = registration.solve(points + noise)
        assert result.trusted
        both = np.stack([result.points, bodies.points[number]])
        found, truth = own.measure(both, pose="standard").values[:, lengths]
        assert np.abs(found - truth).max() < 0.010
