"""Simulated scans have the faults that were asked for, and no others."""

import numpy as np
import pytest
from open_bodies import coarse_bodies

from riemhuman.errors import ArgumentError, DegenerateSurfaceError
from riemhuman.kernels.surface import vertex_normals
from riemhuman.registration import simulated_scan
from riemhuman.surfaces import nearest_points, triangle_areas

BODIES = coarse_bodies()
BODY, FACES = BODIES[3], BODIES.template.faces


def scan_of(**settings):
    return simulated_scan(BODY, FACES, 0, **{"n_points": 3000, "rotate": False} | settings)


def from_surface(scan):
    """Return the distances of points from the body, positive outside, and the normals there."""
    places, distances = nearest_points(scan.points, scan.body, FACES)
    corners = FACES[places.triangles]
    there = np.einsum("nk,nkx->nx", places.barycentric, scan.body[corners])
    normals = vertex_normals(scan.body, FACES)[corners].mean(axis=1)
    outward = np.einsum("nx,nx->n", scan.points - there, normals)
    return np.sign(outward) * distances, normals


def test_points_are_on_the_surface_but_for_noise():
    assert np.abs(from_surface(scan_of(noise=0.0))[0]).max() < 1e-12
    distances, _ = from_surface(scan_of(noise=0.003))
    assert np.std(distances) == pytest.approx(0.003, rel=0.1)
    assert abs(np.mean(distances)) < 3e-4


def test_rotation_is_about_the_vertical_and_takes_the_body_along():
    scan = scan_of(rotate=True, noise=0.0)
    np.testing.assert_allclose(scan.body[:, 1], BODY[:, 1])
    assert np.abs(scan.body - BODY).max() > 0.1
    assert np.abs(from_surface(scan)[0]).max() < 1e-12
    np.testing.assert_array_equal(scan.points, scan_of(rotate=True, noise=0.0).points)


def test_holes_have_the_share_that_was_asked_for():
    whole, holed = scan_of(), scan_of(missing=0.3)
    assert 0.6 < len(holed.points) / len(whole.points) <= 0.7
    with pytest.raises(ArgumentError, match=r"missing must be at most 0\.99; found 1"):
        scan_of(missing=1.0)


def test_one_scanner_sees_what_faces_it():
    view = np.array([0.0, 0.0, 1.0])
    scan = scan_of(view=view)
    assert 0.3 < len(scan.points) / 3000 < 0.6
    assert np.mean(from_surface(scan)[1] @ view > 0.0) > 0.95


def test_clothes_are_outside_the_body():
    distances, _ = from_surface(scan_of(clothing=0.03, noise=0.0))
    assert 0.02 < distances.max() < 0.031
    # Folds, such as armpits, are nearer to the other side.
    assert np.mean(distances < -1e-3) < 0.02


def test_the_floor_is_below_the_feet():
    bare, floored = scan_of(), scan_of(floor=True)
    added = floored.points[len(bare.points) :]
    assert np.abs(added[:, 1] - BODY[:, 1].min()).max() < 0.012
    assert np.ptp(added, axis=0)[[0, 2]] == pytest.approx(1.6, abs=0.02)


def test_meshes_are_the_surface_in_other_triangles():
    scan = scan_of(mesh=True, noise=0.0)
    assert 0.8 < len(scan.points) / 3000 < 1.2
    area = triangle_areas(scan.points, scan.faces).sum()
    assert area == pytest.approx(triangle_areas(BODY, FACES).sum(), rel=0.06)  # chords are shorter
    # They face outward, too.
    normals = vertex_normals(scan.points, scan.faces)
    assert np.mean(np.einsum("nx,nx->n", normals, from_surface(scan)[1]) > 0.0) > 0.98


def test_surfaces_without_area_are_refused():
    with pytest.raises(DegenerateSurfaceError, match="have no area"):
        simulated_scan(np.zeros((3, 3)), [[0, 1, 2]])
