"""Scans before a body is sought: floors and walls, area and spacing of points."""

import numpy as np
import pytest
from scanned_people import sparse_floor, task_of
from scipy.spatial import cKDTree
from scipy.spatial.transform import Rotation

import riemhuman as rh
from riemhuman.registration import simulated_scan
from riemhuman.registration._scan_preparation import estimate_normals, prepare_scan
from riemhuman.registration.scans import as_scan
from riemhuman.surfaces.measures import triangle_areas

AXES = Rotation.from_euler("yx", [33.0, 70.0], degrees=True).as_matrix()
UP = AXES[:, 1]


@pytest.fixture(scope="module")
def scan(natural_bodies):
    faces = natural_bodies.template.faces
    return simulated_scan(natural_bodies[3], faces, rng=3, n_points=8000, rotate=False)


def plane(rng, corner, first, second, n_points=5000):
    """Return points of a rectangle with 2 mm of noise."""
    places = rng.random((n_points, 2)) @ np.array([first, second])
    return corner + places + rng.normal(0.0, 0.002, places.shape)


def floor_below(points, rng):
    corner = [points[:, 0].mean() - 0.9, points[:, 1].min(), points[:, 2].mean() - 0.9]
    return plane(rng, corner, [1.8, 0.0, 0.0], [0.0, 0.0, 1.8])


def wall_behind(points, rng, gap):
    corner = [points[:, 0].mean() - 0.9, points[:, 1].min(), points[:, 2].min() - gap]
    return plane(rng, corner, [1.8, 0.0, 0.0], [0.0, 2.2, 0.0])


def prepared(*parts):
    """Return prepared points in leaning axes, and the share of each part that is background."""
    found = prepare_scan(as_scan(np.concatenate(parts) @ AXES.T))
    ends = np.cumsum([len(part) for part in parts])
    return found, [share.mean() for share in np.split(found.background, ends[:-1])]


def test_a_floor_says_where_up_is(scan):
    found, shares = prepared(scan.points, floor_below(scan.points, np.random.default_rng(0)))
    np.testing.assert_allclose(found.up, UP, atol=0.01)
    assert shares[0] < 0.05  # soles
    assert shares[1] > 0.99


def test_a_wall_is_background_but_no_floor(scan):
    found, shares = prepared(scan.points, wall_behind(scan.points, np.random.default_rng(0), 0.15))
    assert found.up is None
    assert found.floor is None
    assert shares[0] < 0.01
    assert shares[1] > 0.99


@pytest.mark.parametrize("gap", [0.15, 0.003])
def test_of_wall_and_floor_both_are_background(scan, gap):
    rng = np.random.default_rng(0)
    planes = wall_behind(scan.points, rng, gap), floor_below(scan.points, rng)
    found, shares = prepared(scan.points, *planes)
    ups = [found.up, *found.other_ups]
    assert max(up @ UP for up in ups) > 0.999
    assert len(ups) == (2 if gap < 0.05 else 1)  # a body that leans may rest on both
    assert shares[0] < 0.15
    assert min(shares[1:]) > 0.99


@pytest.mark.parametrize(("axis", "share"), [(2, 0.12), (0, 0.15)])
def test_a_flat_back_or_side_is_a_part_of_the_body(scan, axis, share):
    points = scan.points.copy()
    points[:, axis] = np.maximum(points[:, axis], np.quantile(points[:, axis], share))
    found, (background,) = prepared(points)
    assert found.up is None
    assert background < 0.01


def test_who_lies_on_a_floor_rests_on_it(scan):
    lying = scan.points @ Rotation.from_euler("x", -90.0, degrees=True).as_matrix().T
    found, shares = prepared(lying, floor_below(lying, np.random.default_rng(0)))
    np.testing.assert_allclose(found.up, UP, atol=0.01)
    assert shares[0] < 0.3  # the back
    assert shares[1] > 0.99


def test_a_wall_is_no_floor_where_up_is_known(scan, registration):
    points = np.concatenate(
        [scan.points, wall_behind(scan.points, np.random.default_rng(0), 0.003)]
    )
    assert prepare_scan(as_scan(points)).floor is not None  # on which the back would rest
    found = task_of(registration, points).scan
    assert found.floor is None
    np.testing.assert_array_equal(found.up, [0.0, 1.0, 0.0])


@pytest.mark.slow
def test_who_leans_against_a_wall_stands_on_the_floor(scan, registration):
    """Without the floor, a body that leans is one that lies on the wall, and up= decides."""
    rng = np.random.default_rng(0)
    planes = [wall_behind(scan.points, rng, 0.003), floor_below(scan.points, rng)]
    result = rh.registration.ScanRegistration(registration.model).solve(
        np.concatenate([scan.points, *planes])
    )
    assert result.trusted, result.message
    np.testing.assert_allclose(result.up, [0.0, 1.0, 0.0], atol=0.02)
    assert np.linalg.norm(result.points - scan.body, axis=1).mean() < 0.015


# What a scan shows is judged by area and the spacing of its points, not by their number.


@pytest.fixture(scope="module")
def full():
    """Return the vertices of a body, which are densest on its head and hands."""
    return rh.datasets.load_open_model("full")()


