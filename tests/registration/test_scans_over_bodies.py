"""Scans laid over their bodies: motions between their axes, distances with signs, unseen parts."""

import numpy as np
import pytest
from open_bodies import coarse_bodies
from scipy.spatial.transform import Rotation

from riemhuman.errors import ArgumentError
from riemhuman.kernels.surface import vertex_normals
from riemhuman.registration import lay_over_body, simulated_scan
from riemhuman.surfaces.measures import triangle_areas

BODIES = coarse_bodies()
FACES = BODIES.template.faces
BODY = BODIES[57]


@pytest.fixture(scope="module")
def scan():
    return simulated_scan(BODY, FACES, rng=3, n_points=6000, missing=0.12)


@pytest.mark.slow
@pytest.mark.parametrize(
    "rotation",
    [Rotation.identity(), Rotation.from_euler("x", 90, degrees=True), Rotation.random(rng=5)],
    ids=["turned by nothing", "z up", "anyhow"],
)
def test_a_scan_in_other_axes_and_millimetres_is_moved_onto_its_body(scan, rotation):
    there = lay_over_body(scan.points, BODY, FACES)
    moved = 1000.0 * rotation.apply(scan.points) + [300.0, -2000.0, 10.0]
    found = lay_over_body(moved, BODY, FACES)
    gaps = np.linalg.norm(found.scan_points - there.scan_points, axis=1)
    assert np.median(gaps) < 0.003
    assert np.mean(found.seen != there.seen) < 0.05


@pytest.mark.slow
def test_a_scan_that_is_almost_in_place_is_moved_and_one_in_place_is_not(scan):
    placed = lay_over_body(scan.points, BODY, FACES).scan_points
    there = lay_over_body(placed, BODY, FACES)
    aside = lay_over_body(placed + [0.004, 0.003, -0.003], BODY, FACES)
    assert np.array_equal(there.scan_points, placed)
    near = np.median(np.abs(there.distances))
    assert np.median(np.abs(aside.distances)) < 1.2 * near


@pytest.mark.parametrize("metres", [0.004, -0.004])
def test_distances_are_positive_outside_and_negative_inside(metres):
    surface = BODY + metres * vertex_normals(BODY, FACES)
    found = lay_over_body((surface, FACES), BODY, FACES)
    assert np.median(found.distances) == pytest.approx(metres, rel=0.2)
    assert np.mean(np.sign(found.distances) == np.sign(metres)) > 0.95
    assert found.seen.all()


@pytest.mark.slow
def test_what_is_missing_is_not_seen(scan):
    found = lay_over_body(scan.points, BODY, FACES)
    without_head = scan.points[scan.points[:, 1] < BODY[:, 1].max() - 0.25]
    headless = lay_over_body(without_head, BODY, FACES)
    head = BODY[:, 1] > BODY[:, 1].max() - 0.2
    assert not headless.seen[head].any()
    assert found.seen[head].mean() > 0.5


def test_thinned_meshes_keep_their_form():
    over = lay_over_body((BODY, FACES), BODY, FACES)
    thin = over.thinned(500)
    assert 400 < len(thin.scan_points) < 600
    assert thin.n_points == over.n_points == len(BODY)
    assert thin.scan_faces.max() < len(thin.scan_points)
    area = triangle_areas(thin.scan_points, thin.scan_faces).sum()
    assert area == pytest.approx(triangle_areas(BODY, FACES).sum(), rel=0.1)
    assert over.thinned(5000) is over


@pytest.mark.slow  # the command's test is an everyday one
def test_a_scan_of_something_else_is_refused():
    points = np.random.default_rng(0).uniform(-0.9, 0.9, (2000, 3))
    with pytest.raises(ArgumentError, match="half of its points are more than"):
        lay_over_body(points, BODY, FACES)
