"""A template finds a scan of itself, bent, from a rough start."""

import numpy as np
import pytest

import riemhuman as rh
from riemhuman.registration import TemplateRegistration, simulated_scan


@pytest.fixture(scope="module")
def registration():
    return TemplateRegistration(rh.datasets.load_open_bodies("coarse").template)


def bent(points):
    """Return a body that leans and twists a little, as no joint does."""
    moved = points.copy()
    moved[:, 0] += 0.05 * points[:, 1] ** 2
    moved[:, 2] += 0.06 * np.sin(2.0 * points[:, 1])
    return moved


@pytest.mark.slow
def test_a_bent_template_is_found_in_any_unit(registration):
    size = 250.0
    template = rh.Template(size * registration.template.vertices, registration.template.faces)
    scan = simulated_scan(
        bent(registration.template.vertices), template.faces, 0, n_points=8000, rotate=False
    )
    start = template.vertices + size * np.array([0.03, 0.0, -0.03])
    result = TemplateRegistration(template).solve(size * scan.points, start=start)
    errors = np.linalg.norm(result.points / size - scan.body, axis=1)
    assert result.trusted, result.message
    before = np.linalg.norm(start / size - scan.body, axis=1)
    assert errors.mean() < 0.25 * before.mean()
    assert errors.mean() < 0.012
    assert result.fit is None


def test_random_points_are_not_trusted(registration):
    points = np.random.default_rng(0).random((3000, 3))
    result = registration.solve(points)
    assert not result.trusted
    assert "%" in result.message


def test_steps_that_go_too_far_are_halved():
    """Between 3,000 noisy vertices, whole steps once made triangles vanish, and points fly off."""
    bodies = rh.datasets.load_open_bodies("coarse")
    seen = rh.registration.simulated_scan(
        bodies[0], bodies.template.faces, 0, n_points=3000, mesh=True, rotate=False
    )
    registration = rh.registration.TemplateRegistration(bodies.template)
    result = registration.solve(seen.surface, start=bodies[0])
    assert result.trusted
    assert np.linalg.norm(result.points - bodies[0], axis=1).mean() < 0.004