def uneven_cloud(points, model, rng, n_points):
    """Return points of a body, twenty times as dense on its head and hands as elsewhere."""
    owners = model.weights.argmax(axis=1)
    dense = [k for k, name in enumerate(model.joint_names) if name.endswith(("head", "wrist"))]
    density = np.where(np.isin(owners, dense), 20.0, 1.0)[model.faces].mean(axis=1)
    shares = density * triangle_areas(points, model.faces)
    chosen = rng.choice(len(shares), n_points, p=shares / shares.sum())
    places = rng.dirichlet(np.ones(3), n_points)
    return np.einsum("nk,nkx->nx", places, points[model.faces[chosen]])


def clouds(full, natural_bodies):
    """Yield names and clouds of one body whose spacing varies."""
    rng = np.random.default_rng(5)
    yield "all vertices", full
    yield "some vertices", full[rng.choice(len(full), 3000, replace=False)]
    yield "dense head and hands", uneven_cloud(natural_bodies[3], natural_bodies.model, rng, 4000)
    heights = simulated_scan(
        natural_bodies[3], natural_bodies.template.faces, 0, n_points=200_000, rotate=False
    )
    rings = heights.points[heights.points[:, 1] % 0.04 < 0.002]
    yield "rings", rings[rng.choice(len(rings), 8000, replace=False)]


def test_sparse_parts_of_a_body_are_no_background(full, natural_bodies):
    for name, cloud in clouds(full, natural_bodies):
        assert prepare_scan(as_scan(cloud)).background.mean() < 0.002, name


def test_a_sparse_floor_below_an_uneven_cloud_is_background(natural_bodies):
    rng = np.random.default_rng(1)
    scan = simulated_scan(natural_bodies[3], natural_bodies.template.faces, rng, rotate=False)
    cloud = uneven_cloud(scan.body, natural_bodies.model, rng, 6000)
    background = prepare_scan(as_scan(np.concatenate([cloud, sparse_floor(scan, rng)]))).background
    assert background[len(cloud) :].mean() > 0.75
    assert background[: len(cloud)].mean() < 0.01


def test_strays_behind_the_edges_of_a_depth_scan_are_background(natural_bodies):
    rng, view = np.random.default_rng(2), np.array([0.0, 0.0, 1.0])
    faces = natural_bodies.template.faces
    scan = simulated_scan(natural_bodies[3], faces, rng, n_points=24_000, view=view, rotate=False)
    nearest = cKDTree(scan.body).query(scan.points)[1]
    sideways = np.abs(rh.kernels.surface.vertex_normals(scan.body, faces)[nearest] @ view)
    edges = scan.points[np.argsort(sideways)[:1500]]
    strays = rng.choice(edges, 250) - rng.exponential(0.08, (250, 1)) * view
    background = prepare_scan(as_scan(np.concatenate([scan.points, strays]))).background
    far = cKDTree(scan.points).query(strays)[0] > 0.05
    assert background[len(scan.points) :][far].mean() > 0.75
    assert background[: len(scan.points)].mean() < 0.01


def test_normals_of_rings_are_those_of_the_surface(full, natural_bodies):
    *_, (_, rings) = clouds(full, natural_bodies)
    body = natural_bodies[3]
    normals = rh.kernels.surface.vertex_normals(body, natural_bodies.template.faces)
    nearest = cKDTree(body).query(rings)[1]
    cosines = np.einsum("nx,nx->n", estimate_normals(rings), normals[nearest])
    assert np.mean(np.abs(cosines) > 0.7) > 0.85


def test_normals_may_have_any_length(natural_bodies, scan):
    nearest = cKDTree(scan.body).query(scan.points)[1]
    normals = rh.kernels.surface.vertex_normals(scan.body, natural_bodies.template.faces)[nearest]
    lengths = np.random.default_rng(4).uniform(0.1, 100.0, (len(normals), 1))
    found, longer = (
        prepare_scan(rh.registration.Scan(scan.points, normals=given)).normals
        for given in (normals, lengths * normals)
    )
    np.testing.assert_allclose(longer, found, atol=1e-9)


@pytest.mark.slow
@pytest.mark.parametrize("whole", [True, False])
def test_uneven_clouds_are_registered(registration_from, natural_bodies, whole):
    rng = np.random.default_rng(3)
    cloud = uneven_cloud(natural_bodies[0], natural_bodies.model, rng, 4000)
    on_arm = np.zeros(len(natural_bodies[0]), dtype=bool)
    if not whole:
        names, owners = (
            natural_bodies.model.joint_names,
            natural_bodies.model.weights.argmax(axis=1),
        )
        on_arm = np.isin(owners, [names.index(f"left_{joint}") for joint in ("elbow", "wrist")])
        cloud = cloud[~on_arm[cKDTree(natural_bodies[0]).query(cloud)[1]]]
    result = registration_from("t", "down").solve(cloud)
    assert result.trusted, result.message
    assert result.trusted_vertices[~on_arm].mean() > 0.95
    assert not result.trusted_vertices[on_arm].any()
    assert np.linalg.norm(result.points - natural_bodies[0], axis=1)[~on_arm].mean() < 0.015
